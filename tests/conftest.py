"""Fixtures that all tests share."""

from __future__ import annotations

import csv
import datetime
import json
import os
import platform
import shutil
import signal
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[1]
RECORDS = ROOT / "out" / "validated.json"
YARDSTICK_SECONDS = 0.0345  # of the fixture `pace`, on one free core of the machine of vgonio.accuracy.built_in
# files that take long, or wait for the network or for other processes: first, so that no worker ends with one of them
FIRST = (
    "packaging", "test_notebooks.py", "test_docs.py", "test_docs_run.py", "test_benchmarks.py", "hardening", "studies",
    "planning/test_forecast.py", "render/test_normbox", "test_examples.py", "test_left_out.py", "wave/iterated",
)  # fmt: skip
# plans are those of any machine, not of the one somebody has calibrated; what is about calibrations sets its own
os.environ["VGONIO_CALIBRATION"] = "off"


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder with real measurements; tests that need it skip where it is absent."""
    folder = Path(os.environ.get("VGONIO_SHARED", ROOT / ".." / "shared")).resolve()
    if not (folder / "data").is_dir():
        pytest.skip(f"no measurements at {folder}: set VGONIO_SHARED to the folder that has data/")
    return folder


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(20221101)


@pytest.fixture
def pace() -> Callable[[Callable[[], Any]], float]:
    """pace(work): processor seconds of `work`, as they would be on the machine that built-in forecasts are of.

    The least of three runs, over how many times longer than there a little numpy takes here and now: so a slow machine,
    a fast one and a busy one find nearly the same.
    """

    def least(work: Callable[[], Any], times: int) -> float:
        taken = []
        for _ in range(times):
            begin = time.process_time()
            work()
            taken.append(time.process_time() - begin)
        return min(taken)

    def yardstick() -> None:
        x = np.random.default_rng(0).uniform(-1e3, 1e3, 300_000)
        waves = np.exp(1j * x)
        (waves + np.exp(-1j * x)).sum()
        np.fft.fft(waves[: 1 << 18])
        np.matmul(x[:90_000].reshape(300, 300), x[-90_000:].reshape(300, 300))

    def measured(work: Callable[[], Any]) -> float:
        before = least(yardstick, 5)
        took = least(work, 3)
        return took * YARDSTICK_SECONDS / max(min(before, least(yardstick, 5)), 1e-6)

    return measured


# ---- the table "validated against": docs/validated.py makes it from what this fixture records
@pytest.fixture(scope="session")
def printed() -> dict[str, float]:
    """Quantity → share of its limit, of the rows of docs/validated.csv that have a limit from above."""
    file = ROOT / "docs" / "validated.csv"
    if not file.exists():
        return {}
    with file.open(encoding="utf-8", newline="") as stream:
        rows = [r for r in csv.DictReader(stream) if not r["achieved_from"]]
    return {r["quantity"]: float(r["achieved"]) / max(float(r["allowed"]), 1e-300) for r in rows}


@pytest.fixture
def agreement(request: pytest.FixtureRequest, printed: dict[str, float]) -> Callable[..., None]:
    """`agreement("quantity", "against", achieved, allowed, unit)`: asserts, and makes a row of the table of proofs.

    quantity, against : plain strings, as the table prints them; calls of one quantity become one row
    achieved : a number or an array of them; allowed : the most that it may be in size, a number or an array of them, or
        two numbers in a tuple, between which all of `achieved` must lie (±inf where a side is open)
    unit : "" or what is printed behind both, such as "standard errors" or "%"

    A share of the limit ten times that of the figure in print fails as well (of limits from above; below 1e-3 it is
    rounding): the table keeps its word, or `make validated` renews it.
    """

    def check(quantity: str, against: str, achieved: Any, allowed: Any, unit: str = "") -> None:
        found = np.asarray(achieved, dtype=float)
        record = {"quantity": quantity, "against": against, "unit": unit, "cases": int(found.size)}
        if isinstance(allowed, tuple):
            low, high = (float(a) for a in allowed)
            assert np.all((low <= found) & (found <= high)), f"{quantity}: {found} is not within {allowed} {unit}"
            record |= {"achieved_from": float(found.min()), "achieved": float(found.max())}
            record |= {"allowed_from": low, "allowed": high}
        else:
            found, limit = (a.ravel() for a in np.broadcast_arrays(np.abs(found), np.asarray(allowed, dtype=float)))
            assert np.all(found <= limit), f"{quantity}: {found.max()} {unit} is above {limit.max()} {unit}"
            worst = int(np.argmax(found / np.maximum(limit, 1e-300)))
            record |= {"achieved_from": None, "achieved": float(found[worst])}
            record |= {"allowed_from": None, "allowed": float(limit[worst])}
        request.node.user_properties.append(("agreement", record))
        if record["allowed_from"] is None and quantity in printed:
            share = record["achieved"] / max(record["allowed"], 1e-300)
            said = f"{quantity}: {share:.2g} of what is allowed, and {printed[quantity]:.2g} in docs/validated.csv"
            assert share <= max(10 * printed[quantity], 1e-3), f"{said}; if it is to stay, `make validated` renews it"

    return check


class Agreements:
    """Gathers what the tests recorded, from all workers, and writes out/validated.json when the session ends."""

    def __init__(self) -> None:
        self.ran: dict[str, list[dict[str, Any]]] = {}

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.when == "call":
            records = [value for name, value in report.user_properties if name == "agreement"]
            self.ran[report.nodeid] = [{**r, "test": report.nodeid.partition("[")[0]} for r in records]

    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        """A run of all tests begins anew; a run of some renews theirs."""
        if not any(self.ran.values()):
            return
        chosen = session.config.option.keyword or session.config.option.markexpr
        whole = session.config.args_source == pytest.Config.ArgsSource.TESTPATHS and not chosen
        before = {} if whole or not RECORDS.exists() else json.loads(RECORDS.read_text(encoding="utf-8"))
        about = circumstances()
        now = {node: [{**r, **about} for r in records] for node, records in self.ran.items()}
        RECORDS.parent.mkdir(exist_ok=True)
        temporary = RECORDS.with_suffix(f".{os.getpid()}.tmp")
        temporary.write_text(json.dumps({k: v for k, v in (before | now).items() if v}, indent=0), encoding="utf-8")
        os.replace(temporary, RECORDS)


def circumstances() -> dict[str, str]:
    """Day, version, commit and machine that figures belong to."""
    from vgonio import __version__
    from vgonio.accuracy import machine

    try:
        done = subprocess.run(
            ["git", "describe", "--always", "--dirty", "--exclude", "*"], cwd=ROOT, capture_output=True, text=True
        )
        commit = done.stdout.strip()
    except OSError:  # no git: an unpacked source distribution
        commit = ""
    about = machine()
    return {
        "date": datetime.datetime.now(datetime.UTC).date().isoformat(),
        "version": __version__,
        "commit": commit,
        "machine": f"{about['processor']}, {about['processors']} processors, {platform.system()}",
    }


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Files in the order of FIRST, all others after them as they were; by path alone, the same for every worker."""

    def place(item: pytest.Item) -> int:
        path = os.path.relpath(item.path, ROOT / "tests")
        return next((k for k, first in enumerate(FIRST) if path.startswith(first)), len(FIRST))

    items.sort(key=place)


def pytest_configure(config: pytest.Config) -> None:
    # a shell that starts the tests in the background has Ctrl-C ignored, and so would every command that they interrupt
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    if not hasattr(config, "workerinput"):  # with xdist the workers send their reports to the one who writes
        config.pluginmanager.register(Agreements(), "agreements")


@pytest.fixture(scope="session")
def browser() -> list[str]:
    """The start of a command line that loads a page in headless Chromium and prints what became of it."""
    names = ("chromium", "chromium-browser", "google-chrome")
    found = next((path for name in names if (path := shutil.which(name))), None)
    if found is None:
        pytest.skip(f"none of {', '.join(names)} is on the PATH: install chromium to load the page in a browser")
    return [
        *(found, "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync"),
        *("--disable-component-update", "--disable-background-networking", "--disable-dev-shm-usage"),
        *("--disable-extensions", "--enable-logging=stderr", "--virtual-time-budget=4000", "--dump-dom"),
    ]
