"""The mesh covers its box once, faces the light, and walls face their open side."""

import numpy as np
import pytest

from vgonio.errors import InputError
from vgonio.surface import Heightfield
from vgonio.surface.mesh import mesh, mirrored


@pytest.mark.parametrize("kind", ["cubic", "linear", "nearest"])
@pytest.mark.parametrize("periodic", [True, False])
def test_projected_area(kind, periodic, rng):
    surface = Heightfield(rng.normal(size=(6, 8)), (0.5, 0.25), periodic=periodic, interpolation=kind)
    m = mesh(surface)
    x, y = m.vertices[:, 0], m.vertices[:, 1]
    covered = (x.max() - x.min()) * (y.max() - y.min())
    assert np.isclose((m.areas * m.normals[:, 2]).sum(), covered, rtol=1e-12)
    assert m.normals[:, 2].min() >= 0


def test_vertices_are_the_samples(rng):
    z = rng.normal(size=(5, 7))
    m = mesh(Heightfield(z, 1.0))
    assert np.allclose(m.vertices[:, 2], z.ravel(), atol=1e-12)


@pytest.mark.parametrize("axis", [0, 1])
def test_walls_face_the_lower_side(axis):
    z = np.array([[0.0, 1.0, -1.0, 2.0]] * 3)
    m = mesh(Heightfield(z if axis == 1 else z.T, 1.0, interpolation="nearest"))
    walls = m.normals[:, 2] < 0.5
    position = m.vertices[m.faces[walls, 0], 1 - axis]
    # rises at 1 and 3 (normal against the axis), falls at 2
    assert np.array_equal(np.sign(m.normals[walls, 1 - axis]), np.where(position == 2, 1, -1))


def test_refinement_approaches_the_interpolant():
    """Sagitta of a chord falls with the square of its length: the largest error goes down by 4 at each halving."""
    x = (np.arange(32) + 0.5) / 32
    surface = Heightfield(np.sin(2 * np.pi * x)[None].repeat(4, 0), 1 / 32, periodic=True)
    errors = []
    for refinement in (1, 2, 4):
        m = mesh(surface, refinement)
        centre = m.vertices[m.faces].mean(axis=1)
        errors.append(np.abs(centre[:, 2] - surface.interpolant.at(centre[:, 0], centre[:, 1])).max())
    assert np.allclose(np.log2(errors[0] / errors[1]), 2, atol=0.2)
    assert np.allclose(np.log2(errors[1] / errors[2]), 2, atol=0.2)


def test_mirrored_is_periodic_and_continuous(rng):
    m = mirrored(Heightfield(rng.normal(size=(4, 5)), 1.0))
    assert m.periodic
    assert np.array_equal(m.z[:, 4], m.z[:, 5])
    assert np.array_equal(m.z[0], m.z[-1])


def test_a_line_has_no_area():
    with pytest.raises(InputError, match="no area"):
        mesh(Heightfield(np.zeros((1, 9)), 1.0))
