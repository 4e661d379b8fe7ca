"""A processor that PoCL's compiler does not know yet.

PoCL 3.0 from pip carries LLVM 14. On a newer processor (Zen 5, for one) LLVM calls the host "generic", a name that
its own front end then refuses, and no kernel builds (pocl/pocl issue 1049). The name is a string of PoCL's in this
process; here it is replaced by a known processor that has no more instructions than this one. Nothing else is touched.
"""

from __future__ import annotations

import struct
from pathlib import Path

SYMPTOM = "unknown target CPU 'generic'"
# names of LLVM 14 of at most seven letters (they replace "generic" in place) and the flags that they need
KNOWN = (
    ("skx", {"avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl", "avx2", "fma", "bmi2"}),
    ("haswell", {"avx2", "fma", "bmi1", "bmi2", "movbe"}),
    ("x86-64", {"sse2"}),
)


def known_processor() -> str | None:
    """The best name whose instructions this processor has, from /proc/cpuinfo."""
    try:
        text = Path("/proc/cpuinfo").read_text()
    except OSError:
        return None
    flags = set(next((line for line in text.splitlines() if line.startswith("flags")), "").split())
    return next((name for name, needs in KNOWN if needs <= flags), None)


def name_processor(device) -> str | None:
    """Give `device` (of PoCL) a processor name that its compiler knows; the name, or None where that failed.

    The device's structure holds a pointer to the string "generic". Memory is read through /proc/self/mem, where a
    wrong address is an error and not a crash.
    """
    name = known_processor()
    if name is None or not device.version.lower().rstrip().endswith("-generic"):
        return None
    try:
        with open("/proc/self/mem", "r+b", buffering=0) as memory:
            memory.seek(device.int_ptr)
            block = memory.read(2048)
            for (address,) in struct.iter_unpack("<Q", block[: len(block) // 8 * 8]):
                if _read(memory, address) == b"generic\0":
                    memory.seek(address)
                    memory.write(name.encode() + b"\0")
                    return name
    except OSError:
        return None
    return None


def _read(memory, address: int) -> bytes:
    if not 1 << 12 < address < 1 << 47:
        return b""
    try:
        memory.seek(address)
        return memory.read(8)
    except OSError:
        return b""
