"""The demo's measured file: what it says of itself, and that the fits find the parameters it was made with."""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from vgonio.compare import delta_e_2000, fit_global_shift, fit_local_shift
from vgonio.measure import formats
from vgonio.models import evaluate

DEMO = Path(__file__).resolve().parents[2] / "examples" / "demo"


@pytest.fixture(scope="module")
def made() -> ModuleType:
    spec = importlib.util.spec_from_file_location("make_measured", DEMO / "make_measured.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def measured():
    return formats.read(DEMO / "measured_virtual.json")


def test_grid_size_and_provenance(measured):
    path = DEMO / "measured_virtual.json"
    assert path.stat().st_size < 250_000
    assert "NOT A MEASUREMENT" in json.loads(path.read_text())[0]["provenance"]
    assert "NOT A MEASUREMENT" in measured.attrs["provenance"]
    assert measured.theta_i.values.tolist() == list(range(0, 81, 10))
    assert measured.theta_o.values.tolist() == list(range(-85, 86, 5))
    assert measured.wavelength.values.tolist() == list(range(380, 781, 20))
    # only the exact back-scattering pairs are missing
    missing = np.isnan(measured.brdf).all("wavelength")
    np.testing.assert_array_equal(missing, measured.theta_i == measured.theta_o)
    assert int(np.isnan(measured.brdf).sum()) == 9 * 21


def test_the_file_is_what_the_script_makes(made, measured, tmp_path):
    again = formats.read(made.main(tmp_path / "again.json"))
    # one unit of the fourth digit, where another processor may round the other way
    np.testing.assert_allclose(measured.brdf, again.brdf, rtol=1.1e-3)
    assert measured.attrs["provenance"] == again.attrs["provenance"]
    assert float((measured.brdf == again.brdf).sum() / again.brdf.notnull().sum()) > 0.999


def test_noise_is_what_it_says(made, measured):
    truth = evaluate("clausen-2022", made.THETA_I, made.THETA_O, made.WAVELENGTH, **made.PARAMETERS)
    relative = (measured.brdf / truth.brdf - 1).values
    relative = relative[np.isfinite(relative)]
    # 6426 values: the standard deviation is known to 0.9 %, the mean to 0.00025; 4 of each
    assert np.std(relative) == pytest.approx(made.NOISE, rel=0.036)
    assert abs(np.mean(relative)) < 1e-3


@pytest.mark.parametrize("fixed", [{}, {"p": 1.0, "t_y": 0.0}])
def test_the_global_fit_finds_the_parameters(made, measured, fixed):
    fit = fit_global_shift(measured, **fixed)
    truth = {"h": made.PARAMETERS["h"], "w": made.PARAMETERS["w"], "t_y": 0.0, "p": 1.0}
    for name, value in truth.items():
        if name not in fixed:
            # within 4 standard errors of its own, which are small: 1 % of h and w
            assert abs(float(fit[name]) - value) < 4 * float(fit[f"{name}_stderr"])
    assert float(fit.h_stderr) < 0.01 * made.PARAMETERS["h"]
    assert float(fit.w_stderr) < 0.01 * made.PARAMETERS["w"]


def test_local_slopes_and_their_errors(made, measured):
    fit = fit_local_shift(measured, p=1.0)
    theta_m = np.radians(abs(measured.theta_i + measured.theta_o) / 2)
    truth = made.PARAMETERS["h"] * np.cos(made.PARAMETERS["w"] * theta_m)
    pull = ((fit.slope - truth) / fit.slope_stderr).values
    # Student's t with 19 degrees of freedom, 306 spectra: 1.06 ± 0.05
    assert np.nanstd(pull) == pytest.approx(1.06, abs=0.2)


def test_strength_of_the_shift(made):
    """Without noise the Fresnel term alone is off by a ΔE₀₀ of up to 12, as thesis section 4.4 says of sample 1."""
    grid = (made.THETA_I, made.THETA_O, made.WAVELENGTH)
    shifted = evaluate("clausen-2022", *grid, **made.PARAMETERS)
    plain = evaluate("cook-torrance-1982", *grid, alpha=made.PARAMETERS["alpha"], material="Al")
    assert float(delta_e_2000(shifted, plain, scale="normalised").max()) == pytest.approx(12, abs=0.5)
