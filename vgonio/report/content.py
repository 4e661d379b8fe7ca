"""What a result holds, taken apart once for the whole page."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from . import quantities as q

if TYPE_CHECKING:
    from ..surface import Heightfield

THETA_I = 40.0  # the angle of incidence that single figures show, as thesis figure 4.5


@dataclass(frozen=True)
class Content:
    """What a result holds, taken apart once for all sections."""

    title: str
    results: Mapping[str, xr.Dataset]
    comparison: xr.Dataset | None
    surface: xr.Dataset | None
    plan: Mapping[str, Any]
    provenance: Mapping[str, Any]
    scene: Any
    seconds: Mapping[str, float]
    memory_bytes: Mapping[str, float]

    @staticmethod
    def of(tree: xr.DataTree, surface: Heightfield | xr.Dataset | None = None, plan: Any = None) -> Content:
        """From a result; `surface` and `plan` take the place of what the tree lacks."""
        a = tree.attrs
        summary = surface if isinstance(surface, xr.Dataset) else None
        if surface is not None and not isinstance(surface, xr.Dataset):
            from ..measure.surface_summary import surface_dataset

            summary = surface_dataset(surface)
        if summary is None and "surface" in tree.children:
            summary = tree["surface"].to_dataset()
        plan = plan.to_dict() if hasattr(plan, "to_dict") else plan
        plan = plan if isinstance(plan, Mapping) else q.text(a.get("plan"), {})
        return Content(
            str(a.get("title") or tree.name or "Result"),
            q.results(tree),
            tree["comparison"].to_dataset() if "comparison" in tree.children else None,
            summary,
            plan if isinstance(plan, Mapping) else {},
            mapping(a.get("provenance")),
            q.text(a.get("scene")),
            mapping(a.get("seconds")),
            mapping(a.get("memory_bytes")),
        )

    @property
    def theta_i(self) -> float:
        """The angle of incidence for figures that show one: nearest to 40°, that of the first result."""
        if not self.results:
            return THETA_I
        angles = next(iter(self.results.values()))["theta_i"].values
        return float(angles[np.abs(angles - THETA_I).argmin()])

    @property
    def plane(self) -> dict[str, xr.Dataset]:
        return {name: data for name, data in self.results.items() if q.in_plane(data)}

    @property
    def sphere(self) -> dict[str, xr.Dataset]:
        return {name: data for name, data in self.results.items() if not q.in_plane(data)}

    def material(self) -> str:
        """Name of the material as the results give it, "Al" where nothing is known."""
        for data in self.results.values():
            if data.attrs.get("material"):
                return str(data.attrs["material"])
        return "Al"

    def titles(self) -> dict[str, str]:
        return {name: q.title(name, data) for name, data in self.results.items()}

    def why(self, stage: str, otherwise: str) -> str:
        """Why the plan left a stage out."""
        for s in self.plan.get("stages") or []:
            if s.get("name") == stage and not s.get("needed"):
                return str(s.get("why")) + "."
        return otherwise

    def facts(self) -> list[str]:
        """A line under the title: surface, material, angles, wavelengths."""
        found = []
        if self.surface is not None and self.surface.attrs.get("name"):
            found.append(f"surface: {self.surface.attrs['name']}")
        for data in self.results.values():
            if data.attrs.get("material"):
                found.append(f"material: {data.attrs['material']}")
                break
        for data in list(self.results.values())[:1]:
            found += [f"θᵢ {span(data['theta_i'], '°')}", detector_words(data), f"λ {span(data['wavelength'], ' nm')}"]
        return found


def mapping(value: Any) -> Mapping[str, Any]:
    found = q.text(value, {})
    return found if isinstance(found, Mapping) else {}


def span(values: xr.DataArray, unit: str) -> str:
    v = np.sort(values.values)
    if v.size == 1:
        return f"{v[0]:g}{unit}".replace("-", "−")
    return f"{v[0]:g} … {v[-1]:g}{unit} ({v.size})".replace("-", "−")


def detector_words(data: xr.Dataset) -> str:
    return f"θₒ {span(data['theta_o'], '°')}" if q.in_plane(data) else f"hemisphere of {data.sizes['cell']} cells"
