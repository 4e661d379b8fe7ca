"""Objects in the wrong place get one line that says what is needed, not an error of a library."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

import vgonio as vg
from vgonio.errors import InputError

ROUGH = {"kind": "gaussian", "rms_um": 0.2, "correlation_um": 3, "shape": [32, 32], "pitch_um": 0.5}
SCENE = {
    "surface": {"generate": ROUGH},
    "material": {"name": "Al"},
    "light": {"wavelength_nm": [450, 550, 650], "theta_i_deg": [0, 30]},
    "detector": {"theta_o_deg": list(range(-60, 61, 20))},
    "geometric": {"rays": 500},
}


@pytest.fixture(scope="module")
def swept():
    """A result over two more keys, as `vg.sweep` returns them."""
    tree = vg.simulate(SCENE)
    over = xr.concat([xr.concat([tree["rays"].to_dataset()] * 2, "rms_um")] * 3, "seed")
    return xr.DataTree.from_dict({"rays": over.assign_coords(rms_um=[0.1, 0.2], seed=[0, 1, 2])})


@pytest.mark.parametrize("name", ["verdict", "plot_lobes", "plot_spectra", "plot_energy", "plot_rgb"])
@pytest.mark.parametrize("part", ["tree", "node", "dataset"])
def test_a_sweep_is_no_single_result(swept, name, part):
    given = {"tree": swept, "node": swept["rays"], "dataset": swept["rays"].to_dataset()}[part]
    with pytest.raises(InputError, match=r"sweep over .*one point of it is needed.*result.isel\(.*rms_um=0") as error:
        getattr(given.vgonio, name)()
    assert "seed=0" in str(error.value)


def test_a_page_of_a_sweep_is_refused_before_it_is_written(swept, tmp_path):
    for write in (vg.report.plots.page, vg.report.plots.explore):
        with pytest.raises(InputError, match="one point of it is needed"):
            write(swept, tmp_path / "page.html")
    assert list(tmp_path.iterdir()) == []


def test_one_point_of_a_sweep_is_a_result(swept):
    assert swept.isel(rms_um=0, seed=0).vgonio.plot_lobes().axes


@pytest.mark.parametrize("function", [vg.compare.rmse, vg.compare.nrmse, vg.compare.nse])
@pytest.mark.parametrize("wrong", [vg.surface.flat(shape=(4, 4), pitch_um=1.0), np.zeros((2, 2)), "result.nc"])
def test_what_is_no_result_cannot_be_compared(function, wrong):
    with pytest.raises(InputError, match=f"a dataset with a BRDF is needed.*not a {type(wrong).__name__}"):
        function(wrong, wrong)


def test_save_says_which_comes_first(tmp_path, swept):
    for given in (("x.nc", swept), (swept, None), (vg.surface.flat(shape=(4, 4), pitch_um=1.0), tmp_path / "x.nc")):
        with pytest.raises(InputError, match=r"save\(result, path\) takes a DataTree or Dataset and then a file name"):
            vg.save(*given)
