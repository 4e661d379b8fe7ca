"""Closest hits by Embree 4 (Wald 2014)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..errors import BackendError
from ..surface.mesh import Mesh

Floats = NDArray[np.float64]


class Embree:
    """Closest-hit queries on a mesh by Embree 4 (Wald 2014), watertight mode."""

    name = "embreex, robust mode"
    device = "CPU"

    def __init__(self, mesh: Mesh) -> None:
        try:
            from embreex.mesh_construction import TriangleMesh
            from embreex.rtcore_scene import EmbreeScene
        except ImportError as e:
            raise BackendError(f"embreex cannot be loaded ({e}): pip install embreex") from None
        # single precision counts from the middle of the mesh
        self.origin = mesh.middle
        self.scene = EmbreeScene(robust=True)
        self.geometry = TriangleMesh(self.scene, (mesh.vertices - self.origin).astype(np.float32), mesh.faces)

    def facet(self, position: Floats, direction: Floats) -> NDArray[np.int32]:
        """(n,) index of the first facet hit, −1 for none."""
        if len(position) == 0:
            return np.zeros(0, np.int32)
        single = np.empty(position.shape, np.float32)
        for axis in range(3):  # by columns: numpy's inner loop would be three numbers long
            np.subtract(position[:, axis], self.origin[axis], out=single[:, axis], casting="same_kind")
        return self.scene.run(single, direction.astype(np.float32))
