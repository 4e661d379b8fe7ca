"""The first line of the verdict: which method to trust where, from surfaces whose range is known."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr

import vgonio as vg
from vgonio.compare.alike import unlike
from vgonio.compare.significance import in_sigmas
from vgonio.dataset import brdf_dataset
from vgonio.directions import Detector
from vgonio.measure.surface_summary import surface_dataset
from vgonio.report.agreement import Agreement, Figure
from vgonio.report.judgement import Ground, Judgement
from vgonio.report.shifts import MeanShift, in_words, signed
from vgonio.report.tables import percent
from vgonio.report.trusted import _also_waves, _one_for_all, advice, recommendation
from vgonio.report.verdict import lost_beside_cones
from vgonio.report.wave_reflections import reflections_in_words, shares
from vgonio.validity import expectations
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
        assert ground.grating[2] == pytest.approx(period, rel=1e-6)  # the plan's and the verdict's
        assert ground.profile == surface.is_profile
    assert Ground.of(surface_dataset(STEEP)).steep == pytest.approx(0.68, abs=0.02)  # as the plan's caution says


def test_the_full_wave_comes_first_wherever_its_error_is_small():
    some = {"waves": result("kirchhoff"), "waves_full_wave": result("full-wave")}
    said = recommendation(some, surface_dataset(STEEP))
    assert said == "Trust the waves (full wave) at all θᵢ: rigorous, numerical error 0.010 % of the largest BRDF."
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
    assert "harvey-shack's phase" in said or "likely off by" in said
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


# ---- the evidence
def gentle_rough(rms: float = 0.3, correlation: float = 5.0, **options) -> xr.Dataset:
    return surface_dataset(vg.surface.gaussian(rms, correlation, (96, 96), 0.5, seed=1, **options))


def told(surface: xr.Dataset, theories=("kirchhoff",), **attrs):
    named = {f"waves_{i}" if i else "waves": result(t, **attrs) for i, t in enumerate(theories)}
    return advice(named, surface)


def test_the_verdict_rests_on_the_tests_that_the_plan_has():
    """The first sentence has the worst error of `validity.expectations`, and says whether a test is alike."""
    for rms, correlation in ((0.3, 5.0), (5.0, 80.0)):
        surface = vg.surface.gaussian(rms, correlation, (96, 96), correlation / 8, seed=1)
        light = SimpleNamespace(theta_i_deg=THETA_I, wavelength_nm=[550.0])
        (planned,) = expectations(surface, ["kirchhoff"], light, "Al")
        made = told(surface_dataset(surface), material="Al")
        worst = max(j.off for j in made.trusted["waves"].values())
        assert worst == pytest.approx(planned.off, rel=1e-6)
        assert f"off by {percent(max(worst, 1e-3))} of the light" in made.first
        alike = planned.basis == "alike"
        assert ("likely off by" in made.first) == alike
        assert ("is within that" in made.more[0]) == alike
        assert ("This surface (Sq/λ 9.1" in made.more[0]) == (not alike)


def test_the_directions_to_trust_are_named():
    made = told(gentle_rough(), material="Al")
    assert made.first.startswith("Trust the waves (Kirchhoff) at all θᵢ for θₒ = −7")  # Smith's limit of α = 0.12, 79°
    assert "grazing" not in made.first
    assert "mistrust darker directions" in made.more[0]


def test_where_no_test_is_alike_it_says_so_and_what_to_do():
    fine = surface_dataset(vg.surface.gaussian(0.02, 0.05, (96, 96), 0.01, seed=1))
    said = told(fine).first
    assert said.startswith("None of the methods")
    assert "no test is like this surface" in said or "steeper than 30°" in said
    assert '"full-wave"' in said
    grazing = told(gentle_rough(0.05, 5.0)).trusted["waves"]
    assert set(grazing) == set(THETA_I)


def test_kirchhoff_before_harvey_shack_and_the_other_is_named():
    """A slope of 0.12: GHS is off by 2 to 4 %, Kirchhoff by less; the other serves as well within its error."""
    made = told(gentle_rough(), ("generalized-harvey-shack", "kirchhoff"), material="Al")
    assert made.first.startswith("Trust the waves (Kirchhoff) at all θᵢ")
    (other,) = (m for m in made.more if "generalized Harvey–Shack" in m)
    assert other.startswith("Waves (generalized Harvey–Shack) would serve as well")
    assert "of the light in the same tests" in other
    steep = told(gentle_rough(0.5, 3.5), ("generalized-harvey-shack", "kirchhoff"), material="Al")
    assert set(steep.trusted) == {"waves_1"}
    assert any("is not as good here" in m or "may be trusted at" in steep.first for m in [*steep.more, ""])


def test_slightly_rough_surfaces_have_their_directions():
    """Kirchhoff on a perfect conductor at 0° for unpolarised light: within 10 % up to 59°; for s light up to 24°."""
    flat = gentle_rough(0.006, 2.0)
    made = told(flat, material="perfect")
    assert "there within 10 % of rigorous first-order theory" in made.first
    assert "−59 … 59° (θᵢ = 0°)" in made.first
    assert "−80 … −1° (θᵢ = 60°)" not in made.first  # 58° is the largest here
    (why,) = (m for m in made.more if m.startswith("The surface is slightly rough"))
    assert "Rayleigh–Rice for unpolarised light on perfect" in why
    assert "on perfect" in told(flat, material="a file that is not here.yml").more[1]  # and no error
    both = ("kirchhoff", "generalized-harvey-shack")
    assert set(told(flat, both, material="perfect").trusted) == {"waves"}
    polarised = told(flat, both, material="perfect", polarisation="s")
    assert "waves_1" in polarised.trusted  # generalized Harvey–Shack is right for s


def test_rays_that_hold_as_well_are_named():
    some = {"waves": result("kirchhoff", material="Al"), "rays": result("rays")}
    made = advice(some, surface_dataset(WIDE))
    assert made.first.startswith("Trust the waves (Kirchhoff)")
    assert any(m.startswith("The rays would serve as well: features are") for m in made.more)


def agreed(nrmse: float, noise: float) -> Agreement:
    none = Figure()
    return Agreement(("waves", "measured"), Figure(nrmse), noise, Figure(nrmse), *[none] * 5, 3)


@pytest.mark.parametrize(
    ("nrmse", "noise", "contradicts"),
    [(25.12, 6.09, True), (17.0, 6.09, False), (0.45, 0.01, False), (0.6, np.nan, True), (0.6, 0.25, False)],
)
def test_a_measurement_that_contradicts_is_in_the_first_sentence(nrmse, noise, contradicts):
    """Above half of its mean and above three times what noise and the theory's expected error explain."""
    some = {"waves": result("kirchhoff", material="Al"), "measured": result("")}
    made = advice(some, gentle_rough(), [agreed(nrmse, noise)])
    assert ("but the measurement contradicts the waves (Kirchhoff): NRMSE" in made.first) == contradicts


def test_a_profile_loses_light_beside_narrow_cones():
    """ℓ = 8 µm and 2° at 550 nm: 12 % (closed form); nothing of surfaces, nor below half a percent."""
    data = result("kirchhoff", solver="Kirchhoff", coherence_um=8.0, aperture_deg=2.0)
    said = lost_beside_cones("waves", data, surface_dataset(STEEP))
    assert "loses 12 % at 550 nm of the light of this profile" in said
    assert lost_beside_cones("waves", data, surface_dataset(ROUGH)) is None
    assert lost_beside_cones("waves", data.assign_attrs(aperture_deg=10.0), surface_dataset(STEEP)) is None
    assert lost_beside_cones("waves", data.assign_attrs(solver="FullWave"), surface_dataset(STEEP)) is None


def test_one_method_for_all_angles_comes_before_several_that_take_turns():
    """Kirchhoff at 0° and 30°, rays everywhere: rays; never in place of a rigorous solver."""
    good, bad = Judgement(True, "fine", 0.01), Judgement(False, "off")
    theories = {"waves": "kirchhoff", "rays": "rays", "waves_full_wave": "full-wave"}
    judged = {t: {"waves": bad if t > 40 else good, "rays": good} for t in THETA_I}
    turns = {"waves": {0.0: good, 30.0: good}, "rays": {58.0: good}}
    assert set(_one_for_all(turns, judged, theories)) == {"rays"}
    (said,) = _also_waves(judged, theories, {"waves": result("kirchhoff")})
    assert said == "Waves (Kirchhoff) would serve as well at θᵢ = 0°, 30°: fine."
    rigorous = {"waves_full_wave": {0.0: good}, "rays": {58.0: good}}
    assert _one_for_all(rigorous, judged, theories) == rigorous
    judged[58.0]["rays"] = bad
    assert _one_for_all(turns, judged, theories) == turns
