"""Which variant of Mitsuba runs here: llvm where a suitable LLVM is found, scalar otherwise.

An LLVM that is too old (15, 16) ends the whole process when Mitsuba loads it, so each candidate is tried in a
process of its own first. `mitsuba.set_variant` is global: `use` is the only place of vgonio that calls it.
"""

from __future__ import annotations

import glob
import os
import re
import subprocess
import sys
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from ..errors import BackendError, InputError, nearest

SCALAR, LLVM, CUDA = "scalar_spectral", "llvm_ad_spectral", "cuda_ad_spectral"
# what the user writes
VARIANTS = {"auto": "", "scalar": SCALAR, "llvm": LLVM, "cuda": CUDA}
OLDEST_LLVM = 17  # Mitsuba 3.9 refuses 14 and is ended by 15 and 16
LLVM_FOLDERS = ("/usr/lib/*-linux-gnu", "/usr/lib64", "/usr/lib", "/usr/local/lib", "/opt/homebrew/opt/llvm/lib")
PROBE_SECONDS = 60
PROBE = """
import mitsuba as mi
mi.set_variant({variant!r})
import drjit as dr
assert float(dr.sum(mi.Float([1, 2]))[0]) == 3
"""


@dataclass(frozen=True)
class Choice:
    """A variant of Mitsuba, the LLVM library for it ("" = the one that Mitsuba finds) and why it was chosen."""

    variant: str
    library: str
    why: str


def mitsuba() -> Any:
    """The module mitsuba, without a variant; BackendError that names the extra where it is not installed."""
    try:
        import mitsuba as mi
    except ModuleNotFoundError:
        raise BackendError('the Python package mitsuba is missing: pip install "vgonio[render]"') from None
    import drjit

    # on a machine of one processor as well: with one thread Mitsuba 3.9 does not end writing an EXR
    if drjit.thread_count() < 2:
        drjit.set_thread_count(2)
    return mi


@lru_cache(maxsize=8)
def choose(wanted: str = "auto") -> Choice:
    """The variant to use for "auto", "llvm", "scalar" or "cuda".

    Raises InputError for an unknown name, BackendError where the one that was asked for does not work.
    """
    if wanted not in VARIANTS:
        raise InputError(f"variant {wanted!r}: {nearest(wanted, VARIANTS)}")
    mitsuba()
    if wanted == "scalar":
        return Choice(SCALAR, "", "asked for")
    if wanted == "cuda":
        worked, said = _works(CUDA, "")
        if not worked:
            raise BackendError(f"Mitsuba's {CUDA} does not work here ({said}): take --variant llvm or scalar")
        return Choice(CUDA, "", "asked for")
    return _llvm(wanted)


def _llvm(wanted: str) -> Choice:
    library = _newest_llvm()
    worked, said = _works(LLVM, library)
    if worked:
        return Choice(LLVM, library, f"LLVM {library or 'that Mitsuba found itself'} works")
    reason = f"no LLVM of version {OLDEST_LLVM} or newer works ({said}); on Debian: apt install libllvm19"
    if wanted == "llvm":
        raise BackendError(f"Mitsuba's {LLVM} does not work here: {reason}")
    return Choice(SCALAR, "", reason)


def _newest_llvm() -> str:
    """Path of the newest LLVM library that is new enough; "" leaves the search to Mitsuba."""
    if os.environ.get("DRJIT_LIBLLVM_PATH"):
        return os.environ["DRJIT_LIBLLVM_PATH"]
    found: list[tuple[int, str]] = []
    for folder in LLVM_FOLDERS:
        for path in glob.glob(f"{folder}/libLLVM*.so*"):
            version = re.search(r"libLLVM(?:-(\d+)\.so|\.so\.(\d+))", path)
            if version:
                found.append((int(version[1] or version[2]), path))
    usable = [entry for entry in found if entry[0] >= OLDEST_LLVM]
    return max(usable)[1] if usable else ""


def _works(variant: str, library: str) -> tuple[bool, str]:
    """Whether a process of its own can compute with the variant, and the last line that it said otherwise."""
    environment = os.environ | ({"DRJIT_LIBLLVM_PATH": library} if library else {})
    try:
        done = subprocess.run(
            [sys.executable, "-c", PROBE.format(variant=variant)],
            capture_output=True,
            text=True,
            env=environment,
            timeout=PROBE_SECONDS,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return False, f"no answer within {PROBE_SECONDS} s"
    lines = done.stderr.strip().splitlines()
    return done.returncode == 0, lines[-1][:120] if lines else f"its process ended with status {done.returncode}"


def _limit_threads() -> None:
    """As many threads as `--threads` (OMP_NUM_THREADS) says, but two at least: with one, writing an EXR never ends."""
    wanted = os.environ.get("OMP_NUM_THREADS", "")
    if wanted.isdigit() and int(wanted) > 0:
        import drjit

        drjit.set_thread_count(max(2, int(wanted)))


def use(choice: Choice | str = "auto") -> Any:
    """Mitsuba with the variant set and the plug-ins of vgonio registered; the module."""
    from .bsdf import register

    chosen = choose(choice) if isinstance(choice, str) else choice
    if chosen.library:
        os.environ.setdefault("DRJIT_LIBLLVM_PATH", chosen.library)
    mi = mitsuba()
    if mi.variant() != chosen.variant:
        mi.set_variant(chosen.variant)
        _limit_threads()
    register(mi)
    return mi
