"""A detector cone over a narrow lobe: the rules of the cone against the full disc of directions."""

from __future__ import annotations

import numpy as np
import pytest

import vgonio as vg
from vgonio.directions import Detector, unit_vectors
from vgonio.errors import VgonioWarning
from vgonio.surface import Heightfield
from vgonio.wave import Kirchhoff, nufft
from vgonio.wave.coherence import WindowPlan, patch
from vgonio.wave.cone import CUT, RULES, cone_nodes
from vgonio.wave.lobes import cone_rules

THETA_I, WAVELENGTH, APERTURE, COHERENCE = 30.0, 500.0, 2.0, 10.0
ANGLES = [-32.0, -31.0, -30.0, -27.0]


def narrow(kind: str) -> Heightfield:
    if kind == "mirror":
        return Heightfield(np.zeros((32, 32)), 2.0, periodic=True)
    if kind == "grating":
        x = (np.arange(64) + 0.5) * 1.0
        return Heightfield(np.tile(0.04 * np.cos(2 * np.pi * x / 8), (64, 1)), 1.0, periodic=True)
    return vg.surface.gaussian(rms_um=0.12, correlation_um=10, shape=(64, 64), pitch_um=1.0, seed=1)  # α = 0.024


def disc(theta_o: float, aperture: float = APERTURE) -> tuple[np.ndarray, np.ndarray]:
    """(m, 3) directions in rings about the axis of the cone, and their share of ∫ cos θ_o dω: Gauss in the cosine of
    the distance from the axis, even in azimuth."""
    half = np.deg2rad(aperture / 2)
    axis, side = unit_vectors(np.deg2rad(np.array([theta_o, theta_o + 90.0])))
    t, w = np.polynomial.legendre.leggauss(24)
    c = np.cos(half) + (1 - np.cos(half)) * (t[:, None] + 1) / 2
    phi = (np.arange(64) + 0.5) * 2 * np.pi / 64
    ring = np.cos(phi)[:, None] * side + np.sin(phi)[:, None] * np.array([0.0, 1.0, 0.0])
    wo = (c[..., None] * axis + np.sqrt(1 - c[..., None] ** 2) * ring).reshape(-1, 3)
    share = np.repeat(w, 64) * wo[:, 2]
    return wo, share / share.sum()


def full_disc(surface: Heightfield) -> np.ndarray:
    """The BRDF of every window at every direction of the disc, averaged: another quadrature in another frame."""
    k = 2e3 * np.pi / WAVELENGTH
    wi = unit_vectors(np.deg2rad(np.array([THETA_I])))[0]
    wo, share = (np.concatenate(parts) for parts in zip(*[disc(t) for t in ANGLES]))
    q = k * (wi + wo)
    c = (1 + wo @ wi) / (wi[2] + wo[:, 2])
    total = np.zeros(len(wo))
    windows = WindowPlan.of(surface, COHERENCE, None).gaussian
    for window in windows:
        points, area = patch(surface, window, (0.25, 0.25), "uniform")
        total += np.abs(nufft.transform(points, q, 1e-5)) ** 2 / area
    f = k**2 / (4 * np.pi**2) * c**2 / (wi[2] * wo[:, 2]) * total / len(windows)
    return (f * share).reshape(len(ANGLES), -1).sum(axis=1)


@pytest.mark.parametrize("kind", ["rough", "mirror", "grating"])
def test_narrow_lobes_over_the_full_disc(kind, agreement):
    """Lobes inside the cone, on its edge (−31°) and outside of it: to the tolerance, relative to the peak."""
    surface = narrow(kind)
    gonio = vg.measure.Gonioreflectometer([THETA_I], ANGLES, aperture_deg=APERTURE, coherence_um=COHERENCE)
    expected = full_disc(surface)
    for tol in (1e-2, 1e-4):
        data = gonio.measure(surface, Kirchhoff("perfect", [WAVELENGTH], tol=tol))
        error = np.abs(data.brdf[0, :, 0].values - expected).max() / expected.max()
        agreement(
            "detector cone over mirror, grating, narrow lobe (α = 0.024), and lobes on its edge",
            "the full disc by another quadrature",
            error,
            tol,
        )
        assert data.attrs["cone_error"] <= data.attrs["error_achieved"] <= tol
    # the plane of incidence alone is no substitute: the lobe is narrower than the cone across it
    alone = vg.measure.Gonioreflectometer([THETA_I], ANGLES, aperture_deg=1e-3, coherence_um=COHERENCE)
    single = alone.measure(surface, Kirchhoff("perfect", [WAVELENGTH], tol=1e-3)).brdf[0, 2, 0].item()
    assert single > 1.5 * expected[2]


def test_rows_that_many_wavelengths_share():
    """Six wavelengths, soft edge: the mirror's lobe on the edge of the cone against each wavelength by itself."""
    gonio = vg.measure.Gonioreflectometer([THETA_I], ANGLES, aperture_deg=APERTURE, coherence_um=COHERENCE)
    nm = [400.0, 450.0, 500.0, 550.0, 600.0, 650.0]
    for tol in (1e-3, 1e-4):
        together = gonio.measure(narrow("mirror"), Kirchhoff("perfect", nm, tol=tol))
        assert "soft edge" in together.attrs["cone_rule"]
        apart = [gonio.measure(narrow("mirror"), Kirchhoff("perfect", [w], tol=1e-5)).brdf.values for w in nm]
        difference = np.abs(together.brdf.values - np.concatenate(apart, axis=2)).max(axis=1)
        assert np.all(difference < tol * together.brdf.max("theta_o").values)


def window_lobe(k: float, sine: float):
    """|ŵ(q)|² of a window of COHERENCE, cut at 3 ℓ, around a mirror direction, 1 at its top."""
    t, w = np.polynomial.legendre.leggauss(120)
    t, w = t * 3 * COHERENCE, w * 3 * COHERENCE
    g = w * (np.exp(-(t**2) / (2 * COHERENCE**2)) - np.exp(-4.5))
    return lambda d: (
        ((np.cos(np.outer(k * (d[:, 0] - sine), t)) @ g) * (np.cos(np.outer(k * d[:, 1], t)) @ g) / g.sum() ** 2) ** 2
    )


@pytest.mark.parametrize("theta", [30.0, 70.0, 84.0])  # at 84° the cone of 6° is 3° from the horizon
@pytest.mark.parametrize("aperture", [0.1, 1.0, 2.0, 6.0])
@pytest.mark.parametrize("rule", RULES[1:])
def test_rules_keep_their_error(rule, aperture, theta):
    """A window's lobe at eight places, inside of a cone and out: against rings about the cone's axis."""
    k = 4e3 * np.pi / 1000
    wo, share = disc(theta, aperture)
    nodes = cone_nodes(Detector.in_plane([theta], aperture), np.array([k]), 1 / COHERENCE, 0.0, rule)
    peak = share @ window_lobe(k, np.sin(np.deg2rad(theta)))(wo)
    for offset in np.linspace(0, aperture, 8):
        lobe = window_lobe(k, np.sin(np.deg2rad(theta + offset)))
        assert abs(nodes.weight @ lobe(nodes.direction) - share @ lobe(wo)) < max(rule.error, 1e-9) * peak


def test_a_cut_lattice_is_for_diffuse_light_alone():
    """What the fine rules are for: the cut one is off by more than 1 % of the peak; and the choice between them."""
    k = 4e3 * np.pi / 1000
    nodes = cone_nodes(Detector.in_plane([30.0], 2.0), np.array([k]), 1 / COHERENCE)
    wo, share = disc(30.0)
    lobe = window_lobe(k, np.sin(np.deg2rad(31.0)))
    assert abs(nodes.weight @ lobe(nodes.direction) - share @ lobe(wo)) > 0.01 * (share @ window_lobe(k, 0.5)(wo))
    rough = vg.surface.gaussian(rms_um=1.0, correlation_um=5, shape=(128, 128), pitch_um=1.0, seed=1)
    sources = unit_vectors(np.deg2rad(np.array([0.0, 85.0])))
    wavenumber, many = np.array([k]), Detector.in_plane(np.linspace(-85, 85, 5000), 2.0)
    chosen = cone_rules(rough, sources, "kirchhoff", wavenumber, 1 / COHERENCE, many, 1e-3)
    assert chosen[0].rule is CUT  # exp(−(2kσ)²) is nothing
    assert chosen[1].rule is not CUT  # at 85° q_z σ = 2.2: some of the light stays in the mirror direction
    assert chosen[1].elements[0]  # and there alone
    assert chosen[1].elements.sum() < 2500
    chosen = cone_rules(
        rough, sources, "kirchhoff", wavenumber, 1 / COHERENCE, Detector.in_plane([0.0, 85.0], 2.0), 1e-3
    )
    assert all(c.rule is not CUT for c in chosen)  # four pairs cost nothing


def test_cells_that_miss_a_narrow_lobe_say_so():
    """A mirror's lobe of 0.5° in cells of 10°, of which four directions see nothing; a rough surface has no such."""
    gonio = vg.measure.Gonioreflectometer.hemisphere([30], resolution_deg=10, coherence_um=10)
    with pytest.warns(VgonioWarning, match="narrow against the cells"):
        data = gonio.measure(narrow("mirror"), Kirchhoff("perfect", [WAVELENGTH], tol=1e-2, windows=1))
    assert data.attrs["cell_error"] == pytest.approx(abs(data.energy_reflected.item() - 1), abs=0.05)
    rough = vg.surface.gaussian(rms_um=0.6, correlation_um=3, shape=(64, 64), pitch_um=0.5, seed=1)
    gonio = vg.measure.Gonioreflectometer.hemisphere([30], resolution_deg=10, coherence_um=4)
    data = gonio.measure(rough, Kirchhoff("perfect", [WAVELENGTH], tol=1e-2, windows=1))
    assert data.attrs["cell_error"] < 1e-9
