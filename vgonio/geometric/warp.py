"""Closest hits by NVIDIA Warp: on a CUDA device where there is one, otherwise on the processor, one thread.

Tested on the processor; on CUDA that everything is asked of the right device, but neither results nor speed were
measured there.
"""

from __future__ import annotations

from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import BackendError
from ..surface.mesh import Mesh

Floats = NDArray[np.float64]


def device_name(cuda_devices: int) -> str:
    """The first CUDA device where there is one, else the processor."""
    return "cuda:0" if cuda_devices else "cpu"


class Warp:
    """Mesh queries in single precision; `device` is "cuda:0" or "cpu"."""

    name = "warp"

    def __init__(self, mesh: Mesh) -> None:
        try:
            import warp as wp

            wp.config.log_level = 40  # errors only
            wp.init()
            from .warp_kernel import closest
        except ImportError as e:
            raise BackendError(f"Warp cannot be loaded ({e}): pip install 'vgonio[gpu]'") from None
        self.wp, self.kernel = wp, closest
        self.device = device_name(wp.get_cuda_device_count())
        self.origin = mesh.middle
        self.reach = 4 * float(np.linalg.norm(mesh.vertices.max(axis=0) - mesh.vertices.min(axis=0)))
        points: Any = wp.array((mesh.vertices - self.origin).astype(np.float32), dtype=wp.vec3, device=self.device)
        indices: Any = wp.array(mesh.faces.ravel(), dtype=wp.int32, device=self.device)
        self.mesh = wp.Mesh(points=points, indices=indices)
        self.lock = Lock()

    def facet(self, position: Floats, direction: Floats) -> NDArray[np.int32]:
        """(n,) index of the first facet hit, −1 for none."""
        wp, n = self.wp, len(position)
        if n == 0:
            return np.zeros(0, np.int32)
        with self.lock:
            start = wp.array((position - self.origin).astype(np.float32), dtype=wp.vec3, device=self.device)
            along = wp.array(np.ascontiguousarray(direction, np.float32), dtype=wp.vec3, device=self.device)
            facet = wp.empty(n, dtype=wp.int32, device=self.device)
            inputs = [self.mesh.id, start, along, self.reach, facet]
            wp.launch(self.kernel, dim=n, inputs=inputs, device=self.device)
            return np.array(facet.numpy(), np.int32)
