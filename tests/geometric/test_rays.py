"""Rays against closed forms: mirror, V-groove, spherical cap, white furnace, exact multi-bounce reflectance."""

from __future__ import annotations

import numpy as np
import pytest

from vgonio.errors import InputError, MaterialError
from vgonio.geometric import RayOptics
from vgonio.geometric.fresnel_table import FresnelTable
from vgonio.materials import material
from vgonio.measure import Gonioreflectometer
from vgonio.surface import Heightfield

ANGLES = range(-85, 86, 5)


def rough(shape=(96, 96), slope=0.5, pitch=0.5, periodic=True, seed=1) -> Heightfield:
    """A Gaussian surface by spectral synthesis, made here so that this test leans on nothing else."""
    rng = np.random.default_rng(seed)
    fy, fx = np.meshgrid(np.fft.fftfreq(shape[0], pitch), np.fft.fftfreq(shape[1], pitch), indexing="ij")
    z = np.fft.ifft2(np.fft.fft2(rng.normal(size=shape)) * np.exp(-((np.pi * 4.0) ** 2) * (fx**2 + fy**2) / 2)).real
    z *= slope / np.std(np.gradient(z, pitch, axis=1))
    return Heightfield(z - z.mean(), pitch, periodic=periodic)


def v_groove() -> Heightfield:
    return Heightfield(np.tile([0.0, 1.0], (4, 8)), 1.0, periodic=True, interpolation="linear")


def shares(data):
    return data.energy_by_bounce.isel(wavelength=0).values


def total(data):
    return data.energy_by_bounce.sum("bounce") + data.energy_absorbed + data.energy_lost


def test_flat_mirror_sends_everything_into_its_cone(agreement):
    flat = Heightfield(np.zeros((8, 8)), 1.0, periodic=True)
    gonio = Gonioreflectometer([0, 30, 80], [-80, -30, 0, 30, 80], aperture_deg=2)
    data = gonio.measure(flat, RayOptics("Al", [450, 650], rays=4000))
    reflectance = material("Al").reflectance(np.cos(np.deg2rad([0, 30, 80])), [450, 650])
    for i, theta in enumerate([0, 30, 80]):
        cone = gonio.detector.projected_solid_angle[list(gonio.theta_o_deg).index(-theta)]
        error = data.brdf.sel(theta_o=-theta)[i] * cone / reflectance[i] - 1
        agreement("power of a flat mirror in the mirror cone, rays", "Fresnel reflectance", error, 1e-6)
        assert np.all(data.brdf.isel(theta_i=i).drop_sel(theta_o=-theta) == 0)


@pytest.mark.parametrize("theta", [0.0, 60.0, 85.0])
@pytest.mark.parametrize("slope", [0.2, 1.0])
def test_white_furnace(theta, slope):
    data = Gonioreflectometer([theta], ANGLES).measure(rough(slope=slope), RayOptics("perfect", rays=30_000))
    assert abs(total(data) - 1).max() < 1e-6
    assert float(data.energy_absorbed.max()) < 1e-12
    assert float(data.energy_lost.max()) < 1e-3
    assert data.attrs["edges"] == "periodic"


def test_tallies_of_a_metal_add_up_and_absorb():
    data = Gonioreflectometer([0, 70], ANGLES).measure(rough(), RayOptics("Al", [400, 550, 700], rays=30_000))
    assert abs(total(data) - 1).max() < 1e-6
    assert float(data.energy_absorbed.min()) > 0.05  # aluminium absorbs 8 % and more at every reflection


@pytest.mark.parametrize("theta", [0, 10, 25, 40, 60])
def test_v_groove(theta, agreement):
    """90° groove: single reflections |tan θ_i|, double 1 − |tan θ_i| up to 45°, beyond only single ones."""
    n = 40_000
    data = Gonioreflectometer([theta], ANGLES).measure(v_groove(), RayOptics("perfect", rays=n, seed=3))
    single = min(1.0, np.tan(np.deg2rad(theta)))
    sigma = np.sqrt(max(single * (1 - single), 1e-4) / n)
    far = (shares(data)[0, :2] - [single, 1 - single]) / sigma
    agreement("90° V-groove, shares of one and two reflections", "|tan θ_i| and the rest", far, 4, "standard errors")


def test_v_groove_returns_double_paths_antiparallel():
    gonio = Gonioreflectometer([20], [20], aperture_deg=0.2)
    data = gonio.measure(v_groove(), RayOptics("perfect", rays=20_000))
    binned = gonio.measure(v_groove(), RayOptics("perfect", rays=20_000, estimator="binning"))
    in_cone = binned.brdf_by_bounce.sel(bounce=2).item() * gonio.detector.projected_solid_angle[0]
    assert np.isclose(in_cone, shares(binned)[0, 1], rtol=1e-9)
    caught = data.brdf_by_bounce.sel(bounce=2).item() * gonio.detector.projected_solid_angle[0]
    # what leaves upward is counted by the rays alone, what is caught by points on facets as well
    assert abs(caught - shares(data)[0, 1]) < 4 * np.sqrt(2 * 0.25 / 20_000)
    assert np.isclose(caught, 1 - np.tan(np.deg2rad(20)), atol=4 * np.sqrt(0.25 / 20_000))


@pytest.mark.parametrize("beta", [40, 50, 58])
def test_concave_spherical_cap(beta, agreement):
    """Half-angle β, normal incidence: single reflections sin²((π − β)/3)/sin²β for 45° < β < 60°, none double below.

    The cap is tessellated finely; what falls on the flat surroundings reflects once and is taken off by its area.
    """
    b = np.deg2rad(beta)
    n, half = 600, 1.05 * np.sin(b)
    pitch = 2 * half / n
    x = (np.arange(n) + 0.5) * pitch - half
    r2 = x**2 + x[:, None] ** 2
    z = np.where(r2 < np.sin(b) ** 2, np.cos(b) - np.sqrt(np.maximum(1 - r2, 0)), 0.0)
    rays = 60_000
    data = Gonioreflectometer([0], ANGLES).measure(
        Heightfield(z, pitch, periodic=True, interpolation="linear"), RayOptics("perfect", rays=rays)
    )
    inside = np.pi * np.sin(b) ** 2 / (2 * half) ** 2
    double = shares(data)[0, 1:].sum() / inside
    expected = 1 - np.sin((np.pi - b) / 3) ** 2 / np.sin(b) ** 2 if beta > 45 else 0.0
    # facets at the rim (a share of about 4·pitch/sin β of the disc) are steeper or flatter than the sphere
    allowed = 4 * np.sqrt(0.25 / (rays * inside)) + 4 * pitch / np.sin(b)
    agreement(
        "concave spherical cap, share of double reflections", "1 − sin²((π − β)/3)/sin²β", double - expected, allowed
    )


def test_two_reflections_use_polarisation_not_the_product_of_averages(agreement):
    """V-groove of glass near Brewster: both hits share one plane of incidence, so the power is (R_s² + R_p²)/2."""
    data = Gonioreflectometer([0], [0], aperture_deg=1).measure(v_groove(), RayOptics("SiO2", [550], rays=20_000))
    s, p = (material("SiO2").reflectance(np.cos(np.pi / 4), [550], pol)[0] for pol in "sp")
    double = data.energy_by_bounce.sel(bounce=2).item()
    agreement(
        "two reflections on glass near Brewster's angle (the product of averages is 42 % low)",
        "(R_s² + R_p²)/2",
        double / ((s**2 + p**2) / 2) - 1,
        1e-5,
    )
    assert double > 1.5 * ((s + p) / 2) ** 2  # the averaged shortcut would be far off, and the result says by how much
    expected = ((s + p) / 2) ** 2 / ((s**2 + p**2) / 2) - 1
    assert np.isclose(data.averaged_shortcut_error.item(), expected, rtol=1e-5)
    assert f"{-100 * expected:.2g} %" in data.attrs["averaged_shortcut"]


def test_averaged_shortcut_is_exact_where_nothing_depends_on_polarisation():
    """Perfect mirrors, and single reflections; with aluminium on a rough surface it is off by little."""
    gonio = Gonioreflectometer([30], ANGLES)
    perfect = gonio.measure(rough(slope=1.0), RayOptics("perfect", rays=5000))
    assert abs(perfect.averaged_shortcut_error.item()) < 1e-9
    single = gonio.measure(rough(slope=0.05), RayOptics("SiO2", rays=5000))
    assert single.averaged_shortcut_error.item() == 0
    metal = gonio.measure(rough(slope=1.0), RayOptics("Al", [450, 650], rays=20_000, bounces=1))
    assert np.all((np.abs(metal.averaged_shortcut_error) > 1e-4) & (np.abs(metal.averaged_shortcut_error) < 0.05))


@pytest.mark.parametrize("polarisation", ["s", "p"])
def test_polarised_light_on_a_mirror(polarisation):
    flat = Heightfield(np.zeros((8, 8)), 1.0, periodic=True)
    gonio = Gonioreflectometer([50], ANGLES, polarisation=polarisation, phi_i_deg=35)
    data = gonio.measure(flat, RayOptics("SiO2", [550], rays=500))
    expected = material("SiO2").reflectance(np.cos(np.deg2rad(50)), [550], polarisation)
    assert np.allclose(data.energy_by_bounce.sel(bounce=1)[0], expected, rtol=1e-5)


def test_polarised_groove_across_the_plane_of_incidence():
    """Light polarised along the groove (s for both hits) from a plane of incidence turned by 90°: it is p there."""
    data = Gonioreflectometer([1e-4], [0], phi_i_deg=90, polarisation="p").measure(
        v_groove(), RayOptics("SiO2", [550], rays=20_000)
    )
    s = material("SiO2").reflectance(np.cos(np.pi / 4), [550], "s")[0]
    assert np.isclose(data.energy_by_bounce.sel(bounce=2).item(), s**2, rtol=1e-3)


def test_hemisphere_catches_what_leaves():
    gonio = Gonioreflectometer.hemisphere([30], resolution_deg=10)
    data = gonio.measure(rough(), RayOptics("Al", [550], rays=30_000))
    caught = (data.brdf.isel(theta_i=0, wavelength=0).values * gonio.detector.projected_solid_angle).sum()
    assert np.isclose(caught, data.energy_by_bounce.sum().item(), rtol=1e-9)


def test_cones_and_the_hemisphere_see_the_same():
    """The cap of the hemisphere is a cone of 20° about the normal: the same rays, the same numbers and errors."""
    solver, surface = RayOptics("Al", [450, 550], rays=20_000, estimator="binning"), rough()
    cone = Gonioreflectometer([30], [0], aperture_deg=20).measure(surface, solver)
    cap = Gonioreflectometer.hemisphere([30], resolution_deg=20).measure(surface, solver).sel(cell=0)
    for name in ("brdf", "brdf_stderr", "brdf_by_bounce"):
        assert np.allclose(cone[name].isel(theta_o=0), cap[name], rtol=1e-9), name
    better = Gonioreflectometer([30], [0], aperture_deg=20).measure(surface, RayOptics("Al", [450, 550], rays=20_000))
    assert np.all(np.abs(better.brdf.isel(theta_o=0) - cap.brdf) < 4 * cap.brdf_stderr)


def test_bounces_add_up_and_are_labelled():
    data = Gonioreflectometer([40], ANGLES).measure(rough(slope=1.0), RayOptics("Al", [550], rays=30_000, bounces=3))
    assert np.allclose(data.brdf_by_bounce.sum("bounce"), data.brdf, rtol=1e-12)
    assert data.attrs["bounce_last"] == "3 gathers 3 and more reflections"
    for name in data.variables:
        assert data[name].attrs.get("units") is not None


def test_reciprocity():
    """f(i, o) = f(o, i) within 4 standard errors on a periodic surface, with equal cones of source and detector."""
    gonio = Gonioreflectometer([20, 50], [20, 50], aperture_deg=10, divergence_deg=10)
    data = gonio.measure(rough(slope=0.7), RayOptics("perfect", rays=400_000))
    f, e = data.brdf.isel(wavelength=0), data.brdf_stderr.isel(wavelength=0)
    difference = float(f[0, 1] - f[1, 0])
    assert f[0, 1] > 0
    assert abs(difference) < 4 * float(np.hypot(e[0, 1], e[1, 0]))


def test_one_seed_one_result_whatever_the_threads():
    gonio, surface = Gonioreflectometer([60], ANGLES), rough()
    a, b, c = (
        gonio.measure(surface, RayOptics("Al", [550], rays=300_000, seed=s, threads=t))
        for s, t in ((7, 1), (7, 2), (8, 2))
    )
    assert np.array_equal(a.brdf, b.brdf)
    assert np.array_equal(a.energy_by_bounce, b.energy_by_bounce)
    assert not np.array_equal(a.brdf, c.brdf)


def test_standard_error_is_that_of_repetition():
    """Over 24 seeds the spread of brdf agrees with the stated standard error (an upper bound by stratification)."""
    gonio, surface = Gonioreflectometer([30], [-30, -10, 0], aperture_deg=10), rough()
    runs = [gonio.measure(surface, RayOptics("Al", [550], rays=6000, seed=s)) for s in range(24)]
    spread = np.std([r.brdf.values for r in runs], axis=0, ddof=1)
    stated = np.mean([r.brdf_stderr.values for r in runs], axis=0)
    # relative error of a standard deviation from 24 values is 15 %: 4 of them
    assert np.all(spread < 1.6 * stated)
    assert np.all(spread > 0.3 * stated)


def test_tolerance_stops_early_and_is_met():
    gonio = Gonioreflectometer([0], [0, 10], aperture_deg=20)
    data = gonio.measure(rough(), RayOptics("Al", [550], rays=3_000_000, tol=0.02))
    assert int(data.rays[0]) < 3_000_000
    assert data.attrs["error_achieved"] <= 0.02


def test_finite_samples_guard_or_mirror():
    gonio = Gonioreflectometer([0, 60], ANGLES)
    shallow = rough(slope=0.05, periodic=False)
    data = gonio.measure(shallow, RayOptics("perfect", rays=20_000))
    assert data.attrs["edges"] == "guard band"
    assert float(data.energy_lost.max()) < 1e-3
    steep = gonio.measure(rough(slope=1.0, periodic=False), RayOptics("perfect", rays=20_000))
    assert steep.attrs["edges"].startswith("mirrored")
    assert float(steep.energy_lost.max()) < 1e-3
    assert abs(total(steep) - 1).max() < 1e-6


def test_lamellar_walls_furnace():
    groove = Heightfield(np.tile([0.0, 0, 0, 3, 3, 3], (3, 4)), 1.0, periodic=True, interpolation="nearest")
    data = Gonioreflectometer([0, 45, 85], ANGLES).measure(groove, RayOptics("perfect", rays=20_000))
    assert abs(total(data) - 1).max() < 1e-6
    assert float(data.energy_lost.max()) < 1e-3


def test_divergence_widens_the_mirror_lobe():
    flat = Heightfield(np.zeros((8, 8)), 1.0, periodic=True)
    gonio = Gonioreflectometer([30], [-30], aperture_deg=2, divergence_deg=4)
    data = gonio.measure(flat, RayOptics("perfect", rays=40_000))
    caught = data.brdf.item() * gonio.detector.projected_solid_angle[0]
    # the detector cone covers (1 − cos 1°)/(1 − cos 2°) of the source's cone
    expected = (1 - np.cos(np.deg2rad(1))) / (1 - np.cos(np.deg2rad(2)))
    assert abs(caught - expected) < 4 * np.sqrt(expected * (1 - expected) / 40_000)


def test_table_of_fresnel_elements():
    """Linear interpolation in √cos: below 1e-6 for aluminium and glass at every angle."""
    cos = np.random.default_rng(0).random(4000)
    for name in ("Al", "SiO2"):
        table = FresnelTable(material(name), [400.0, 700.0])
        rs, rp = material(name).amplitudes(cos, [400.0, 700.0])
        exact = (np.abs(rs) ** 2 + np.abs(rp) ** 2) / 2
        assert np.abs(table.elements(cos)[:, 0] - exact).max() < 1e-6
        assert np.allclose(table.summed(cos, None, 0), exact.sum(axis=0), rtol=1e-6)


def test_joint_histograms_of_element_and_angle(agreement):
    """Sums over rays by detector element, weighted, of a and of a²: 1e-6 beside the formula ray by ray."""
    rng = np.random.default_rng(1)
    cos, weight, row = rng.random(5000), rng.random(5000), rng.integers(0, 7, 5000)
    for name in ("Al", "SiO2"):
        table = FresnelTable(material(name), [400.0, 700.0])
        s, p = (material(name).reflectance(cos, [400.0, 700.0], x) for x in "sp")
        histogram = table.histogram(cos, weight, row, 7)
        for exact, column in (
            ((s + p) / 2, table.powers[0]),
            ((s - p) / 2, table.powers[1]),
            (((s + p) / 2) ** 2, table.squares[0]),
            ((s**2 - p**2) / 2, table.squares[1]),
            (((s - p) / 2) ** 2, table.squares[2]),
        ):
            expected = np.stack([(weight[:, None] * exact)[row == k].sum(axis=0) for k in range(7)])
            error = np.abs(histogram @ column - expected).max() / weight.sum()
            agreement("sums over joint histograms of element and angle", "Fresnel ray by ray", error, 2e-6)


def test_what_finer_facets_change_is_no_standard_error():
    """Of a cubic surface, and by less the finer they are; of plateaus nothing but noise."""
    surface = rough((24, 24), slope=0.3, pitch=1.0)
    gonio = Gonioreflectometer([20], range(-60, 61, 20), aperture_deg=15)
    changes = []
    for refinement in (1, 4):
        solver = RayOptics("Al", [550], rays=100_000, refinement=refinement, refinement_check=True)
        data = gonio.measure(surface, solver)
        changes.append(float(np.abs(data.brdf_refinement_change).max() / data.brdf.max()))
        finer = gonio.measure(surface, RayOptics("Al", [550], rays=100_000, refinement=2 * refinement))
        assert np.allclose(data.brdf_refinement_change, finer.brdf - data.brdf, atol=1e-12)
        assert data.brdf_refinement_change.attrs["units"] == "sr-1"
        assert "refinement" in data.attrs["error_leaves_out"]
        assert float(data.attrs["refinement_change"].split(",")[0]) > 0
    # second order: 1/16 where the noise of both does not show
    assert changes[1] < 0.3 * changes[0]
    assert changes[0] > 0.01
    plateaus = Heightfield(surface.z, 1.0, periodic=True, interpolation="nearest")
    data = gonio.measure(plateaus, RayOptics("perfect", rays=20_000, refinement_check=True))
    assert np.abs(data.brdf_refinement_change).max() < 5 * np.sqrt(2) * data.brdf_stderr.max() + 1e-9


def test_input_is_checked():
    for bad in ({"rays": 0}, {"tol": 2}, {"seed": -1}, {"tracer": "embre"}, {"edges": "wrap"}, {"wavelength_nm": []}):
        with pytest.raises(InputError):
            RayOptics(**bad)
    with pytest.raises(MaterialError, match="225.43"):
        RayOptics("Al", [5000])
    with pytest.raises(InputError, match="missing points"):
        z = np.zeros((8, 8))
        z[3, 3] = np.nan
        Gonioreflectometer([0], [0]).measure(Heightfield(z, 1.0), RayOptics())
