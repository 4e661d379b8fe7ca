"""The numerical libraries and drivers that a calibration was made with: where they change, so do the speeds."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

PACKAGES = ("numpy", "scipy", "embreex", "finufft", "pyopencl", "pocl-binary-distribution")
VENDORS = "/etc/OpenCL/vendors"  # where drivers of OpenCL say what they are
KERNEL_DRIVERS = ("/proc/driver/nvidia/version", "/sys/module/amdgpu/version")


def libraries() -> dict[str, str]:
    """Name → version of each that is installed, drivers of OpenCL included; nothing is loaded for that."""
    from importlib.metadata import PackageNotFoundError, version

    found = {}
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    drivers = _drivers()
    chosen = os.environ.get("VGONIO_OPENCL_DEVICE", "")
    return found | ({"OpenCL drivers": drivers} if drivers else {}) | ({"OpenCL device": chosen} if chosen else {})


def changes(then: Mapping[str, str], now: Mapping[str, str]) -> str:
    """ "numpy 2.1.0 has become 2.2.0, …", or nothing."""
    names = [n for n in {**then, **now} if then.get(n) != now.get(n)]
    return ", ".join(f"{n} {then.get(n, '(none)')} has become {now.get(n, '(none)')}" for n in names)


def _drivers() -> str:
    """What the drivers' own files say: their libraries' names, versions and dates."""
    folder = Path(os.environ.get("OCL_ICD_VENDORS") or os.environ.get("OPENCL_VENDOR_PATH") or VENDORS)
    files = sorted(folder.glob("*.icd")) if folder.is_dir() else [folder] if folder.is_file() else []
    found = [_driver(f) for f in files]
    for path in KERNEL_DRIVERS:
        words = _first_line(Path(path)).split()
        found += [w for w in words if w[0].isdigit() and "." in w][:1]
    return "; ".join(found)


def _driver(icd: Path) -> str:
    """Name of its file, and the real name and date of the library where that is given with its path."""
    library = Path(_first_line(icd))
    if not library.is_absolute() or not library.exists():
        return icd.stem
    return f"{icd.stem} ({library.resolve().name}, {library.stat().st_mtime:.0f})"


def _first_line(path: Path) -> str:
    try:
        return (path.read_text(encoding="utf-8", errors="replace").splitlines() or [""])[0].strip()
    except OSError:
        return ""
