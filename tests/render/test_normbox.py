"""The Normbox: closed forms of the scene, inputs, comparison, error model, error path, the command."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
import xarray as xr

from vgonio.cli import main
from vgonio.errors import FileFormatError, InputError
from vgonio.render import Appearance, choose, of_model, radiance
from vgonio.render.normbox import (
    Box,
    Scene,
    closed_forms,
    comparison,
    error_model,
    error_path,
    inputs,
    load,
    settings,
    validate,
)
from vgonio.render.normbox import predict as predictions
from vgonio.render.normbox import virtual as made_up

W = np.array([420.0, 520.0, 600.0, 700.0])
SMALL = {
    "virtual": {"samples": 64},
    "render": {"patches": [4, 19, 24], "angles_deg": [30, 60, 85], "wavelengths": 12, "samples": 64},
    "errors": {"repeats": 0},
}


def lambertian(reflectance: float) -> Appearance:
    return Appearance(
        f"ρ = {reflectance}", {"type": "diffuse", "reflectance": {"type": "uniform", "value": reflectance}}, "formula"
    )


def needs_llvm():
    chosen = choose("auto")
    if not chosen.variant.startswith("llvm"):
        pytest.skip(f"scalar would take minutes: {chosen.why}")


# ---- the scene in closed form
def test_irradiance_of_a_parallel_square_on_its_axis():
    """Side 2a, height h, over a parallel element: π times four configuration factors C-11 (Howell 2010)."""
    a, h = 1.0, 2.0
    x = a / h
    r = np.sqrt(1 + x * x)
    expected = 4 * x / r * np.arctan(x / r)
    corners = [(-a, -a, h), (a, -a, h), (a, a, h), (-a, a, h)]
    np.testing.assert_allclose(closed_forms.polygon_irradiance([0, 0, 0], [0, 0, 1], corners), expected, rtol=1e-12)


def test_irradiance_cut_by_the_horizon(rng):
    """Against a sum over the square, also where a part of it is behind the element."""
    corners = np.array([(-1.0, -1, 2), (1, -1, 2), (1, 1, 2), (-1, 1, 2)])
    t = (np.arange(1000) + 0.5) / 500 - 1
    x, y = np.meshgrid(t, t)
    r2 = x**2 + y**2 + 4
    for tilt in (0.0, 50.0, 80.0, 90.0, 110.0):
        n = np.array([0.0, -np.sin(np.radians(tilt)), np.cos(np.radians(tilt))])
        cos = np.maximum((y * n[1] + 2 * n[2]) / np.sqrt(r2), 0)
        expected = np.sum(cos * 2 / np.sqrt(r2) / r2) * (2 / 1000) ** 2
        np.testing.assert_allclose(
            closed_forms.polygon_irradiance([0, 0, 0], n, corners), expected, rtol=2e-5, atol=1e-9
        )


@pytest.mark.parametrize("angle", [30.0, 65.0, 90.0])
def test_direct_irradiance_of_the_light(llvm, angle, agreement):
    """A Lambertian sample sees the 25 parts of the light as the closed form says: 3 standard errors of 16 passes."""
    light = np.random.default_rng(0).uniform(0.5, 1.5, (25, 4))
    scene = Scene(llvm, Box(), lambertian(0.3), lambertian(0.5), W, light)
    scene.set_angle(angle)
    direct = llvm.load_dict({"type": "path", "max_depth": 2})
    found = np.array([radiance(llvm, scene.scene, direct, W, 64, seed).mean(axis=(0, 1)) for seed in range(100, 116)])
    # the four wavelengths of a path share its noise: their mean ratio is one number
    ratio = (found / (0.5 / np.pi * closed_forms.direct_irradiance(Box(), angle, light))).mean(axis=1)
    agreement(
        "direct light of the Normbox at 30, 65, 90° (standard error up to 0.4 %)",
        "Lambert's polygon formula, cut by the horizon",
        (ratio.mean() - 1) / (ratio.std(ddof=1) / 4),
        3,
        "standard errors",
    )
    assert ratio.std(ddof=1) / 4 < 0.004


def test_energy_balance_of_the_white_closed_box(llvm, agreement):
    """Mean irradiance Φ/((1 − ρ)A) of an enclosure in which everything reflects ρ, within 3 standard errors (0.3 %)."""
    white = lambertian(0.7)
    box = Box(closed=True, holder_reflectance=0.7, light_points=(1, 1))
    scene = Scene(llvm, box, white, white, W, np.ones((1, 4)))
    mean, error = closed_forms.mean_irradiance(scene, 500.0, 400_000, seed=5)
    expected = closed_forms.balanced_irradiance(scene, 1.0, 0.7)
    agreement(
        "mean irradiance of the closed white box (standard error up to 0.5 %)",
        "Φ/((1 − ρ) A)",
        (mean - expected) / error,
        3,
        "standard errors",
    )
    assert error < 0.005 * expected


def test_open_box_loses_light(llvm):
    white = lambertian(0.7)
    scene = Scene(llvm, Box(holder_reflectance=0.7, light_points=(1, 1)), white, white, W, np.ones((1, 4)))
    mean, error = closed_forms.mean_irradiance(scene, 500.0, 100_000)
    assert mean + 10 * error < closed_forms.balanced_irradiance(scene, 1.0, 0.7)


def test_changed_scene_equals_a_new_one(llvm):
    """Angle and material changed in place give the very numbers of a scene built so."""

    def patch(alpha, k_d):
        return of_model("clausen-2022", {"alpha": alpha, "eta": 1.5, "h": 1e-3, "w": 2.0, "k_d": k_d}, W)

    wall, light = lambertian(0.3), np.ones((25, 4))
    path = llvm.load_dict({"type": "path", "max_depth": 4})
    changed = Scene(llvm, Box(), wall, patch(0.2, [0.1, 0.2, 0.3, 0.4]), W, light)
    changed.set_angle(40.0)
    changed.set_sample(patch(0.5, [0.9, 0.5, 0.1, 0.3]))
    new = Scene(llvm, Box(), wall, patch(0.5, [0.9, 0.5, 0.1, 0.3]), W, light)
    new.set_angle(40.0)
    a, b = (radiance(llvm, s.scene, path, W, 16, 3) for s in (changed, new))
    np.testing.assert_allclose(a, b, rtol=1e-5)
    other = Scene(llvm, Box(), wall, lambertian(0.5), W, light)  # a material of another form: its shape is made anew
    other.set_angle(40.0)
    other.set_sample(patch(0.5, [0.9, 0.5, 0.1, 0.3]))
    np.testing.assert_allclose(radiance(llvm, other.scene, path, W, 16, 3), a, rtol=1e-5)


def test_scalar_and_llvm_predict_the_same(llvm):
    from vgonio.render import use

    wall, light = lambertian(0.3), np.ones((25, 4))
    patch = of_model("cook-torrance-1982", {"alpha": 0.4, "eta": 1.5, "k_d": 0.5}, W)
    found = []
    for name in ("scalar", "llvm"):
        mi = use(name)
        job = predictions.Job(Box(pixels=4), wall, {1: patch}, (45.0,), W, light, 64 if name == "llvm" else 12)
        found.append(predictions.predict(mi, job))
    error = np.hypot(*(d["radiance_stderr"].values for d in found))
    assert np.abs((found[0]["radiance"] - found[1]["radiance"]).values / error).max() < 4.5


# ---- the whole
@pytest.fixture(scope="module")
def small():
    needs_llvm()
    return validate(load(SMALL))


def test_virtual_truth_is_said_to_be_virtual(small):
    assert small.attrs["virtual"] == 1
    assert "nothing was measured" in small.attrs["note"]


def test_fit_dominates_and_the_extension_removes_it(small):
    found = json.loads(small.attrs["verdict"])
    assert found["fit_share"]["cook-torrance-1982"] > 0.6
    assert found["fit_share"]["clausen-2022"] < 0.1
    assert found["removed"]["clausen-2022"] > 0.6
    assert found["fit"]["clausen-2022"] < 0.1 * found["fit"]["cook-torrance-1982"]
    models = found["models"]
    assert models["clausen-2022"]["delta_e_2000"] < 0.4 * models["cook-torrance-1982"]["delta_e_2000"]
    assert found["modelled"]["spectral_correlation"] > 0.7


def test_what_is_left_of_the_extension_is_noise(small):
    """NRMSE of the extended model against what the standard errors of reference and prediction make of it."""
    data = small["predicted_clausen-2022"].to_dataset()
    reference = small["reference"].to_dataset()
    variance = data["radiance_stderr"] ** 2 + reference["radiance_stderr"] ** 2
    expected = np.sqrt(variance.mean("wavelength")) / reference["radiance"].mean("wavelength")
    ratio = np.sqrt(float((data["nrmse"] ** 2).mean()) / float((expected**2).mean()))
    assert 0.6 < ratio < 1.6


def test_direct_share_falls_with_the_angle(small):
    share = small["error_model"]["direct_share"].values
    assert np.all(share[:, 0] > share[:, 2])
    assert np.all((share > 0.5) & (share <= 1))


def test_finished_predictions_are_found_again(llvm, tmp_path, monkeypatch):
    job = predictions.Job(
        Box(), lambertian(0.3), {1: lambertian(0.5), 2: lambertian(0.1)}, (30.0, 60.0), W, np.ones((25, 4)), 4
    )
    first = predictions.predict(llvm, job, tmp_path)
    assert len(list(tmp_path.glob("*.npz"))) == 2
    next(tmp_path.glob("*.npz")).write_bytes(b"damaged")
    made = []
    real = predictions._spectrum
    monkeypatch.setattr(predictions, "_spectrum", lambda *a: made.append(1) or real(*a))
    again = predictions.predict(llvm, job, tmp_path)
    assert len(made) == 2  # one angle of two
    xr.testing.assert_identical(first, again)


def test_all_that_decides_a_prediction_is_in_its_name():
    """Finished parts are found again by it: a change of anything must not find those of before."""
    from dataclasses import replace

    made, paint = (of_model("cook-torrance-1982", {"alpha": a, "eta": 1.5, "k_d": 0.3}, W) for a in (0.5, 0.4))
    job = predictions.Job(Box(), made, {1: made, 2: made}, (30.0, 75.0), W, np.ones((25, 4)), 16)
    other = replace(job, light=job.light.copy())
    other.light[3, 2] += 1e-6
    changed = [
        other,
        replace(job, box=Box(sample_mm=41.0)),
        replace(job, wall=paint),
        replace(job, patches={1: made, 2: paint}),
        replace(job, angles_deg=(30.0, 75.5)),
        replace(job, wavelength_nm=W + 0.1),
        replace(job, samples=17),
        replace(job, seed=1),
        replace(job, max_depth=2),
    ]
    keys = [j.key("llvm") for j in (job, *changed)] + [job.key("scalar")]
    assert len(set(keys)) == len(keys)
    assert replace(job, light=job.light.copy()).key("llvm") == keys[0]


# ---- comparison and error model on numbers known beforehand
def arrays(factor=1.1):
    w = np.linspace(400, 700, 31)
    reference = np.outer([1.0, 0.2], 1 + (w - 400) / 600)[:, None, :] * np.array([1.0, 0.5])[None, :, None]
    coords = {"patch": [19, 24], "angle": [30.0, 70.0], "wavelength": w}
    r = xr.DataArray(reference, coords, ("patch", "angle", "wavelength"))
    return r, r * factor


def test_errors_of_a_constant_factor():
    data = comparison.compare(*arrays(1.1))
    np.testing.assert_allclose(data["nse"], -0.1)
    r = arrays()[0]
    np.testing.assert_allclose(data["rmse"], 0.1 * np.sqrt((r**2).mean("wavelength")))
    np.testing.assert_allclose(data["nrmse"], data["rmse"] / r.mean("wavelength"))
    same = comparison.compare(*arrays(1.0))
    assert float(same["delta_e_2000"].max()) == 0
    assert float(same["delta_e_1976"].max()) == 0


def test_white_patch_is_white():
    r, p = arrays(0.5)
    x, y = comparison.tristimulus(r, p)
    np.testing.assert_allclose(x[0, 0], [0.95046, 1.0, 1.08906], rtol=2e-4)
    np.testing.assert_allclose(y[0, 0], 0.5 * x[0, 0])


def test_correlations_of_proportional_errors():
    found = comparison.correlations(comparison.compare(*three_patches()))
    np.testing.assert_allclose(found["small"]["rmse"], 1.0)
    assert np.isnan(found["small"]["nrmse"])  # all the same: no coefficient


def three_patches():
    w = np.linspace(400, 700, 11)
    reference = np.array([1.0, 0.5, 0.2])[:, None, None] * np.ones((3, 1, w.size))
    r = xr.DataArray(
        reference, {"patch": [1, 2, 3], "angle": [30.0], "wavelength": w}, ("patch", "angle", "wavelength")
    )
    return r, 1.05 * r


def test_direct_light_comes_at_the_angles_of_the_thesis():
    theta_i, theta_o, weight = comparison.direct_pairs(Box(light_mm=(1.0, 1.0)), 30.0)
    np.testing.assert_allclose(theta_i, 30, atol=0.1)
    assert theta_o == -60
    np.testing.assert_allclose(weight.sum(), 1)
    # at 90° only the half in front of the sample shines on it
    theta_i, _, _ = comparison.direct_pairs(Box(), 90.0)
    assert theta_i.max() < 90
    assert len(theta_i) == 10


@pytest.mark.parametrize("angle", [30.0, 60.0, 85.0])
def test_strips_of_the_light_weigh_as_their_irradiance(angle):
    """Against the polygon formula for a small square in the middle of each strip: the light's cosine counts as well."""
    box = Box()
    theta_i, _, weight = comparison.direct_pairs(box, angle)
    normal = closed_forms.sample_frame(angle)[2]
    height = box.size_mm[2] - box.sample_at_mm[2]
    corners = np.array([(-1.0, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)])
    y = height * np.tan(np.radians(theta_i - angle))
    expected = [closed_forms.polygon_irradiance([0, 0, 0], normal, corners + [0, v, height]) for v in y]
    np.testing.assert_allclose(weight, np.array(expected) / np.sum(expected), rtol=1e-3)


def test_white_is_patch_19_even_where_another_is_brighter():
    r, p = arrays(0.5)
    brighter = xr.concat([r, (2 * r.sel(patch=[19])).assign_coords(patch=[22])], "patch")
    x, _ = comparison.tristimulus(brighter, brighter)
    np.testing.assert_allclose(x[0, 0], [0.95046, 1.0, 1.08906], rtol=2e-4)
    np.testing.assert_allclose(x[2, 0], 2 * x[0, 0])


def in_plane_brdf(value: float) -> xr.Dataset:
    shape = (3, 5, W.size)
    coords = {"theta_i": [0.0, 45.0, 85.0], "theta_o": [-85.0, -45.0, 0.0, 45.0, 85.0], "wavelength": W}
    return xr.Dataset({"brdf": (("theta_i", "theta_o", "wavelength"), np.full(shape, value))}, coords)


def test_the_two_term_model_in_closed_form():
    """Fits that are off by a factor each: 10 and 20 % of two patches, 5 % of a wall with ρ = 0.6, so met 2.5 times."""
    share = xr.DataArray([[0.9, 0.5], [0.6, 0.2]], {"patch": [4, 19], "angle": [30.0, 75.0]}, ("patch", "angle"))
    radiance_ = xr.full_like(share, 3.0)
    wall = in_plane_brdf(0.6 / np.pi)
    patches = {4: (0.2, 1.1), 19: (0.9, 0.8)}
    fits = {
        n: error_model.Fitted(in_plane_brdf(f), f * k * xr.ones_like(wall["brdf"])) for n, (f, k) in patches.items()
    }
    found = error_model.error_model(
        share, radiance_, W, fits, error_model.Fitted(wall, 0.95 * wall["brdf"]), Box(holder_reflectance=0.0)
    )
    np.testing.assert_allclose(found["nse_fit"].sel(patch=4), -0.1, rtol=1e-9)
    np.testing.assert_allclose(found["err_d"], [[0.1, 0.1], [0.2, 0.2]], rtol=1e-9)
    err_i = np.array([0.1, 0.2]) + 0.05 / (1 - 0.6)
    np.testing.assert_allclose(found["err_i"], err_i, rtol=1e-9)
    expected = share * found["err_d"] + (1 - share) * err_i[:, None]
    np.testing.assert_allclose(found["modelled_nrmse"], expected, rtol=1e-9)
    np.testing.assert_allclose(found["modelled_rmse"], 3 * expected, rtol=1e-9)


def test_black_reference_is_refused():
    r, p = arrays()
    with pytest.raises(InputError, match="patch 24 at 70°"):
        comparison.compare(r * xr.DataArray([[1, 1], [1, 0]], {"patch": [19, 24], "angle": [30.0, 70.0]}), p)


def test_regression_of_the_two_terms():
    share = xr.DataArray(np.linspace(0.5, 1, 6)[None, :])
    found = error_model.regressed(0.02 * share + 0.3 * (1 - share), share)
    np.testing.assert_allclose([found["err_d"], found["err_i"], found["explained"]], [0.02, 0.3, 1.0], atol=1e-9)


# ---- the virtual instrument
def test_virtual_measurement_is_the_model_in_a_cone():
    from vgonio import models

    data = made_up.measured_patch(4, 1.5e-3, 0.0, 1)
    w = data["wavelength"].values
    truth = made_up.true_parameters(4, w, 1.5e-3)
    exact = models.evaluate("clausen-2022", [30.0], [-60.0, 0.0], w, **truth)
    got = data["brdf"].sel(theta_i=[30.0], theta_o=[-60.0, 0.0])
    np.testing.assert_allclose(got, exact["brdf"], rtol=2e-3)  # curvature over a cone of 2°
    assert np.isnan(data["brdf"].sel(theta_i=30, theta_o=30)).all()
    noisy = made_up.measured_patch(4, 1.5e-3, 0.007, 1)
    np.testing.assert_allclose(float((noisy["brdf"] / data["brdf"]).std()), 0.007, rtol=0.03)


# ---- the error path
def test_sources_that_are_a_factor(llvm):
    """Emission and reference scale the radiance: the deviation is the factor drawn, to rounding."""
    job = predictions.Job(
        Box(), lambertian(0.3), {1: of_model("cook-torrance-1982", {"alpha": 0.4, "eta": 1.5, "k_d": 0.5}, W)},
        (30.0, 75.0), W, np.ones((25, 4)), 16,
    )  # fmt: skip
    wall = of_model("cook-torrance-1982", {"alpha": 0.5, "eta": 1.5, "k_d": 0.3}, W)
    from dataclasses import replace

    job = replace(job, wall=wall)
    options = settings.ErrorPath(repeats=2, sizes={"geometry": 0.0, "angle": 0.0, "homogeneity": 0.0})
    data = error_path.error_path(llvm, job, options)["deviation"]
    for name in ("emission", "reference"):
        values = data.sel(source=name).values
        assert 1e-3 < values.min() < 0.06
    np.testing.assert_allclose(np.ptp(data.sel(source="emission").values), 0, atol=1e-5)
    for name in ("geometry", "angle", "homogeneity", "interpolation"):  # size 0, or a light without structure
        np.testing.assert_allclose(data.sel(source=name).values, 0, atol=2e-6)
    assert data.sel(source="rendering").values.min() > 0
    # direct light is not all of it, and less so at 75°
    diffuse = data.sel(source="diffusivity").values[0]
    assert diffuse[0] > diffuse[1] > 0


def test_deviations_and_their_sum_in_closed_form(monkeypatch):
    """A renderer whose radiance is the mean of the light, a quarter of it direct: each source has the size it is given.

    n draws know a standard deviation to 1/√2n: 100 of what is rendered, 400 of a factor alone.
    """

    def predicted(mi, job, *_):
        values = np.broadcast_to(job.light.mean(axis=0), (1, 2, W.size))
        return xr.Dataset(
            {"radiance": (("patch", "angle", "wavelength"), values)}, {"patch": [1], "angle": [30.0, 75.0]}
        )

    monkeypatch.setattr(error_path, "predict", predicted)
    monkeypatch.setattr(error_path, "direct_part", lambda mi, job: 0.25 * predicted(mi, job)["radiance"])
    paint = of_model("cook-torrance-1982", {"alpha": 0.5, "eta": 1.5, "k_d": 0.3}, W)
    job = predictions.Job(Box(), paint, {1: paint}, (30.0, 75.0), W, np.ones((25, 4)), 16)
    found = error_path.error_path(None, job, settings.ErrorPath(repeats=100))
    each = {name: float(found["deviation"].sel(source=name, angle=30.0, patch=1)) for name in error_path.SOURCES}
    expected = {
        "emission": 0.02,
        "reference": 0.02,
        "repeatability": 0.01,
        "diffusivity": 0.026 / 4,
        "homogeneity": 0.03 / np.sqrt(3) / 5,  # limits of 25 points
    }
    for name, size in expected.items():
        draws = 100 if name in ("emission", "homogeneity") else error_path.FACTOR_DRAWS
        assert each[name] == pytest.approx(size, rel=4 / np.sqrt(2 * draws)), name
    assert all(each[name] == 0 for name in ("geometry", "angle", "rendering"))
    np.testing.assert_allclose(found["combined"], np.sqrt((found["deviation"] ** 2).sum("source")), rtol=1e-12)
    assert float(found["combined"].max()) == pytest.approx(np.sqrt(sum(v**2 for v in expected.values())), rel=0.1)


def test_a_perturbed_reference_has_every_source_once():
    paint = of_model("cook-torrance-1982", {"alpha": 0.5, "eta": 1.5, "k_d": 0.3}, W)
    job = predictions.Job(Box(), paint, {1: paint}, (30.0, 90.0), W, np.ones((25, 4)), 16)
    changed, factor = error_path.perturbed_once(job, settings.ErrorPath(), 3)
    moved = np.subtract(changed.box.size_mm, job.box.size_mm)
    assert np.all((np.abs(moved) <= 1) & (moved != 0))
    turned = np.subtract(changed.angles_deg, job.angles_deg)
    assert 0 < abs(turned[0]) <= 1
    assert turned[1] <= 0  # nothing beyond 90°
    assert 1e-4 < abs(factor - 1) < 0.1
    each = changed.light[:, 0] / changed.light[:, 0].mean()
    assert 0.005 < each.std() < 0.03  # limits of 3 %: a standard deviation of 1.7 %
    assert changed.wall.bsdf["k_d"]["values"] != job.wall.bsdf["k_d"]["values"]
    assert error_path.perturbed_once(job, settings.ErrorPath(), 3)[0].key("") == changed.key("")


def test_scaled_material_is_the_same_times_a_factor(llvm):
    """k_d, k_s and c carry the factor: the sample's radiance is linear in them."""
    material = of_model("cook-torrance-1982", {"alpha": 0.4, "eta": 1.5, "k_d": [0.2, 0.4, 0.3, 0.6], "c": 0.01}, W)
    found = []
    for sample in (material, error_path.scaled(material, 1.3)):
        scene = Scene(llvm, Box(), lambertian(0.0), sample, W, np.ones((25, 4)))
        scene.set_angle(45.0)
        found.append(radiance(llvm, scene.scene, llvm.load_dict({"type": "path", "max_depth": 2}), W, 16, 1))
    np.testing.assert_allclose(found[1], 1.3 * found[0], rtol=1e-5)


# ---- input
def write_files(folder, tree):
    from vgonio.render.normbox.exporting import write_inputs

    write_inputs(load(SMALL), tree, folder)
    return folder / "normbox.toml"


def test_written_data_drop_in(small, tmp_path):
    """The virtual data as files give what the virtual scene gave."""
    scene = write_files(tmp_path, small)
    settings = load(scene)
    truth = inputs.read_ground_truth(settings)
    np.testing.assert_allclose(truth.reference, small["reference"]["radiance"], rtol=1e-9)
    assert "virtual" in (tmp_path / "light.csv").read_text().splitlines()[0]
    tree = validate(settings)
    # the wavelengths are those of the reference: the same range, so the same values
    a, b = (t["predicted_cook-torrance-1982"]["nrmse"].values for t in (small, tree))
    np.testing.assert_allclose(a, b, rtol=0.02, atol=5e-4)
    assert "fit_share" not in json.loads(tree.attrs["verdict"])


def edited(path, change):
    path.write_text(change(path.read_text()))


@pytest.mark.parametrize(
    "file, change, said",
    [
        ("patch_19.json", None, "1 of 6 files of [files] are missing"),
        (
            "reference.csv",
            lambda t: "\n".join(r for r in t.splitlines() if not r.startswith("24,")),
            "patch 24 is missing",
        ),
        ("normbox.toml", lambda t: t.replace("60.0", "33.0"), "not measured at 33°; its angles are 30, 60, 85"),
        ("normbox.toml", lambda t: t.replace("60.0", "95.0"), "95°"),
        ("light.csv", lambda t: re.sub(r"\n(\d{3}),", r"\n1\1,", t), "do not overlap"),
        ("reference.csv", lambda t: t.replace(",0.0", ",-0.0", 5), "negative"),
        ("wall.json", lambda t: re.sub(r'"phiOut": *[0-9.]+', '"phiOut": 90', t), "outside the plane"),
        ("normbox.toml", lambda t: t.replace("samples", "sample"), "did you mean 'samples'"),
        ("normbox.toml", lambda t: t + "\n[virtual]\n", "not both"),
        ("normbox.toml", lambda t: t.replace("clausen-2022", "clausen-2023"), "did you mean 'clausen-2022'"),
        ("light.csv", lambda t: t.replace("wavelength_nm", "nm"), "wavelength_nm"),
    ],
)
def test_bad_files_are_one_line(small, tmp_path, capsys, file, change, said):
    scene = write_files(tmp_path, small)
    if change is None:
        (tmp_path / file).unlink()
    else:
        edited(tmp_path / file, change)
    assert main(["validate", str(scene), "-q"]) == 2
    err = capsys.readouterr().err
    assert said in err
    assert err.count("\n") == 1
    assert not list(tmp_path.glob("*.nc"))


@pytest.mark.parametrize(
    "table, said",
    [
        ({"box": {"sample_mm": 10.0}}, "larger than a sample"),
        ({"box": {"size_mm": [600, 600]}}, "3 positive numbers"),
        ({"box": {"light_mm": [700, 200]}}, "does not fit"),
        ({"box": {"distance_mm": 200}}, "in front of the opening"),
        ({"render": {"patches": []}}, "patches"),
        ({"render": {"patches": [25]}}, "25"),
        ({"errors": {"sizes": {"angel": 1}}}, "did you mean 'angle'"),
        ({"fit": {"models": ["lambert-1760"]}}, "cannot be rendered by formula"),
        ({"errors": {"patches": [4, 77]}}, "patches has 77.*1 to 24"),
        ({"boxes": {}}, "did you mean 'box'"),
    ],
)
def test_impossible_scenes(table, said):
    with pytest.raises(InputError, match=said):
        validate(load({"virtual": {}} | table))


def test_command(tmp_path, capsys):
    needs_llvm()
    scene = tmp_path / "n.toml"
    assert main(["validate", "--init", str(scene), "-q"]) == 0
    assert load(scene).render.wavelengths == 200
    assert main(["validate", "--init", str(scene), "-q"]) == 2
    capsys.readouterr()
    scene.write_text(
        "[virtual]\nsamples = 16\n[render]\npatches = [4, 22]\nangles_deg = [30, 80]\nwavelengths = 8\nsamples = 8\n"
        "[errors]\nrepeats = 1\nsamples = 8\nwavelengths = 8\nangles_deg = [30, 80]\n"
    )
    page = tmp_path / "page.html"
    assert main(["validate", str(scene), "--json", "--report", str(page)]) == 0
    out = capsys.readouterr().out
    found = json.loads(out[out.index("{") :])
    assert found["removed"]["clausen-2022"] > 0
    assert set(found["path"]["sources"]) == set(error_path.SOURCES)
    text = page.read_text()
    assert "VIRTUAL ground truth" in text
    assert text.count("<svg") >= 8
    assert sorted(p.name for p in tmp_path.iterdir()) == ["n.nc", "n.toml", "page.html"]


def test_interrupted_runs_go_on(tmp_path, capsys, monkeypatch):
    """What is finished is kept and said; the same command finds it again, and leaves nothing beside the result."""
    needs_llvm()
    scene = tmp_path / "n.toml"
    scene.write_text(
        "[virtual]\nsamples = 4\n[render]\npatches = [4]\nangles_deg = [30, 60]\nwavelengths = 4\nsamples = 4\n"
        "[errors]\nrepeats = 0\n"
    )
    real, made = predictions._spectrum, []

    def counted(*arguments):
        made.append(1)
        if len(made) == 4:
            raise KeyboardInterrupt
        return real(*arguments)

    monkeypatch.setattr(predictions, "_spectrum", counted)
    assert main(["validate", str(scene), "-q"]) == 130
    assert "n.nc.parts" in capsys.readouterr().err
    kept = len(list((tmp_path / "n.nc.parts").glob("*.npz")))
    assert kept == 3
    assert main(["validate", str(scene), "-q"]) == 0
    # true, reference, two models and the direct part, at two angles: ten in all, three of them found again
    assert len(made) == 4 + 10 - 3
    assert sorted(p.name for p in tmp_path.iterdir()) == ["n.nc", "n.toml"]


def test_missing_scene(capsys):
    assert main(["validate", "nowhere.toml"]) == 2
    assert "vgonio validate --init nowhere.toml" in capsys.readouterr().err
    assert main(["validate"]) == 2
    assert "--init" in capsys.readouterr().err
    with pytest.raises(FileFormatError, match="no such file"):
        load("nowhere.toml")
