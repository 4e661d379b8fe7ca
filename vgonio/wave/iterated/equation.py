"""The boundary integral equations on the points of a profile, row by row: what tangent planes and sight leave out.

With layer potentials S, D, D', T = ∂D/∂n of air and normals into it, u and v = ∂u/∂n on the surface satisfy

    ½u = u_i + D u − S v,   ½v = v_i + T u − D' v.

"perfect": v alone (TE) or u alone (TM), the magnetic-field equation. "impedance": v = −ikζu, ζ of the material at 45°,
which is right to sin²θ/n² inside (Leontovich), with the first term of the surface's curvature (Rytov 1940).
"media": u and v, both equations added to those of the inside so that what is singular cancels (Müller 1969).

Points are midpoints of equal arcs. The rule that leaves out the point itself gets the terms of the singular kernels at
s = 0 (Wu and Martinsson 2021, zeta correction): 1/s² and ln|s| are then right to the third order in the spacing.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ...materials import Material
from ..full_wave import kernels
from ..full_wave.lattice import FarImages, far_images
from ..quadrature import Complex, Floats
from .curve import Curve
from .propagate import POLARISATIONS, hankel

RULES = ("perfect", "impedance", "media")
DENSE = 2.4  # |ζ| of TE from which on the impedance is that of a plane wave straight down
ABSORBS = 0.5  # Im n from which on nothing comes back out of the material
POINTS_INSIDE = 4.0  # points in a wavelength of the inside that the equations of two media need
OBLIQUE = np.sqrt(0.5)  # cos θ at which ζ is taken


@dataclass(frozen=True, eq=False)
class Images:
    """Periodic continuation: the field is exp(iα·period) times itself one period, in µm, further along x."""

    period: float
    alpha: float

    def far(self, k: complex, height: float) -> FarImages:
        return far_images(k, self.alpha, self.period, height)


def rule_of(material: Material, wavelength_nm: float, per: float) -> tuple[str | None, str]:
    """Which of RULES holds for a material with `per` points per wavelength; None and the reason where none does."""
    if material.perfect:
        return "perfect", ""
    rs = material.amplitudes(OBLIQUE, wavelength_nm)[0]
    dense = abs(OBLIQUE * (1 - rs) / (1 + rs)) >= DENSE
    if getattr(material, "layers", ()):
        return ("impedance", "") if dense else (None, "a coated material that is no good metal")
    n = complex(material.index(wavelength_nm))
    if dense and n.imag >= ABSORBS:
        return "impedance", ""
    if abs(n) * POINTS_INSIDE <= per * (1 + 1e-6):
        return "media", ""
    return None, f"|n + ik| = {abs(n):.3g} needs points_per_wavelength ≥ {np.ceil(POINTS_INSIDE * abs(n)):g}"


@dataclass(frozen=True, eq=False)
class Equation:
    """x = b + A x at the points of a curve, x = (n·unknowns, t), the unknowns of one point side by side.

    rule : one of RULES;  polarisation : "TE" or "TM";  index : n + ik ("media");  zeta : (n,) ζ ("impedance")
    images : of a grating
    """

    curve: Curve
    k: float
    rule: str
    polarisation: str
    index: complex = 1.0
    zeta: Complex = field(default_factory=lambda: np.ones(1, np.complex128))
    images: Images | None = None

    @staticmethod
    def of(
        curve: Curve, k: float, material: Material, wavelength_nm: float, polarisation: str, rule: str,
        images: Images | None = None,
    ) -> Equation:  # fmt: skip
        if rule == "media":
            return Equation(curve, k, rule, polarisation, complex(material.index(wavelength_nm)), images=images)
        if rule == "impedance":
            zeta = _impedance(curve, k, material, wavelength_nm, polarisation, images)
            return Equation(curve, k, rule, polarisation, zeta=zeta, images=images)
        return Equation(curve, k, rule, polarisation, images=images)

    @property
    def unknowns(self) -> int:
        """At each point."""
        return 2 if self.rule == "media" else 1

    @property
    def beta(self) -> complex:
        """∂u/∂n inside over that outside."""
        return 1.0 if self.polarisation == "TE" else self.index**2

    def right(self, u: Complex, v: Complex) -> Complex:
        """b of incident u, v (n, t)."""
        if self.rule == "media":
            return self._stacked(u, 2 / (1 + self.beta) * v)
        return 2 * (v if self.polarisation == "TE" else u)

    def unknown(self, u: Complex, v: Complex) -> Complex:
        """x of surface fields u, v (n, t)."""
        if self.rule == "media":
            return self._stacked(u, v)
        return v if self.polarisation == "TE" else u

    def fields(self, x: Complex) -> tuple[Complex, Complex]:
        """u, v (n, t) of x."""
        if self.rule == "media":
            return x[0::2], x[1::2] * self.k
        if self.rule == "perfect":
            return (np.zeros_like(x), x) if self.polarisation == "TE" else (x, np.zeros_like(x))
        slope = -1j * self.k * self.zeta[:, None]
        return (x / slope, x) if self.polarisation == "TE" else (x, slope * x)

    def _stacked(self, u: Complex, v: Complex) -> Complex:
        return np.stack([u, v / self.k], axis=1).reshape(-1, u.shape[1])

    def rows(self, first: int, last: int) -> Complex:
        """Rows of A of the points first … last − 1, ((last − first)·unknowns, n·unknowns)."""
        part = slice(first, last)
        te = self.polarisation == "TE"
        if self.rule == "perfect":
            wanted = "adjoint" if te else "double"
            return (-2 if te else 2) * potentials(self.curve, part, self.k, (wanted,), self.images)[wanted]
        if self.rule == "media":
            return self._of_media(part)
        if te:
            air = potentials(self.curve, part, self.k, ("adjoint", "slope"), self.images)
            return 2 * (air["slope"] * (1j / (self.k * self.zeta)) - air["adjoint"])
        air = potentials(self.curve, part, self.k, ("double", "single"), self.images)
        return 2 * (air["double"] + air["single"] * (1j * self.k * self.zeta))

    def _of_media(self, part: slice) -> Complex:
        every, k, beta = ("single", "double", "adjoint", "slope"), self.k, self.beta
        inner = k * (self.index if complex(self.index).imag else complex(self.index).real)
        air, inside = (potentials(self.curve, part, q, every, self.images) for q in (k, inner))
        m, n = air["single"].shape
        a, half = np.empty((m, 2, n, 2), np.complex128), 2 / (1 + beta)
        a[:, 0, :, 0] = air["double"] - inside["double"]
        a[:, 0, :, 1] = (beta * inside["single"] - air["single"]) * k
        a[:, 1, :, 0] = (air["slope"] - inside["slope"]) * (half / k)
        a[:, 1, :, 1] = (beta * inside["adjoint"] - air["adjoint"]) * half
        return a.reshape(2 * m, 2 * n)


def bend(curve: Curve, images: Images | None = None) -> Floats:
    """(n,) curvature in 1/µm from the turning of the normals, positive in valleys."""
    angle = np.arctan2(-curve.nx, curve.nz)
    along = np.cumsum(curve.ds) - curve.ds / 2
    if images:
        ends = along[0] - (curve.ds[0] + curve.ds[-1]) / 2, along[-1] + (curve.ds[0] + curve.ds[-1]) / 2
        angle, along = np.r_[angle[-1], angle, angle[0]], np.r_[ends[0], along, ends[1]]
        return np.gradient(np.unwrap(angle), along)[1:-1]
    return np.gradient(angle, along) if len(curve) > 1 else np.zeros(len(curve))


def _impedance(
    curve: Curve, k: float, material: Material, wavelength_nm: float, polarisation: str, images: Images | None
) -> Complex:
    r = material.amplitudes(OBLIQUE, wavelength_nm)[POLARISATIONS[polarisation]]
    zeta = np.full(len(curve), complex(OBLIQUE * (1 - r) / (1 + r)))
    if getattr(material, "layers", ()):
        return zeta
    n = complex(material.index(wavelength_nm))
    return zeta + 0.5j * bend(curve, images) / k / (1.0 if polarisation == "TE" else n**2)


def potentials(
    curve: Curve, part: slice, k: complex, wanted: tuple[str, ...], images: Images | None = None
) -> dict[str, Complex]:
    """Matrices (rows in `part`, n) of the potentials at points of a curve, principal values, weights included.

    wanted : "single" G, "double" ∂G/∂n', "adjoint" ∂G/∂n, "slope" ∂²G/∂n∂n'
    """
    targets = curve.cut(part)
    out = _direct(targets, curve, k, wanted)
    _at_home(curve, part, k, out, images)
    if images is None:
        return out
    for m in (-1, 1):
        phase = np.exp(1j * images.alpha * m * images.period)
        for name, values in _direct(targets, curve.moved(m * images.period), k, wanted).items():
            out[name] += phase * values
    _add_far(targets, curve, images.far(k, float(np.ptp(curve.z))), out)
    return out


def _direct(targets: Curve, sources: Curve, k: complex, wanted: tuple[str, ...]) -> dict[str, Complex]:
    """The kernels between points, 0 where they coincide."""
    dx, dz = targets.x[:, None] - sources.x, targets.z[:, None] - sources.z
    r = np.hypot(dx, dz)
    same = r == 0
    r[same] = 1.0
    g0, g1 = _green(k, r, sources.ds, "single" in wanted or "slope" in wanted)
    leaving = dx * sources.nx + dz * sources.nz
    arriving = dx * targets.nx[:, None] + dz * targets.nz[:, None]
    out = {}
    for name in wanted:
        if name == "single":
            out[name] = g0
        elif name == "double":
            out[name] = g1 * leaving
        elif name == "adjoint":
            out[name] = -g1 * arriving
        else:
            facing = targets.nx[:, None] * sources.nx + targets.nz[:, None] * sources.nz
            out[name] = leaving * arriving / r**2 * (k**2 * g0 - 2 * g1) + g1 * facing
        out[name][same] = 0
    return out


def _green(k: complex, r: Floats, ds: Floats, zeroth: bool) -> tuple[Complex, Complex]:
    """G (empty unless `zeroth`) and −G'/r, weights included."""
    if complex(k).imag:
        h0 = kernels.hankel(0, k, r) if zeroth else np.zeros(0, np.complex128)
        h1 = kernels.hankel(1, k, r)
    else:
        h0, h1 = hankel(complex(k).real * r.ravel(), zeroth)
    single = 0.25j * h0.reshape(r.shape) * ds if zeroth else h0
    return single, 0.25j * k * h1.reshape(r.shape) * (ds / r)


def _at_home(curve: Curve, part: slice, k: complex, out: dict[str, Complex], images: Images | None) -> None:
    """Terms of a point with itself, and of 1/s² with its neighbours (see above)."""
    n = len(curve)
    at = np.arange(n)[part]
    row, h = np.arange(len(at)), curve.ds[part]
    kappa = bend(curve, images)[part]
    log = np.log(k * h / (4 * np.pi)) + np.euler_gamma
    if "single" in out:
        out["single"][row, at] += h * (0.25j - log / (2 * np.pi))
    for name in ("double", "adjoint"):
        if name in out:
            out[name][row, at] += kappa * h / (4 * np.pi)
    if "slope" in out:
        own = h * 0.125j * k**2 * (1 + 2j / np.pi * (log - 0.5))
        out["slope"][row, at] += own - np.pi / (6 * h) - 1 / (2 * np.pi * h)
        for step in (-1, 1):
            beside = at + step
            inside = (beside >= 0) & (beside < n)
            out["slope"][row[inside], beside[inside]] += 1 / (4 * np.pi * h[inside])
            if images is not None:
                phase = np.exp(1j * images.alpha * step * images.period)
                out["slope"][row[~inside], beside[~inside] % n] += phase / (4 * np.pi * h[~inside])


def _add_far(targets: Curve, sources: Curve, far: FarImages, out: dict[str, Complex]) -> None:
    """All images beyond the nearest, as plane waves."""
    middle = sources.x.mean(), sources.z.mean()
    to, back = (
        np.exp(sign * 1j * (np.outer(c.x - middle[0], far.p) + np.outer(c.z - middle[1], far.t)))
        for c, sign in ((targets, 1), (sources, -1))
    )
    to, back = to * far.c, back.T * sources.ds
    here, there = (1j * (np.outer(c.nx, far.p) + np.outer(c.nz, far.t)) for c in (targets, sources))
    factors = {"single": (to, back), "double": (to, -back * there.T), "adjoint": (to * here, back),
               "slope": (to * here, -back * there.T)}  # fmt: skip
    for name in out:
        a, b = factors[name]
        out[name] += a @ b
