"""Figures show the numbers of the dataset: shares, sums, spectra, cells, and labels with units."""

from __future__ import annotations

import re
import subprocess
import sys

import numpy as np
import pytest
import xarray as xr
from matplotlib.patches import Rectangle, StepPatch

from vgonio.directions import Detector
from vgonio.errors import InputError
from vgonio.report import figures
from vgonio.report import quantities as q
from vgonio.report.hemisphere_figures import cell_borders, cell_polygons
from vgonio.report.style import edges, some, svg
from vgonio.report.surface_figures import round_length


def labels(figure) -> str:
    """All axis labels, titles and figure labels in one string."""
    found = [ax.get_xlabel() + "|" + ax.get_ylabel() + "|" + ax.get_title("left") for ax in figure.axes]
    return "|".join([*found, figure.get_supxlabel(), figure.get_supylabel()])


def test_bounce_shares_add_up_to_one_where_something_was_caught(ray_result):
    shares, _ = q.bounce_shares(ray_result)
    np.testing.assert_allclose(shares.sum("bounce"), 1.0, atol=1e-12)


def test_decomposition_draws_the_shares(ray_result):
    """Three quarters reflected once are a step at 75, whatever the BRDF; the untrusted bin is hatched and not drawn."""
    data = ray_result.isel(bounce=[0, 1]).copy(deep=True)
    level = 1.0 + np.arange(data.sizes["theta_o"])
    data["brdf"] = data["brdf"] * 0 + xr.DataArray(level, dims="theta_o")
    weights = xr.DataArray([0.75, 0.25], dims="bounce", coords={"bounce": data["bounce"]})
    data["brdf_by_bounce"] = weights * data["brdf"]
    data["brdf_stderr"] = 0.01 * data["brdf"]
    data["brdf_stderr"].loc[{"theta_o": 80}] = 100.0
    figure = figures.decomposition(data)
    shown = [ax for ax in figure.axes if ax.get_visible() and ax.patches]
    assert len(shown) == data.sizes["theta_i"]
    for ax in shown:
        single, more, unknown = (p for p in ax.patches if isinstance(p, StepPatch))
        np.testing.assert_allclose(single.get_data().values[:-1], 75.0)
        np.testing.assert_allclose(more.get_data().values[:-1], 100.0)
        assert np.isnan(single.get_data().values[-1])
        assert unknown.get_hatch()
        assert unknown.get_data().values[-1] == 100
    assert "(°)" in labels(figure)
    assert "(%)" in labels(figure)


def test_decomposition_shows_each_angle_of_incidence(ray_result):
    titles = [ax.get_title("left") for ax in figures.decomposition(ray_result).axes if ax.axison]
    assert titles == [f"θᵢ = {t}°" for t in range(0, 81, 20)]


def test_error_of_the_multiple_share_is_that_of_counted_rays():
    """Against 20,000 repetitions of the counting itself: 300 single and 100 multiple rays of equal power.

    The first-order formula is good to about 1/N; the repetitions know the spread to 1/√(2·20,000) = 0.5 %. Allowed 3 %.
    """
    rng = np.random.default_rng(5)
    one, two = rng.poisson(300, 20_000), rng.poisson(100, 20_000)
    spread = np.std(two / (one + two))
    data = xr.Dataset(
        {
            "brdf": 400.0,
            "brdf_stderr": 20.0,
            "brdf_by_bounce": ("bounce", [300.0, 100.0]),
            "brdf_by_bounce_stderr": ("bounce", [np.sqrt(300), 10.0]),
        },
        coords={"bounce": [1, 2]},
    )
    share, error = q.multiple_share(data)
    assert float(share) == pytest.approx(0.25)
    assert float(error) == pytest.approx(spread, rel=0.03)
    without = data.drop_vars("brdf_by_bounce_stderr")
    assert float(q.multiple_share(without)[1]) == pytest.approx(spread, rel=0.03)


def test_energy_bars_end_at_the_sum_of_the_tallies(ray_result):
    figure = figures.energy(ray_result)
    bars = [p for p in figure.axes[0].patches if isinstance(p, Rectangle)]
    total = sum(bar.get_height() for bar in bars) / ray_result.sizes["theta_i"]
    assert total == pytest.approx(100.0, abs=1e-9)
    assert max(bar.get_y() + bar.get_height() for bar in bars) == pytest.approx(100.0, abs=1e-9)
    assert "(%)" in labels(figure)


def test_wave_energy_keeps_the_largest_value_in_view(wave_result):
    figure = figures.wave_energy({"waves": wave_result})
    assert figure.axes[0].get_ylim()[1] > 100 * float(wave_result["energy_reflected"].max())


def test_spectra_are_relative_to_600_nm(ray_result, wave_result):
    figure = figures.spectra({"rays": ray_result, "waves": wave_result}, theta_i=40)
    forward = figure.axes[2].get_lines()[1]
    here = wave_result["brdf"].sel(theta_i=40, theta_o=-40)
    wavelength, value = forward.get_data()
    straight = np.polyfit(wavelength, value, 1)
    assert np.polyval(straight, 600.0) == pytest.approx(1.0, abs=1e-9)
    np.testing.assert_allclose(value / value[0], here / here[0], rtol=1e-12)
    assert "(sr⁻¹)" in labels(figure)
    assert "(nm)" in labels(figure)


def test_back_scattering_takes_the_nearest_direction_that_was_measured(measured_result):
    one = q.incidence(measured_result, 40)
    assert float(q.direction(one, -40)["theta_o"]) == -40
    assert float(q.direction(one, 40)["theta_o"]) in (30, 50)  # 40° itself is where the source stands
    assert q.direction(one.isel(theta_o=slice(0, 5)), 40) is None


def test_direction_on_the_hemisphere_is_the_nearest_cell():
    detector = Detector.hemisphere(10)
    data = xr.Dataset(
        {"brdf": ("cell", np.arange(len(detector), dtype=float))},
        coords={
            "cell": np.arange(len(detector)),
            "theta_o": ("cell", detector.theta_deg),
            "phi_o": ("cell", detector.phi_deg),
        },
    )
    for theta_o in (-40.0, 0.0, 40.0):
        found = q.direction(data, theta_o)
        wanted = np.array([np.sin(np.deg2rad(theta_o)), 0, np.cos(np.deg2rad(theta_o))])
        assert int(found["brdf"]) == np.argmax(detector.directions @ wanted)


@pytest.mark.parametrize("resolution", [5.0, 10.0, 22.5])
def test_cells_of_the_hemisphere_come_back_from_their_solid_angles(resolution):
    """Borders are those of the detector, so that areas are the solid angles; to rounding of the coordinates (1e-9)."""
    detector = Detector.hemisphere(resolution)
    data = xr.Dataset(
        coords={
            "theta_o": ("cell", detector.theta_deg),
            "phi_o": ("cell", detector.phi_deg),
            "solid_angle": ("cell", detector.solid_angle),
        }
    )
    inner, outer, start, stop = np.deg2rad(cell_borders(data)).T
    np.testing.assert_allclose((np.cos(inner) - np.cos(outer)) * (stop - start), detector.solid_angle, rtol=1e-9)
    rings = np.repeat(np.arange(len(detector.ring_cells)), detector.ring_cells)
    np.testing.assert_allclose(outer, detector.ring_edges_rad[rings + 1], atol=1e-7)
    assert len(cell_polygons(data)) == len(detector)


def test_squares_have_the_colours_of_the_map():
    rgb = xr.DataArray(
        np.random.default_rng(0).random((2, 3, 3)),
        coords={"theta_i": [0.0, 30.0], "theta_o": [-30.0, 0.0, 30.0]},
        dims=("theta_i", "theta_o", "rgb"),
        attrs={"exposure": 1.0, "clipped": 0.25},
    )
    rgb[0, 1] = np.nan
    figure = figures.rgb_maps({"rays": rgb}, {"rays": "Rays"})
    figure.canvas.draw()
    drawn = np.asarray(figure.axes[0].collections[0].get_array()).reshape(2, 3, 4)
    known = ~np.isnan(rgb.values)
    np.testing.assert_allclose(drawn[..., :3][known], rgb.values[known])
    np.testing.assert_array_equal(drawn[..., 3], known.all(axis=-1))  # a missing square is not painted
    assert "25" in labels(figure)  # the clipped share stands beside


def test_slopes_are_drawn_in_percent_per_100_nm():
    coords = {"theta_i": [0.0, 40.0], "theta_o": [-40.0, 0.0, 40.0]}
    slope = xr.DataArray(np.full((2, 3), 1e-3), coords, ("theta_i", "theta_o"))
    data = xr.Dataset({"slope": slope, "slope_stderr": 0.1 * slope, "slope_global": slope})
    figure = figures.shift_slopes({"waves": data})
    np.testing.assert_allclose(max(np.max(line.get_ydata()) for line in figure.axes[0].get_lines()[:2]), 10.0)
    assert "% per 100 nm" in labels(figure)


def test_the_legend_of_slopes_shows_each_line_as_it_is_drawn():
    """Fits in the colours of their results, the dashed line the mirror direction, the dotted one back-scattering."""
    coords = {"theta_i": [40.0], "theta_o": [-40.0, 0.0, 40.0]}
    slope = xr.DataArray(np.full((1, 3), 1e-3), coords, ("theta_i", "theta_o"))
    data = xr.Dataset({"slope": slope, "slope_stderr": 0.1 * slope, "slope_global": slope})
    figure = figures.shift_slopes({"rays": data, "waves": 2 * data})
    drawn = figure.axes[0].get_lines()
    at = {x: line for line in drawn for x in set(line.get_xdata()) if len(set(line.get_xdata())) == 1}
    fits = {line.get_color() for line in drawn if len(line.get_xdata()) == 3 and line.get_linestyle() == "-"}
    (legend,) = figure.legends
    named = {text.get_text(): handle for text, handle in zip(legend.get_texts(), legend.legend_handles)}
    for x, words in ((-40.0, "mirror direction"), (40.0, "back-scattering")):
        assert named[words]._dash_pattern == at[x]._dash_pattern
        assert named[words].get_color() == at[x].get_color()
    assert at[-40.0]._dash_pattern != at[40.0]._dash_pattern
    assert len(fits) == 2
    assert "global fit of each, h·cos(w·θₘ) + t" in named
    assert {handle.get_color() for handle in legend.findobj(type(drawn[0])) if handle.get_linestyle() == "-"} >= fits


@pytest.mark.parametrize(
    ("make", "units"),
    [
        (figures.surface_map, ("µm",)),
        (figures.height_histogram, ("(µm)", "(µm⁻¹)")),
        (figures.slope_histogram, ("∂z/∂x",)),
        (figures.psd, ("(µm⁻¹)", "(µm⁴)")),
    ],
)
def test_surface_figures_name_their_units(make, units, surface_summary):
    found = labels(make(surface_summary))
    assert all(unit in found for unit in units)


def test_a_flat_surface_can_be_drawn(surface_summary):
    flat = surface_summary.copy(deep=True)
    flat["z"] = flat["z"] * 0
    flat.attrs |= {"Sq": 0.0, "alpha": 0.0}
    for make in (figures.surface_map, figures.height_histogram, figures.slope_histogram):
        assert svg(make(flat), "flat", "f").startswith("<svg")


def test_dark_results_and_flat_spectra_can_be_drawn(ray_result, hemisphere_rays, surface_summary):
    """Nothing to put on a logarithmic axis: no exception, and no made-up value."""
    dark = ray_result * 0
    assert figures.lobes({"rays": dark}).axes[0].get_yscale() == "linear"
    assert svg(figures.spectra({"rays": dark}), "dark", "d").count("no light was caught here") == 2
    assert svg(figures.decomposition(dark), "dark", "d").startswith("<svg")
    assert svg(figures.polar_maps({"rays": hemisphere_rays * 0}), "dark", "d").startswith("<svg")
    flat = surface_summary.assign(psd=surface_summary["psd"] * 0)
    assert "a flat surface has none" in svg(figures.psd(flat), "flat", "f")


def test_psd_of_a_grating_is_drawn_as_lines(surface_summary):
    line = surface_summary.isel(frequency=slice(0, 5)).copy(deep=True)
    line["psd"][[0, 1, 3, 4]] = 0.0
    figure = figures.psd(line)
    assert figure.axes[0].get_lines()[0].get_marker() == "o"
    assert len(figure.axes[0].collections) == 1


def test_in_plane_figures_refuse_a_hemisphere_and_the_other_way_round(ray_result, hemisphere_rays):
    for make in (figures.decomposition, lambda d: figures.lobes({"rays": d})):
        with pytest.raises(InputError, match="hemisphere"):
            make(hemisphere_rays)
    for make in (figures.polar_decomposition, lambda d: figures.polar_maps({"rays": d})):
        with pytest.raises(InputError, match="in-plane"):
            make(ray_result)


def test_edges_lie_half_way():
    np.testing.assert_allclose(edges([-85, -80, 0]), [-87.5, -82.5, -40, 40])
    np.testing.assert_allclose(edges([20]), [15, 25])
    assert edges([-89, 89])[0] == -90.0


def test_some_keeps_first_and_last():
    np.testing.assert_array_equal(some(np.arange(5), 12), np.arange(5))
    chosen = some(np.arange(100), 12)
    assert len(chosen) == 12
    assert (chosen[0], chosen[-1]) == (0, 99)


@pytest.mark.parametrize(("value", "length"), [(1.0, 1), (1.99, 1), (2.0, 2), (25.0, 20), (99.0, 50), (0.034, 0.02)])
def test_scale_bar_is_one_two_or_five(value, length):
    assert round_length(value) == pytest.approx(length)


def test_svg_is_inline_text_with_its_own_ids(ray_result):
    text = svg(figures.energy(ray_result), 'power & "more"', "energy0")
    assert text.startswith("<svg ")
    assert 'aria-label="power &amp; &quot;more&quot;"' in text
    assert '<tspan font-style="italic">θ</tspan>' in text
    for unwanted in ("DejaVu", "http", "<metadata", "θᵢ"):
        assert unwanted not in text
    ids = re.findall(r'\bid="([^"]+)"', text)
    assert len(ids) == len(set(ids))
    assert all(i.startswith("energy0-") for i in ids)
    assert set(re.findall(r'(?:href="|url\()#([^")]+)', text)) <= set(ids)


def test_figures_leave_no_global_state():
    code = (
        "import sys; sys.path.insert(0, 'tests/report'); import conftest as c, matplotlib as mpl;"
        "from vgonio.report import figures, style; before = [mpl.rcParams[k] for k in style.STYLE];"
        "style.svg(figures.energy(c.rays()), 'x', 'x');"
        "assert [mpl.rcParams[k] for k in style.STYLE] == before; assert 'matplotlib.pyplot' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True, cwd=__file__.rsplit("/tests/", 1)[0], timeout=600)


def test_importing_the_report_does_not_import_matplotlib():
    code = "import sys, vgonio.report; assert 'matplotlib' not in sys.modules and 'colour' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True, timeout=600)


def test_lines_that_lie_on_each_other_both_show():
    """Two theories that agree: the later one is dashed, in its lines and in the legend; single results stay solid."""
    from vgonio.report.style import dashes

    names = ["rays", "waves", "waves_generalized_harvey_shack", "waves_harvey_shack"]
    line = dashes(names)
    assert [line[n] for n in names[:2]] == ["-", "-"]
    assert line[names[2]] != line[names[3]]
    assert all(line[n] != "-" for n in names[2:])


def test_a_sweep_says_at_which_further_key_lobes_are_drawn(wave_result):
    """Lobes of the first value of the second key; the legend lies beneath the panel and covers no curve."""
    from vgonio.report.sweep_figures import overview

    sizes = {"rms_um": [0.1, 0.2], "correlation_um": [3.0, 5.0]}
    data = xr.concat([xr.concat([wave_result] * 2, "correlation_um")] * 2, "rms_um").assign_coords(sizes)
    done = xr.DataArray(np.zeros((2, 2), int), sizes, ("rms_um", "correlation_um"))
    tree = xr.DataTree.from_dict({"/": xr.Dataset({"state": done, "seconds": done + 1.0}), "waves": data})
    figure = overview(tree)
    figure.canvas.draw()
    lobes = figure.axes[0]
    assert lobes.get_title(loc="left").endswith("\ncorrelation_um 3.0")
    assert lobes.get_legend().get_window_extent().y1 < lobes.get_window_extent().y0
