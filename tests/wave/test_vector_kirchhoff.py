"""Mueller matrices of waves: closed form of the mirror, the scalar theory, the rays, physical matrices."""

from __future__ import annotations

import numpy as np
import pytest

import vgonio as vg
from vgonio.errors import InputError
from vgonio.materials import material
from vgonio.surface import Heightfield
from vgonio.wave import Kirchhoff

PAULI = np.array([[[1, 0], [0, 1]], [[1, 0], [0, -1]], [[0, 1], [1, 0]], [[0, -1j], [1j, 0]]])


def measured(surface, theta_i, theta_o, name="SiO2", coherence_um=8, aperture=8.0, phi=0.0, **options):
    gonio = vg.measure.Gonioreflectometer(
        [theta_i], theta_o, aperture_deg=aperture, coherence_um=coherence_um, phi_i_deg=phi
    )
    return gonio.measure(surface, Kirchhoff(name, [500], **options)), gonio


def gaussian(sigma: float, correlation: float, n: int = 128) -> Heightfield:
    return vg.surface.gaussian(rms_um=sigma, correlation_um=correlation, shape=(n, n), pitch_um=0.5, seed=1)


@pytest.mark.parametrize("name", ["SiO2", "Al", "perfect"])
@pytest.mark.parametrize(("theta", "phi"), [(0, 0), (70, 0), (-50, 30), (0, 30)])
def test_flat_mirror(name, theta, phi):
    """J = diag(r_s, −r_p) as for the rays; the lobe's width of 1° changes Fresnel's amplitudes by a per cent."""
    flat = Heightfield(np.zeros((32, 32)), 2.5, periodic=True)
    data, gonio = measured(flat, theta, [-theta], name, coherence_um=20, phi=phi, polarised=True)
    rs, rp = (r[0] for r in material(name).amplitudes(np.cos(np.deg2rad(theta)), [500.0]))
    j = np.diag([rs, -rp])
    expected = np.einsum("iab,bc,jcd,da->ij", PAULI, j, PAULI, j.conj().T).real / 2
    found = data.mueller.values[0, 0, 0] * gonio.detector.projected_solid_angle[0]
    assert np.allclose(found, expected, atol=5e-3 * expected[0, 0])
    assert data.mueller.dims[-2:] == ("stokes_out", "stokes_in")
    assert np.allclose(data.brdf, data.mueller.sel(stokes_out="I", stokes_in="I"))


def test_gentle_slopes_agree_with_the_scalar_theory():
    """R changes by 40 % over these directions; 4 % of the peak allowed, as for Fresnel at each facet."""
    surface, angles = gaussian(0.25, 8.0), range(-68, -51, 4)
    scalar, _ = measured(surface, 60, angles)
    vector, _ = measured(surface, 60, angles, polarised=True)
    assert float(abs(scalar.brdf - vector.brdf).max() / scalar.brdf.max()) < 0.04


@pytest.mark.parametrize("polarisation", ["s", "p"])
def test_brdf_of_polarised_light(polarisation):
    surface = gaussian(0.2, 6.0, 64)
    gonio = vg.measure.Gonioreflectometer([50], [-50], aperture_deg=8, coherence_um=6, polarisation=polarisation)
    data = gonio.measure(surface, Kirchhoff("SiO2", [500], polarised=True))
    sign = {"s": 1, "p": -1}[polarisation]
    m = data.mueller.values[0, 0, 0]
    assert data.brdf.item() == pytest.approx(m[0, 0] + sign * m[0, 1])
    scalar = gonio.measure(surface, Kirchhoff("SiO2", [500]))
    assert data.brdf.item() == pytest.approx(scalar.brdf.item(), rel=0.1)


def test_matrices_are_physical():
    """The coherency matrix (Cloude 1986) of a mean over windows and cone is positive semidefinite."""
    data, _ = measured(gaussian(0.5, 4.0, 64), 30, [-60, -30, 0, 40], polarised=True)
    for m in data.mueller.values.reshape(-1, 4, 4):
        coherency = np.einsum("ij,iab,jcd->acbd", m, PAULI, PAULI.conj()).reshape(4, 4) / 4
        assert np.linalg.eigvalsh(coherency).min() > -1e-9 * m[0, 0]


def test_rays_have_the_same_matrix():
    """Oblique facets in the geometric limit, normalised by [0, 0], which is speckle: all of 16 elements to 0.06."""
    tilt = np.tan(np.deg2rad([25.0, 18.0]))
    y, x = np.meshgrid(np.arange(40) * 0.5, np.arange(40) * 0.5, indexing="ij")
    plane = Heightfield(-tilt[0] * x - tilt[1] * y, 0.5)
    n = np.array([tilt[0], tilt[1], 1.0]) / np.sqrt(1 + tilt @ tilt)
    wi = np.array([np.sin(np.deg2rad(40)), 0, np.cos(np.deg2rad(40))])
    wo = 2 * (n @ wi) * n - wi
    gonio = vg.measure.Gonioreflectometer.hemisphere([40], resolution_deg=15, coherence_um=3)
    waves = gonio.measure(plane, Kirchhoff("Al", [500], polarised=True, tol=1e-2))
    rays = gonio.measure(plane, vg.geometric.RayOptics("Al", [500], rays=2000, polarised=True))
    cell = gonio.detector.catch(wo[None])[1][0]
    a, b = (d.mueller.isel(cell=cell).values[0, 0] for d in (waves, rays))
    assert np.abs(b / b[0, 0])[0, 1] < 1
    assert np.abs(np.abs(b / b[0, 0]) - np.eye(4)).max() > 0.1  # not the unit matrix
    assert np.abs(a / a[0, 0] - b / b[0, 0]).max() < 0.06


def test_bad_input():
    with pytest.raises(InputError, match="theory 'kirchhoff'"):
        Kirchhoff(polarised=True, theory="harvey-shack")
    with pytest.raises(InputError, match="scatter"):
        Kirchhoff(polarised=True).orders(gaussian(0.1, 2.0), [0])
