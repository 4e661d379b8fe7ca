"""The first line of the verdict: which method to trust where, from surfaces whose range is known."""

import json

import numpy as np
import pytest
import xarray as xr

import vgonio as vg
from vgonio.compare.alike import unlike
from vgonio.compare.significance import in_sigmas
from vgonio.dataset import brdf_dataset
from vgonio.directions import Detector
from vgonio.measure.surface_summary import surface_dataset
from vgonio.report.shifts import MeanShift, in_words, signed
from vgonio.report.tables import percent
from vgonio.report.trusted import Ground, recommendation
from vgonio.report.wave_reflections import reflections_in_words, shares
from vgonio.wave import trust
from vgonio.wave.closed_forms import mean_intensity

THETA_I = [0.0, 30.0, 58.0]
GENTLE = vg.surface.sinusoid(period_um=5, amplitude_um=0.05, shape=(4, 1000), pitch_um=0.05)
STEEP = vg.surface.sinusoid(period_um=5, amplitude_um=1, shape=(4, 300), pitch_um=0.1)
ROUGH = vg.surface.gaussian(rms_um=1.5, correlation_um=3, shape=(128, 128), pitch_um=0.25, seed=1)
WIDE = vg.surface.gaussian(rms_um=5, correlation_um=60, shape=(128, 128), pitch_um=4, seed=1)


def result(theory: str, nm=(550.0,), later=0.0, **attrs) -> xr.Dataset:
    detector = Detector.in_plane([-30, 0, 30], 2.0)
    shape = (len(THETA_I), 3, len(nm))
    dims = ("theta_i", "theta_o", "wavelength")
    energy = np.broadcast_to(np.array([0.8, 0.2])[None, :, None], (3, 2, len(nm))) * 1.0
    energy[:, 1] = later * np.array([1.0, 2.0, 0.5])[:, None]
    whole = energy.sum(axis=1) - 0.05 + 0.01
    variables = {
        "brdf": (dims, np.ones(shape)),
        "energy_by_bounce": (("theta_i", "bounce", "wavelength"), energy),
        "energy_interference": (("theta_i", "wavelength"), 0 * whole - 0.05),
        "energy_diffraction": (("theta_i", "wavelength"), 0 * whole + 0.01),
        "energy_reflected": (("theta_i", "wavelength"), whole),
    }
    known = {"error_achieved": 1e-4, "remarks": "[]"} | ({} if theory == "rays" else {"theory": theory}) | attrs
    return brdf_dataset(variables, THETA_I, nm, detector, coords={"bounce": [1, 2]}, attrs=known)


ITERATED = {"sweeps_done": 2, "diffraction_left_out": ""}


def test_the_ground_of_a_summary_is_the_grating_of_the_surface():
    for surface in (GENTLE, STEEP, ROUGH):
        ground = Ground.of(surface_dataset(surface))
        shape, depth, period = trust.equivalent_grating(surface)
        assert ground.grating[0] == shape
        assert ground.grating[1] == pytest.approx(depth, rel=1e-3)
        assert ground.grating[2] == pytest.approx(period, rel=0.06)  # slopes of facets, and the mean of both axes
        assert ground.profile == surface.is_profile
    assert Ground.of(surface_dataset(STEEP)).steep == pytest.approx(0.68, abs=0.02)  # as the plan's caution says


def test_the_full_wave_comes_first_wherever_its_error_is_small():
    some = {"waves": result("kirchhoff"), "waves_full_wave": result("full-wave")}
    said = recommendation(some, surface_dataset(STEEP))
    assert said == "Trust the waves (full wave) at all θᵢ: rigorous, numerical error 0.010 %."
    some["waves_full_wave"].attrs["error_achieved"] = 0.2
    said = recommendation(some, surface_dataset(STEEP))
    assert said.startswith("None of the methods of this result may be trusted (")
    assert "its numerical error is 20 %" in said
    assert "is steeper than 30°" in said


def test_iterated_kirchhoff_counts_with_diffraction_and_without_a_remark():
    iterated = result("iterated-kirchhoff", **ITERATED)
    steep = surface_dataset(STEEP)
    assert recommendation({"waves": iterated}, steep).startswith("Trust the waves (iterated Kirchhoff) at all θᵢ")
    cut = iterated.assign_attrs(remarks=json.dumps(["the coherence length is 5 µm instead of the light's 8 µm"]))
    assert recommendation({"waves": cut}, steep).startswith("Trust")
    for attrs in ({"remarks": json.dumps(["grooves in the resonance domain"])}, {"sweeps_done": 0}):
        said = recommendation({"waves": iterated.assign_attrs(attrs)}, steep)
        assert said.startswith("None of the methods")
        assert said.endswith('The surface is a profile: add "full-wave" to wave.theory.')


def test_kirchhoff_is_trusted_where_the_rigorous_gratings_say_so():
    """Slope 0.04, depth 0.18 λ: Kirchhoff within 1 %, harvey-shack off by more than half at 58° (docs/trust.md)."""
    gentle = surface_dataset(GENTLE)
    assert recommendation({"waves": result("kirchhoff")}, gentle).startswith("Trust the waves (Kirchhoff) at all θᵢ")
    said = recommendation({"waves": result("harvey-shack")}, gentle)
    assert said.startswith("Trust the waves (Harvey–Shack) at θᵢ = 0°")
    assert "none of the methods of this result may be trusted at θᵢ = 30°, 58°" in said
    assert "likely off by" in said
    rays = result("rays", later=0.3)
    assert "reflected more than once" in recommendation({"waves": result("kirchhoff"), "rays": rays}, gentle)


def test_rays_are_trusted_on_features_much_larger_than_the_wavelength():
    assert recommendation({"rays": result("rays")}, surface_dataset(WIDE)).startswith("Trust the rays at all θᵢ")
    for surface in (ROUGH, GENTLE):
        said = recommendation({"rays": result("rays")}, surface_dataset(surface))
        assert said.startswith("None of the methods")
        assert "no diffraction in it" in said
    assert '"iterated-kirchhoff"' in recommendation({"rays": result("rays")}, surface_dataset(ROUGH))


def test_heights_are_rough_enough_for_rays_where_the_mean_lobe_is_that_of_the_slopes():
    """Series of Beckmann and Spizzichino beside its limit exp(−q²T²/4g)/g, coherent peak (q ℓ < 8) apart."""
    correlation, coherence = 50.0, 2000.0

    def error(phase: float) -> float:
        q = np.linspace(0.004, 14 * phase / correlation, 3000)
        vectors = np.stack([q, 0 * q, np.ones_like(q)], axis=1)
        exact = mean_intensity(vectors, phase, correlation, coherence)
        limit = np.pi * (correlation / phase) ** 2 * np.exp(-((q * correlation / phase) ** 2) / 4)
        return float(np.sum(abs(exact - limit) * q) / np.sum(exact * q))

    assert error(trust.ROUGH_PHASE) < trust.NOTABLE < error(0.9 * trust.ROUGH_PHASE)
    assert error(10.0) == pytest.approx(0.0062, rel=0.05)


def test_without_a_surface_or_a_simulation_nothing_is_invented():
    assert recommendation({"measured": result("")}, None) is None
    assert "carries no summary" in recommendation({"rays": result("rays")}, None)
    assert recommendation({"waves": result("full-wave")}, None).startswith("Trust the waves (full wave)")


def test_the_verdict_begins_with_it_and_tells_what_waves_make_of_further_reflections():
    """Also where there is one wavelength; the share is the largest, at 30°: 0.2 of 0.8 + 0.2 − 0.05 + 0.01."""
    one = result("iterated-kirchhoff", later=0.1, **ITERATED)
    tree = xr.DataTree.from_dict({"waves": one, "surface": surface_dataset(STEEP)})
    first, second, *_ = tree.vgonio.verdict().statements
    assert first.startswith("Trust the waves (iterated Kirchhoff)")
    assert second == (
        "Multiple reflections of the waves (iterated Kirchhoff) make 21 % of the reflected power by themselves, "
        "−5.2 % by interference, +1.0 % by diffraction (at θᵢ = 30°, 550 nm, where their share is largest)."
    )
    found = shares(one)
    single = one["energy_by_bounce"].sel(bounce=1, wavelength=550) / one["energy_reflected"].sel(wavelength=550)
    np.testing.assert_allclose(sum(found.data_vars.values()) + single, 1.0)
    assert reflections_in_words("waves", one.drop_vars("energy_reflected")) is None
    assert reflections_in_words("waves", result("iterated-kirchhoff")).startswith("No light of the waves")


def test_results_that_were_not_simulated_alike_are_not_blamed_on_a_theory():
    a, b = result("kirchhoff", coherence_um=8.0), result("iterated-kirchhoff", coherence_um=5.0, **ITERATED)
    assert "coherence_um is 8 and 5 µm" in unlike(a, b)
    assert unlike(a, b.assign_attrs(coherence_um=8.0)) == ""
    assert unlike(a, a.drop_attrs(deep=False)) == ""
    one = b.assign_attrs(coherence_um=8.0, windows_used=1, windows_tiled=9)
    assert "9 and 1 coherence windows" in unlike(a.assign_attrs(windows_used=9, windows_tiled=9), one)
    wide = a.assign_coords(solid_angle=4 * a["solid_angle"])
    assert "detector cones" in unlike(a, wide)
    said = xr.DataTree.from_dict({"waves": a, "waves_iterated_kirchhoff": b}).vgonio.verdict()
    (pair,) = (s for s in said.statements if "differ by" in s)
    assert "does not blame a theory" in pair
    assert "not of the theories alone" in next(c.note for c in said.cards if "against" in c.what)


def test_figures_below_rounding_are_not_printed():
    assert percent(1.6e-14) == "< 10⁻⁶ %"
    assert percent(-1.6e-14) == "0 % (to rounding)"
    assert percent(0.0) == "0 %"
    assert percent(2e-8) == "2.0·10⁻⁶ %"
    assert [in_sigmas(s) for s in (2.04, 30.2, 1546.1)] == ["2.0 σ", "30 σ", "> 100 σ"]
    assert in_words(MeanShift(-9.9e-14, 1e-15, 9)) == "0 % per 100 nm (to rounding)"
    assert in_words(MeanShift(1e-3, 1e-9, 9)).endswith("(towards red, > 100 σ)")
    assert signed(-9.9e-14) == "0"
