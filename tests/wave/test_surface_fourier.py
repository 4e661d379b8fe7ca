"""The surface integral against closed forms, its methods against each other, its stated error against the true one."""

from __future__ import annotations

import os
import subprocess
import sys
import warnings

import numpy as np
import pytest
from scipy.special import jv

import vgonio as vg
from vgonio.errors import BackendError, InputError, VgonioWarning
from vgonio.surface import Heightfield
from vgonio.wave.fourier import evaluate, sample
from vgonio.wave.quadrature import Points, finer, gauss_rule

METHODS = ("nufft", "opencl", "reference")


def opencl_or_skip(method: str) -> None:
    if method == "opencl":
        from vgonio.wave import opencl

        try:
            opencl.device()
        except BackendError as e:
            pytest.skip(str(e))


def distance(a, b) -> float:
    return float(np.linalg.norm(a - b) / np.linalg.norm(b))


def rough(shape=(48, 64), pitch=0.5, periodic=True, seed=4) -> Heightfield:
    rng = np.random.default_rng(seed)
    fy, fx = np.meshgrid(np.fft.fftfreq(shape[0], pitch), np.fft.fftfreq(shape[1], pitch), indexing="ij")
    z = np.fft.ifft2(np.fft.fft2(rng.normal(size=shape)) * np.exp(-((np.pi * 3.0) ** 2) * (fx**2 + fy**2) / 2)).real
    return Heightfield(0.4 * z / z.std(), pitch, periodic=periodic)


@pytest.mark.parametrize("method", [*METHODS, "auto"])
@pytest.mark.parametrize("qz", [5.0, 20.0])
def test_sinusoid_follows_bessel(method, qz, agreement):
    """|S|² of order m is A² J_m(q_z a)², to the tolerance asked; 1e-3 is what the whole chain has to keep."""
    opencl_or_skip(method)
    surface = vg.surface.sinusoid(period_um=2, amplitude_um=0.1, shape=(64, 1000), pitch_um=0.05)
    m = np.arange(-4, 5)
    q = np.stack([2 * np.pi * m / 2, 0 * m, np.full(m.shape, qz)], axis=1)
    tol = 1e-4 if method == "opencl" else 1e-5
    power = np.abs(vg.wave.surface_fourier(surface, q, method=method, tol=tol) / surface.area_um2) ** 2
    error = np.abs(power - jv(m, qz * 0.1) ** 2).max()
    agreement("|S|² of a sinusoid, orders −4 … 4, each method", "J_m(q_z a)²", error, 2 * tol)


@pytest.mark.parametrize("kind", ["cubic", "linear"])
def test_tilted_plane_is_a_product_of_sincs(kind, rng, agreement):
    x = (np.arange(50) + 0.5) * 0.2
    surface = Heightfield(np.tile(0.3 * x, (40, 1)), 0.2, interpolation=kind)
    q = rng.uniform(-20, 20, (30, 3))

    def side(k, length):
        return length * np.exp(-0.5j * k * length) * np.sinc(k * length / (2 * np.pi))

    exact = side(q[:, 0] + 0.3 * q[:, 2], 10.0) * side(q[:, 1], 8.0)
    for tol in (1e-2, 1e-5, 1e-9):
        error = distance(vg.wave.surface_fourier(surface, q, tol=tol), exact)
        agreement("transform of a tilted plane over a finite window", "product of sincs", error, tol)


def test_lamellar_in_closed_form(agreement):
    """Two levels ±h, duty ½: S/A = cos(q_z h) in order 0 and sin(q_z h)·sinc in odd orders; walls are vertical."""
    z = np.tile(np.repeat([0.05, -0.05], 20), (8, 5))
    surface = Heightfield(z, 0.1, periodic=True, interpolation="nearest")
    m = np.arange(-5, 6)
    q = np.stack([2 * np.pi * m / 4.0, 0 * m, np.full(m.shape, 18.0)], axis=1)
    power = np.abs(vg.wave.surface_fourier(surface, q, tol=1e-9) / surface.area_um2) ** 2
    exact = np.where(m == 0, np.cos(0.9) ** 2, np.sin(0.9) ** 2 * np.sinc(m / 2) ** 2 * (m % 2))
    error = np.abs(power - exact).max()
    agreement("orders of a lamellar grating, vertical walls", "closed form", error, 1e-12)


@pytest.mark.parametrize("kind", ["cubic", "linear", "nearest"])
@pytest.mark.parametrize("windowed", [False, True])
def test_methods_agree(kind, windowed, rng, agreement):
    opencl_or_skip("opencl")
    surface = rough().replace(interpolation=kind, periodic=False)
    window = np.hanning(48)[:, None] * np.hanning(64) if windowed else None
    q = np.stack([rng.uniform(-5, 5, 24), rng.integers(-2, 3, 24) * 0.3, rng.uniform(1, 5, 24)], axis=1)
    exact = vg.wave.surface_fourier(surface, q, window, "reference", 1e-8)
    for method, tol in (("nufft", 1e-3), ("nufft", 1e-6), ("opencl", 1e-4), ("auto", 1e-5)):
        result = evaluate(surface, q, window, method, tol)
        error = distance(result.S, exact)
        agreement("transforms: nufft, OpenCL, auto", "direct sum in double precision", error, tol)
        assert result.error <= tol


def test_scattered_vectors_go_through_space(rng, agreement):
    """Vectors all over the hemisphere: FFTs of the grid at a few q_l, or FINUFFT in space, in tiles and in blocks."""
    from vgonio.wave import nufft, planes, reference

    x, y = np.arange(60) * 0.2 + 3, np.arange(50) * 0.25 - 7
    window = np.hanning(50)[:, None] * np.hanning(60)
    points = Points(x, y, rng.normal(size=(50, 60)), window)
    q = np.stack([rng.uniform(-12, 12, 150), rng.uniform(-10, 10, 150), rng.uniform(1, 12, 150)], axis=1)
    exact = reference.transform(points, q)
    for tol in (1e-3, 1e-6, 1e-9):
        error = distance(planes.transform(points, q, tol), exact)
        agreement("transform over the hemisphere", "direct sum", error, tol)
    assert distance(nufft.transform(points, q, 1e-6), exact) < 1e-6
    assert distance(nufft._tiles(points, q, 1e-6), exact) < 1e-5
    block, memory = planes.BLOCK, nufft.MEMORY
    try:
        planes.BLOCK, nufft.MEMORY = 32, 2e6
        assert distance(planes.transform(points, q, 1e-6), exact) < 1e-6
        assert distance(nufft._tiles(points, q, 1e-6), exact) < 1e-5
    finally:
        planes.BLOCK, nufft.MEMORY = block, memory


def test_error_stays_below_the_tolerance(rng):
    surface = rough((32, 32), periodic=True)
    q = np.stack([rng.integers(-20, 21, 30) * 2 * np.pi / 16, np.zeros(30), rng.uniform(2, 12, 30)], axis=1)
    exact = vg.wave.surface_fourier(surface, q, method="reference", tol=1e-10)
    for tol in (1e-1, 1e-2, 1e-4, 1e-6, 1e-8):
        result = evaluate(surface, q, None, "nufft", tol)
        true = distance(result.S, exact)
        assert true < tol
        assert true < 3 * result.error + 1e-12  # the stated error is not a fairy tale


def test_order_of_convergence(agreement):
    """Midpoints on a cubic spline: the kinks of its third derivative limit the error to fourth order."""
    from vgonio.wave.fourier import apply, sample

    # few samples for strong kinks; an odd number of points per sample, so that kinks fall at different places
    rng = np.random.default_rng(2)
    surface = Heightfield(np.tile(rng.normal(size=16), (2, 1)), 1.0, periodic=True)
    q = np.array([[2 * np.pi * 3 / 16, 0.0, 1.0]])
    exact = apply("reference", sample(surface, (1.0, 1 / 64), "gauss"), q, 0)
    n = np.array([5, 10, 20, 40])
    error = [abs(apply("reference", sample(surface, (1.0, 1 / k), "uniform"), q, 0) - exact)[0] for k in n]
    order = -np.polyfit(np.log(n), np.log(error), 1)[0]
    agreement("order of the midpoint rule on a cubic spline", "fourth order expected", order, (3.6, 4.6))


def test_gauss_panels_integrate_polynomials_exactly():
    x, w = gauss_rule(np.array([0.0, 0.3, 1.0]), 0.2)
    assert np.isclose(w.sum(), 1.0, rtol=1e-14)
    for power in range(6):
        assert np.isclose(w @ x**power, 1 / (power + 1), rtol=1e-13)


def test_opencl_keeps_its_digits_at_a_hundred_thousand_radians(rng):
    """Patches of 2 mm: phases of 10⁵ rad, reduced to a fraction of a cycle without loss, keep 1e-5."""
    opencl_or_skip("opencl")
    from vgonio.wave import opencl, reference

    points = Points(
        np.sort(rng.uniform(0, 2000, 200)), np.sort(rng.uniform(0, 2000, 100)), rng.normal(size=(100, 200)) * 5,
        rng.random((100, 200)),
    )  # fmt: skip
    q = np.stack([rng.uniform(-33, 33, 40), rng.uniform(-33, 33, 40), rng.uniform(1, 33, 40)], axis=1)
    assert np.abs(q[:, :2] @ np.array([2000, 2000])).max() > 5e4
    assert distance(opencl.transform(points, q), reference.transform(points, q)) < 1e-5


def test_a_precision_that_opencl_does_not_have_is_said():
    opencl_or_skip("opencl")
    surface = rough((16, 16))
    with pytest.warns(VgonioWarning, match="single precision"):
        vg.wave.surface_fourier(surface, [[0.3, 0, 2.0]], np.ones((16, 16)), method="opencl", tol=1e-9)


def test_opencl_works_where_nothing_can_be_written_at_home(tmp_path):
    """PoCL's cache goes to a temporary folder where ~/.cache cannot be made (here: a file is in its place)."""
    opencl_or_skip("opencl")
    home = tmp_path / "home"
    home.write_text("not a folder")
    code = (
        "import os; from vgonio.wave import opencl; opencl.device(); print(os.environ['POCL_CACHE_DIR']);"
        "import numpy as np; from vgonio.wave.quadrature import Points;"
        "one = np.ones((1, 1)); p = Points(np.zeros(1), np.zeros(1), 0 * one, one);"
        "assert abs(opencl.transform(p, np.ones((1, 3)))[0] - 1) < 1e-6"
    )
    unset = {k: v for k, v in os.environ.items() if k not in ("POCL_CACHE_DIR", "XDG_CACHE_HOME")}
    run = subprocess.run(
        [sys.executable, "-c", code], env=unset | {"HOME": str(home)}, capture_output=True, text=True, timeout=600
    )
    assert run.returncode == 0, run.stderr
    assert "vgonio-pocl-" in run.stdout


def test_phases_beyond_single_precision_are_refused():
    opencl_or_skip("opencl")
    from vgonio.wave import opencl

    points = Points(np.array([0.0, 1e6]), np.zeros(1), np.zeros((1, 2)), np.ones((1, 2)))
    with pytest.raises(BackendError, match="nufft"):
        opencl.transform(points, np.array([[100.0, 0, 0]]))


def test_opencl_on_grids_of_any_shape(rng):
    """Rows and columns that fill no work-item, single rows and columns, rows and columns without weight."""
    opencl_or_skip("opencl")
    from vgonio.wave import opencl, reference

    q = rng.uniform(-20, 20, (30, 3))
    for rows, columns in ((1, 1), (1, 700), (700, 1), (65, 63), (3, 257), (300, 64)):
        weight = rng.random((rows, columns))
        weight[rows // 2 + 1 :: 2] = 0
        weight[:, : columns // 3] = 0
        z = rng.normal(size=weight.shape)
        points = Points(np.sort(rng.uniform(0, 30, columns)), np.sort(rng.uniform(5, 9, rows)), z, weight)
        exact = reference.transform(points, q)
        assert np.abs(opencl.transform(points, q) - exact).max() < 1e-6 * weight.sum()
    points = Points(np.zeros(2), np.zeros(2), np.zeros((2, 2)), np.zeros((2, 2)))
    assert np.all(opencl.transform(points, q) == 0)


def test_missing_opencl_is_an_explained_absence(monkeypatch):
    from vgonio.wave import opencl

    with pytest.raises(BackendError, match="no OpenCL device matches 'voodoo'"):
        opencl.device("voodoo")


def test_sampling_shows_no_grating_of_its_own():
    """A coarse map of a smooth surface: at q_x = 2π/pitch a plain sum over samples would have its full order."""
    x = (np.arange(64) + 0.5) * 1.0
    surface = Heightfield(np.tile(0.2 * np.cos(2 * np.pi * x / 16), (4, 1)), 1.0, periodic=True)
    q = np.array([[0.0, 0.0, 6.0], [2 * np.pi, 0.0, 6.0]])
    S = np.abs(vg.wave.surface_fourier(surface, q, tol=1e-6))
    assert S[1] < 1e-4 * S[0]


def test_bad_input():
    surface = rough((8, 8))
    with pytest.raises(InputError, match=r"\(m, 3\)"):
        vg.wave.surface_fourier(surface, np.zeros(3))
    with pytest.raises(InputError, match="window"):
        vg.wave.surface_fourier(surface, np.zeros((1, 3)), np.ones((3, 3)))
    with pytest.raises(InputError, match="did you mean 'nufft'"):
        vg.wave.surface_fourier(surface, np.zeros((1, 3)), method="nuft")
    with pytest.raises(InputError, match="missing points"):
        z = surface.z.copy()
        z[0, 0] = np.nan
        vg.wave.surface_fourier(Heightfield(z, 1.0), np.zeros((1, 3)))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert vg.wave.surface_fourier(surface, np.zeros((0, 3))).shape == (0,)


@pytest.mark.parametrize("share", np.linspace(0.05, 40, 57))
def test_the_grid_that_checks_gauss_panels_is_finer(share):
    """1.5 times finer may round to the same nodes, and a difference of nothing is no error estimate."""
    surface = vg.surface.gaussian(rms_um=0.1, correlation_um=4.0, shape=[12, 9], pitch_um=(0.7, 1.3), seed=1)
    spacing = np.array(surface.pitch_um) / share
    coarse = sample(surface, spacing, "gauss")
    fine = sample(surface, finer(surface, spacing, "gauss"), "gauss")
    assert len(fine.x) > len(coarse.x)
    assert len(fine.y) > len(coarse.y)


def test_jagged_surface_to_a_tolerance_that_once_passed_unmet():
    """72 samples of noise: the check rounded to the rule it checked, and an error of 1e-4 passed for 1e-7."""
    z = 0.2 * np.random.default_rng(163).normal(size=(8, 9))
    surface = Heightfield(z, (0.7, 1.3), periodic=True)
    q = np.array([[0.0, 3.0, 1.0], [0.0, -3.0, -1.0], [0.0, 0.0, 0.0]])
    exact = vg.wave.surface_fourier(surface, q, method="reference", tol=1e-11)
    for tol in (1e-3, 1e-5, 1e-7):
        found = vg.wave.surface_fourier(surface, q, method="reference", tol=tol)
        assert np.linalg.norm(found - exact) <= tol * np.linalg.norm(exact)


@pytest.mark.parametrize("seed", [9, 30, 34])
def test_midpoints_that_would_not_do_give_way_to_panels(seed, monkeypatch):
    """72 jagged samples, periodic: midpoints (fourth order at the spline's kinks) ended with a warning after eight
    grids; panels between the samples meet the tolerance on fewer points, without one."""
    rng = np.random.default_rng(seed)
    z = rng.choice([0.05, 0.2, 1.0]) * rng.normal(size=(8, 9))
    surface = Heightfield(z, (0.7, 1.3), periodic=True)
    m = np.stack([rng.integers(-4, 5, 5) for _ in range(2)], axis=1)  # on the field's orders midpoints are the rule
    q = np.column_stack([2 * np.pi * m / np.array(surface.size_um[::-1]), rng.uniform(-20, 20, 5)])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = evaluate(surface, q, None, "reference", 1e-7)
    exact = evaluate(surface, q, None, "reference", 1e-11).S
    assert np.linalg.norm(found.S - exact) <= 1e-7 * np.linalg.norm(exact)
    monkeypatch.setattr("vgonio.wave.fourier._fewer", lambda *given: False)
    with pytest.warns(VgonioWarning, match="is not enough"):
        assert evaluate(surface, q, None, "reference", 1e-7).points > found.points
