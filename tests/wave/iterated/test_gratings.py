"""Efficiencies of gratings: an identity with `Kirchhoff`, and the rigorous solver."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import vgonio as vg
from vgonio.errors import InputError, VgonioWarning
from vgonio.wave import FullWave, IteratedKirchhoff, Kirchhoff


def sinusoid(period: float, amplitude: float):
    return vg.surface.sinusoid(period, amplitude, (2, 400), period / 400)


@pytest.mark.parametrize("surface", [sinusoid(4, 0.3), sinusoid(6, 1.5)], ids=["shallow", "deep"])
def test_first_reflection_without_shadows_is_kirchhoff(surface, agreement):
    """A period has no ends, so the integration by parts that makes Kirchhoff's factor C is exact: 1e-6."""
    solver = IteratedKirchhoff("perfect", [550], bounces=1, shadowing=False, points_per_wavelength=40)
    one = solver.orders(surface, [0, 20, 50])
    other = Kirchhoff("perfect", [550], tol=1e-8).orders(surface, [0, 20, 50])
    for polarisation in ("TE", "TM"):
        agreement(
            "iterated Kirchhoff, gratings, first reflection without shadows",
            "`Kirchhoff`",
            np.nan_to_num(one.efficiency.sel(polarisation=polarisation).values - other.efficiency.values),
            1e-5,
        )
        assert np.array_equal(one.order, other.order)


@pytest.mark.parametrize("material", ["perfect", "Al"])
def test_deep_grating_against_the_rigorous_solver(material, agreement):
    """P = 18 λ, peak to valley 7 λ, steepest slope 1.26: Σ|Δ|/Σ of the orders at 0° and 20° goes from 0.65 … 0.85 to
    below 0.35, and the reflected power of the mean of TE and TM to within 7 %. One grating has no ensemble to average
    over: every shadow edge shows."""
    surface = sinusoid(10.0, 2.0)
    found = IteratedKirchhoff(material, [550], bounces=6).orders(surface, [0, 20])
    exact = FullWave(material, [550]).orders(surface, [0, 20]).efficiency
    order = np.intersect1d(found.order, exact.order)
    names = ("theta_i", "order", "wavelength", "polarisation")
    single, iterated, exact = (
        a.sel(order=order, polarisation=["TE", "TM"]).transpose(*names).fillna(0)
        for a in (found.efficiency_single, found.efficiency, exact)
    )
    errors = [np.abs(a - exact).sum("order") / exact.sum("order") for a in (single, iterated)]
    assert np.all(errors[0] > 0.6)
    agreement(
        "iterated Kirchhoff, sinusoid 18 λ × 7 λ, all reflections, Σ|Δ|/Σ (single: 65 … 85 %)",
        "full wave",
        100 * errors[1],
        35,
        "%",
    )
    powers = [a.sum("order").mean("polarisation") for a in (iterated, exact)]
    assert np.allclose(powers[0], powers[1], rtol=0.07)


def test_orders_are_where_scatter_sends_the_light():
    """A window over twenty periods: cones around the orders hold their efficiencies, 2 %."""
    surface = vg.surface.sinusoid(3.0, 0.25, (2, 1200), 0.05)
    solver = IteratedKirchhoff("perfect", [600], windows=1)
    orders = solver.orders(surface, [10]).isel(theta_i=0, wavelength=0)
    theta = orders.theta_o.values[np.isfinite(orders.theta_o.values)]
    gonio = vg.measure.Gonioreflectometer([10], theta[np.abs(theta) < 60], aperture_deg=6, coherence_um=10)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", VgonioWarning)
        data = gonio.measure(surface, solver)
    power = data.brdf.values[0, :, 0] * gonio.detector.projected_solid_angle
    expected = orders.efficiency.mean("polarisation").values[np.isfinite(orders.theta_o.values)][np.abs(theta) < 60]
    assert np.allclose(power, expected, atol=0.02)


def test_only_gratings_have_orders():
    with pytest.raises(InputError, match="orders are for gratings"):
        IteratedKirchhoff("perfect", [550]).orders(sinusoid(4, 0.3).replace(periodic=False), [0])
