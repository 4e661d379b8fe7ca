"""Instruments against each other: deviations by hand, grids that differ, spectra that tilt, real PTFE."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import linregress

from vgonio.errors import InputError
from vgonio.measure import formats
from vgonio.measure.cross_validation import _slopes, cross_validate, grazing_spectra
from vgonio.measure.isotropic import sampled

THETA_O = np.arange(-80, 81, 10)


def test_deviations_by_hand(facets):
    """A set 2 % high everywhere and 5 % at one direction: mean, largest, bias and where."""
    a = sampled(facets(0.5, 0.5), [10, 30, 45], THETA_O)
    b = a.copy(deep=True)
    b["brdf"] = b.brdf * 1.02
    b.brdf.loc[{"theta_i": 30, "theta_o": -60}] *= 1.05 / 1.02
    rows = {(r["name"], r["theta_i_deg"]): r for r in cross_validate({"ours": b, "ref": a}, reference="ref")}
    assert set(rows) == {("ours", t) for t in (10.0, 30.0, 45.0, None)}
    assert rows["ours", 10.0]["mean"] == pytest.approx(0.02)
    assert rows["ours", 10.0]["bias"] == pytest.approx(0.02)
    here = rows["ours", 30.0]
    assert (here["angles"], here["largest_theta_o_deg"]) == (17, -60)
    assert here["mean"] == pytest.approx((16 * 0.02 + 0.05) / 17)
    assert rows["ours", None]["largest"] == pytest.approx(0.05)
    assert rows["ours", None]["mean"] == pytest.approx((50 * 0.02 + 0.05) / 51)


def test_any_number_against_their_mean(facets):
    a = sampled(facets(0.5, 0.5), [30], THETA_O)
    sets = {name: a.assign(brdf=a.brdf * factor) for name, factor in (("a", 0.97), ("b", 1.0), ("c", 1.03))}
    rows = cross_validate(sets, wavelength_nm=600.0)
    assert [r["reference"] for r in rows] == ["mean of all"] * 3
    assert [r["bias"] for r in rows] == pytest.approx([-0.03, 0.0, 0.03])


def test_common_angles_of_different_grids(facets):
    """A dense, shifted grid with gaps against a coarse one: linear in between, never beyond; light from both sides."""
    brdf = facets(1.0, 0.5)
    coarse = sampled(brdf, [30], np.arange(-60, 61, 20))
    dense = sampled(brdf, [-30.2], np.arange(-72.5, 75, 5))
    dense["brdf"] = dense.brdf.where(np.abs(dense.theta_o - 2.5) > 1)
    (row,) = cross_validate({"dense": dense, "coarse": coarse}, reference="coarse")
    assert row["angles"] == 7
    assert row["largest"] < 0.02  # of interpolation over 10° and 0.2° of incidence


def test_what_cannot_be_compared(facets):
    a = sampled(facets(0.5, 0.5), [30], THETA_O)
    with pytest.raises(InputError, match="1 data sets"):
        cross_validate({"a": a})
    with pytest.raises(InputError, match="did you mean 'ref'"):
        cross_validate({"a": a, "ref": a}, reference="reff")
    with pytest.raises(InputError, match="angles of incidence"):
        cross_validate({"a": a, "b": sampled(facets(0.5), [60], THETA_O)})
    with pytest.raises(InputError, match="no directions of reflection"):
        cross_validate({"a": a.isel(theta_o=slice(0, 5)), "b": a.isel(theta_o=slice(10, 15))})
    with pytest.raises(InputError, match="450 to 650"):
        cross_validate({"a": a, "b": a}, wavelength_nm=800)
    with pytest.raises(InputError, match="no wavelengths in common"):
        cross_validate({"a": a.isel(wavelength=[0]), "b": a.isel(wavelength=[2])})
    with pytest.raises(InputError, match="hemisphere"):
        cross_validate({"a": a, "b": sampled(facets(0.5), [30], resolution_deg=20)})
    with pytest.raises(InputError, match="two and more"):
        grazing_spectra({"a": a.isel(wavelength=[0])}, theta_i_deg=30)
    with pytest.raises(InputError, match="covers -80 to 80"):
        grazing_spectra({"a": a}, theta_i_deg=30, theta_o_deg=[-85])


def test_tilt_of_spectra(facets):
    """f ∝ 1 + 0.2 (λ − 550)/100: a slope of 0.002 per nm of its mean; with noise the error covers it."""
    a = sampled(facets(0.5, 0.5, np.arange(450.0, 651.0, 10)), [80], THETA_O)
    noisy = a.assign(brdf=a.brdf * (1 + 0.01 * np.random.default_rng(0).normal(size=a.brdf.shape)))
    out = grazing_spectra({"a": a, "noisy": noisy})
    np.testing.assert_allclose(out.tilt.sel(name="a"), 0.002, rtol=1e-9)
    np.testing.assert_allclose(out.tilt_stderr.sel(name="a"), 0, atol=1e-12)
    pull = (out.tilt.sel(name="noisy") - 0.002) / out.tilt_stderr.sel(name="noisy")
    assert (np.abs(pull) < 4).all()
    assert out.brdf.dims == ("name", "theta_o", "wavelength")
    assert out.theta_o.values.tolist() == [-50, -60, -70, -80]
    # σ/√Σ(λ − mean)²: 0.01 / 277
    expected = 0.01 / np.sqrt(np.sum((a.wavelength.values - 550) ** 2))
    np.testing.assert_allclose(out.tilt_stderr.sel(name="noisy"), expected, rtol=0.4)


@pytest.mark.parametrize("n", [3, 7])
def test_tilts_and_their_errors_are_those_of_a_regression(rng, n):
    """Against SciPy's, with n − 2 degrees of freedom: three wavelengths leave one."""
    x, y = np.sort(rng.uniform(400, 700, n)), rng.random((2, n))
    slope, stderr = _slopes(x, y)
    expected = [linregress(x, row) for row in y]
    np.testing.assert_allclose(slope, [e.slope for e in expected], rtol=1e-9)
    np.testing.assert_allclose(stderr, [e.stderr for e in expected], rtol=1e-9)


def test_ptfe_tilts_with_the_side(shared):
    """NIST's PTFE, 351 … 1064 nm: oblique light leaves redder forward and bluer backward, as the thesis says.

    Slopes of f over its mean in 10⁻⁵/nm at θ_o = −60° and +60°: 4.9 ± 1.3 and −2.7 ± 0.7 at θ_i = 45°, 7.2 ± 3.7 and
    −3.6 ± 3.4 at 75°; at normal incidence both are alike. Four wavelengths, and errors from the residuals alone.
    """
    ptfe = formats.read(shared / "data" / "nist_ptfe" / "PTFE.data.csv")

    def sides(theta_i):
        out = grazing_spectra({"nist": ptfe}, theta_i_deg=theta_i, theta_o_deg=[-60, 60])
        return out.tilt.values[0], out.tilt_stderr.values[0]

    for theta_i, sigmas in ((45, 5), (75, 2)):
        (forward, backward), errors = sides(theta_i)
        assert forward > 0 > backward
        assert forward - backward > sigmas * np.hypot(*errors)
    (a, b), errors = sides(0)
    assert abs(a - b) < 2 * np.hypot(*errors)


def test_ptfe_against_itself(shared):
    ptfe = formats.read(shared / "data" / "nist_ptfe" / "PTFE.data.csv")
    rows = cross_validate({"a": ptfe, "b": ptfe.assign(brdf=ptfe.brdf * 1.01)}, reference="a", wavelength_nm=633)
    assert rows[-1]["mean"] == pytest.approx(0.01)
    assert rows[-1]["theta_i_deg"] is None
    assert len(rows) == 7
