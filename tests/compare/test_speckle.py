"""Speckle as noise of the comparison: correlations in closed form, by brute force, and of simulated surfaces."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from scipy.special import j1

import vgonio as vg
from vgonio.compare.drawn_errors import Noise, standard_errors
from vgonio.compare.speckle import Speckle

LENGTH, HEIGHT = 10.0, 0.2
ATTRS = {"theory": "kirchhoff", "coherence_um": LENGTH, "surface_sq_um": HEIGHT, "surface_digest": "a", "windows": 9.0}
DRAWS = 600


def speckled(theta_o=(-1.0, 0.0, 0.5, 1.0, 30.0), theta_i=(0.0, 30.0), wavelength=(540.0, 560.0, 600.0), **attrs):
    shape = len(theta_i), len(theta_o), len(wavelength)
    coords = {"theta_i": list(theta_i), "theta_o": list(theta_o), "wavelength": list(wavelength)}
    made = {name: (tuple(coords), np.ones(shape)) for name in ("brdf", "brdf_stderr")}
    return xr.Dataset(made, coords=coords, attrs={**ATTRS, "aperture_deg": 1e-3, **attrs})


def drawn(data):
    speckle = Speckle.of(data)
    return np.stack([speckle(np.random.default_rng([7, k])) for k in range(DRAWS)])


def q_of(data, i, o, w, grazing=True):
    ti, to = np.radians(data.theta_i.values[i]), np.radians(data.theta_o.values[o])
    height = np.cos(ti) + np.cos(to) if grazing else 2.0
    return 2e3 * np.pi / data.wavelength.values[w] * np.array([np.sin(ti) + np.sin(to), height])


def expected(data, a, b, grazing=True):
    dx, dz = q_of(data, *a, grazing) - q_of(data, *b, grazing)
    return np.exp(-((LENGTH * dx) ** 2) / 2 - (HEIGHT * dz) ** 2)


PAIRS = [
    ((0, 1, 1), (0, 2, 1)),  # neighbouring directions
    ((0, 0, 1), (0, 3, 1)),
    ((0, 1, 0), (0, 1, 2)),  # wavelengths in the mirror direction: heights alone
    ((0, 2, 0), (0, 2, 2)),
    ((0, 4, 0), (0, 4, 1)),  # and away from it
    ((1, 1, 1), (0, 4, 1)),  # source and detector exchanged: 1
]


@pytest.mark.parametrize("theory", ["kirchhoff", "harvey-shack"])
def test_correlations_are_those_of_the_window(theory):
    """exp(−ℓ² Δq_∥²/2 − Sq² Δq_z²), q_z = 2k in the theory of Harvey and Shack; of 600 draws, 4.5 errors."""
    data = speckled(theory=theory)
    noise = drawn(data)
    np.testing.assert_allclose((noise**2).mean(axis=0), 1.0, atol=4.5 * np.sqrt(2 / DRAWS))
    for a, b in PAIRS:
        rho = expected(data, a, b, theory != "harvey-shack")
        found = np.mean(noise[:, *a] * noise[:, *b])
        assert found == pytest.approx(rho, abs=4.5 * np.sqrt((1 + rho**2) / DRAWS))


def test_cones_broaden_it_as_their_mean_does():
    """Cones of 2° see several speckles each: against the mean of the closed form over pairs of their directions."""
    data = speckled(theta_o=(0.0, 0.5, 1.0, 2.0), theta_i=(0.0,), wavelength=(560.0,), aperture_deg=2.0)
    noise = drawn(data)[:, 0, :, 0]
    rng = np.random.default_rng(0)
    k, a = 2e3 * np.pi / 560, np.sin(np.radians(1.0))
    r, turn = a * np.sqrt(rng.random((2, 200_000))), 2 * np.pi * rng.random((2, 200_000))
    x, y = r * np.cos(turn), r * np.sin(turn)

    def mean(shift):
        return np.exp(-((LENGTH * k) ** 2) * ((x[0] - x[1] + shift) ** 2 + (y[0] - y[1]) ** 2) / 2).mean()

    for j, angle in enumerate((0.5, 1.0, 2.0), 1):
        rho = mean(np.sin(np.radians(angle))) / mean(0.0)
        assert np.mean(noise[:, 0] * noise[:, j]) == pytest.approx(rho, abs=4.5 * np.sqrt((1 + rho**2) / DRAWS))
    # what is left of the fringes of a pair is the transform of the disc
    u = 3.0
    assert np.cos(u * x[0] / a).mean() == pytest.approx(2 * j1(u) / u, abs=0.01)


def test_the_error_of_a_sum_is_that_of_all_covariances():
    """√(Σ Σ ρ) over nine directions 0.25° apart, 3.1 times fewer independent ones than there are; 600 draws: 3 %."""
    data = speckled(theta_o=np.arange(-1.0, 1.01, 0.25), theta_i=(0.0,), wavelength=(560.0,))
    rho = [[expected(data, (0, a, 0), (0, b, 0)) for b in range(9)] for a in range(9)]
    found = standard_errors(lambda f: {"sum": float(f.sum())}, data, draws=DRAWS)["sum"]
    assert found == pytest.approx(np.sqrt(np.sum(rho)), rel=0.13)
    independent = standard_errors(lambda f: {"sum": float(f.sum())}, data.drop_attrs(deep=False), draws=DRAWS)["sum"]
    assert independent == pytest.approx(3.0, rel=0.13)
    assert found > 1.4 * independent


def test_theories_of_one_surface_share_their_speckle_and_no_others():
    ours, theirs = speckled(), speckled(theory="generalized-harvey-shack")
    same, other = Noise((ours, theirs), False)(0), Noise((ours, speckled(surface_digest="b")), False)(0)
    np.testing.assert_array_equal(same[0], same[1])
    assert abs(np.corrcoef(other[0].ravel(), other[1].ravel())[0, 1]) < 0.9
    # their difference has no error where both have the same values
    assert standard_errors(lambda a, b: {"mean": float((a - b).mean())}, ours, theirs) == {}


def test_what_the_data_do_not_say_is_drawn_as_independent():
    for missing in ("theory", "coherence_um", "surface_sq_um"):
        data = speckled()
        assert (
            Speckle.of(data.drop_attrs(deep=False).assign_attrs({k: v for k, v in ATTRS.items() if k != missing}))
            is None
        )
    assert Speckle.of(speckled(coherence_um="whole sample")) is None


def test_many_directions_cost_fewer_pairs_of_each_draw():
    data = speckled(theta_o=np.linspace(-85, 85, 4001), wavelength=np.arange(400.0, 781, 20))
    assert Speckle.of(data).many == 8
    assert Speckle.of(speckled()).many == 64


def test_means_over_simulated_surfaces_scatter_as_stated(agreement):
    """Profiles by Kirchhoff's theory, 40 seeds: the mean BRDF near the mirror direction, of 17 neighbours and 5
    wavelengths, scatters as one result says. 40 surfaces and 60 draws tell that to 15 %. Taken as independent from
    value to value the error was 3.7 times too small."""
    gonio = vg.measure.Gonioreflectometer(
        theta_i_deg=[20], theta_o_deg=np.arange(-28.0, -11.9, 1.0), aperture_deg=0.5, coherence_um=4
    )
    solver = vg.wave.Kirchhoff("perfect", wavelength_nm=np.arange(500.0, 601, 25), tol=1e-2)
    values, stated, alone = [], [], []
    for seed in range(40):
        surface = vg.surface.gaussian(rms_um=0.25, correlation_um=1.5, shape=(1, 800), pitch_um=0.2, seed=seed)
        data = gonio.measure(surface, solver)
        values.append(float(data.brdf.mean()))
        for found, one in ((stated, data), (alone, data.drop_attrs(deep=False))):
            kinds = Noise((one,), False)
            found.append(np.std([kinds(k)[0].mean() for k in range(60)]))
    spread = np.std(values, ddof=1)
    ratio, before = (spread / np.sqrt(np.mean(np.square(e))) for e in (stated, alone))
    agreement("stated error of a mean of speckle, neighbours and wavelengths", "40 other surfaces", ratio, (0.6, 1.4))
    assert before > 2
