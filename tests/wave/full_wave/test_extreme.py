"""Where the system is hard to solve: nothing crashes, nothing is NaN, condition and residual are reported."""

from __future__ import annotations

import json
import tracemalloc

import numpy as np
import pytest
import xarray as xr

import vgonio as vg
from vgonio.errors import ToleranceError, VgonioWarning
from vgonio.materials import Material
from vgonio.wave import FullWave
from vgonio.wave.full_wave import effort, forecast, profile

GLASS = Material("glass", "test", lambda w: np.full(np.shape(w), 1.5 + 0j), (100.0, 10_000.0))
MATERIALS = pytest.mark.parametrize("made", ["perfect", "Al", GLASS], ids=["perfect", "Al", "glass"])


def lamellar(period: float, depth: float, duty: float, samples: int):
    return vg.surface.lamellar(period, depth, duty, shape=(1, samples), pitch_um=period / samples)


def sound(data: xr.Dataset, residual: float = 1e-8) -> list[str]:
    """All numbers there and sensible; the remarks."""
    values = data["efficiency"] if "efficiency" in data else data["brdf"]
    assert np.isfinite(values.values).all()
    assert np.all(values.values >= 0)
    assert np.all(np.isfinite(data.condition_number.values) & (data.condition_number.values >= 1 - 1e-6))
    assert float(data.residual.max()) < residual
    assert data.attrs["error_achieved"] <= data.attrs["tolerance_asked"]
    return json.loads(data.attrs["remarks"])


@MATERIALS
def test_deep_narrow_grooves(made):
    """Depth ten times the width: 3 µm deep, 0.3 µm wide."""
    data = FullWave(made, [550.0], polarisation="TM").orders(lamellar(0.6, 3.0, 0.5, 20), [20.0])
    sound(data)
    assert np.abs(data.energy_balance.values - 1).max() < 1e-3


@pytest.mark.parametrize("made", ["perfect", "Al"])
def test_wood_anomaly(made):
    """Exactly at the anomaly, P = 2λ and normal incidence: the limit from both sides, and it is said."""
    surface = lamellar(1.0, 0.2, 0.5, 20)
    found = {}
    for wavelength in (499.9999, 500.0, 500.0001):
        with pytest.warns(VgonioWarning, match="Wood's anomaly"):
            found[wavelength] = FullWave(made, [wavelength], tol=1e-3).orders(surface, [0.0])
        remarks = sound(found[wavelength])
        assert any("Wood" in r for r in remarks)
    there = found[500.0].efficiency.sel(order=[-1, 0, 1]).values
    for wavelength in (499.9999, 500.0001):
        # efficiencies go as the square root of the distance: (2·10⁻⁷)^½ = 4·10⁻⁴
        assert np.abs(found[wavelength].efficiency.sel(order=[-1, 0, 1]).values - there).max() < 5e-4
    assert found[500.0].condition_number.max() > 10 * found[499.9999].condition_number.min()


@pytest.mark.parametrize(("made", "gap_nm"), [("perfect", 1), ("perfect", 10), ("Al", 1)])
def test_walls_that_nearly_touch(made, gap_nm):
    samples = 1000 // gap_nm
    data = FullWave(made, [550.0]).orders(lamellar(1.0, 0.5, 1 - 1 / samples, samples), [10.0])
    sound(data)
    assert np.abs(data.energy_balance.values - 1).max() < 1e-3


@MATERIALS
def test_grazing_incidence(made):
    data = FullWave(made, [550.0]).orders(lamellar(0.7, 0.3, 0.5, 20), [85.0, -85.0])
    sound(data)
    assert np.abs(data.energy_balance.values - 1).max() < 1e-3
    assert np.allclose(data.efficiency.values[0], data.efficiency.values[1][::-1], atol=1e-3)


def test_grazing_incidence_on_a_finite_profile_is_said_to_leave_waves_out():
    z = 0.1 * np.cos(np.arange(160) / 6.0)
    row = vg.surface.Heightfield(z[None], pitch_um=0.1)
    gonio = vg.measure.Gonioreflectometer([85.0], np.arange(-85, 86, 10), coherence_um=2.0)
    with pytest.warns(VgonioWarning, match="do not propagate"):
        data = gonio.measure(row, FullWave("perfect", [550.0]))
    assert any("do not propagate" in r for r in sound(data))


@pytest.mark.parametrize("depth", [0.275, 0.5499])
def test_resonant_cavities(depth):
    """Grooves half a wavelength wide and as deep: loss-free, and the combined field knows no resonance of its own."""
    data = FullWave("perfect", [550.0]).orders(lamellar(0.5, depth, 0.5, 20), [0.0, 20.0])
    sound(data)
    assert np.abs(data.energy_balance.values - 1).max() < 1e-3
    assert float(data.condition_number.max()) < 1e5


def test_window_of_one_wavelength():
    """ℓ = 0.55 µm spreads over the whole hemisphere; a sample of one wavelength is mostly missed, and it is said."""
    x = np.arange(160) * 0.1
    row = vg.surface.Heightfield(0.1 * np.cos(x)[None], pitch_um=0.1)
    gonio = vg.measure.Gonioreflectometer([0.0], np.arange(-80, 81, 20), coherence_um=0.55)
    data = gonio.measure(row, FullWave("perfect", [550.0], windows=1))
    sound(data)
    assert float(data.energy_balance.min()) == pytest.approx(1.0, abs=1e-3)
    small = row.replace(z=row.z[:, :6])
    wide = vg.measure.Gonioreflectometer([0.0], np.arange(-80, 81, 20), coherence_um=5.0)
    with pytest.warns(VgonioWarning, match="cut at the ends"):
        sound(wide.measure(small, FullWave("perfect", [550.0])))


def test_corners_of_finite_profiles():
    """Walls and kinks of a finite profile, its two ends included."""
    gonio = vg.measure.Gonioreflectometer([0.0], np.arange(-80, 81, 20), coherence_um=0.25)
    steps = vg.surface.Heightfield([0.2 * (np.arange(6) % 2)], pitch_um=0.25, interpolation="nearest")
    kinks = vg.surface.Heightfield([0.2 * (np.arange(6) % 2)], pitch_um=0.25, interpolation="linear")
    for row, p in ((steps, "TE"), (kinks, "TM")):
        data = gonio.measure(row, FullWave("perfect", [550.0], polarisation=p, windows=1))
        sound(data)
        # a window of λ/2 on four ridges: some of the light runs along them and leaves past the ends
        assert np.abs(data.energy_balance.values - 1).max() < 1e-3 + float(data.energy_lost.max())


def test_where_a_second_solution_is_too_dear_a_coarser_one_gives_the_error(monkeypatch):
    surface = vg.surface.sinusoid(2.0, 0.2, (1, 200), 0.01)
    nodes = FullWave("Al").orders(surface, [0.0]).attrs["unknowns"]
    monkeypatch.setattr(effort, "MOST_UNKNOWNS", nodes - 1)
    data = FullWave("Al").orders(surface, [0.0])
    assert data.attrs["unknowns"] < nodes
    assert 0 < data.attrs["error_achieved"] < 0.1
    monkeypatch.setattr(effort, "MOST_UNKNOWNS", 20)
    with pytest.raises(ToleranceError, match="at most 20 unknowns"):
        FullWave("Al").orders(surface, [0.0])


@pytest.mark.parametrize("interpolation", ["cubic", "linear", "nearest"])
@pytest.mark.parametrize("periodic", [False, True])
def test_heights_out_of_all_proportion_are_refused_before_memory_is_asked_for(interpolation, periodic):
    """8 m of profile on 50 µm, 10⁷ panels: refused, and told by the forecast, from its length alone."""
    x = (np.arange(1000) + 0.5) * 0.05
    heights = 4e5 * np.sin(2 * np.pi * x / 5)[None]
    surface = vg.surface.Heightfield(heights, 0.05, periodic=periodic, interpolation=interpolation)
    solver, incoming = FullWave("Al", [550.0]), vg.directions.Incoming([0.0])
    assert not forecast(solver, surface, incoming).affordable  # numpy's imports come before memory is traced
    tracemalloc.start()
    try:
        with pytest.raises(ToleranceError, match="unknowns are solved"):
            solver.scatter(surface, incoming, vg.directions.Detector.in_plane([0.0, 10.0], aperture_deg=2.0))
        assert not forecast(solver, surface, incoming).affordable
        assert tracemalloc.get_traced_memory()[1] < 20e6  # 0.3 MB; panels would be 10 GB
    finally:
        tracemalloc.stop()


def test_the_fewest_nodes_are_no_more_than_there_are():
    rng = np.random.default_rng(1)
    for interpolation in ("cubic", "linear", "nearest"):
        surface = vg.surface.Heightfield(rng.normal(0, 0.2, (1, 300)), 0.2, interpolation=interpolation)
        how = profile.Resolution(0.5, 1e-4)
        least, made = profile.fewest_nodes(surface, 3.03, 50.1, how), profile.cut(surface, 3.03, 50.1, how).size
        # panels shrink towards the corners of the others: 300 of them here, at most 10 panels each
        assert (0.3 if interpolation == "cubic" else 0.05) * made < least <= made
