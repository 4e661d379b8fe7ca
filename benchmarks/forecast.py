"""What `vgonio plan` expects of a scene, beside what it takes: seconds of each part, and memory of the process.

    python benchmarks/forecast.py [SCENE ...] [--quick] [--wall] [-o forecast.csv]

Each scene is planned and simulated in a process of its own, on a calibration made at the start. As a rule one thread
works and seconds are those of the processor, which other programs on the machine hardly change; with --wall they are
those of the clock and all threads, for a machine that does nothing else. Memory is the process' largest
(VmHWM; ru_maxrss would count that of the process it was forked from).
Parts below 0.1 s are left out: nobody waits for them.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
LEAST_SECONDS = 0.1
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "POCL_MAX_PTHREAD_COUNT")
COLUMNS = ("scene", "part", "expected", "measured", "ratio", "unit")

# planned first, so that what planning costs is not counted with the first part
CHILD = """
import json, os, re, sys, time, warnings
warnings.simplefilter("ignore")
clock = getattr(time, sys.argv[2])
import vgonio as vg
scene = json.loads(sys.argv[1])
scene = scene if isinstance(scene, dict) else os.fspath(scene)
begin = clock()
plan = vg.plan(scene)
planning = clock() - begin
open_, parts = {}, {}
def progress(part, share):
    if share == 0.0:
        open_[part] = clock()
    elif share == 1.0:
        parts[part] = clock() - open_[part]
tree = vg.simulate(scene, progress=progress, output=sys.argv[3] + ".nc", report=sys.argv[3] + ".html")
errors = {n: tree[n].attrs.get("error_achieved") for n in tree.children}
print(json.dumps({"parts": parts, "expected": plan.parts(), "memory": plan.memory_bytes, "planning": planning,
                  "errors": {n: e for n, e in errors.items() if isinstance(e, float)},
                  "peak": 1024.0 * int(re.search(r"VmHWM:\\s+(\\d+)", open("/proc/self/status").read())[1])}))
"""

LIGHT = {"wavelength_nm": [450, 550, 650], "theta_i_deg": [0, 30, 60], "coherence_um": 10}
CONES = {"theta_o_deg": {"start": -80, "stop": 80, "step": 5}, "aperture_deg": 2.0}


def scene(**tables: Any) -> dict[str, Any]:
    made: dict[str, Any] = {
        "surface": {
            "generate": {"kind": "gaussian", "rms_um": 0.3, "correlation_um": 4, "shape": [128, 128], "pitch_um": 0.5}
        },
        "material": {"name": "Al"},
        "light": LIGHT,
        "detector": CONES,
    }
    return {**made, **tables, "output": {"file": "x.nc", "report": "x.html"}}


def generated(kind: str, **more: Any) -> dict[str, Any]:
    return {"generate": {"kind": kind, **more}}


def cases() -> dict[str, Any]:
    """Scenes by name: files, or tables."""
    large = generated("gaussian", rms_um=1.0, correlation_um=10, shape=[1024, 1024], pitch_um=0.5)
    steep = generated("gaussian", rms_um=0.5, correlation_um=1.4, shape=[1, 400], pitch_um=0.1)
    few = {**LIGHT, "wavelength_nm": [550], "theta_i_deg": [30]}
    return {
        "init": str(ROOT / "vgonio" / "template.toml"),
        "demo": str(ROOT / "examples" / "demo" / "scene.toml"),
        "rays to 2 %": scene(geometric={"tol": 0.02, "rays": 10_000_000}),
        "steep rays": scene(
            surface=generated("gaussian", rms_um=2.0, correlation_um=4, shape=[256, 256], pitch_um=0.5),
            geometric={"rays": 500_000, "estimator": "binning"},
        ),
        "polarised": scene(geometric={"rays": 200_000, "polarised": True}, wave={"polarised": True, "tol": 1e-2}),
        "hemisphere": scene(
            light=few, detector={"kind": "hemisphere", "resolution_deg": 5}, geometric={"rays": 300_000}, wave={}
        ),
        "large map": scene(surface=large, geometric={"rays": 300_000}, wave={}, light={**LIGHT, "coherence_um": 30}),
        "fine tol": scene(wave={"tol": 1e-5}),
        "many windows": scene(wave={}, light={**LIGHT, "coherence_um": 3}),
        "shadows": scene(light={**few, "theta_i_deg": [70]}, wave={"shadowing": True, "tol": 1e-2}),
        "opencl": scene(light=few, wave={"method": "opencl"}),
        "grating": scene(
            surface=generated("lamellar", period_um=4, depth_um=0.2, shape=[80, 80], pitch_um=0.5),
            geometric={"rays": 200_000}, wave={},
        ),
        "full wave": scene(surface=steep, light={**few, "coherence_um": 3}, wave={"theory": "full-wave"}),
        "full wave, grating": scene(
            surface=generated("sinusoid", period_um=10, amplitude_um=0.4, shape=[1, 400], pitch_um=0.025),
            light={**few, "theta_i_deg": [0, 30]}, wave={"theory": "full-wave"},
        ),
        "iterated profile": scene(
            surface=steep, light={**few, "coherence_um": 3}, wave={"theory": "iterated-kirchhoff"}
        ),
        "iterated patch": scene(
            surface=generated("gaussian", rms_um=0.8, correlation_um=2.0, shape=[64, 64], pitch_um=0.2),
            light={**few, "coherence_um": 1.2}, wave={"theory": "iterated-kirchhoff", "window_um": 7},
        ),
    }  # fmt: skip


QUICK = ("init", "grating", "hemisphere")


def environment(calibration: str, wall: bool) -> dict[str, str]:
    return {**os.environ, "VGONIO_CALIBRATION": calibration, **({} if wall else dict.fromkeys(THREADS, "1"))}


def calibrated(path: str, wall: bool) -> None:
    """A calibration at `path`, by the clock that everything is measured with."""
    code = f"import vgonio as vg; vg.accuracy.calibrate(processor_time={not wall})"
    subprocess.run([sys.executable, "-c", code], check=True, env=environment(path, wall))


def measured(name: str, given: Any, calibration: str, wall: bool = False) -> list[dict[str, Any]]:
    """Rows of one scene: its parts, all of them together, and the memory."""
    clock = "perf_counter" if wall else "process_time"
    with tempfile.TemporaryDirectory() as folder:
        done = subprocess.run(
            [sys.executable, "-c", CHILD, json.dumps(given), clock, str(Path(folder) / "result")],
            capture_output=True, text=True, check=False, env=environment(calibration, wall),
        )  # fmt: skip
    if done.returncode:
        raise RuntimeError(f"{name}: {done.stderr.strip().splitlines()[-1]}")
    found = json.loads(done.stdout.splitlines()[-1])
    rows = []
    both = {p: (found["expected"][p]["seconds"], s) for p, s in found["parts"].items() if p in found["expected"]}
    both["all parts"] = tuple(sum(x) for x in zip(*both.values()))
    for part, (expected, took) in both.items():
        if max(took, expected) >= LEAST_SECONDS:
            rows.append(dict(zip(COLUMNS, (name, part, expected, took, expected / took, "s"))))
    rows.append(
        dict(zip(COLUMNS, (name, "memory", found["memory"] / 1e6, found["peak"] / 1e6,
                           found["memory"] / found["peak"], "MB")))
    )  # fmt: skip
    for part, error in found["errors"].items():
        stated = found["expected"].get(part, {}).get("error")
        if stated is not None:
            ratio = stated / error if error else float("nan")
            rows.append(dict(zip(COLUMNS, (name, f"{part}, error", stated, error, ratio, ""))))
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", help=f"names of {', '.join(cases())}; all without any")
    parser.add_argument("--quick", action="store_true", help=f"{', '.join(QUICK)} alone")
    parser.add_argument("--wall", action="store_true", help="all threads, seconds of the clock")
    parser.add_argument("--calibration", help="a calibration that is there, instead of a new one")
    parser.add_argument("-o", "--output", help="a CSV file as well")
    asked = parser.parse_args()
    from vgonio.accuracy import machine

    rows: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as folder:
        path = asked.calibration or str(Path(folder) / "calibration.json")
        if not asked.calibration:
            calibrated(path, asked.wall)
        print(machine(), flush=True)
        for name in asked.scenes or (QUICK if asked.quick else cases()):
            for row in measured(name, cases()[name], path, asked.wall):
                rows.append(row)
                figures = f"{row['expected']:10.3g} {row['measured']:10.3g} {row['ratio']:6.2f}"
                print(f"{row['scene']:20} {row['part']:24} {figures} {row['unit']}", flush=True)
    if asked.output:
        with open(asked.output, "w", newline="", encoding="utf-8") as stream:
            writer = csv.DictWriter(stream, COLUMNS)
            writer.writeheader()
            writer.writerows(rows)
    seconds = [r["ratio"] for r in rows if r["part"] == "all parts"]
    memory = [r["ratio"] for r in rows if r["part"] == "memory"]
    print(f"expected over measured: seconds {min(seconds):.2f} to {max(seconds):.2f}, "
          f"memory {min(memory):.2f} to {max(memory):.2f}")  # fmt: skip


if __name__ == "__main__":
    main()
