"""What the others are held against: the most trusted of what there is, said with its reason, or what was asked for."""

from __future__ import annotations

import json

import numpy as np
import pytest

import vgonio as vg
from vgonio import models
from vgonio.cli import main
from vgonio.compare import compare
from vgonio.compare.reference import TRUST, default_reference, origin
from vgonio.errors import InputError

THEORIES = ("full-wave", "iterated-kirchhoff", "kirchhoff", "generalized-harvey-shack", "harvey-shack")


def result(theory: str = "", method: str = "", **attrs):
    data = models.evaluate("lambert-1760", [0.0, 30.0], np.arange(-60.0, 61, 20), np.arange(400.0, 701, 50), k_d=0.5)
    data.attrs = {"method": method or f"waves: {theory}", **({"theory": theory} if theory else {}), **attrs}
    return data


MADE = {
    "own:waves": result("kirchhoff"),
    "own:waves_full_wave": result("full-wave"),
    "own:rays": result(method="rays: geometric optics"),
    "own:waves_iterated_kirchhoff": result("iterated-kirchhoff", bounces=3),
    "sample": result(method="measured"),
    "own:waves_generalized_harvey_shack": result("generalized-harvey-shack"),
    "own:waves_harvey_shack": result("harvey-shack"),
}
ORDER = ["sample", "own:waves_full_wave", "own:waves_iterated_kirchhoff", "own:rays", "own:waves",
         "own:waves_generalized_harvey_shack", "own:waves_harvey_shack"]  # fmt: skip


def test_the_most_trusted_that_is_left_is_the_reference():
    left, found = dict(MADE), []
    while left:
        found.append(default_reference(left))
        del left[found[-1]]
    assert found == ORDER
    assert [origin(name, MADE[name]) for name in ORDER] == list(TRUST[:7])
    # one reflection of the iterated theory is Kirchhoff's, a fit says least, and among equals the last counts
    assert origin("a", result("iterated-kirchhoff", bounces=1)) == "Kirchhoff"
    assert origin("a", result(method="fit")) == "model"
    assert default_reference({"a": MADE["sample"], "b": MADE["sample"]}) == "b"


def test_the_comparison_names_its_reference_and_why():
    found = compare({k: MADE[k] for k in ("own:rays", "own:waves_harvey_shack")})
    assert found.attrs["reference"] == "own:rays"
    assert found.attrs["reference_chosen"].startswith("rays, by default")
    assert found.pair.values.tolist() == ["own:waves_harvey_shack and own:rays"]
    asked = compare({k: MADE[k] for k in ("own:rays", "own:waves")}, reference="waves")
    assert (asked.attrs["reference"], asked.attrs["reference_chosen"]) == ("own:waves", "as asked for")
    with pytest.raises(InputError, match="did you mean"):
        compare(MADE, reference="own:wave")


def test_the_command_says_what_the_reference_is(tmp_path, capsys):
    import xarray as xr

    groups = {k.partition(":")[2]: MADE[k] for k in ("own:rays", "own:waves", "own:waves_harvey_shack")}
    vg.save(xr.DataTree.from_dict(groups), tmp_path / "own.nc")
    assert main(["compare", str(tmp_path / "own.nc")]) == 0
    first = capsys.readouterr().out.split("\n")[0]
    assert first.startswith("Reference: own:rays (rays, by default the first of measured")
    assert main(["compare", str(tmp_path / "own.nc"), "--reference", "own:waves", "--json"]) == 0
    first = json.loads(capsys.readouterr().out)[0]
    assert (first["of"], first["quantity"], first["unit"]) == ("own:waves", "reference", "as asked for")
