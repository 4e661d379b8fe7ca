"""All points of a study as one result over the swept dimensions."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from ..dataset import COORDINATES, VARIABLES
from ..errors import InputError, VgonioError
from .store import Store
from .stored import read_point, unit
from .study import Study, content_key

# a name that says too little by itself takes the name of its table along
VAGUE = {"name", "file", "kind", "format", "theory", "method", "level", "tol", "seed"}
# what the results themselves name so: rays, windows, fresnel, …
TAKEN = {*COORDINATES, *VARIABLES, "point", "state", "reason", "seconds"}
LARGEST = 4e9  # bytes: beyond it the one dataset is for a computer with more memory, the points are there one by one
STATES = ("done", "failed", "not computed")  # of a point, by number


def gather(study: Study, store: Store) -> xr.DataTree:
    """The tree of a study: groups `rays`, `waves`, … of its points over the swept dims, NaN where a point is missing.

    Root: state (0 done, 1 failed, 2 not computed), reason, seconds, all over the swept dims, which are named after the
    keys; with zip = true there is one dim `point`. Group `surfaces`: each point's surface parameters. Coordinates that
    differ between points are united. Raises InputError where it would take more than 4 GB.
    """
    points = [_state(study, store, values) for values in study.values()]
    dims, coords = swept_dims(study)
    shape = study.shape
    root = xr.Dataset(
        {
            "state": (dims, np.array([p[0] for p in points], np.int8).reshape(shape)),
            "reason": (dims, np.array([p[1] for p in points], object).reshape(shape)),
        },
        coords=coords,
        attrs={"title": study.title, "vary": json.dumps(dict(study.vary)), "scene": study.scene.to_json()},
    )
    root["state"].attrs = {"units": "1", "long_name": ", ".join(f"{n} {s}" for n, s in enumerate(STATES))}
    root["reason"].attrs = {"units": "", "long_name": "why a point failed"}
    files = [store.result(p[2]) if p[0] == 0 else None for p in points]
    groups = _filled(files, dims, shape, coords)
    if "seconds" in groups:
        root["seconds"] = groups.pop("seconds")["seconds"]
    return xr.DataTree.from_dict({"/": root, **groups})


def _state(study: Study, store: Store, values: Mapping[str, Any]) -> tuple[int, str, str]:
    try:
        key = content_key(study.point(values))
    except VgonioError as e:
        return 1, str(e), ""
    if store.has(key):
        return 0, "", key
    failed = store.why_failed(key)
    return (1, str(failed["reason"]), key) if failed else (2, "", key)


def swept_dims(study: Study) -> tuple[tuple[str, ...], dict[str, Any]]:
    """Names of the swept dims and their coordinates; side by side, all keys are coordinates of `point`."""
    names = dict(zip(study.vary, _short_names(list(study.vary))))
    dims = ("point",) if study.zipped else tuple(names.values())
    coords: dict[str, Any] = {"point": np.arange(len(study))} if study.zipped else {}
    for key, name in names.items():
        attrs = {"units": unit(key), "long_name": key}
        coords[name] = ("point" if study.zipped else name, _coordinate(study.vary[key]), attrs)
    return dims, coords


def _short_names(keys: Sequence[str]) -> list[str]:
    """The shortest ends of the keys that say enough and differ."""
    names = []
    for key in keys:
        parts = key.split(".")
        count = 1
        while count < len(parts) and _ambiguous("_".join(parts[-count:]), parts[-count:], key, keys):
            count += 1
        name = "_".join(parts[-count:])
        names.append(f"{name}_swept" if name in TAKEN else name)
    return names


def _ambiguous(name: str, end: list[str], key: str, keys: Sequence[str]) -> bool:
    others = [k for k in keys if k != key and k.split(".")[-len(end) :] == end]
    return name in VAGUE | TAKEN or bool(others)


def _coordinate(values: Sequence[Any]) -> np.ndarray:
    if all(isinstance(v, (int, float)) and not isinstance(v, bool) for v in values):
        return np.asarray(values)
    return np.asarray([v if isinstance(v, str) else json.dumps(v) for v in values], dtype=object)


# ---- filling
def _filled(files: Sequence[Any], dims: tuple[str, ...], shape: tuple[int, ...], coords: Any) -> dict[str, xr.Dataset]:
    """The groups over the swept dims, in two passes: what there is, then its values."""
    indices: dict[str, dict[str, np.ndarray]] = {}
    kinds: dict[tuple[str, str], tuple[tuple[str, ...], dict[str, Any]]] = {}
    extras: dict[str, dict[str, xr.DataArray]] = {}
    for _, name, data in _parts(files):
        known = indices.setdefault(name, {})
        for dim in map(str, data.dims):
            values = data[dim].values
            known[dim] = np.union1d(known[dim], values) if dim in known else np.unique(values)
        for variable in data.data_vars.values():
            kinds.setdefault((name, str(variable.name)), (tuple(map(str, variable.dims)), dict(variable.attrs)))
        extras[name] = {str(k): c for k, c in data.coords.items() if k not in data.dims}
    _check_size(indices, kinds, shape)
    arrays = {
        place: np.full(shape + tuple(indices[place[0]][d].size for d in kind[0]), np.nan)
        for place, kind in kinds.items()
    }
    for i, name, data in _parts(files):
        _put(arrays, kinds, indices[name], np.unravel_index(i, shape), name, data)
    return {
        name: xr.Dataset(
            {v: ((*dims, *kind[0]), arrays[g, v], kind[1]) for (g, v), kind in kinds.items() if g == name},
            coords={**coords, **known, **_constant(extras[name], known)},
        )
        for name, known in indices.items()
    }


def _parts(files: Sequence[Any]) -> Iterator[tuple[int, str, xr.Dataset]]:
    """(point, group, numbers of it) of the results that are there."""
    for i, file in enumerate(files):
        for name, data in (read_point(file) if file is not None else {}).items():
            yield i, name, data


def _constant(extras: Mapping[str, xr.DataArray], known: Mapping[str, np.ndarray]) -> dict[str, xr.DataArray]:
    """Further coordinates (solid angles, φ), where all points have the same grid of directions."""
    return {k: c for k, c in extras.items() if all(c.sizes[d] == known[str(d)].size for d in c.dims)}


def _put(arrays: Any, kinds: Any, known: Mapping[str, np.ndarray], place: Any, name: str, data: xr.Dataset) -> None:
    for variable in data.data_vars.values():
        dims = kinds[name, str(variable.name)][0]
        if tuple(variable.dims) != dims:
            raise InputError(
                f"{variable.name} of {name} has dims {variable.dims} in one point and {dims} in another: "
                "sweep such keys apart"
            )
        array = arrays[name, str(variable.name)]
        if dims:
            array[place][np.ix_(*(np.searchsorted(known[d], data[d].values) for d in dims))] = variable.values
        else:
            array[place] = variable.values


def _check_size(indices: Any, kinds: Any, shape: tuple[int, ...]) -> None:
    size = sum(
        8.0 * np.prod(shape) * np.prod([indices[g][d].size for d in dims]) for (g, _), (dims, _) in kinds.items()
    )
    if size > LARGEST:
        raise InputError(
            f"all points together take {size / 1e9:.0f} GB, at most {LARGEST / 1e9:.0f} GB go into one result: they "
            "are stored one by one in the folder of the sweep, gather a part of the study"
        )
