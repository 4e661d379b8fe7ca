"""The integral equations on a circle, against the exact series (Bowman, Senior and Uslenghi 1969), and their order."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import special

from vgonio.wave.full_wave import operators, panels, system

RADIUS, K = 1.0, 2 * np.pi / 0.8
OUT = np.linspace(0, 2 * np.pi, 40)


def circle(t):
    """Clockwise, so that the outside lies to the left."""
    return RADIUS * np.cos(t), -RADIUS * np.sin(t), -RADIUS * np.sin(t), -RADIUS * np.cos(t)


def found(index: complex | None, polarisation: str, count: int, p: int) -> np.ndarray:
    """Far-field amplitude for a plane wave along +x."""
    curve = panels.on_curve(circle, np.linspace(0, 2 * np.pi, count + 1), p)
    air = operators.assemble(K, curve, curve, system.operators_needed(index is None, polarisation), True)
    inside = None if index is None else operators.assemble(K * index, curve, curve, ("single", "double"), True)
    (x, z), (nx, nz) = curve.point, curve.normal
    field = np.exp(1j * K * x)[:, None]
    psi, phi, residual = system.factored(curve, K, index, polarisation, air, inside).solve(
        field, 1j * K * nx[:, None] * field
    )
    assert residual.max() < 1e-12
    wave = np.exp(-1j * K * (np.outer(np.cos(OUT), x) + np.outer(np.sin(OUT), z))) * curve.weight
    slope = wave * (-1j * K) * (np.outer(np.cos(OUT), nx) + np.outer(np.sin(OUT), nz))
    return 0.25j * (slope @ psi - wave @ phi)[:, 0]


def exact(index: complex | None, polarisation: str) -> np.ndarray:
    n = np.arange(-45, 46)
    j, jp = special.jv(n, K * RADIUS), special.jvp(n, K * RADIUS)
    h, hp = special.hankel1(n, K * RADIUS), special.h1vp(n, K * RADIUS)
    if index is None:
        ratio = j / h if polarisation == "TE" else jp / hp
    else:
        u = K * index * RADIUS
        r = index * special.jvp(n, u) / special.jv(n, u) / system.contrast(index, polarisation)
        ratio = (jp - r * j) / (hp - r * h)
    return -np.exp(1j * np.outer(OUT, n)) @ ratio


@pytest.mark.parametrize("polarisation", ["TE", "TM"])
@pytest.mark.parametrize("index", [None, 1.5, 0.79 + 5.85j, 2.0 + 0.05j])
def test_far_field_of_a_cylinder(index, polarisation, agreement):
    """Ten digits with 14 (perfect, metal) or 21 (glass) points a wavelength of air; amplitudes are of order one."""
    panels_ = 12 if index is None or index.real < 1 else 18
    error = np.abs(found(index, polarisation, panels_, 10) - exact(index, polarisation)).max()
    agreement("full wave: cylinders, perfect, glass, metal", "exact series", error, 2e-8)


@pytest.mark.parametrize("polarisation", ["TE", "TM"])
@pytest.mark.parametrize("p", [4, 6])
def test_observed_order(p, polarisation):
    """Interpolation by p nodes: at least order p in the panel length; far fields converge faster, at most twice so."""
    counts = np.array([16, 24, 36])
    errors = [np.abs(found(None, polarisation, n, p) - exact(None, polarisation)).max() for n in counts]
    order = -np.polyfit(np.log(counts), np.log(errors), 1)[0]
    assert p < order < 2 * p + 2


def test_the_absorbing_and_the_transparent_way_agree(monkeypatch):
    """The eliminated field of a metal against the full system of both fields."""
    index = 0.79 + 5.85j
    sparse = found(index, "TM", 60, 8)
    monkeypatch.setattr(system, "SPARSE", 0.0)
    assert np.abs(found(index, "TM", 60, 8) - sparse).max() < 1e-11


def test_touching_curves_are_integrated():
    """A double layer of one on a circle is −1 inside and 0 outside in the static limit, a hair off the line too."""
    curve = panels.on_curve(circle, np.linspace(0, 2 * np.pi, 25), 10)
    for off, expected in ((1e-5, 0.0), (-1e-5, 1.0)):

        def beside(t, off=off):
            return tuple(a * (1 + off) for a in circle(t))

        targets = panels.on_curve(beside, np.linspace(0, 2 * np.pi, 25), 10)
        value = operators.assemble(1e-6, targets, curve, ("double",), False)["double"].sum(axis=1)
        assert np.abs(np.abs(value) - expected).max() < 2e-4
