"""`theory = "full-wave"` in a scene: plan, simulation, refusals."""

from __future__ import annotations

import numpy as np
import pytest
from threadpoolctl import threadpool_info

import vgonio as vg
from vgonio.errors import InputError
from vgonio.wave.full_wave import FullWave, forecast

SCENE = {
    "surface": {
        "generate": {"kind": "sinusoid", "period_um": 2, "amplitude_um": 0.05, "shape": [2, 200], "pitch_um": 0.05}
    },
    "material": {"name": "Al"},
    "light": {"wavelength_nm": [450, 650], "theta_i_deg": [0, 30], "coherence_um": 15},
    "detector": {"theta_o_deg": {"start": -80, "stop": 80, "step": 5}},
    "wave": {"theory": ["full-wave", "kirchhoff"]},
}


def test_plan_and_simulation():
    plan = vg.plan(SCENE)
    assert plan.needs("full wave")
    assert plan.needs("transform")
    stage = next(s for s in plan.stages if s.name == "full wave")
    assert "unknowns" in stage.cost
    assert "one-dimensional" in stage.why
    tree = vg.simulate(SCENE)
    rigorous, scalar = tree["waves"], tree["waves_kirchhoff"]
    assert rigorous.attrs["theory"] == "full-wave"
    assert scalar.attrs["theory"] == "kirchhoff"
    a, b = rigorous["brdf"].values, scalar["brdf"].values
    assert np.abs(a - b).max() < 0.1 * b.max()  # a shallow grating: 2.6 % is what the table of gratings expects


def test_a_surface_in_three_dimensions_is_refused_by_the_plan():
    scene = SCENE | {
        "surface": {
            "generate": {"kind": "gaussian", "rms_um": 0.1, "correlation_um": 1.0, "shape": [64, 64], "pitch_um": 0.1}
        }
    }
    with pytest.raises(InputError, match="one-dimensional profiles"):
        vg.plan(scene)


def test_options_of_the_scalar_theories_are_refused():
    with pytest.raises(InputError, match="full-wave holds shadows"):
        vg.plan(SCENE | {"wave": {"theory": "full-wave", "shadowing": True}})


def test_a_system_that_is_too_large_is_in_the_plan():
    long = {"kind": "sinusoid", "period_um": 2000, "amplitude_um": 0.1, "shape": [1, 4000], "pitch_um": 0.5}
    plan = vg.plan(SCENE | {"surface": {"generate": long}, "wave": {"theory": "full-wave"}})
    assert not plan.needs("full wave")
    assert "TOO LARGE" in next(s for s in plan.stages if s.name == "full wave").why


def test_the_forecast_is_of_the_right_size(pace):
    """Seconds of a core against the processor's own count, within 5: on the machine they are of, 1 to 1.9 of it. Every
    incidence on a grating costs its own lattice sum, one on a finite profile next to nothing."""
    detector = vg.directions.Detector.in_plane([-30.0, 0.0, 30.0], aperture_deg=2.0)
    made = vg.surface.sinusoid(20, 0.4, shape=(1, 400), pitch_um=0.05)
    solver = FullWave("Al", [550.0])
    one, three = vg.directions.Incoming([0.0]), vg.directions.Incoming([0.0, 30.0, 60.0])
    solver.scatter(made, one, detector)  # loads libraries
    spent = pace(lambda: solver.scatter(made, three, detector))
    expected = forecast(solver, made, three).seconds
    assert spent / 5 < expected < 5 * spent
    assert expected > 1.5 * forecast(solver, made, one).seconds
    cut = made.replace(periodic=False)
    assert forecast(solver, cut, three).seconds == forecast(solver, cut, one).seconds


@pytest.mark.parametrize("periodic", [True, False])
def test_progress_moves_within_one_wavelength(periodic):
    """Up to 1, never back, no step larger than a half: several windows, one wavelength; and one thread of BLAS."""
    told, threads = [], []

    def progress(share: float) -> None:
        told.append(share)
        threads.extend(pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas")

    made = vg.surface.sinusoid(5, 0.2, shape=(1, 600), pitch_um=0.05).replace(periodic=periodic)
    incoming = vg.directions.Incoming([0.0, 30.0], coherence_um=2.5)
    solver = FullWave("Al", [550.0], progress=progress, windows=2)
    solver.scatter(made, incoming, vg.directions.Detector.in_plane([0.0, 30.0], aperture_deg=2.0))
    steps = np.diff([0.0, *told])
    assert told[-1] == 1
    assert len(told) >= 5
    assert steps.min() >= 0
    assert steps.max() <= 0.5
    assert min(threads, default=1) == 1
