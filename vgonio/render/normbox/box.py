"""The Normbox (thesis 3.3.1) as a Mitsuba scene: built once, then only the sample's angle and material are changed.

Axes: x along the axis that the sample turns about, y away from the instrument, z up; the floor is z = 0, the opening is
the side y = −size/2, the instrument looks along +y. The sample's angle is 0° where its normal points up, along the
light's (parallel to the light), and 90° where it points at the instrument.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ..appearance import Appearance
from ..bsdf import spectrum

Floats = NDArray[np.float64]
ANGLES_DEG = tuple(range(30, 91, 5))
# the emitting rectangle lies this far below the ceiling, and the sample above its holder, so that neither coincides
GAP_MM = 0.1
SIGNED = ("light_offset_mm", "sample_at_mm", "instrument_offset_mm", "holder_reflectance", "closed")


@dataclass(frozen=True)
class Box:
    """Lengths in mm. Those of box, light and angles are the thesis'; the rest it does not state and is chosen here.

    size_mm : (x, y, z) inside;  light_mm : (x, y) of the light, light_offset_mm (x, y) of its centre, in the plane of
    the ceiling (chosen: the opal panel is flush);  light_points : measured spectra along x and y
    sample_mm : side of the square sample (a ColorChecker field);  sample_at_mm : its centre
    holder_mm : side of the thin plate behind it;  post_mm : side of the post below;  holder_reflectance : of
    both, diffuse black paint;  distance_mm : instrument's aperture to the sample's centre, at the same height, so that
    1° is a field of 17.5 mm;  acceptance_deg : side of the square field;  pixels : along each side of it
    closed : a sixth wall, for the energy balance
    """

    size_mm: tuple[float, float, float] = (600.0, 600.0, 600.0)
    light_mm: tuple[float, float] = (220.0, 200.0)
    light_offset_mm: tuple[float, float] = (0.0, 0.0)
    light_points: tuple[int, int] = (5, 5)
    sample_mm: float = 40.0
    sample_at_mm: tuple[float, float, float] = (0.0, 0.0, 300.0)
    holder_mm: float = 60.0
    post_mm: float = 20.0
    holder_reflectance: float = 0.04
    distance_mm: float = 1000.0
    instrument_offset_mm: tuple[float, float] = (0.0, 0.0)
    acceptance_deg: float = 1.0
    pixels: int = 10
    closed: bool = False

    def __post_init__(self) -> None:
        for f in fields(self):
            values = np.atleast_1d(np.asarray(getattr(self, f.name), dtype=np.float64))
            signed = f.name in SIGNED
            expected = np.atleast_1d(np.asarray(f.default)).size
            if values.size != expected or not np.all(np.isfinite(values)) or (not signed and np.any(values <= 0)):
                kind = "finite" if signed else "positive"
                raise InputError(f"{f.name} = {getattr(self, f.name)!r}: {expected} {kind} numbers are needed")
        self._check_places()

    def _check_places(self) -> None:
        sx, sy, sz = self.size_mm
        for length, offset, side, name in zip(self.light_mm, self.light_offset_mm, (sx, sy), "xy"):
            if abs(offset) + length / 2 > side / 2:
                raise InputError(f"light_mm = {length:g} along {name} does not fit under a ceiling of {side:g} mm")
        x, y, z = self.sample_at_mm
        reach = self.holder_mm / 2
        if abs(x) + reach > sx / 2 or abs(y) + reach > sy / 2 or not reach < z < sz - reach:
            raise InputError(f"sample_at_mm = {self.sample_at_mm}: holder and sample do not fit into the box")
        if self.sample_mm > self.holder_mm:
            raise InputError(f"sample_mm = {self.sample_mm:g} is larger than its holder, {self.holder_mm:g} mm")
        if self.distance_mm <= sy / 2 + y:
            raise InputError(f"distance_mm = {self.distance_mm:g}: the instrument stands in front of the opening")
        if not 0 <= self.holder_reflectance <= 1:
            raise InputError(f"holder_reflectance = {self.holder_reflectance:g} is not between 0 and 1")
        if self.field_mm() / np.cos(np.radians(60)) > self.sample_mm:
            raise InputError(
                f"the field of {self.field_mm():.3g} mm is larger than a sample of {self.sample_mm:g} mm seen at 60° "
                "(the sample's angle 30°): come nearer (distance_mm) or take a larger sample"
            )

    def field_mm(self) -> float:
        """Side of the field of view at the sample, across the line of sight."""
        return float(2 * self.distance_mm * np.tan(np.radians(self.acceptance_deg / 2)))

    @property
    def light_count(self) -> int:
        return int(self.light_points[0] * self.light_points[1])

    def moved(self, **changes: Any) -> Box:
        """The box with other lengths."""
        return replace(self, **changes)


def check_angle(angle_deg: float) -> float:
    if not (np.isfinite(angle_deg) and 0 < angle_deg <= 90):
        raise InputError(f"sample angle {angle_deg:g}°: allowed is 0° < angle ≤ 90° (90° faces the instrument)")
    return float(angle_deg)


class Scene:
    """A Normbox in Mitsuba's memory.

    wall : material of the walls;  sample : of the sample, replaced by `set_sample`
    light : spectral radiance (n points, n_λ) at wavelength_nm (n_λ,), x fastest from x < 0, y < 0 on
    """

    def __init__(
        self, mi: Any, box: Box, wall: Appearance, sample: Appearance, wavelength_nm: Floats, light: Floats
    ) -> None:
        if light.shape != (box.light_count, wavelength_nm.size):
            raise InputError(
                f"the light has spectra of shape {light.shape}: {box.light_count} points × {wavelength_nm.size} "
                "wavelengths are needed"
            )
        self.mi, self.box = mi, box
        self._sample_kind = _kind(sample)
        self._parts = _parts(mi, box, wall, wavelength_nm, light)
        self._angle = 90.0
        self._build(sample)

    def _build(self, sample: Appearance) -> None:
        sample_part = _sample(self.mi, self.box, self._angle, sample)
        # not merged with others of their kind: the names stay
        self.scene = self.mi.load_dict({**self._parts, "sample": sample_part}, optimize=False)
        self.parameters = self.mi.traverse(self.scene)

    def set_angle(self, angle_deg: float) -> None:
        """Turn sample and holder."""
        self._angle = check_angle(angle_deg)
        at = _turned(self.mi, self.box, self._angle)
        self._place("sample", at @ _on_plate(self.mi, self.box))
        for name, place in _plates(self.mi, self.box).items():
            self._place(name, at @ place)
        self.parameters.update()

    def _place(self, name: str, at: Any) -> None:
        self.parameters[f"{name}.to_world"] = self.mi.AffineTransform4f(at.matrix)

    def set_sample(self, sample: Appearance) -> None:
        """Another material on the sample: other values where it has the same form, else its shape is made anew."""
        # numbers of Python, as scalar variants have them, cannot be replaced in place
        if _kind(sample) != self._sample_kind or self.mi.variant().startswith("scalar"):
            self._sample_kind = _kind(sample)
            self._build(sample)
            self.set_angle(self._angle)
            return
        for key, value in sample.bsdf.items():
            if isinstance(value, dict) and "values" in value:  # other textures are part of the kind
                name = f"sample.bsdf.{key}.values"
                self.parameters[name] = type(self.parameters[name])([float(x) for x in value["values"].split(",")])
            elif not isinstance(value, dict) and f"sample.bsdf.{key}" in self.parameters:
                self.parameters[f"sample.bsdf.{key}"] = self.mi.Float(float(value))
        self.parameters.update()


def _kind(sample: Appearance) -> tuple[Any, ...]:
    """What cannot be changed in a scene that is built: plug-in, which parameters, wavelengths of spectra, words."""
    found = []
    for key, value in sorted(sample.bsdf.items()):
        if isinstance(value, dict):
            found.append((key, value.get("wavelengths") or str(value)))
        else:
            found.append((key, value if isinstance(value, str) or key == "p" else ""))
    return tuple(found)


def _turned(mi: Any, box: Box, angle_deg: float) -> Any:
    """From a sample that lies flat, facing up, to its place in the box."""
    t = mi.ScalarTransform4f()
    return t.translate(list(box.sample_at_mm)) @ mi.ScalarTransform4f().rotate([1, 0, 0], angle_deg)


def _on_plate(mi: Any, box: Box) -> Any:
    return mi.ScalarTransform4f().scale([box.sample_mm / 2, box.sample_mm / 2, 1])


def _plates(mi: Any, box: Box) -> dict[str, Any]:
    """Front and back of the holder's plate, of a sample that lies flat."""
    new, scale = mi.ScalarTransform4f, [box.holder_mm / 2, box.holder_mm / 2, 1]
    back = new().translate([0, 0, -2 * GAP_MM]).rotate([1, 0, 0], 180).scale(scale)
    return {"plate_front": new().translate([0, 0, -GAP_MM]).scale(scale), "plate_back": back}


def _sample(mi: Any, box: Box, angle_deg: float, sample: Appearance) -> dict[str, Any]:
    at = _turned(mi, box, angle_deg) @ _on_plate(mi, box)
    return {"type": "rectangle", "to_world": at, "bsdf": dict(sample.bsdf)}


def _parts(mi: Any, box: Box, wall: Appearance, wavelength_nm: Floats, light: Floats) -> dict[str, Any]:
    """Everything but the sample."""
    black = {"type": "diffuse", "reflectance": {"type": "uniform", "value": float(box.holder_reflectance)}}
    reach = box.holder_mm / 2 * np.sqrt(2)
    x, y, z = box.sample_at_mm
    height = z - reach
    new = mi.ScalarTransform4f
    post = new().translate([x, y, height / 2]).scale([box.post_mm / 2, box.post_mm / 2, height / 2])
    at = _turned(mi, box, 90.0)
    plates = {k: {"type": "rectangle", "to_world": at @ p, "bsdf": black} for k, p in _plates(mi, box).items()}
    return {
        "type": "scene",
        "paint": {**wall.bsdf, "id": "paint"},
        **_walls(mi, box),
        **_lights(mi, box, wavelength_nm, light),
        **plates,
        "post": {"type": "cube", "to_world": post, "bsdf": black},
        "instrument": _instrument(mi, box),
    }


def _walls(mi: Any, box: Box) -> dict[str, Any]:
    sx, sy, sz = box.size_mm
    new = mi.ScalarTransform4f
    places = {
        "floor": new().scale([sx / 2, sy / 2, 1]),
        "ceiling": new().translate([0, 0, sz]).rotate([1, 0, 0], 180).scale([sx / 2, sy / 2, 1]),
        "back": new().translate([0, sy / 2, sz / 2]).rotate([1, 0, 0], 90).scale([sx / 2, sz / 2, 1]),
        "left": new().translate([-sx / 2, 0, sz / 2]).rotate([0, 1, 0], 90).scale([sz / 2, sy / 2, 1]),
        "right": new().translate([sx / 2, 0, sz / 2]).rotate([0, 1, 0], -90).scale([sz / 2, sy / 2, 1]),
    }
    if box.closed:
        places["front"] = new().translate([0, -sy / 2, sz / 2]).rotate([1, 0, 0], -90).scale([sx / 2, sz / 2, 1])
    ref = {"type": "ref", "id": "paint"}
    return {name: {"type": "rectangle", "to_world": at, "bsdf": ref} for name, at in places.items()}


def light_centres(box: Box) -> Floats:
    """(n, 2) centres (x, y) in mm of the parts of the light, x fastest."""
    n = box.light_points
    x, y = ((np.arange(k) + 0.5) / k - 0.5 for k in n)
    yy, xx = np.meshgrid(y * box.light_mm[1], x * box.light_mm[0], indexing="ij")
    return np.stack([xx.ravel(), yy.ravel()], axis=1) + np.array(box.light_offset_mm)


def _lights(mi: Any, box: Box, wavelength_nm: Floats, light: Floats) -> dict[str, Any]:
    half = [box.light_mm[0] / box.light_points[0] / 2, box.light_mm[1] / box.light_points[1] / 2, 1]
    z = box.size_mm[2] - GAP_MM
    found = {}
    for k, ((x, y), values) in enumerate(zip(light_centres(box), light)):
        at = mi.ScalarTransform4f().translate([float(x), float(y), z]).rotate([1, 0, 0], 180).scale(half)
        found[f"light{k:02d}"] = {
            "type": "rectangle",
            "to_world": at,
            # the panel reflects as the walls do
            "bsdf": {"type": "ref", "id": "paint"},
            "emitter": {"type": "area", "radiance": spectrum(wavelength_nm, values)},
        }
    return found


def _instrument(mi: Any, box: Box) -> dict[str, Any]:
    x, y, z = box.sample_at_mm
    dx, dz = box.instrument_offset_mm
    at = mi.ScalarTransform4f().look_at(origin=[x + dx, y - box.distance_mm, z + dz], target=[x, y, z], up=[0, 0, 1])
    film = {"type": "hdrfilm", "width": box.pixels, "height": box.pixels, "rfilter": {"type": "box"}}
    return {
        "type": "perspective",
        "fov": box.acceptance_deg,
        "near_clip": 1.0,
        "far_clip": 10 * box.distance_mm,
        "to_world": at,
        "film": film,
    }
