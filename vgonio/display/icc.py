"""ICC v4 matrix/TRC display profile of a display model (ICC.1:2022)."""

from __future__ import annotations

import datetime as dt
import hashlib
import os
import struct
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..files import written_whole
from .model import DisplayModel

Floats = NDArray[np.float64]
# profile connection space: D50 as ICC.1:2022 writes it
D50 = np.array([0.9642, 1.0, 0.8249])
# linear Bradford adaptation, ICC.1:2022 annex E
BRADFORD = np.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]])
CURVE_POINTS = 4096
VERSION = 0x04300000


def adaptation(white: Floats) -> Floats:
    """(3, 3) matrix that brings XYZ under `white` (3,), Y = 1, to D50."""
    cone = BRADFORD @ D50 / (BRADFORD @ white)
    return np.linalg.inv(BRADFORD) @ (cone[:, None] * BRADFORD)


def profile(model: DisplayModel, description: str, date: dt.datetime | None = None) -> bytes:
    """The profile as bytes: primaries adapted to D50, tone curves of 4096 points, luminance of white, profile ID.

    White is the sum of the three primaries. A matrix profile has no place for the light of black: it describes what is
    above black, so the darkest colours come out lighter by it. The 3-D LUT has its black at that of the display too.
    """
    white = model.matrix.sum(axis=1)
    to_d50 = adaptation(white / white[1])
    columns = to_d50 @ model.matrix / white[1]
    signal = np.linspace(0, 1, CURVE_POINTS)
    tags: dict[bytes, bytes] = {
        b"desc": _text(description),
        b"cprt": _text("No copyright: made by vgonio from measurements, use freely"),
        b"wtpt": _xyz(D50),
        b"chad": b"sf32" + bytes(4) + _fixed(to_d50.ravel()),
        b"lumi": _xyz(np.array([0.0, white[1], 0.0])),
    }
    for c, letter in enumerate((b"r", b"g", b"b")):
        tags[letter + b"XYZ"] = _xyz(columns[:, c])
        tags[letter + b"TRC"] = _curve(model.curves[c](signal))
    return _assembled(tags, date or dt.datetime.now(dt.UTC))


def write_icc(
    path: str | os.PathLike[str], model: DisplayModel, description: str = "", date: dt.datetime | None = None
) -> Path:
    """Write the ICC v4 profile of a display; returns the path. Raises FileFormatError where it cannot be written."""
    path = Path(path)
    with written_whole(path) as stream:
        stream.write(profile(model, description or f"vgonio {path.stem}", date))
    return path


def _fixed(values: Floats) -> bytes:
    """s15Fixed16 numbers, big-endian."""
    return np.round(np.asarray(values) * 65536).astype(">i4").tobytes()


def _xyz(values: Floats) -> bytes:
    return b"XYZ " + bytes(4) + _fixed(values)


def _curve(light: Floats) -> bytes:
    return b"curv" + bytes(4) + struct.pack(">I", light.size) + np.round(light * 65535).astype(">u2").tobytes()


def _text(text: str) -> bytes:
    """multiLocalizedUnicodeType with one English record."""
    content = text.encode("utf-16-be")
    return b"mluc" + bytes(4) + struct.pack(">II2s2sII", 1, 12, b"en", b"GB", len(content), 28) + content


def _assembled(tags: dict[bytes, bytes], date: dt.datetime) -> bytes:
    """Header, table of tags and data; equal data are stored once; the ID is the MD5 of ICC.1:2022 section 7.2.18."""
    start = 128 + 4 + 12 * len(tags)
    places: dict[bytes, int] = {}
    data = b""
    for content in tags.values():
        if content not in places:
            places[content] = start + len(data)
            data += content + bytes(-len(content) % 4)
    table = struct.pack(">I", len(tags))
    for name, content in tags.items():
        table += struct.pack(">4sII", name, places[content], len(content))
    size = start + len(data)
    when = struct.pack(">6H", date.year, date.month, date.day, date.hour, date.minute, date.second)
    head = struct.pack(">III", size, 0, VERSION) + b"mntrRGB XYZ " + when + b"acsp" + bytes(24)
    # intent 1: media-relative colorimetric is what a matrix profile holds
    head += struct.pack(">I", 1) + _fixed(D50) + bytes(4)
    plain = head + bytes(128 - len(head)) + table + data
    without_intent = plain[:64] + bytes(4) + plain[68:]
    return plain[:84] + hashlib.md5(without_intent, usedforsecurity=False).digest() + plain[100:]
