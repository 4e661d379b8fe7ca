"""Long work is announced, or refused, before it is begun; and the estimate is of the right size."""

from __future__ import annotations

import numpy as np
import pytest

import vgonio as vg
from vgonio.errors import ToleranceError, VgonioWarning
from vgonio.wave import Kirchhoff, forecast


def surface(n: int = 96) -> vg.surface.Heightfield:
    return vg.surface.gaussian(rms_um=0.3, correlation_um=3, shape=(n, n), pitch_um=0.5, seed=1)


def gonio(**light):
    return vg.measure.Gonioreflectometer([0, 40], range(-60, 61, 20), **({"coherence_um": 5} | light))


def test_long_work_is_announced(monkeypatch):
    monkeypatch.setattr(forecast, "WARN_SECONDS", 1e-3)
    with pytest.warns(VgonioWarning, match="min of work on two cores: take fewer angles"):
        gonio().measure(surface(32), Kirchhoff("Al", [500]))


def test_work_of_days_is_refused(monkeypatch):
    monkeypatch.setattr(forecast, "MOST_SECONDS", 1e-3)
    with pytest.raises(ToleranceError, match="are begun"):
        gonio().measure(surface(32), Kirchhoff("Al", [500]))


@pytest.mark.parametrize("options", [{}, {"fresnel": "local"}, {"method": "reference"}])
def test_the_estimate_is_of_the_right_size(options, monkeypatch, pace):
    """Within a factor 10, on whatever machine and load this runs: it decides between minutes and days."""
    expected = []
    estimate = forecast.estimate
    monkeypatch.setattr(forecast, "estimate", lambda *a: expected.append(estimate(*a)) or expected[-1])
    made = surface(24 if options.get("method") else 64)

    def work() -> None:
        gonio().measure(made, Kirchhoff("Al", [450, 600], tol=1e-2, **options))

    work()  # loads libraries
    took = pace(work)
    assert expected[0] / 10 < took < 10 * max(expected[0], 0.05)


def test_progress_is_told_for_every_window():
    seen = []
    gonio().measure(surface(48), Kirchhoff("Al", [500], progress=seen.append))
    assert seen == sorted(seen)
    assert len(seen) > 3
    assert seen[-1] == pytest.approx(1)


def scene(**light) -> dict:
    return {
        "surface": {"generate": {"kind": "gaussian", "rms_um": 0.3, "correlation_um": 3, "shape": [64, 64],
                                 "pitch_um": 0.5}},
        "material": {"name": "Al"},
        "light": {"wavelength_nm": [500], "theta_i_deg": [0, 30], "coherence_um": 5} | light,
        "detector": {"theta_o_deg": [-30, 0, 30]},
        "wave": {},
    }  # fmt: skip


def test_the_plan_has_the_time():
    transform = next(s for s in vg.plan(scene()).stages if s.name == "transform")
    assert 0 < transform.seconds < 60
    assert not any("two cores" in w for w in vg.plan(scene()).warnings)
    long = scene(theta_i_deg=list(np.arange(0, 80.0)), wavelength_nm=list(np.arange(380, 780.0, 2)))
    long["wave"] = {"shadowing": True, "fresnel": "local"}
    long["detector"] = {"theta_o_deg": list(range(-80, 81, 2))}
    made = vg.plan(long)
    assert "of work on two cores" in made.refused
