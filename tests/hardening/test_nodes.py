"""A group of a result is as good as its dataset, wherever BRDFs are compared."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from vgonio import compare
from vgonio.errors import InputError
from vgonio.measure.isotropic import IsotropicBrdf, sampled


@pytest.fixture(scope="module")
def result() -> xr.DataTree:
    """Two diffuse BRDFs of different tint, wide enough for colours and reflectances."""
    nm = np.linspace(400, 700, 7)
    groups = {}
    for name, tint in (("rays", nm / 3000), ("waves", 0.2 + 0 * nm)):
        brdf = IsotropicBrdf(nm, lambda wi, wo, tint=tint: tint * (0.5 + wi[:, 2:] * wo[:, 2:]), "")
        groups[name] = sampled(brdf, [0, 30, 60], np.arange(-80, 81, 10))
    return xr.DataTree.from_dict(groups)


PAIRS = ("align", "nse", "rmse", "nrmse", "delta_e_2000")
SINGLES = ("xyz", "reflectance", "fit_local_shift", "rgb_map")


def same(a, b) -> None:
    for one, other in zip(a if isinstance(a, tuple) else (a,), b if isinstance(b, tuple) else (b,)):
        xr.testing.assert_identical(one, other)


@pytest.mark.parametrize("name", PAIRS)
def test_groups_of_a_result_are_compared(result, name):
    function = getattr(compare, name)
    rays, waves = result["rays"], result["waves"]
    same(function(rays, waves), function(rays.to_dataset(), waves.to_dataset()))


@pytest.mark.parametrize("name", SINGLES)
def test_a_group_of_a_result_is_taken(result, name):
    function = getattr(compare, name)
    same(function(result["rays"]), function(result["rays"].to_dataset()))


def test_groups_by_name_are_compared(result):
    given = {"rays": result["rays"], "waves": result["waves"]}
    same(compare.compare(given), compare.compare({k: v.to_dataset() for k, v in given.items()}))


def test_what_is_neither_says_what_to_give(result):
    with pytest.raises(InputError, match=r"one of its groups, as in result\['rays'\]"):
        compare.rmse(result, result["waves"])
    with pytest.raises(InputError, match="the dataset that it belongs to"):
        compare.rmse(result["rays"].brdf, result["waves"].brdf)
