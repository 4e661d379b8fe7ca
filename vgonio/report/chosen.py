"""Which parts of a result a picture takes, and the words with which it is refused where they are not there."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..errors import InputError

if TYPE_CHECKING:
    import xarray as xr

    from ..surface import Heightfield

    Result = xr.DataTree | xr.Dataset | dict[str, xr.Dataset]

SURFACE_HELP = "a whole result has it in the group 'surface', and a Heightfield is taken as well"


def tree_of(result: Result) -> xr.DataTree:
    """A whole result as it is; of a single one the tree that holds it alone."""
    import xarray as xr

    if isinstance(result, xr.DataTree) and "brdf" not in result.data_vars:
        for node in result.children.values():
            _require_one_point(node)
        return result
    name = result.name if isinstance(result, xr.DataTree) else None
    return xr.DataTree.from_dict(results_of(result), name=name)


def results_of(result: Result) -> dict[str, xr.Dataset]:
    """The BRDFs of a result, or of several by name, by name; InputError where there are none."""
    import xarray as xr

    from . import quantities as q

    if isinstance(result, dict):
        return {name: _single(name, data) for name, data in result.items()}
    if isinstance(result, xr.DataTree) and "brdf" not in result.data_vars:
        found = q.results(result)
        if not found:
            raise InputError(f"this result holds no BRDF: its groups are {', '.join(result.children) or 'none'}")
        for group in found.values():
            _require_one_point(group)
        return found
    data = result.to_dataset() if isinstance(result, xr.DataTree) else result
    if "brdf" not in data:
        raise InputError(
            f"a result with the variable 'brdf' is needed, got {', '.join(map(str, data.data_vars)) or 'no variables'}"
        )
    _require_one_point(data)
    name = result.name if isinstance(result, xr.DataTree) else None
    return q.results(xr.DataTree.from_dict({name or _name(data): _whole(data)}))


def _require_one_point(data: xr.Dataset | xr.DataTree) -> None:
    """InputError for a BRDF over swept keys, which is that of many scenes."""
    dims = data["brdf"].dims if "brdf" in data.data_vars else ()
    further = [str(d) for d in dims if d not in ("theta_i", "theta_o", "cell", "wavelength")]
    if further:
        one = ", ".join(f"{d}=0" for d in further)
        raise InputError(
            f"this is the result of a sweep over {', '.join(further)}, and one point of it is needed here: take "
            f"result.isel({one}), or plot_sweep for all"
        )


def _single(name: str, data: xr.Dataset) -> xr.Dataset:
    found = list(results_of(data).values())
    if len(found) != 1:
        raise InputError(f"{name!r}: one dataset is needed beside others, got a result of {len(found)}: name its parts")
    return found[0]


def _name(data: xr.Dataset) -> str:
    """What a dataset without a name is: measured ones say so, waves state their theory, rays split by reflections."""
    if data.attrs.get("method") == "measured":
        return "measured"
    if "theory" in data.attrs:
        return "waves"
    return "rays" if {"brdf_by_bounce", "energy_by_bounce"} & set(data.data_vars) else "measured"


def _whole(data: xr.Dataset) -> xr.Dataset:
    """Of a selection at one θᵢ or wavelength the dimension again; InputError where the detector is selected away."""
    lost = [d for d in ("theta_i", "wavelength") if d not in data["brdf"].dims and d in data.coords]
    if not {"theta_o", "cell"} & set(data["brdf"].dims):
        raise InputError(f"figures need all directions of the detector, got 'brdf' over {data['brdf'].dims}")
    for dim in lost:
        data = data.expand_dims(dim)
    if not {"theta_i", "wavelength"} <= set(data["brdf"].dims):
        raise InputError(f"figures need 'brdf' over theta_i and wavelength, got {data['brdf'].dims}")
    return data


def in_the_plane(result: Result, figure: str, instead: str = "") -> dict[str, xr.Dataset]:
    """The results in the plane of incidence; InputError where all cover a hemisphere."""
    from . import quantities as q

    found = {name: data for name, data in results_of(result).items() if q.in_plane(data)}
    if not found:
        remedy = f": use {instead}" if instead else ""
        raise InputError(f"{figure} is drawn in the plane of incidence and this result covers a hemisphere{remedy}")
    return found


def with_spectra(results: dict[str, xr.Dataset], figure: str) -> dict[str, xr.Dataset]:
    """Those of three wavelengths at least; InputError where there are none."""
    from . import quantities as q

    found = {name: data for name, data in results.items() if q.spectral(data)}
    if not found:
        most = max(data.sizes["wavelength"] for data in results.values())
        raise InputError(f"{figure} needs spectra, three wavelengths at least: this result has {most}")
    return found


def holding(result: Result, figure: str, variable: str, help: str) -> xr.Dataset:
    """The first result that holds a variable; InputError, with where it comes from, where none does."""
    for data in results_of(result).values():
        if variable in data:
            return data
    raise InputError(f"{figure} needs the variable {variable!r}, which this result does not hold: {help}")


def surface_of(result: xr.DataTree | xr.Dataset | Heightfield, figure: str, variable: str) -> xr.Dataset:
    """The summary of a surface, of a whole result, by itself, or of a Heightfield; InputError without the variable."""
    import xarray as xr

    from ..measure.surface_summary import surface_dataset
    from ..surface import Heightfield

    if isinstance(result, Heightfield):
        found = surface_dataset(result)
    elif isinstance(result, xr.DataTree):
        node = result.children.get("surface", result)
        found = node.to_dataset()
    else:
        found = result
    if variable not in found:
        raise InputError(f"{figure} needs the summary of a surface with {variable!r}: {SURFACE_HELP}")
    return found
