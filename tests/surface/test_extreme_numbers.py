"""Arrays of every kind and fields at the edge of sense: right numbers or a clear refusal, no NumPy warning."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
import xarray as xr

from vgonio import surface as sf
from vgonio.errors import InputError, VgonioWarning
from vgonio.surface import Heightfield
from vgonio.surface.mesh import mesh
from vgonio.surface.symmetry import leaning
from vgonio.surface.visibility import visible

Z = np.random.default_rng(7).normal(size=(6, 9))


# ---- what is taken for heights
def test_what_a_mask_hides_is_missing():
    masked = np.ma.masked_array(Z, Z > 1)
    assert np.array_equal(np.isnan(Heightfield(masked, 1.0).z), Z > 1)
    whole_numbers = np.ma.masked_array([[1, 2], [3, 4]], [[False, True], [False, False]])
    assert Heightfield(whole_numbers, 1.0).missing == 1
    with pytest.raises(InputError, match="missing"):
        Heightfield(np.ma.masked_all((3, 3)), 1.0)


@pytest.mark.parametrize("coordinates", [False, True])
def test_labelled_arrays_come_with_y_first_and_upwards(coordinates):
    """As in CONVENTIONS.md: z[iy, ix], y grows with iy; an image has its y coordinates the other way round."""
    named = xr.DataArray(Z, dims=("y", "x"))
    if coordinates:
        named = named.assign_coords(y=np.arange(6) * 0.5, x=np.arange(9) * 0.5)
        assert np.array_equal(Heightfield(named[::-1], 0.5).z, Z)
        assert np.array_equal(Heightfield(named[:, ::-1].T, 0.5).z, Z)
    assert np.array_equal(Heightfield(named, 0.5).z, Z)
    assert np.array_equal(Heightfield(named.transpose("x", "y"), 0.5).z, Z)
    assert np.array_equal(Heightfield(named.rename(y="rows", x="columns"), 0.5).z, Z)


@pytest.mark.parametrize("kind", ["<f8", ">f8", "<f4", ">f4", "f2", "longdouble", "object"])
@pytest.mark.parametrize("order", ["C", "F"])
def test_numbers_of_every_kind(kind, order):
    given = np.asarray(Z, dtype=kind, order=order)
    given.flags.writeable = False
    made = Heightfield(given, 1.0).z
    assert made.dtype == np.dtype("f8")
    assert made.flags.c_contiguous
    assert np.array_equal(made, given.astype("f8"))


@pytest.mark.parametrize("values", [Z + 1j, Z.astype("M8[s]"), Z.astype("m8[s]"), np.zeros((3, 3), "f8,f8")])
def test_what_is_no_real_number(values):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(InputError, match="real numbers"):
            Heightfield(values, 1.0)


@pytest.mark.parametrize("height", [2e12, -1e300])
def test_heights_and_pitches_beyond_all_measure(height):
    with pytest.raises(InputError, match="unit"):
        Heightfield([[0.0, height]], 1.0)
    for pitch in (1e-10, 1e13, (1.0, 1e-300)):
        with pytest.raises(InputError, match="unit"):
            Heightfield(Z, pitch)


def test_single_precision_beside_a_large_offset():
    """Steps of 2⁻⁷ µm at 10⁵ µm, where the relief has an Sq of 0.1 µm; in double precision nothing is lost."""
    with pytest.warns(VgonioWarning, match="in steps of 0.0078 µm"):
        Heightfield((0.1 * Z + 1e5).astype("f4"), 1.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        Heightfield(0.1 * Z + 1e5, 1.0)
        Heightfield(Z.astype("f4"), 1.0)
        Heightfield(np.full((3, 3), 1e5, "f4"), 1.0)  # flat: nothing to lose


# ---- what is computed of them
@pytest.mark.parametrize("offset", [0.1, 1e9 + 0.1])
def test_a_field_of_equal_heights_is_flat(offset):
    """Whatever the height: the mean of 10⁹ + 0.1 is not 10⁹ + 0.1, and a spectrum of rounding has no period."""
    flat = Heightfield(np.full((7, 11), offset), 0.3, periodic=True)
    found = sf.parameters(flat)
    assert found["Sq"] == found["Sz"] == 0
    assert np.isnan([found["Ssk"], found["Sal"]]).all()
    assert flat.period_um is None
    assert not sf.psd(flat).values.any()
    with pytest.raises(InputError, match="flat"):
        sf.autocorrelation(flat)


def test_the_period_of_rows_that_differ_by_a_constant():
    grating = sf.sinusoid(2.0, 0.1, (4, 100), 0.1)
    assert grating.period_um == pytest.approx(2.0)
    stepped = grating.replace(z=grating.z + np.arange(4)[:, None] + 1e4)
    assert stepped.period_um == pytest.approx(2.0)
    assert Heightfield(np.arange(4.0)[:, None] * np.ones(5), 1.0, periodic=True).period_um is None


@pytest.mark.parametrize("interpolation", ["cubic", "linear", "nearest"])
@pytest.mark.parametrize("periodic", [True, False])
@pytest.mark.parametrize("shape", [(1, 40), (40, 1), (2, 2), (1, 2)])
def test_the_smallest_fields(shape, periodic, interpolation):
    z = np.random.default_rng(1).normal(size=shape)
    surface = Heightfield(z, 0.5, periodic, interpolation)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for direction in ((1, 0.3, 0.1), (0.3, -1, 0.1), (1, 0, 1e-300), (0, 0, 1)):
            seen = visible(surface, direction)
            assert seen.shape == shape
            if not (direction[0] and direction[1]):  # oblique lines of sight are right to a step of the grid
                assert seen[np.unravel_index(z.argmax(), shape)]
        leaning(surface)
        slopes = sf.slope_distribution(surface)
        width = np.diff(slopes.slope)[0]
        assert slopes.density_x.sum() * width == pytest.approx(1)
        assert np.isfinite(slopes.gaussian).all()
        assert sf.parameters(surface)["Sq"] == pytest.approx(z.std())


def test_too_little_is_left_for_slopes():
    z = np.full((8, 8), np.nan)
    z[2, 3], z[6, 1] = 1.0, 2.0
    surface = Heightfield(z, 0.5)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = sf.parameters(surface)
        assert found["Sq"] == 0.5
        assert np.isnan([found["Sdq"], found["alpha"]]).all()
        assert leaning(surface) == {}
        with pytest.raises(InputError, match="no slopes"):
            sf.slope_distribution(surface)


@pytest.mark.parametrize("height", [1e-300, 1e-160, 1e-12])
def test_walls_too_low_to_have_an_area(height):
    steps = Heightfield(height * (np.arange(12.0).reshape(3, 4) % 2), 1.0, True, "nearest")
    assert np.isfinite(mesh(steps).normals).all()
    assert np.isclose(mesh(steps).areas.sum(), 5 * 6, rtol=1e-9)  # one cell more around the 3 × 4 of the period
