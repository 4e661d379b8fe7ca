"""The usual pictures as methods of results: what they draw is what the result holds, and what they refuse."""

from __future__ import annotations

import inspect
import pickle
import struct
import subprocess
import sys

import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure

import vgonio as vg
from vgonio import report
from vgonio.compare.bright import colour_difference
from vgonio.compare.colour import delta_e_2000
from vgonio.errors import InputError
from vgonio.measure.surface_summary import surface_dataset
from vgonio.report.content import Content
from vgonio.report.sections import compose
from vgonio.report.style import NOTEBOOK_DPI

PLOTS = [name for name in report.__all__ if name.startswith("plot_")]
OF_A_PLANE = sorted(set(PLOTS) - {"plot_hemisphere", "plot_mueller", "plot_orders", "plot_ways", "plot_sweep"})


@pytest.mark.parametrize("name", OF_A_PLANE)
def test_every_picture_of_a_whole_result(full_result, name):
    drawn = getattr(full_result.vgonio, name)()
    assert isinstance(drawn, Figure)
    assert any(ax.lines or ax.patches or ax.collections or ax.images for ax in drawn.axes)


@pytest.mark.parametrize("name", PLOTS)
def test_methods_are_the_functions(name):
    function, method = getattr(report, name), getattr(xr.Dataset.vgonio, name)
    assert method.__doc__ == function.__doc__
    assert list(inspect.signature(method).parameters)[1:] == list(inspect.signature(function).parameters)[1:]
    assert "InputError" in function.__doc__ or name in ("plot_lobes",)


def test_a_whole_result_shows_all_a_node_itself(full_result):
    def legend(figure):
        return [t.get_text() for t in figure.legends[0].get_texts()]

    assert legend(full_result.vgonio.plot_lobes()) == ["Rays", "Waves (Kirchhoff)", "Measured"]
    assert legend(full_result["waves"].vgonio.plot_lobes()) == ["Waves (Kirchhoff)"]
    # a dataset has no name: its content says what it is
    assert legend(full_result["waves"].to_dataset().vgonio.plot_lobes()) == ["Waves (Kirchhoff)"]
    assert legend(full_result["rays"].to_dataset().vgonio.plot_lobes()) == ["Rays"]
    assert legend(full_result["measured"].to_dataset().vgonio.plot_lobes()) == ["Measured"]


def test_lobes_draw_the_brdf_at_the_wavelength_asked(wave_result):
    figure = wave_result.vgonio.plot_lobes(wavelength_nm=700)
    drawn = figure.axes[0].lines[0].get_ydata()
    np.testing.assert_allclose(drawn, wave_result["brdf"].sel(theta_i=0, wavelength=700))


def test_a_selection_is_drawn_too(wave_result):
    assert len(wave_result.sel(theta_i=40).vgonio.plot_lobes().axes) == 1
    assert wave_result.sel(wavelength=540).vgonio.plot_lobes().axes[0].lines
    with pytest.raises(InputError, match="all directions"):
        wave_result.sel(theta_o=0).vgonio.plot_lobes()


def test_delta_e_against_the_last_or_another(full_result, wave_result, measured_result):
    found = full_result.vgonio.plot_delta_e()
    assert [ax.get_title(loc="left") for ax in found.axes[:2]] == [
        "Rays and the measurement",
        "Waves (Kirchhoff) and the measurement",
    ]
    expected = float(delta_e_2000(measured_result, wave_result, "absolute").mean())
    one = wave_result.vgonio.plot_delta_e(measured_result, scale="absolute")
    assert f"mean ΔE₀₀ {expected:.3g}," in one.axes[0].get_xlabel()
    with pytest.raises(InputError, match="give another as reference"):
        wave_result.vgonio.plot_delta_e()


def test_the_colour_of_noise_does_not_count(wave_result, measured_result):
    """By default the number of the verdict: colour alone, without directions that are dark in one of the two."""
    dark = wave_result.theta_o > 30
    noise = 1e-8 * np.random.default_rng(0).random(wave_result.brdf.shape)
    dimmed = wave_result.assign(brdf=wave_result.brdf.where(~dark, noise))
    tree = xr.DataTree.from_dict({"waves": dimmed, "measured": measured_result})
    text = tree.vgonio.plot_delta_e().axes[0].get_xlabel()
    verdict = colour_difference(measured_result, dimmed, "normalised")
    assert f"mean ΔE₀₀ {float(verdict.mean()):.3g}," in text
    everywhere = delta_e_2000(measured_result, dimmed, "normalised")
    assert float(everywhere.mean()) > 2 * float(verdict.mean())
    assert np.isnan(verdict.where(dark, drop=True)).all()
    assert f"left out: {int(np.isnan(verdict).sum())} of {verdict.size} pairs" in text


def test_hemisphere(hemisphere_rays, hemisphere_waves):
    assert len(hemisphere_waves.vgonio.plot_hemisphere().axes) >= 2
    assert hemisphere_rays.vgonio.plot_decomposition().axes[0].get_title(loc="left").startswith("θᵢ = 30°")
    with pytest.raises(InputError, match="use plot_hemisphere"):
        hemisphere_rays.vgonio.plot_lobes()
    with pytest.raises(InputError, match="covers a hemisphere"):
        hemisphere_waves.vgonio.plot_rgb()


def test_what_does_not_apply_is_refused_in_one_line(full_result, wave_result):
    refused = {
        "plot_hemisphere": "use plot_lobes",
        "plot_mueller": "polarised = true",
        "plot_orders": r"of gratings, as vg\.wave\.Kirchhoff.*\.orders\(surface",
        "plot_sweep": "use plot_lobes",
        "plot_ways": "statistics = true",
    }
    for name, words in refused.items():
        with pytest.raises(InputError, match=words) as e:
            getattr(full_result.vgonio, name)()
        assert "\n" not in str(e.value)
    for name, words in (("plot_decomposition", "brdf_by_bounce"), ("plot_surface", "summary of a surface")):
        with pytest.raises(InputError, match=words):
            getattr(wave_result.vgonio, name)()
    with pytest.raises(InputError, match="this result has 2"):
        wave_result.isel(wavelength=[0, 1]).vgonio.plot_spectra()
    with pytest.raises(InputError, match="'brdf' is needed, got x"):
        xr.Dataset({"x": 1}).vgonio.plot_lobes()
    with pytest.raises(InputError, match="its groups are none"):
        xr.DataTree().vgonio.plot_lobes()


def test_surface_pictures_take_the_summary(full_result, surface_summary):
    for data in (full_result, full_result["surface"], surface_summary):
        figure = data.vgonio.plot_heights()
        np.testing.assert_allclose(figure.axes[0].lines[0].get_ydata(), surface_summary["height_density"])


def test_the_verdict_in_words_is_that_of_the_page(full_result, wave_result):
    said = full_result.vgonio.verdict()
    lines = str(said).splitlines()
    assert max(map(len, lines)) <= 110
    assert " ".join(str(said).split()) == " ".join(
        word
        for mark, items in (("!", said.alarms), ("-", said.statements), ("?", said.cautions))
        for item in items
        for word in (mark, *item.split())
    )
    whole, _ = compose(Content.of(full_result))
    assert said == whole
    assert any("and the measurement differ by" in s for s in said.statements)
    assert not any("differ by" in s for s in wave_result.vgonio.verdict().statements)  # one alone


def test_surface_pictures_take_a_heightfield():
    surface = vg.surface.gaussian(rms_um=0.5, correlation_um=4, shape=(48, 64), pitch_um=0.5, seed=2)
    drawn = [report.plot_heights(data).axes[0].lines[0].get_ydata() for data in (surface, surface_dataset(surface))]
    np.testing.assert_array_equal(*drawn)


def test_several_results_by_name(full_result, ray_result, wave_result):
    figure = report.plot_lobes({"rays": ray_result, "waves_coarse": wave_result, "measured": full_result["measured"]})
    names = [t.get_text() for t in figure.legends[0].get_texts()]
    assert names == ["Rays", "Waves (Kirchhoff)", "Measured"]
    ends = [line.get_ydata() for line in figure.axes[0].lines if len(line.get_ydata()) == ray_result.sizes["theta_o"]]
    whole = [line.get_ydata() for line in report.plot_lobes(full_result).axes[0].lines]
    assert len(ends) == 3
    for one, other in zip(ends, whole):
        np.testing.assert_array_equal(one, other)
    with pytest.raises(InputError, match="'all': one dataset is needed beside others, got a result of 3"):
        report.plot_lobes({"all": full_result})


def test_a_notebook_shows_a_figure_without_pyplot(ray_result):
    """IPython asks an object for `_repr_png_`; a plain Figure has none, and pyplot, which would help, is not loaded."""
    figure = ray_result.vgonio.plot_lobes()
    shown = figure._repr_png_()
    assert shown[:8] == b"\x89PNG\r\n\x1a\n"
    wide, tall = struct.unpack(">II", shown[16:24])
    np.testing.assert_allclose([wide, tall], figure.get_size_inches() * NOTEBOOK_DPI, atol=1)
    assert shown == figure._repr_png_()
    copy = pickle.loads(pickle.dumps(figure))  # figures go from worker to worker
    assert copy._repr_png_()[:4] == b"\x89PNG"


@pytest.mark.parametrize(
    ("code", "there"),
    [("vgonio", False), *((f"vgonio.{part}", True) for part in ("measure", "models", "report", "open"))],
)
def test_who_registers_the_accessor(code, there):
    program = f"import vgonio, sys\n{code}\nassert 'matplotlib' not in sys.modules\n"
    program += f"assert ('xarray' in sys.modules) == {there}\nimport xarray\n"
    program += f"assert hasattr(xarray.Dataset, 'vgonio') == {there} == hasattr(xarray.DataTree, 'vgonio')"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
