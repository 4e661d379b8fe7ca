"""Mueller matrices of traced paths, in the frames of the macroscopic normal.

For a direction ω that points away from the surface s = n × ω / |n × ω| (ŷ at normal incidence, turned with the plane of
incidence) and p = ω × s, for the incident and for the reflected beam alike. With amplitudes E_s, E_p under exp(−iωt)

    I = |E_s|² + |E_p|²,   Q = |E_s|² − |E_p|²,   U = 2 Re(E_s* E_p),   V = 2 Im(E_s* E_p).

V > 0: the field turns from s towards p in the course of time, anticlockwise for whoever looks at the surface from the
side of ω. This holds for both beams, so each matrix is that of a Jones matrix between real bases: the coherency
matrix (Cloude 1986) is positive semidefinite, a perfect mirror has the unit matrix, and reciprocity reads
M(i → o)_jk = ε_j ε_k M(o → i)_kj with ε = (1, 1, 1, −1).

Along a path the frames go with the direction of travel d instead (p = d × s, thesis 2.19, 2.20): the same as above for
the reflected beam, but p turned round for the incident one, where d = −ω_i. That is the diag(1, 1, −1, −1) here.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..directions import Detector, s_axes
from .fresnel_table import FresnelTable
from .trace import Paths

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
FROM_INCIDENT_FRAME = np.diag([1.0, 1.0, -1.0, -1.0])
AT_ONCE = 1 << 22  # numbers in the matrices that are held at a time


def path_matrices(
    paths: Paths, table: FresnelTable, ray: Ints, detector: Detector, element: Ints, phi_i_deg: float
) -> Floats:
    """(n, 4, 4, w) Mueller matrices of the rays `ray` (n,), each into the frame of its detector element.

    The axis of a detector is that of its centre: a polariser in front of a cone has one direction for all of it.
    """
    state = np.empty((len(ray), 4, 4, table.table.shape[2]))
    state[:] = FROM_INCIDENT_FRAME[:, :, None]
    bounces = paths.bounces[ray]
    place = np.empty(len(paths.bounces), np.int64)
    for k, hits in enumerate(paths.hits):
        row = np.flatnonzero(bounces > k)
        if len(row) == 0:
            break
        place[hits.ray] = np.arange(len(hits.ray))
        at = place[ray[row]]
        turned = turn(state[row], hits.cos_2psi[at], hits.sin_2psi[at])
        state[row] = mirror(turned, table.elements(hits.cos_i[at]))
    return turn(state, *_turn_to_detector(paths, ray, detector, element, phi_i_deg))


def turn(stokes: Floats, cos_2psi: Floats, sin_2psi: Floats) -> Floats:
    """Stokes vectors (n, 4, …) in a frame that is turned by ψ from s towards p."""
    shape = (-1,) + (1,) * (stokes.ndim - 2)
    c, s = cos_2psi.reshape(shape), sin_2psi.reshape(shape)
    out = stokes.copy()
    out[:, 1] = c * stokes[:, 1] + s * stokes[:, 2]
    out[:, 2] = c * stokes[:, 2] - s * stokes[:, 1]
    return out


def mirror(stokes: Floats, m: Floats) -> Floats:
    """Stokes vectors (n, 4, …, w) after a facet with the elements a, b, c, d in m (n, 4, w)."""
    shape = (len(m),) + (1,) * (stokes.ndim - 3) + (m.shape[-1],)
    a, b, c, d = (m[:, j].reshape(shape) for j in range(4))
    i, q, u, v = (stokes[:, j] for j in range(4))
    return np.stack([a * i + b * q, b * i + a * q, c * u + d * v, c * v - d * u], axis=1)


def _turn_to_detector(
    paths: Paths, ray: Ints, detector: Detector, element: Ints, phi_i_deg: float
) -> tuple[Floats, Floats]:
    """cos 2ψ and sin 2ψ from the frame after the last reflection to the detector element's."""
    d, s = paths.direction[ray], paths.s_axis[ray]
    wanted = s_axes(detector.directions, phi_i_deg)[element]
    cos = np.einsum("ij,ij->i", s, wanted)
    sin = np.einsum("ij,ij->i", np.cross(d, s), wanted)
    length2 = np.maximum(cos**2 + sin**2, 1e-300)  # below 1: the ray is not quite at the centre of its element
    return (cos**2 - sin**2) / length2, 2 * sin * cos / length2


def slices(count: int, wavelengths: int) -> list[slice]:
    """Parts of `count` rays whose matrices fit into the memory that is set aside for them."""
    step = max(1, AT_ONCE // (16 * wavelengths))
    return [slice(i, i + step) for i in range(0, count, step)]
