"""Bounds on what a reader may take, and files of every kind, small and whole, to be damaged."""

from __future__ import annotations

import os
import resource
import signal
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import scipy.io

import vgonio as vg
from vgonio.errors import VgonioError

SECONDS = 20  # of the processor: 5 on a machine four times slower
HANGS = 300  # by the clock: one that waits for something
MEGABYTES = 600


class TooSlow(Exception):
    """A reader that did not come to an end."""


@contextmanager
def bounded(seconds: float = SECONDS, megabytes: float = MEGABYTES) -> Iterator[None]:
    """Within the block address space may grow by so much and the processor work so long: MemoryError or TooSlow beyond.

    Address space, not memory in use: what a header only asks for counts as well. The processor's seconds, not those of
    the clock, which pass while other programs run.
    """

    def stop(*_: object) -> None:
        raise TooSlow(f"longer than {seconds} s of the processor, or {HANGS} s by the clock")

    with open("/proc/self/statm", encoding="ascii") as stream:
        now = int(stream.read().split()[0]) * os.sysconf("SC_PAGE_SIZE")
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    timers = {signal.ITIMER_PROF: (signal.SIGPROF, seconds), signal.ITIMER_REAL: (signal.SIGALRM, HANGS)}
    before = {number: signal.signal(number, stop) for number, _ in timers.values()}
    resource.setrlimit(resource.RLIMIT_AS, (now + int(megabytes * 1e6), hard))
    for timer, (_, most) in timers.items():
        signal.setitimer(timer, most)
    try:
        yield
    finally:
        for timer in timers:
            signal.setitimer(timer, 0)
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))
        for number, handler in before.items():
            signal.signal(number, handler)


def outcome(read: Callable[[Path], object], path: Path) -> str:
    """The message of a refusal, "" where `read` took the file; anything but a refusal of ours fails the test."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            with bounded():
                read(path)
        except VgonioError as e:
            said = str(e)
            assert said, type(e)
            assert "\n" not in said
            assert len(said) < 1500
            assert path.stem in said or str(path.parent) in said, f"the message names no file: {said}"
            return said
    return ""


def damaged(content: bytes, rng: np.random.Generator) -> bytes:
    """The content cut, with bits flipped or bytes changed near its head, with a part twice, noise after its head, or
    numbers of its head replaced by extreme ones."""
    data = bytearray(content)
    kind = rng.integers(7)
    if kind == 0:
        return bytes(data[: rng.integers(1, len(data))])
    if kind == 1:
        for k in rng.integers(0, min(len(data), 600), rng.integers(1, 8)):
            data[k] ^= 1 << rng.integers(8)
    elif kind == 2:
        for k in rng.integers(0, len(data), rng.integers(1, 12)):
            data[k] = rng.integers(256)
    elif kind == 3:
        a, b = sorted(rng.integers(0, len(data), 2))
        return bytes(data[:b] + data[a:])
    elif kind == 4:
        return bytes(data[: rng.integers(4, 64)]) + rng.bytes(300)
    elif kind == 5:
        at, size = rng.integers(0, min(len(data), 2000)), [2, 4, 8][rng.integers(3)]
        data[at : at + size] = EXTREME[rng.integers(len(EXTREME))][:size]
    else:
        digits = [i for i, c in enumerate(data[:3000]) if 48 <= c < 58]
        if digits:
            at = digits[rng.integers(len(digits))]
            data[at : at + 1] = WORDS[rng.integers(len(WORDS))]
    return bytes(data)


EXTREME = (b"\xff" * 8, b"\0" * 8, b"\x7f" + b"\xff" * 7, b"\xff\xff\xff\x7f" * 2, np.float64(np.nan).tobytes())
WORDS = (
    b"-1",
    b"0",
    b"nan",
    b"1e400",
    b"-inf",
    b"9" * 30,
    b"9" * 5000,
    b"\0",
    b"\xff",
    b"1e-320",
    b"",
    b'"',
    b"[" * 2000,
)


# ---- whole files
def surfaces(folder: Path) -> dict[str, bytes]:
    """One small surface file of each format that can be made here, by suffix."""
    import h5py
    from SurfaceTopography import Topography

    rng = np.random.default_rng(1)
    field = vg.surface.Heightfield(rng.normal(size=(12, 9)), 5.0, name="fuzz")
    found = {s: vg.surface.write(field, folder / f"a{s}").read_bytes() for s in (".npz", ".x3p", ".csv", ".vgms")}
    from vgonio.surface.readers import vgms

    found["z.vgms"] = vgms.encode(field, "ascii", "zlib")
    found["usurf.txt"] = b"DATA\n0\t1\t2\n0\t1\t2\t3\n1\t4\t5\t6\n"
    found["am.txt"] = b"AsciiMatrix 3 2 1 1\n1 2 3\n4 5 6\n"
    found["matrix.asc"] = b"# Channel: Height\n# Width: 3 um\n# Height: 3 um\n# Value units: nm\n1 2 3\n4 5 6\n7 8 10\n"
    np.savetxt(folder / "own.csv", field.z, delimiter=",")
    np.save(folder / "own.npy", field.z)
    found["own.csv"], found[".npy"] = ((folder / name).read_bytes() for name in ("own.csv", "own.npy"))
    found[".xyz"] = b"".join(b"%d %d %d\n" % (x, y, x * y) for x in range(4) for y in range(3))
    scipy.io.savemat(folder / "a.mat", {"z": rng.normal(size=(8, 9))})
    with h5py.File(folder / "a.h5", "w") as file:
        file["z"] = rng.normal(size=(8, 9))
    Topography(rng.normal(size=(8, 9)), (8.0, 9.0), unit="um").to_netcdf(str(folder / "a.nc"))
    for suffix in (".mat", ".h5", ".nc"):
        found[suffix] = (folder / f"a{suffix}").read_bytes()
    head = "aBCR-1.0\nManufacID=x\nCreateDate=0\nModDate=0\nNumPoints=3\nNumProfiles=2\nXscale=1e-6\nYscale=1e-6\n"
    head += "Zscale=1e-6\nZresolution=0\nCompression=0\nDataType=7\nCheckType=0\n*\n1 2 3\n4 5 6\n*\n"
    found[".sdf"] = head.replace("aBCR", "aISO").encode()
    return found


SCENE = """title = "a scene"
[surface]
generate = { kind = "gaussian", rms_um = 0.1, correlation_um = 3.0, shape = [16, 16], pitch_um = 1.0 }
level = "plane"
[material]
name = "Al"
[light]
wavelength_nm = [450, 550]
theta_i_deg = { start = 0, stop = 60, step = 30 }
[detector]
theta_o_deg = [-30, 0, 30]
[geometric]
rays = 100
"""
