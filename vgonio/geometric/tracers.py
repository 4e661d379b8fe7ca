"""The tracers by name: what finds the first facet that a ray meets."""

from __future__ import annotations

from collections.abc import Callable

from ..surface.mesh import Mesh
from .embree import Embree
from .reference import Reference
from .trace import Tracer
from .warp import Warp

TRACERS: dict[str, Callable[[Mesh], Tracer]] = {"embree": Embree, "reference": Reference, "warp": Warp}
