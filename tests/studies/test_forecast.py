"""What a sweep will take, before it begins: against the plans of all its points, one by one."""

from __future__ import annotations

import json
from types import SimpleNamespace

import numpy as np
import pytest

import vgonio as vg
from vgonio.cli import main
from vgonio.errors import InputError, MaterialError
from vgonio.studies import Store, load_study, plan_study
from vgonio.studies.forecast import GATHERED, SPREAD, START
from vgonio.studies.study import content_key


@pytest.fixture(autouse=True)
def known_machine(monkeypatch):
    """Built-in figures, and planning itself, whose seconds are this machine's, takes none."""
    monkeypatch.setenv("VGONIO_CALIBRATION", "off")
    monkeypatch.setenv("OMP_NUM_THREADS", "1")  # as workers have it
    monkeypatch.setattr("vgonio.studies.forecast.time", SimpleNamespace(process_time=lambda: 0.0))


SCENE = {
    "surface": {"generate": {"kind": "gaussian", "rms_um": 0.5, "correlation_um": 4, "shape": [32, 32], "pitch_um": 0.5,
                             "seed": 1}},
    "material": {"name": "perfect"},
    "light": {"wavelength_nm": [450, 650], "theta_i_deg": [0, 40]},
    "detector": {"theta_o_deg": [-40, 0, 40]},
    "geometric": {"rays": 1000, "estimator": "binning"},
}  # fmt: skip


def study(**vary):
    return load_study({"scene": SCENE, "vary": {k.replace("__", "."): v for k, v in vary.items()}})


@pytest.fixture
def store(tmp_path):
    return Store(tmp_path / "points")


def test_the_mean_and_the_dearest_are_those_of_all_points(store):
    """Of 40 points nine are planned, evenly spread; the dearest is found as the corner of the grid that it is."""
    made = study(
        geometric__rays=[10**4, 10**5, 10**6, 10**7],
        surface__generate__rms_um=[1.2, 0.2],
        surface__generate__seed=[1, 2, 3, 4, 5],
    )
    found = plan_study(made, store, workers=2)
    every = [vg.plan({**made.point(v).to_dict(), "output": {"file": "a.nc"}}, new_process=True) for v in made.values()]
    seconds = np.array([p.seconds - p.loading for p in every])
    assert (found.left, len(found.planned)) == (40, SPREAD)
    assert found.planned[0].seconds == pytest.approx(seconds[0])
    assert found.planned[-1].seconds == pytest.approx(seconds[-1])
    assert found.point_seconds == pytest.approx(
        seconds.mean(), rel=0.4
    )  # a sample of nine, of seconds that spread 100:1
    assert found.dearest.seconds == pytest.approx(seconds.max(), rel=0.02)  # seeds differ a little
    assert {k: found.dearest.values[k] for k in made.vary if "seed" not in k} == {
        "geometric.rays": 10**7, "surface.generate.rms_um": 1.2,
    }  # fmt: skip
    assert found.memory_bytes > max(p.memory_bytes for p in every) * 0.99


def test_libraries_are_counted_once_for_each_worker(store):
    """Twice the points are twice the work and no more libraries."""
    one, two = (plan_study(study(surface__generate__seed=list(range(n))), store, workers=2) for n in (20, 40))
    assert one.loading == two.loading > 0.3
    each = one.point_seconds
    assert each < one.loading
    assert one.seconds == pytest.approx(START + one.loading + (each / 2 + GATHERED) * 20)
    assert two.seconds - one.seconds == pytest.approx((each / 2 + GATHERED) * 20, rel=0.02)


def test_more_workers_take_less_time_and_no_more_than_there_are_points(store):
    made = study(geometric__rays=[10**7], surface__generate__seed=[1, 2, 3])
    one, three, many = (plan_study(made, store, workers=n) for n in (1, 3, 50))
    assert one.seconds > 2 * three.seconds - START
    assert (many.workers, many.seconds) == (3, three.seconds)
    with pytest.raises(InputError, match="workers"):
        plan_study(made, store, workers=0)


def test_what_is_stored_is_not_planned_again(tmp_path):
    made, store = study(surface__generate__seed=[1, 2, 3]), Store.made(tmp_path / "points")
    for left, values in zip((2, 1, 0), made.values()):
        place = store.result(content_key(made.point(values)))
        place.parent.mkdir(parents=True, exist_ok=True)
        place.touch()
        found = plan_study(made, store)
        assert (found.left if found else 0) == left
    assert found is None


def test_points_that_are_refused_are_left_out_unless_all_are(store):
    some = study(material__name=["perfect", "Xx"])
    assert [p.values["material.name"] for p in plan_study(some, store).planned] == ["perfect"]
    with pytest.raises(MaterialError, match="Xx"):
        plan_study(study(material__name=["Xx"]), store)


def test_the_command_tells_it_and_computes_nothing(tmp_path, capsys):
    text = [
        '[scene.surface]\ngenerate = { kind = "flat", shape = [16, 16], pitch_um = 0.5 }',
        '[scene.material]\nname = "perfect"',
        "[scene.light]\nwavelength_nm = [500]\ntheta_i_deg = [0]",
        "[scene.detector]\ntheta_o_deg = [0]",
        "[scene.geometric]\nrays = 100",
        '[vary]\n"geometric.rays" = [100, 200]',
    ]
    path = tmp_path / "study.toml"
    path.write_text("\n".join(text))
    assert main(["sweep", str(path), "--dry-run", "--workers", "1"]) == 0
    said = capsys.readouterr().out
    assert "What is left will take" in said
    assert "memory of a worker" in " ".join(said.split())
    assert main(["sweep", str(path), "--dry-run", "--workers", "1", "--json"]) == 0
    plan = json.loads(capsys.readouterr().out)["plan"]
    assert (plan["left"], plan["workers"]) == (2, 1)
    assert plan["seconds"] > plan["loading"] > 0
    assert not path.with_suffix(".sweep").exists()
