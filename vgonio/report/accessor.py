"""`result.vgonio.plot_lobes()`: the pictures of `vgonio.report.plots` as methods of xarray's Dataset and DataTree.

Importing this module registers them: the parts of vgonio that hand out results (`vg.open`, `vg.simulate`, `vg.sweep`,
`vg.measure`, `vg.models`, `vg.compare`) and `vg.report` do, `import vgonio` alone does not.
"""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from typing import Any

import xarray as xr

from .plots import PLOTS, explore, page, verdict


class Pictures:
    """Pictures and pages of a result: every `plot_…` returns a matplotlib Figure, `page` and `explore` write HTML."""

    def __init__(self, result: xr.Dataset | xr.DataTree) -> None:
        self._result = result

    def __repr__(self) -> str:
        names = (name for name in dir(type(self)) if not name.startswith("_"))
        return f"<pictures of a result: {', '.join(names)}>"


def _method(function: Callable[..., Any]) -> Callable[..., Any]:
    """The function with the accessor's result in place of its first argument."""

    @functools.wraps(function)
    def method(self: Pictures, *args: Any, **kwargs: Any) -> Any:
        return function(self._result, *args, **kwargs)

    first, *others = inspect.signature(function).parameters.values()
    method.__signature__ = inspect.Signature([first.replace(name="self", annotation=first.empty), *others])  # type: ignore[attr-defined]
    return method


for _function in (*PLOTS, verdict, page, explore):
    setattr(Pictures, _function.__name__, _method(_function))

xr.register_dataset_accessor("vgonio")(Pictures)
xr.register_datatree_accessor("vgonio")(Pictures)
