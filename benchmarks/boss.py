"""A hemispherical boss on a plane, both perfect conductors: iterated Kirchhoff on a patch against the exact series.

    python benchmarks/boss.py [--sizes 1 2 3 4] [--theta-i 0 20 40 60] [--per 10] [-o results.json]

By images (Rayleigh 1907; Twersky 1957) the boss scatters, above the plane, as a full sphere in free space does under
the incident plane wave and under the one that the plane reflects: twice the series of Mie (1908). Here it is written
with SciPy's spherical Bessel functions and shares nothing with the package. Fields are exp(−iωt), amplitudes A of E → A
exp(ikr)/r with their phase from the middle of the boss, in µm for 1 V/µm; directions point away from the surface.

The patch: the heights sqrt(a² − r²), the light faded out towards its edges, and what a patch without boss sends out
taken off. The second reflections are faded out in the same way, since the true plane has no edges.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import spherical_jn, spherical_yn

Floats = NDArray[np.float64]
Complex = NDArray[np.complex128]
FLIP = np.array([1.0, 1.0, -1.0])
SHADOW = 30.0  # degrees from the mirror direction, up to which the boss' shadow on the plane is what is seen
PER = 10.0  # points per wavelength
BOUNCES = 3


# ---- exact
def coefficients(x: float) -> tuple[NDArray[np.int64], Complex, Complex]:
    """n, a_n and b_n of a perfectly conducting sphere, x = ka (Bohren and Huffman 1983, 4.56 and 4.57, m → ∞)."""
    n = np.arange(1, int(np.ceil(x + 4.5 * x ** (1 / 3) + 6)) + 1)
    j, dj = spherical_jn(n, x), spherical_jn(n, x, derivative=True)
    h, dh = (f + 1j * g for f, g in zip((j, dj), (spherical_yn(n, x), spherical_yn(n, x, derivative=True))))
    return n, (j + x * dj) / (h + x * dh), j / h


def angular(n: NDArray[np.int64], cosine: Floats) -> tuple[Floats, Floats]:
    """π_n and τ_n, (len(n), m)."""
    pi = np.zeros((len(n) + 1, len(cosine)))
    pi[1] = 1
    for m in range(2, len(n) + 1):
        pi[m] = ((2 * m - 1) * cosine * pi[m - 1] - m * pi[m - 2]) / (m - 1)
    return pi[1:], n[:, None] * cosine * pi[1:] - (n[:, None] + 1) * pi[:-1]


def sphere(k: float, a: float, d: Floats, e: Floats, o: Floats) -> Complex:
    """(m, 3) amplitude towards o (m, 3) of a plane wave along d (3,) with the field e (3,) at the middle."""
    n, electric, magnetic = coefficients(k * a)
    pi, tau = angular(n, np.clip(o @ d, -1, 1))
    f = (2 * n + 1) / (n * (n + 1))
    s1 = (f * electric) @ pi + (f * magnetic) @ tau
    s2 = (f * electric) @ tau + (f * magnetic) @ pi
    across = np.cross(d, o)
    length = np.linalg.norm(across, axis=1, keepdims=True)
    across = np.where(length > 1e-9, across / np.maximum(length, 1e-300), np.cross(d, e))
    along, out = np.cross(across, d), np.cross(across, o)
    return 1j / k * ((s2 * (along @ e))[:, None] * out + (s1 * (across @ e))[:, None] * across)


def near(k: float, a: float, d: Floats, e: Floats, r: Floats) -> Complex:
    """(m, 3) what the sphere sends to points r (m, 3) on it or outside (Bohren and Huffman 1983, 4.50 and 4.45)."""
    n, electric, magnetic = coefficients(k * a)
    axes = np.stack([e, np.cross(d, e), d])
    far = np.linalg.norm(r, axis=1)
    x, y, c = (r @ axes.T / far[:, None]).T
    s, phi = np.sqrt(1 - c**2), np.arctan2(y, x)
    pi, tau = angular(n, c)
    order, rho = n[:, None], k * far[None]
    h = spherical_jn(order, rho) + 1j * spherical_yn(order, rho)
    slope = spherical_jn(order, rho, derivative=True) + 1j * spherical_yn(order, rho, derivative=True)
    f = 1j**n * (2 * n + 1) / (n * (n + 1))
    p, q = (f * 1j * electric)[:, None], (f * magnetic)[:, None]
    radial = np.cos(phi) * s * np.sum(p * order * (order + 1) * pi * h / rho, axis=0)
    polar = np.cos(phi) * np.sum(p * tau * (h / rho + slope) - q * pi * h, axis=0)
    around = np.sin(phi) * np.sum(q * tau * h - p * pi * (h / rho + slope), axis=0)
    e_r = np.stack([s * np.cos(phi), s * np.sin(phi), c])
    e_theta = np.stack([c * np.cos(phi), c * np.sin(phi), -s])
    e_phi = np.stack([-np.sin(phi), np.cos(phi), 0 * phi])
    return (radial * e_r + polar * e_theta + around * e_phi).T @ axes


def images(d: Floats, e: Floats) -> tuple[tuple[Floats, Floats], tuple[Floats, Floats]]:
    """(direction, field) of the incident wave and of the one that the plane z = 0 reflects."""
    return (d, e), (d * FLIP, -e * FLIP)


def exact(k: float, a: float, wi: Floats, o: Floats) -> tuple[Complex, Complex]:
    """(2, m, 3) for s and p: what the boss makes of the incident wave, and of the reflected one."""
    both = [images(-wi, e) for e in frame(wi)]
    direct, mirrored = (np.stack([sphere(k, a, *waves[i], o) for waves in both]) for i in (0, 1))
    return direct, mirrored


def tangent_planes(k: float, a: float, wi: Floats, o: Floats) -> Complex:
    """(2, m, 3) the same by 2 n × H on what each of the two waves lights of the full sphere, nothing else hidden.

    It is what iterated Kirchhoff would come to with points close enough: the lower half is the reflection of the upper
    one in the plane. Gauss-Legendre in the cosine, even steps around.
    """
    count, steps = int(6 * a) + 12, int(30 * a) + 40
    t, w = np.polynomial.legendre.leggauss(2 * count)
    c, phi = (t[:, None] + 1) / 2, (np.arange(steps) + 0.5) * 2 * np.pi / steps
    weight = np.repeat(w / 2, steps) * 2 * np.pi / steps * a**2
    total = np.zeros((2, len(o), 3), np.complex128)
    for out, e in zip(total, frame(wi)):
        for along, field in images(-wi, e):
            h, s = np.cross(along, field), np.sqrt(1 - c**2)
            axes = np.stack([-along, field, h])
            n = np.stack(np.broadcast_arrays(c, s * np.cos(phi), s * np.sin(phi)), -1).reshape(-1, 3) @ axes
            current = 2 * np.cross(n, h) * (np.exp(1j * k * a * (n @ along)) * weight)[:, None]
            radiated = np.exp(-1j * k * a * (o @ n.T)) @ current
            out -= 1j * k / (4 * np.pi) * np.cross(o, np.cross(o, radiated))
    return total


# ---- iterated Kirchhoff
def frame(w: Floats) -> tuple[Floats, Floats]:
    """s = z × ω/|z × ω|, y at the pole, and p = ω × s."""
    s = np.cross([0.0, 0.0, 1.0], w)
    length = np.linalg.norm(s)
    s = s / length if length > 1e-9 else np.array([0.0, 1.0, 0.0])
    return s, np.cross(w, s)


def patch_of(a: float, half: float, pitch: float) -> Any:
    """The points of a square of side 2 `half` around a boss of radius a, 0 for the plane; the light fades out from 0.6
    of `half` on."""
    from vgonio.wave.iterated.far_waves import AZIMUTHS
    from vgonio.wave.iterated.pairs import Grid
    from vgonio.wave.iterated.patch import Patch

    n = 2 * int(np.ceil(half / pitch))
    margin, half = n // 2, n * pitch / 2
    at: Floats = (np.arange(2 * n, dtype=np.float64) + 0.5) * pitch - 2 * half
    wide = np.sqrt(np.maximum(a**2 - at[None] ** 2 - at[:, None] ** 2, 0))
    inner = slice(margin, margin + n)
    x: Floats = at[inner]
    z = wide[inner, inner].copy()
    r = np.hypot(x[None], x[:, None])
    up = np.array([0.0, 0.0, 1.0])[:, None, None]
    outward = np.stack([*np.meshgrid(x, x), z])
    normal = np.where(z > 0, outward / max(a, 1e-300), up)
    weight = np.cos(np.pi / 2 * np.clip((r / half - 0.6) / 0.4, 0, 1)) ** 2
    turns = 2 * np.pi * np.arange(AZIMUTHS) / AZIMUTHS
    return Patch(Grid(z, normal, pitch), x, x, weight, float(np.sum(weight**2) * pitch**2), wide, margin, turns)


def iterated(k: float, a: float, wi: Floats, o: Floats, per: float = PER, bounces: int = BOUNCES) -> Complex:
    """(bounces, 2, m, 3) amplitudes of the first, second, … reflections, for s and p."""
    from vgonio.materials import material
    from vgonio.wave.iterated.far_patch import far_sums
    from vgonio.wave.iterated.patch import all_reflections, first_fields

    wavelength, metal = 2 * np.pi / k, material("perfect")
    boss, plane = (patch_of(r, 3 * a + 2 * wavelength, wavelength / per) for r in (a, 0.0))
    fields, _ = all_reflections(boss, wi, k, metal, 1e3 * wavelength, 0.0, bounces, 0.0)
    sums = far_sums(boss, [fields[0], *(f * boss.weight for f in fields[1:])], o, k)
    sums[0] -= far_sums(plane, [first_fields(plane, wi, k, metal, 1e3 * wavelength, 0.0)], o, k)[0]
    electric, magnetic = np.moveaxis(sums.reshape(len(sums), 2, 2, 3, -1), (2, 4), (0, 3))
    return 1j * k / (4 * np.pi) * np.cross(o, electric - np.cross(o, magnetic))


def directions(step: float = 5.0) -> Floats:
    """(m, 3) −75 … 75° in the plane of incidence, across it and in the two planes between."""
    theta, phi = np.meshgrid(np.deg2rad(np.arange(-75, 75.1, step)), np.deg2rad([0, 45, 90, 135]))
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], -1).reshape(-1, 3)


def compared(a: float, theta_i: float, per: float = PER, step: float = 5.0, bounces: int = BOUNCES) -> dict:
    """Figures for s and p of a boss of a wavelengths, in directions more than SHADOW off the mirror direction.

    error i : 2-norm of the sum of i reflections minus the exact amplitude, over the norm of that
    lobe 2 : Σ|ΔP|/ΣP of powers after two reflections;  power i : ΣP after i over the exact one
    single, double : error of the first reflections against the exact answer to the incident wave, and of the second
        against that to the reflected wave
    factor, its phase in degrees : what the second reflections have to be multiplied by to fit the exact amplitude best
    wrong sign : error with the second reflections taken off instead of added
    theory : error 2 of the tangent-plane rule itself, see `tangent_planes`
    """
    k, t = 2 * np.pi, np.deg2rad(theta_i)
    wi, o = np.array([np.sin(t), 0.0, np.cos(t)]), directions(step)
    o = o[o @ (wi * -FLIP) < np.cos(np.deg2rad(SHADOW))]
    direct, mirrored = exact(k, a, wi, o)
    true, made = direct + mirrored, iterated(k, a, wi, o, per, bounces)
    one, two = made[:2]
    sums = np.cumsum(made, axis=0)
    found: dict = {"a": a, "theta_i": theta_i, "per": per}
    found |= {f"error {i + 1}": norm(got - true) / norm(true) for i, got in enumerate(sums)}
    found |= {f"power {i + 1}": (norm(got) / norm(true)) ** 2 for i, got in enumerate(sums)}
    p, q = (np.sum(np.abs(v) ** 2, axis=2) for v in (sums[1], true))
    factor = np.sum(np.conj(two) * (true - one), axis=(1, 2)) / norm(two) ** 2
    return found | {
        "lobe 2": np.abs(p - q).sum(axis=1) / q.sum(axis=1),
        "single": norm(one - direct) / norm(direct),
        "double": norm(two - mirrored) / norm(mirrored),
        "factor": np.abs(factor),
        "phase": np.rad2deg(np.angle(factor)),
        "wrong sign": norm(one - two - true) / norm(true),
        "theory": norm(tangent_planes(k, a, wi, o) - true) / norm(true),
    }


def norm(a: Complex) -> Floats:
    """(2,) of s and p."""
    return np.sqrt(np.sum(np.abs(a) ** 2, axis=(1, 2)))


def main(arguments: list[str] | None = None) -> list[dict]:
    """Print and return the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", nargs="+", type=float, default=[1.0, 2.0, 3.0, 4.0], help="radii in wavelengths")
    parser.add_argument("--theta-i", nargs="+", type=float, default=[0.0, 20.0, 40.0, 60.0], help="degrees")
    parser.add_argument("--per", type=float, default=PER, help="points per wavelength")
    parser.add_argument("-o", "--output", help="JSON file for the figures")
    asked = parser.parse_args(arguments)
    rows = []
    for a in asked.sizes:
        for theta_i in asked.theta_i:
            start = time.process_time()
            row = compared(a, theta_i, asked.per)
            rows.append({n: v.tolist() if isinstance(v, np.ndarray) else v for n, v in row.items()})
            rows[-1]["processor_s"] = time.process_time() - start
            print({n: np.round(v, 3).tolist() for n, v in rows[-1].items()}, flush=True)
            if asked.output:
                Path(asked.output).write_text(json.dumps(rows, indent=1), encoding="utf-8")
    return rows


if __name__ == "__main__":
    main()
