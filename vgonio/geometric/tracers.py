"""The tracers by name: what finds the first facet that a ray meets."""

from __future__ import annotations

from collections.abc import Callable

from ..surface.mesh import Mesh
from .embree import Embree
from .trace import Tracer

TRACERS: dict[str, Callable[[Mesh], Tracer]] = {"embree": Embree}
