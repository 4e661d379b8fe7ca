"""Wheel and source distribution: whole, and what they install runs the demo away from the checkout.

Built from what git holds, installed into fresh environments; needs PyPI, as `make test` itself does.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PYTHONS = ("3.11", "3.12", "3.13")


@dataclass(frozen=True)
class Packages:
    """The two files that a release consists of, and the copy of the sources that they were built from."""

    sources: Path
    wheel: Path
    sdist: Path


def command(*words: object, cwd: Path, timeout: float = 1200) -> str:
    """Standard output of a command in a clean environment; AssertionError with all it said where it fails."""
    kept = ("PATH", "HOME", "UV_CACHE_DIR", "UV_INDEX_URL", "UV_DEFAULT_INDEX", "PIP_INDEX_URL", "SSL_CERT_FILE")
    environment = {name: os.environ[name] for name in kept if name in os.environ}
    environment |= {"OMP_NUM_THREADS": "1", "MPLBACKEND": "Agg"}
    # a slow network is no fault of ours
    environment |= {"UV_HTTP_TIMEOUT": "300", "UV_HTTP_RETRIES": "10", "UV_LOCK_TIMEOUT": "1200"}
    if "PIP_INDEX_URL" in environment:
        environment.setdefault("UV_DEFAULT_INDEX", environment["PIP_INDEX_URL"])
    done = subprocess.run([str(word) for word in words], cwd=cwd, env=environment, timeout=timeout, capture_output=True)
    said = (done.stdout + done.stderr).decode(errors="replace")
    assert done.returncode == 0, f"{words} failed:\n{said[-3000:]}"
    return done.stdout.decode()


def uv(*words: object, cwd: Path = ROOT) -> str:
    """uv, which installs into an environment of any Python and resolves to the oldest allowed versions."""
    return command(sys.executable, "-m", "uv", *words, cwd=cwd)


def tracked() -> list[str]:
    """Files that git holds or would take, by their paths from the root."""
    if not (ROOT / ".git").exists() or shutil.which("git") is None:
        pytest.skip("packages are built from what git holds, and this is no git checkout")
    asked = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]  # also what is not committed yet
    listed = subprocess.run(asked, cwd=ROOT, capture_output=True, check=True).stdout.decode()
    return [name for name in listed.split("\0") if name and (ROOT / name).is_file()]


@pytest.fixture(scope="session")
def packages(tmp_path_factory: pytest.TempPathFactory) -> Packages:
    """The wheel and the source distribution, built in a copy, so that the checkout stays as it is."""
    sources = tmp_path_factory.mktemp("sources")
    for name in tracked():
        (sources / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(ROOT / name, sources / name)
    folder = tmp_path_factory.mktemp("dist")
    uv("build", "--quiet", "--out-dir", folder, sources)  # the wheel is built from the source distribution
    return Packages(sources, next(folder.glob("*.whl")), next(folder.glob("*.tar.gz")))


@pytest.fixture(scope="session")
def environment(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str, list[object]], Path]:
    """environment(python, requirements) makes a bare environment with these installed and returns its bin folder."""

    def make(python: str, requirements: list[object]) -> Path:
        folder = tmp_path_factory.mktemp("bare") / "venv"
        uv("venv", "--quiet", "--python", python, folder)
        uv("pip", "install", "--quiet", "--python", folder / "bin" / "python", *requirements)
        return folder / "bin"

    return make


def interpreter(version: str) -> str | None:
    """Path of a Python of this version on this machine, or None. Pyenv's shims on PATH may be of no version set."""
    named = shutil.which(f"python{version}")
    pyenv = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv")) / "versions"
    candidates = [named, *sorted(map(str, pyenv.glob(f"{version}.*/bin/python3")))]
    if f"{sys.version_info.major}.{sys.version_info.minor}" == version:
        candidates.insert(0, sys.executable)
    for candidate in filter(None, candidates):
        try:
            asked = subprocess.run([candidate, "-c", "import venv"], capture_output=True, timeout=300, cwd="/")
        except OSError:
            continue
        if asked.returncode == 0:
            return candidate
    return None


# the demo with fewer angles and rays: every stage of it runs, the page and its pictures too
DEMO = """
import sys, numpy as np, vgonio as vg
tree = vg.open("demo.nc")
rays = tree["rays"].to_dataset()
reflected = rays["energy_by_bounce"].sum("bounce") if "energy_by_bounce" in rays else rays["energy"]
assert "site-packages" in vg.__file__, vg.__file__
assert set(tree.children) >= {"rays", "waves", "measured"}, sorted(tree.children)
brdf = rays["brdf"].values
assert np.isfinite(brdf).all() and brdf.max() > 0.05
print(sys.version_info.minor, float(brdf.sum()), float(np.nansum(tree["waves"]["brdf"].values)))
"""


def run_demo(scripts: Path, folder: Path, sources: Path) -> list[float]:
    """The demo by the command of an environment, away from the checkout; the sums of the two BRDFs."""
    for part in ("examples/demo", "heightfields"):
        shutil.copytree(sources / part, folder / part)
    fewer = ("geometric.rays=20000", "light.theta_i_deg=[0, 30]", "light.wavelength_nm=[450, 550, 650]")
    sets = [word for key in fewer for word in ("--set", key)]
    scene = "examples/demo/scene.toml"
    command(scripts / "vgonio", "simulate", scene, "-o", "demo.nc", "--report", "demo.html", *sets, cwd=folder)
    assert (folder / "demo.html").stat().st_size > 200_000  # figures are inside
    return [float(word) for word in command(scripts / "python", "-c", DEMO, cwd=folder).split()[1:]]


def test_the_wheel_holds_all_of_the_package_and_nothing_else(packages):
    with zipfile.ZipFile(packages.wheel) as archive:
        inside = {name for name in archive.namelist() if ".dist-info/" not in name}
        metadata = next(name for name in archive.namelist() if name.endswith("METADATA"))
        described = archive.read(metadata).decode()
    assert inside == {name for name in tracked() if name.startswith("vgonio/")}
    assert "License-Expression: MIT" in described
    assert "Requires-Python: >=3.11" in described


def test_the_source_distribution_holds_what_git_holds(packages):
    with tarfile.open(packages.sdist) as archive:
        inside = {name.partition("/")[2] for name in archive.getnames()}
    hidden = {name for name in tracked() if name.startswith(".")}
    assert set(tracked()) - hidden <= inside
    assert not [name for name in inside if name.startswith(("out/", ".venv", "build/"))]


@pytest.mark.parametrize("version", PYTHONS)
def test_an_installed_wheel_runs_the_demo(version, packages, environment, tmp_path):
    python = interpreter(version)
    if python is None:
        pytest.skip(f"no Python {version} on this machine")
    scripts = environment(python, [packages.wheel])
    assert "failed" not in command(scripts / "vgonio", "doctor", cwd=tmp_path)
    rays, waves = run_demo(scripts, tmp_path, packages.sources)
    assert rays > 0
    assert waves > 0


def lower_bounds() -> dict[str, str]:
    """Name of each dependency and the oldest version that pyproject.toml allows."""
    from packaging.requirements import Requirement

    asked = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["dependencies"]
    found = {}
    for line in map(Requirement, asked):
        oldest = [bound.version for bound in line.specifier if bound.operator == ">="]
        assert len(oldest) == 1, f"{line} names no oldest version, or several"
        found[line.name.lower()] = oldest[0]
    return found


def test_the_oldest_allowed_dependencies_run_the_demo_and_tests(packages, environment, tmp_path):
    """The newest ones are what every other test runs with; together they are the bounds that hold."""
    from packaging.version import Version

    resolved = tmp_path / "oldest.txt"
    uv("pip", "compile", "--quiet", "--no-header", "--python-version", "3.11", "--resolution", "lowest-direct",
       packages.sources / "pyproject.toml", "-o", resolved)  # fmt: skip
    pinned = dict(line.split("==") for line in resolved.read_text().split("\n") if "==" in line and line[0] not in " #")
    pinned = {name: version.split()[0] for name, version in pinned.items()}
    for name, oldest in lower_bounds().items():
        # what is written as the oldest is what was installed, not something newer that another package asks for
        wanted = Version(oldest).release[:2]
        assert Version(pinned[name]).release[: len(wanted)] == wanted, f"{name}: {pinned[name]}, not {oldest}"

    scripts = environment(interpreter("3.11") or sys.executable, ["-r", resolved, "pytest", "hypothesis"])
    uv("pip", "install", "--quiet", "--no-deps", "--python", scripts / "python", packages.wheel)
    run_demo(scripts, tmp_path, packages.sources)
    shutil.copytree(packages.sources / "tests", tmp_path / "tests")
    parts = ("test_files.py", "geometric/test_furnace.py", "materials/test_films.py", "compare/test_compare_colour.py")
    ran = command(scripts / "python", "-m", "pytest", "-q", "-c", "/dev/null", "--import-mode=importlib",
                  *(tmp_path / "tests" / part for part in parts), cwd=tmp_path)  # fmt: skip
    assert " passed" in ran
    assert " failed" not in ran
