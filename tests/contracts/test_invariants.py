"""What no solver may depend on: the unit of length, where heights are counted from, which side is left, where y points.

Geometric optics has no scale, and waves know lengths in wavelengths alone: heights, pitch, wavelength and coherence
length a thousand times as large leave every BRDF as it is. So do a constant added to all heights and the mirror image
of the whole experiment.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
import pytest

import vgonio as vg
from vgonio.errors import InputError, ToleranceError, VgonioWarning
from vgonio.geometric import RayOptics
from vgonio.materials import Material
from vgonio.measure import Gonioreflectometer
from vgonio.surface import Heightfield
from vgonio.wave import FullWave, IteratedKirchhoff, Kirchhoff

METAL = Material("n + ik = 1.2 + 7i", "made up", lambda um: np.full(np.shape(um), 1.2 + 7j), (1e-9, 1e12))
NOTHING = Material("air", "made up", lambda um: np.full(np.shape(um), 1 + 0j), (1e-9, 1e12))
THETA_I, THETA_O = (0, 40), tuple(range(-72, 73, 12))
NM = 600.0


def patch(**changes: Any) -> Heightfield:
    return vg.surface.gaussian(0.3, 2.0, shape=(40, 48), pitch_um=0.4, seed=3).replace(**changes)


def profile(**changes: Any) -> Heightfield:
    return vg.surface.gaussian(0.1, 1.5, shape=(1, 40), pitch_um=0.3, seed=5).replace(**changes)


def walls(**changes: Any) -> Heightfield:
    return vg.surface.lamellar(4.0, 0.5, shape=(4, 40), pitch_um=0.2).replace(**changes)


# name → surface, ℓ in µm, solver of the unit of length, what rounding of the heights may do
CASES: dict[str, tuple[Callable[..., Heightfield], float, Callable[[float], Any], float]] = {
    "kirchhoff": (patch, 6.0, lambda u: Kirchhoff(METAL, [NM * u]), 1e-6),
    "generalized Harvey-Shack": (
        patch,
        6.0,
        lambda u: Kirchhoff(METAL, [NM * u], theory="generalized-harvey-shack"),
        1e-6,
    ),
    "Harvey-Shack on walls": (walls, 3.0, lambda u: Kirchhoff(METAL, [NM * u], theory="harvey-shack"), 1e-6),
    "local Fresnel, profile": (profile, 3.0, lambda u: Kirchhoff(METAL, [NM * u], fresnel="local"), 1e-5),
    "iterated": (profile, 1.5, lambda u: IteratedKirchhoff(METAL, [NM * u], window_um=9 * u), 1e-6),
    "full wave": (profile, 1.5, lambda u: FullWave(METAL, [NM * u]), 1e-6),
    "rays, facets": (patch, 6.0, lambda u: RayOptics(METAL, [NM * u], rays=2000), 1e-6),
    "rays, binned": (patch, 6.0, lambda u: RayOptics(METAL, [NM * u], rays=2000, estimator="binning"), 1e-6),
}
FINITE = ("kirchhoff", "iterated", "full wave", "rays, facets")


def brdf(name: str, surface: Heightfield, unit: float = 1.0, mirrored: bool = False) -> np.ndarray:
    _, coherence, solver, _ = CASES[name]
    theta_i, theta_o = ([-t for t in THETA_I], [-t for t in THETA_O]) if mirrored else (list(THETA_I), list(THETA_O))
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        warnings.simplefilter("ignore", VgonioWarning)  # of Wood's anomaly and the like, as often in all units
        data = Gonioreflectometer(theta_i, theta_o, 6.0, coherence_um=coherence * unit).measure(surface, solver(unit))
    values = data["brdf"].values
    assert np.isfinite(values).all()
    assert values.min() >= 0
    return values


@lru_cache
def plain(name: str, periodic: bool) -> np.ndarray:
    return brdf(name, CASES[name][0](periodic=periodic))


def each(*, finite: bool = True) -> Any:
    cases = [(name, True) for name in CASES] + [(name, False) for name in FINITE if finite]
    return pytest.mark.parametrize(("name", "periodic"), cases)


def distance(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.abs(a - b).max() / b.max())


@pytest.mark.parametrize("unit", [1e-3, 1e3])
@each()
def test_the_unit_of_length_does_not_matter(name, periodic, unit):
    """To the last digits, but for the grid that a transform takes, which rounding may change: then within tol/100."""
    field = CASES[name][0](periodic=periodic)
    scaled = field.replace(z=field.z * unit, pitch_um=(field.dy * unit, field.dx * unit))
    assert distance(brdf(name, scaled, unit), plain(name, periodic)) < 1e-5


@pytest.mark.parametrize("offset", [-1e3, 1e9])
@each()
def test_a_constant_height_does_not_matter(name, periodic, offset):
    """Heights of nanometres are rounded to 1.2e-7 µm at 10⁹ µm: 2e-6 rad of a wave, and as much in slopes."""
    field = CASES[name][0](periodic=periodic)
    allowed = CASES[name][3] if offset == -1e3 else 2e-5
    assert distance(brdf(name, field.replace(z=field.z + offset)), plain(name, periodic)) < allowed


@pytest.mark.parametrize(
    ("name", "allowed"),
    [("kirchhoff", 1e-3), ("Harvey-Shack on walls", 1e-3), ("iterated", 1e-9), ("full wave", 1e-6)],
)
def test_the_mirror_image(name, allowed):
    """Surface and angles mirrored; Kirchhoff's grids need not be mirror images, so that tol is what holds."""
    field = CASES[name][0]()
    seen = brdf(name, field.replace(z=field.z[:, ::-1]), mirrored=True)
    assert distance(seen, plain(name, True)) < allowed


def test_rays_of_the_mirror_image():
    """Facets are cut along the other diagonal, so that only finer and finer meshes agree: on eight cells a sample."""

    def seen(field: Heightfield, sign: int) -> np.ndarray:
        gonio = Gonioreflectometer([40 * sign], [t * sign for t in THETA_O], 12.0)
        return gonio.measure(field, RayOptics(METAL, [NM], rays=20_000, refinement=8)).brdf.values

    field = patch()
    assert distance(seen(field.replace(z=field.z[:, ::-1]), -1), seen(field, 1)) < 0.02


def test_axes_exchanged():
    """x and y change places and the plane of incidence turns by 90°."""
    field = patch()
    turned = Heightfield(field.z.T, (field.dx, field.dy), periodic=True)
    solver = Kirchhoff(METAL, [NM])
    gonio = Gonioreflectometer(list(THETA_I), list(THETA_O), 6.0, coherence_um=6, phi_i_deg=90)
    assert distance(gonio.measure(turned, solver).brdf.values, plain("kirchhoff", True)) < 1e-3


# ---- values at the edge
@pytest.mark.parametrize("coherence", [1e4, 1e8, 1e12])
def test_light_more_coherent_than_the_sample_is_wide(coherence):
    """The window is the parabola that is left of the Gaussian: the same from ℓ = 10³ sample widths on."""
    field = patch(periodic=False)
    gonio = Gonioreflectometer(list(THETA_I), list(THETA_O), 6.0, coherence_um=coherence)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = gonio.measure(field, Kirchhoff(METAL, [NM])).brdf.values
    reference = Gonioreflectometer(list(THETA_I), list(THETA_O), 6.0, coherence_um=1e4)
    assert distance(found, reference.measure(field, Kirchhoff(METAL, [NM])).brdf.values) < 1e-5


def test_coherence_that_no_light_has():
    with pytest.raises(InputError, match="whole sample"):
        Gonioreflectometer([0], [0], coherence_um=1e200)


@pytest.mark.parametrize("interpolation", ["cubic", "linear", "nearest"])
def test_windows_of_too_many_samples_are_refused_before_memory_is_asked_for(interpolation):
    """12 µm at a pitch of 0.1 nm are 10¹⁰ cells: panels and cells go by the pitch, whatever the wavelength."""
    fine = Heightfield(patch().z * 1e-4, 1e-4, periodic=True, interpolation=interpolation)
    gonio = Gonioreflectometer([0], [0], 6.0, coherence_um=5e-3 if interpolation == "cubic" else 2.0)
    if interpolation == "cubic":
        assert np.isfinite(gonio.measure(fine, Kirchhoff("perfect", [1.0])).brdf).all()
    else:
        with pytest.raises(ToleranceError, match="points"):
            gonio.measure(fine, Kirchhoff("perfect", [NM]))


def test_heights_of_a_hundred_kilometres():
    far = Heightfield(np.arange(16.0).reshape(4, 4) % 3 * 1e11, 0.5, periodic=True, interpolation="nearest")
    with pytest.raises(ToleranceError, match="too large"):
        Gonioreflectometer([0, 30], list(THETA_O), 6.0, coherence_um=4).measure(far, Kirchhoff("perfect", [NM]))


@pytest.mark.parametrize("solver", [RayOptics(NOTHING, [NM], rays=2000), Kirchhoff(NOTHING, [NM], energy=True)])
def test_an_index_of_one_reflects_nothing(solver):
    data = Gonioreflectometer([0, 60], list(THETA_O), 6.0, coherence_um=6).measure(patch(), solver)
    assert float(data.brdf.max()) < 1e-20


@pytest.mark.parametrize("theta_o", [[0, 10], None])
@pytest.mark.parametrize("rays", [1, 7, 100_000])
def test_rays_with_a_tolerance_end_where_no_light_arrives(rays, theta_o):
    """A mirror seen beside its mirror direction, and a surface that reflects nothing: no number of rays is enough."""
    mirror = Heightfield(np.zeros((8, 8)), 1.0, periodic=True)
    material = "perfect" if theta_o else NOTHING
    data = Gonioreflectometer([30], theta_o, resolution_deg=20).measure(
        mirror, RayOptics(material, [NM], rays=rays, tol=0.02)
    )
    assert not data.brdf.values.any()
    assert data.attrs["error_achieved"] == np.inf
    assert int(data.rays.max()) >= rays
