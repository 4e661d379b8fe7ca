"""Methods and efforts for a time and an error: what is chosen, what is refused and how that is said."""

from __future__ import annotations

import json
import re
from types import SimpleNamespace

import pytest

import vgonio as vg
from vgonio.cli import main
from vgonio.errors import InputError, ToleranceError
from vgonio.planning.choice import Candidate, _cheapest, _found, _most_accurate
from vgonio.planning.plans import duration, rounded_up


@pytest.fixture(autouse=True)
def known_machine(monkeypatch):
    """Its built-in figures, and no library loaded, whatever tests ran before in this process."""
    monkeypatch.setenv("VGONIO_CALIBRATION", "off")
    monkeypatch.setattr("vgonio.planning.loading.already", lambda: {"Python"})
    # the time of planning itself counts as well, and is this machine's
    monkeypatch.setattr("vgonio.planning.choice.time", SimpleNamespace(process_time=lambda: 0.0))


def scene(**changes) -> dict:
    return {
        "surface": {"generate": {"kind": "gaussian", "rms_um": 0.3, "correlation_um": 4, "shape": [64, 64]}},
        "material": {"name": "Al"},
        "light": {"wavelength_nm": [450, 550, 650], "theta_i_deg": [0, 40], "coherence_um": 5},
        "detector": {"theta_o_deg": [-60, -40, -20, 0, 20], "aperture_deg": 4},
        "geometric": {"rays": 1000},
        "wave": {},
        **changes,
    }  # fmt: skip


# ---- the rule, on candidates made for it
def ladder(part: str, *rungs: tuple[float, float]) -> list[Candidate]:
    return [Candidate(part, {f"{part}.n": i}, seconds, error) for i, (seconds, error) in enumerate(rungs)]


RAYS, WAVES = ladder("rays", (1, 0.3), (4, 0.1), (40, 0.01)), ladder("waves", (2, 0.1), (3, 0.01), (9, 1e-4))


def test_the_cheapest_that_meets_the_tolerance():
    assert [c.seconds for c in _cheapest([RAYS, WAVES], 0.1)] == [4, 2]
    assert [c.seconds for c in _cheapest([RAYS, WAVES], 0.02)] == [40, 3]


def test_the_most_accurate_in_a_time_is_the_smallest_of_the_largest_errors():
    """Against all combinations of both ladders."""
    for seconds in (3, 5, 6, 7.5, 14, 43, 100):
        found = _most_accurate([RAYS, WAVES], seconds)
        best = min(max(r.error, w.error) for r in RAYS for w in WAVES if r.seconds + w.seconds <= seconds)
        assert max(c.error for c in found) == best
        assert sum(c.seconds for c in found) <= seconds
    assert _most_accurate([RAYS, WAVES], 2.9) is None


def test_windows_are_left_out_only_where_all_of_them_take_too_long():
    waves = [Candidate("waves", {"wave.tol": 0.1}, 10, 0.1, 0.2),
             Candidate("waves", {"wave.tol": 0.1, "wave.windows": 2}, 2, 0.1, 0.5)]  # fmt: skip
    assert _most_accurate([waves], 20) == [waves[0]]
    assert _most_accurate([waves], 5) == [waves[1]]
    assert _cheapest([waves], 0.3) == [waves[0]]
    assert _cheapest([waves], 0.6, speckled=True) == [waves[1]]


# ---- scenes
def test_a_tolerance_is_met_and_the_choice_is_in_the_result():
    tree = vg.simulate(scene(), tol=0.02)
    for group in ("rays", "waves"):
        assert tree[group].attrs["error_achieved"] <= 0.02
    plan, kept = json.loads(tree.attrs["plan"]), json.loads(tree.attrs["scene"])
    assert plan["chosen"]["geometric.tol"] == kept["geometric"]["tol"] <= 0.02
    assert plan["chosen"]["wave.tol"] == kept["wave"]["tol"] <= 0.02
    assert {a["part"] for a in plan["alternatives"] if a["chosen"]} == {"rays", "waves"}
    assert kept["light"] == json.loads(vg.plan(scene()).to_json())["chosen"] | kept["light"]  # questions stay


def test_a_finer_tolerance_takes_longer_and_more_time_gives_less_error():
    coarse, fine = (vg.plan(scene(), tol=t) for t in (0.1, 1e-3))
    assert fine.seconds > coarse.seconds
    short, long = (vg.plan(scene(), max_seconds=s) for s in (20, 2000))
    assert long.error <= short.error
    assert short.seconds < 20


def test_theories_and_their_options_stay():
    asked = {"theory": ["harvey-shack", "kirchhoff"], "shadowing": False, "energy": True}
    tree = vg.simulate(scene(geometric=None, wave=asked), tol=0.05)
    kept = json.loads(tree.attrs["scene"])["wave"]
    assert {k: kept[k] for k in asked} == asked
    assert set(tree.children) >= {"waves", "waves_kirchhoff"}


def test_methods_that_a_scene_names_stay():
    made = vg.plan(scene(geometric={"rays": 10, "estimator": "binning"}, wave={"method": "opencl"}), tol=0.1)
    assert made.chosen["geometric.estimator"] == "binning"
    assert made.chosen["wave.method"] == "opencl"


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"max_seconds": 0.5}, ("0.5 s is too short", "rays", "waves", "all else", "Allow")),
        ({"max_seconds": 1.0, "tol": 1e-3}, ("0.1 % in 1.0 s cannot be had", "Allow", "fewer angles")),
    ],
)
def test_what_cannot_be_had_is_refused_before_any_work(given, words):
    with pytest.raises(ToleranceError) as refused:
        vg.simulate(scene(), **given, progress=lambda part, share: part == "surface" or pytest.fail("work was begun"))
    for word in words:
        assert word in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_theory_whose_error_has_a_floor_says_so():
    profile = {"generate": {"kind": "sinusoid", "period_um": 8, "amplitude_um": 0.4, "shape": [2, 320]}}
    wave = {"theory": "iterated-kirchhoff"}
    with pytest.raises(ToleranceError, match=r"tol = 0.001 cannot be met: the waves reach 1 % at best"):
        vg.plan(scene(surface=profile, geometric=None, wave=wave), tol=1e-3)


@pytest.mark.parametrize("given", [{"max_seconds": 0}, {"max_seconds": -3}, {"tol": 0}, {"tol": 2}, {"tol": "x"}])
def test_times_and_tolerances_that_are_none_are_refused(given):
    with pytest.raises(InputError):
        vg.plan(scene(), **given)


def test_a_scene_that_simulates_nothing_is_refused():
    with pytest.raises(InputError, match="scenes that simulate"):
        vg.plan(scene(geometric=None, wave=None), tol=0.1)


def test_the_command_refuses_in_one_line_and_tells_what_it_chose(tmp_path, capsys):
    path = tmp_path / "scene.toml"
    assert main(["init", str(path)]) == 0
    small = ["--set", "surface.generate.shape=[64, 64]", "--set", "light.theta_i_deg=[0]", "--set", "output={}"]
    capsys.readouterr()
    assert main(["simulate", str(path), "--max-seconds", "0.2", *small, "-o", str(tmp_path / "a.nc")]) == 2
    said = capsys.readouterr()
    assert said.err.count("\n") == 1
    assert "too short" in said.err
    assert not (tmp_path / "a.nc").exists()
    assert main(["plan", str(path), "--tol", "0.05", *small]) == 0
    out = capsys.readouterr().out
    assert "what else would have cost" in out
    assert max(map(len, out.splitlines()[:-1])) <= 118
    assert main(["simulate", str(path), "--tol", "0.05", *small, "-o", str(tmp_path / "a.nc")]) == 0
    assert "chosen: wave.tol = 0.05" in capsys.readouterr().out


@pytest.mark.parametrize("given", [{"max_seconds": 0.5}, {"max_seconds": 1.0, "tol": 1e-3}, {"max_seconds": 1.0}])
def test_the_time_that_a_refusal_advises_is_enough(given):
    with pytest.raises(ToleranceError) as refused:
        vg.plan(scene(), **given)
    said = str(refused.value)
    assert "with the fifth kept in hand" in said
    expected, kept = (float(x) for x in re.search(r"([\d.]+) s expected in all, ([\d.]+) s with", said).groups())
    assert kept == pytest.approx(1.25 * expected, abs=0.2)
    advised = float(re.search(r"Allow ([\d.]+) s", said)[1])
    assert advised >= kept
    assert vg.plan(scene(), **{**given, "max_seconds": advised}).seconds < advised


@pytest.mark.parametrize(
    ("value", "up"), [(10.02, 11), (10, 10), (0.101, 0.11), (9.91, 10), (129, 130), (3.21e-6, 3.3e-6)]
)
def test_advice_is_rounded_up(value, up):
    assert rounded_up(value) == up


@pytest.mark.parametrize(
    ("seconds", "words"),
    [(7.96, "8.0 s"), (119, "119 s"), (600, "10 min"), (49320, "13.7 h"), (1e6, "12 days"),
     (325407.1 * 3600, "37 years"), (1e14, "3,200,000 years")],
)  # fmt: skip
def test_long_times_are_in_days_and_years(seconds, words):
    assert duration(seconds) == words


# ---- what no computer gives
RAYS_ALONE = {"wave": None, "geometric": {"estimator": "binning"}}


@pytest.mark.parametrize("tol", [1e-30, 1e-13])
def test_waves_below_double_precision_are_refused(tol):
    with pytest.raises(ToleranceError, match="the waves reach 1e-10 % at best .* take tol = 1e-12"):
        vg.plan(scene(geometric=None), tol=tol)
    with pytest.raises(ToleranceError, match="double precision gives 1e-12 at best"):
        vg.plan(scene(wave={"tol": tol}))


@pytest.mark.parametrize("tol", [1e-30, 1e-12, 1e-6])
def test_numbers_of_rays_that_cannot_be_had_are_refused(tol):
    """And what the refusal advises is accepted, with no more than 10¹¹ rays."""
    with pytest.raises(ToleranceError, match="the rays reach .* at best") as refused:
        vg.plan(scene(**RAYS_ALONE), tol=tol)
    advised = float(re.search(r"take tol = ([\d.e-]+)", str(refused.value))[1])
    assert tol < advised < 1e-3
    assert vg.plan(scene(**RAYS_ALONE), tol=advised).chosen["geometric.rays"] * 2 <= 10**11


def test_single_precision_promises_no_more_than_it_gives():
    assert vg.plan(scene(geometric=None, wave={"tol": 1e-9, "method": "opencl"})).error == 1e-5


def test_at_equal_cost_the_tolerance_is_the_one_asked_for():
    rays = [Candidate("rays", {"geometric.tol": t}, 1.0, t) for t in (0.3, 0.05, 0.001)]
    assert _cheapest([rays], 0.05) == [rays[1]]


class FewRays:
    """Instead of a simulation: a result of rays with an error of 0.0042 and a plan of two minutes."""

    def __init__(self, monkeypatch, seconds: float = 120.0) -> None:
        from vgonio import simulation

        monkeypatch.setattr(simulation, "simulate", self)
        self.seconds = seconds

    def __call__(self, scene, planned, **given):
        import xarray as xr

        from vgonio.planning import Plan, Stage

        made = Plan("t", (Stage("trace", True, "", seconds=self.seconds),), machine="here")
        planned(made)
        tree = xr.DataTree()
        tree["rays"] = xr.DataTree(xr.Dataset(attrs={"tolerance_asked": 0.001, "error_achieved": 0.0042}))
        tree.attrs = {"title": "t", "plan": made.to_json(), "seconds": '{"rays": 1.0}'}
        return tree


@pytest.mark.parametrize(
    ("options", "warned"),
    [
        (["--tol", "0.05", "--max-seconds", "20"], False),
        (["--max-seconds", "20"], False),
        (["--tol", "0.004"], True),
        (["--set", "geometric.tol=0.05"], False),
        (["--set", "geometric.tol=0.001"], True),
    ],
)
def test_the_rays_warn_only_where_the_user_asked_for_less(monkeypatch, tmp_path, capsys, options, warned):
    FewRays(monkeypatch)
    path = tmp_path / "scene.toml"
    main(["init", str(path)])
    assert main(["simulate", str(path), "-o", str(tmp_path / "a.nc"), *options]) == 0
    assert ("raise geometric.rays" in capsys.readouterr().err) == warned


@pytest.mark.parametrize(("seconds", "quiet", "said"), [(120, [], True), (59, [], False), (120, ["--quiet"], False)])
def test_long_runs_say_first_how_long(monkeypatch, tmp_path, capsys, seconds, quiet, said):
    FewRays(monkeypatch, seconds)
    path = tmp_path / "scene.toml"
    main(["init", str(path)])
    assert main(["simulate", str(path), "-o", str(tmp_path / "a.nc"), *quiet]) == 0
    assert ("expected time: 2 min (here)" in capsys.readouterr().err) == said


# ---- what of a scene fits, where all of it does not
def test_a_refusal_tells_what_can_be_had_in_the_time():
    """What it offers is accepted in that time, as it is offered; what it does not offer is refused."""
    given = scene(wave={"theory": ["kirchhoff", "harvey-shack"], "shadowing": True})
    whole = vg.plan(given, tol=0.01).seconds
    seconds = 1.25 * whole * 0.7
    offers = {
        "without [wave]": {**given, "wave": None},
        "without [geometric]": {**given, "geometric": None},
        'with theory = "kirchhoff" alone': {**given, "wave": {**given["wave"], "theory": "kirchhoff"}},
        'with theory = "harvey-shack" alone': {**given, "wave": {**given["wave"], "theory": "harvey-shack"}},
    }
    with pytest.raises(ToleranceError, match="What was asked for can be had") as refused:
        vg.plan(given, tol=0.01, max_seconds=seconds)
    offered = [words for words in offers if words in str(refused.value)]
    assert "without [wave]" in offered
    for words, smaller in offers.items():
        if words in offered:
            assert vg.plan(smaller, tol=0.01, max_seconds=seconds).seconds < seconds
        else:
            with pytest.raises(ToleranceError):
                vg.plan(smaller, tol=0.01, max_seconds=seconds)


def test_a_tolerance_that_one_theory_cannot_meet_is_offered_without_it():
    profile = {
        "generate": {"kind": "sinusoid", "period_um": 8, "amplitude_um": 0.2, "shape": [1, 160], "pitch_um": 0.1}
    }
    wave = {"theory": ["kirchhoff", "iterated-kirchhoff"]}
    with pytest.raises(ToleranceError, match="the waves reach 1 % at best") as refused:
        vg.plan(scene(surface=profile, geometric=None, wave=wave), tol=1e-3)
    assert 'can be had with theory = "kirchhoff" alone' in str(refused.value)
    assert '"iterated-kirchhoff" alone' not in str(refused.value)


def test_nothing_is_offered_where_nothing_fits():
    with pytest.raises(ToleranceError) as refused:
        vg.plan(scene(), max_seconds=0.1)
    assert "can be had" not in str(refused.value)


def test_the_error_that_is_reached_holds_the_speckle_of_windows_left_out():
    """A smaller error than the one that was refused would be no reason to refuse it."""
    waves = [Candidate("waves", {"wave.tol": 0.003}, 10, 0.003, 0.2),
             Candidate("waves", {"wave.tol": 0.003, "wave.windows": 2}, 2, 0.003, 0.5)]  # fmt: skip
    with pytest.raises(ToleranceError, match=r"an error of 50 % is reached, its speckle included \(windows = 2\)"):
        _found([waves], 0.1, 5, 0.02)


def test_more_time_takes_no_patch_that_adds_more_speckle_than_it_takes_away():
    plain = Candidate("waves", {"wave.tol": 0.03}, 1, 0.09, 0.4)
    large = Candidate("waves", {"wave.tol": 0.03, "wave.window_um": 50.0}, 2, 0.02, 0.7, added=0.57)
    good = Candidate("waves", {"wave.tol": 0.03, "wave.window_um": 20.0}, 2, 0.02, 0.4001, added=0.01)
    assert _most_accurate([[plain, large]], 100) == [plain]
    assert _most_accurate([[plain, large, good]], 100) == [good]
    assert _cheapest([[plain, large]], 0.05) == [large]  # what was asked for is the numerical error
