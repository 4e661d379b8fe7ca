"""Vector Kirchhoff: fields of the tangent plane at each facet, Jones and Mueller matrices of the far field.

At a facet with normal n the wave that travels along d = −ω_i is reflected as r_s (E·s) s + r_p (E·p_i) p_r with
s = d × n/|d × n|, p_i = d × s, p_r = d_r × s (thesis 2.19, 2.20). The far field of Stratton and Chu (1939),

    F(ω_o) = −k/(4π) ω_o × ∫ [N × E_r − ω_o × (N × H_r)] exp(−i q·r) dx dy,   N = (−∂z/∂x, −∂z/∂y, 1),  H_r = d_r × E_r,

depends on ω_o outside of the integral alone, so that twelve sums (two incident polarisations, N × E_r and N × H_r) for
each θ_i and λ serve all detectors. The incident field radiates nothing upward and is left out. For constant r the
magnitude is that of the scalar theory, k/(2π) C r S.

Frames and signs as for the rays: s = n × ω/|n × ω| and p = ω × s for both beams, both pointing away from the surface,
I = |E_s|² + |E_p|², Q = |E_s|² − |E_p|², U = 2 Re(E_s* E_p), V = 2 Im(E_s* E_p) under exp(−iωt).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..directions import s_axes
from ..materials import Material
from .amplitudes import Facets
from .job import Job
from .quadrature import Complex, Floats

PAULI = np.array([[[1, 0], [0, 1]], [[1, 0], [0, -1]], [[0, 1], [1, 0]], [[0, -1j], [1j, 0]]])
STOKES_Q = {"unpolarised": 0.0, "s": 1.0, "p": -1.0}


@dataclass(frozen=True, eq=False)
class VectorKirchhoff:
    """Twelve sums; brdf for the incident polarisation, then the 16 elements of the Mueller matrix, row by row.

    phi_deg : azimuth of the plane of incidence, which gives the s axis at the pole
    """

    material: Material
    polarisation: str
    phi_deg: float = 0.0
    parts: int = 12
    outcomes: int = 17
    local: bool = True

    def fields(self, wi: Floats, wavelength_nm: float, facets: Facets) -> Complex:
        """(12, ny, nx): (incident s or p, N × E_r or N × H_r, component)."""
        normal = np.stack([-facets.zx, -facets.zy, np.ones_like(facets.zx)])
        n = normal / np.linalg.norm(normal, axis=0)
        d = -wi[:, None, None]
        along = np.einsum("iyx,i->yx", n, -wi)
        reflected = d - 2 * along * n
        s = np.cross(np.broadcast_to(d, n.shape), n, axis=0)
        length = np.linalg.norm(s, axis=0)
        # head-on there is no plane of incidence, and any axis across will do
        s = np.where(length > 1e-9, s / np.maximum(length, 1e-300), s_axes(wi[None], self.phi_deg)[0][:, None, None])
        p_in, p_out = np.cross(np.broadcast_to(d, n.shape), s, axis=0), np.cross(reflected, s, axis=0)
        rs, rp = self.material.amplitudes(facets.cosine(wi), wavelength_nm)
        found = []
        for e in _frame(wi[None], s_axes(wi[None], self.phi_deg)):
            on_s, on_p = np.einsum("iyx,i->yx", s, e[0]), np.einsum("iyx,i->yx", p_in, e[0])
            electric = rs * on_s * s + rp * on_p * p_out
            magnetic = np.cross(reflected, electric, axis=0)
            found += [np.cross(normal, electric, axis=0), np.cross(normal, magnetic, axis=0)]
        return np.concatenate(found)

    def intensity(self, sums: Complex, job: Job) -> Floats:
        """(17, m); in units in which the scalar theory has C² R |S|²."""
        m = len(job.q)
        parts = sums.reshape(2, 2, 3, m).transpose(0, 1, 3, 2)  # (incident, electric or magnetic, m, component)
        far = -np.cross(job.wo, parts[:, 0] - np.cross(job.wo, parts[:, 1])) / 2
        # the axis of a detector is that of its centre: a polariser in front of it has one direction for all of it
        centre = s_axes(job.views, self.phi_deg)[job.view]
        across = centre - np.sum(centre * job.wo, axis=1, keepdims=True) * job.wo
        out = _frame(job.wo, across / np.linalg.norm(across, axis=1, keepdims=True))
        jones = np.stack([[np.sum(far[b] * axis, axis=1) for b in range(2)] for axis in out])  # (out, in, m)
        mueller = np.einsum("iab,bcm,jcd,adm->ijm", PAULI, jones, PAULI, jones.conj()).real / 2
        brdf = mueller[0, 0] + STOKES_Q[self.polarisation] * mueller[0, 1]
        return np.concatenate([brdf[None], mueller.reshape(16, m)])


def _frame(w: Floats, s: Floats) -> tuple[Floats, Floats]:
    """(n, 3) axes s and p = ω × s."""
    return s, np.cross(w, s)
