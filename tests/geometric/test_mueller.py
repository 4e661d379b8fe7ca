"""Signs and frames of Mueller matrices: closed forms, Jones products, physical matrices, reciprocity.

V > 0 means E_p = i E_s under exp(−iωt) with s = n × ω/|n × ω| and p = ω × s, for both beams
(vgonio/geometric/mueller.py).
"""

from __future__ import annotations

import numpy as np
import pytest

import vgonio as vg
from vgonio.geometric import RayOptics
from vgonio.materials import fresnel, material
from vgonio.measure import Gonioreflectometer
from vgonio.surface import Heightfield

PAULI = np.array([[[1, 0], [0, 1]], [[1, 0], [0, -1]], [[0, 1], [1, 0]], [[0, -1j], [1j, 0]]])
SIGN = np.diag([1.0, 1.0, 1.0, -1.0])
FLAT = Heightfield(np.zeros((4, 4)), 1.0, periodic=True)


def of_jones(j: np.ndarray) -> np.ndarray:
    """Mueller matrix of a Jones matrix (E_s, E_p), V = 2 Im(E_s* E_p)."""
    return np.einsum("iab,bc,jcd,da->ij", PAULI, j, PAULI, j.conj().T).real / 2


def turned(phi: float) -> np.ndarray:
    """Jones rotation into axes turned from s towards p by phi."""
    return np.array([[np.cos(phi), np.sin(phi)], [-np.sin(phi), np.cos(phi)]])


def reflect(e: np.ndarray, d: np.ndarray, n: np.ndarray, index: complex) -> tuple[np.ndarray, np.ndarray]:
    """Field vectors e (3, …) that travel along d after a mirror with normal n, component by component."""
    s = np.cross(d, n)
    s = s / np.linalg.norm(s)
    out = d - 2 * (d @ n) * n
    rs, rp = fresnel(-d @ n, index)
    return rs * np.outer(s, s @ e) + rp * np.outer(np.cross(out, s), np.cross(d, s) @ e), out


def v_groove(along_x: bool = False) -> Heightfield:
    z = np.tile([0.0, 1.0], (4, 8))
    return Heightfield(z.T if along_x else z, 1.0, periodic=True, interpolation="linear")


def chiral(seed: int = 3) -> Heightfield:
    """Oblique ridges on a rough ground: no mirror symmetry in any plane, so every element of M is there."""
    rng = np.random.default_rng(seed)
    n, k = 64, np.fft.fftfreq(64)
    ground = np.fft.ifft2(np.fft.fft2(rng.normal(size=(n, n))) * np.exp(-300 * (k**2 + k[:, None] ** 2))).real
    x, y = np.meshgrid(np.arange(n), np.arange(n))
    z = 3.75 * ground / ground.std() + 3.0 * np.sin(2 * np.pi * (2 * x + 3 * y) / n)
    return Heightfield(z, 1.0, periodic=True)


def matrix(surface, theta_i, theta_o, name="SiO2", phi=0.0, aperture=2.0, rays=2000, **more):
    gonio = Gonioreflectometer([theta_i], [theta_o], aperture_deg=aperture, phi_i_deg=phi)
    data = gonio.measure(surface, RayOptics(name, [550], rays=rays, polarised=True, **more))
    assert data.mueller.dims == ("theta_i", "theta_o", "wavelength", "stokes_out", "stokes_in")
    return data.mueller.values[0, 0, 0] * gonio.detector.projected_solid_angle[0]


@pytest.mark.parametrize("name", ["SiO2", "Al"])
@pytest.mark.parametrize("theta", [0.0, 30.0, -56.0, 80.0])
@pytest.mark.parametrize("phi", [0.0, 35.0])
def test_flat_mirror(name, theta, phi, agreement):
    """J = diag(r_s, −r_p): between frames that both point away from the surface the p axis turns round."""
    rs, rp = (r[0] for r in material(name).amplitudes(np.cos(np.deg2rad(theta)), [550.0]))
    expected = of_jones(np.diag([rs, -rp]))
    error = np.abs(matrix(FLAT, theta, -theta, name, phi) - expected).max()
    agreement("Mueller matrix of a mirror, glass and aluminium", "Fresnel, closed form", error, 2e-6)


def test_flat_mirror_written_out():
    """Glass beyond Brewster's angle, element by element: M_UU changes its sign there, M_IQ > 0 as R_s > R_p."""
    s, p = (material("SiO2").reflectance(np.cos(np.deg2rad(70)), [550.0], x)[0] for x in "sp")
    m = matrix(FLAT, 70, -70)
    c = -np.sqrt(s * p)  # below Brewster's angle it is positive
    expected = [[(s + p) / 2, (s - p) / 2, 0, 0], [(s - p) / 2, (s + p) / 2, 0, 0], [0, 0, c, 0], [0, 0, 0, c]]
    assert np.allclose(m, expected, atol=2e-6)
    assert matrix(FLAT, 40, -40)[2, 2] > 0


def test_perfect_mirror_has_the_unit_matrix():
    assert np.allclose(matrix(FLAT, 60, -60, "perfect"), np.eye(4), atol=1e-12)


@pytest.mark.parametrize("phi", [0.0, 30.0, 90.0])
def test_retroreflecting_groove_turns_with_the_frame(phi, agreement):
    """Normal incidence, two hits at 45° in one plane: J = diag(r_s², −r_p²) in the groove's axes, turned by φ_i."""
    rs, rp = (r[0] for r in material("Al").amplitudes(np.cos(np.pi / 4), [550.0]))
    turn = turned(np.deg2rad(phi))
    expected = of_jones(turn @ np.diag([rs**2, -(rp**2)]) @ turn.T)
    error = np.abs(matrix(v_groove(), 0, 0, "Al", phi) - expected).max()
    agreement("Mueller matrix of two hits in one plane", "Jones product, by hand", error, 3e-6)


def test_turning_surface_and_plane_together_changes_nothing():
    """A groove along y seen with φ_i = 0 and the same along x with φ_i = 90°, oblique incidence."""
    a = matrix(v_groove(), 25, 25, "Al", 0.0, rays=20_000)
    b = matrix(v_groove(True), 25, 25, "Al", 90.0, rays=20_000)
    assert np.allclose(a / a[0, 0], b / b[0, 0], atol=1e-6)
    assert abs(a[0, 0] - b[0, 0]) < 4 * np.sqrt(0.5 / 20_000)  # the share of double paths, a binomial


@pytest.mark.parametrize("theta", [20.0, 65.0])
def test_conical_double_reflection_is_the_jones_product(theta, agreement):
    """Light along a 90° groove: every path hits both walls in skew planes and leaves in the mirror direction."""
    index = material("Al").index(550.0)
    t = np.deg2rad(theta)
    wi, wo = np.array([0, np.sin(t), np.cos(t)]), np.array([0, -np.sin(t), np.cos(t)])
    walls = np.array([[1, 0, 1], [-1, 0, 1]]) / np.sqrt(2)

    def axes(w):
        s = np.cross([0, 0, 1], w) / np.sin(t)
        return np.stack([s, np.cross(w, s)])

    expected = np.zeros((4, 4))
    for first, second in (walls, walls[::-1]):
        field, d = reflect(axes(wi).T.astype(complex), -wi, first, index)
        field, d = reflect(field, d, second, index)
        assert np.allclose(d, wo)
        expected += of_jones(axes(wo) @ field) / 2  # one half of the beam each
    # the shares of the two halves are counted with stratified starts: 1/√n is far above their error
    error = np.abs(matrix(v_groove(), theta, -theta, "Al", 90.0, rays=20_000) - expected).max() * np.sqrt(20_000)
    agreement("Mueller matrix of two hits in skew planes", "Jones product, by hand", error, 4, "/ √rays")
    assert abs(expected[2, 3]) > 0.05


@pytest.fixture(scope="module")
def rough_matrices():
    # source and detector fill equal cones: between a parallel beam and a cone single facets would break reciprocity
    gonio = Gonioreflectometer([60, -40], [60, -40], aperture_deg=6, divergence_deg=6)
    return gonio.measure(chiral(), RayOptics("Al", [450, 650], rays=400_000, polarised=True, seed=5))


def test_matrices_are_physical(rough_matrices):
    """Cloude's coherency matrix is positive semidefinite: each matrix is a sum of pure ones, so up to rounding."""
    for m in rough_matrices.mueller.values.reshape(-1, 4, 4):
        h = np.einsum("ij,iab,jcd->acbd", m, PAULI, PAULI.conj()).reshape(4, 4) / 4
        assert np.linalg.eigvalsh(h).min() > -1e-10 * m[0, 0]
        assert m[0, 0] > 0


def test_reciprocity(rough_matrices, agreement):
    """M(i → o)_jk = ε_j ε_k M(o → i)_kj with ε = (1, 1, 1, −1), all 16 elements within 4 standard errors."""
    m, e = rough_matrices.mueller.values, rough_matrices.mueller_stderr.values
    there, back = m[0, 1], SIGN @ np.swapaxes(m[1, 0], -1, -2) @ SIGN
    error = np.hypot(e[0, 1], np.swapaxes(e[1, 0], -1, -2))
    agreement(
        "reciprocity of Mueller matrices, chiral rough surface",
        "M and its transpose, signs of V",
        (there - back) / error,
        4,
        "standard errors",
    )
    # the test can fail: elements that have to change places differ by far more than their errors
    apart = np.abs(there - np.swapaxes(there, -1, -2)) / error
    assert apart.max() > 10


def test_first_row_is_what_each_polarisation_sees(rough_matrices):
    """Unpolarised light is (1, 0, 0, 0), s is (1, 1, 0, 0), p is (1, −1, 0, 0): the same rays give the same power."""
    m = rough_matrices.mueller.values
    assert np.allclose(rough_matrices.brdf, m[..., 0, 0], rtol=1e-10)
    # the stated error of brdf adds up the variances of its parts by bounce
    assert np.allclose(rough_matrices.brdf_stderr, rough_matrices.mueller_stderr[..., 0, 0], rtol=0.02)
    for polarisation, sign in (("s", 1), ("p", -1)):
        gonio = Gonioreflectometer([20, 50], [20, 50], aperture_deg=10, polarisation=polarisation)
        data = gonio.measure(chiral(), RayOptics("Al", [450, 650], rays=60_000, polarised=True, seed=5))
        m = data.mueller.values
        assert np.allclose(data.brdf, m[..., 0, 0] + sign * m[..., 0, 1], rtol=1e-10)


def test_one_axis_for_the_whole_cone_of_the_source():
    """At normal incidence a divergent beam keeps the polariser's axis: s light is s at both hits."""
    gonio = Gonioreflectometer([0], [0], aperture_deg=10, divergence_deg=4, polarisation="s")
    data = gonio.measure(v_groove(), RayOptics("SiO2", [550], rays=20_000))
    s = material("SiO2").reflectance(np.cos(np.pi / 4), [550.0], "s")[0]
    # up to 2° off the axis: a share tan 2° of the light reflects once, and R_s² changes by a few per cent
    assert np.isclose(data.energy_by_bounce.sel(bounce=2).item(), s**2, rtol=0.05)


def test_hemisphere_labels_and_file(tmp_path):
    gonio = Gonioreflectometer.hemisphere([30], resolution_deg=30)
    data = gonio.measure(chiral(), RayOptics("Al", [550], rays=3000, polarised=True))
    assert data.mueller.dims == ("theta_i", "cell", "wavelength", "stokes_out", "stokes_in")
    caught = (data.mueller[0, :, 0, 0, 0].values * gonio.detector.projected_solid_angle).sum()
    assert np.isclose(caught, data.energy_by_bounce.sum().item(), rtol=1e-9)
    for name in ("mueller", "mueller_stderr", "stokes_in", "stokes_out"):
        assert data[name].attrs["units"]
        assert data[name].attrs["long_name"]
    vg.save(data, tmp_path / "m.nc")
    again = vg.open(tmp_path / "m.nc")
    group = again if "mueller" in again else next(iter(again.children.values()))
    assert np.array_equal(group["mueller"], data.mueller)
    assert list(group["stokes_in"].values) == list("IQUV")


def test_no_matrices_unless_asked_for():
    data = Gonioreflectometer([30], [-30]).measure(FLAT, RayOptics("Al", [550], rays=100))
    assert "mueller" not in data
    assert "stokes_in" not in data.coords
