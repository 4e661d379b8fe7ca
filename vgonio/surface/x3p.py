"""The X3P container of ISO 25178-72: a zip archive of `main.xml`, binary heights in metres and checksums."""

from __future__ import annotations

import hashlib
import zipfile
from typing import BinaryIO
from xml.sax.saxutils import escape

import numpy as np

from ..errors import one_line
from ..units import to_um
from .heightfield import Heightfield

_MAIN = """<?xml version="1.0" encoding="UTF-8" standalone="no"?>
<p:ISO5436_2 xmlns:p="http://www.opengps.eu/2008/ISO5436_2" xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" \
xsi:schemaLocation="http://www.opengps.eu/2008/ISO5436_2 http://www.opengps.eu/2008/ISO5436_2/ISO5436_2.xsd">
  <Record1>
    <Revision>ISO5436 - 2000</Revision>
    <FeatureType>SUR</FeatureType>
    <Axes>
      <CX><AxisType>I</AxisType><DataType>D</DataType><Increment>{dx!r}</Increment><Offset>0.0</Offset></CX>
      <CY><AxisType>I</AxisType><DataType>D</DataType><Increment>{dy!r}</Increment><Offset>0.0</Offset></CY>
      <CZ><AxisType>A</AxisType><DataType>D</DataType><Increment>1.0</Increment><Offset>0.0</Offset></CZ>
    </Axes>
  </Record1>{about}
  <Record3>
    <MatrixDimension><SizeX>{nx}</SizeX><SizeY>{ny}</SizeY><SizeZ>1</SizeZ></MatrixDimension>
    <DataLink>
      <PointDataLink>bindata/data.bin</PointDataLink>
      <MD5ChecksumPointData>{data_sum}</MD5ChecksumPointData>{valid}
    </DataLink>
  </Record3>
  <Record4><ChecksumFile>md5checksum.hex</ChecksumFile></Record4>
</p:ISO5436_2>
"""
# dates and numbers that the standard wants and nobody knows are written as other programs write them
_ABOUT = """
  <Record2>
    <Date>1970-01-01T00:00:00Z</Date>
    <Instrument>
      <Manufacturer>vgonio</Manufacturer><Model>software</Model>
      <Serial>not available</Serial><Version>unknown</Version>
    </Instrument>
    <CalibrationDate>1970-01-01T00:00:00Z</CalibrationDate>
    <ProbingSystem><Type>Software</Type><Identification>not available</Identification></ProbingSystem>
    <Comment>{comment}</Comment>
  </Record2>"""
_VALID = """
      <ValidPointsLink>bindata/valid.bin</ValidPointsLink>
      <MD5ChecksumValidPoints>{valid_sum}</MD5ChecksumValidPoints>"""


def x3p(surface: Heightfield, stream: BinaryIO, comment: str = "") -> None:
    """Write the X3P archive: x runs fastest, the first row is y = 0; missing points as NaN and in the validity mask.

    comment : one line in Record2, which then names software, not an instrument, as the origin
    """
    metre = to_um("m")
    data = np.ascontiguousarray(surface.z / metre, dtype="<f8").tobytes()
    members = {"bindata/data.bin": data}
    valid = ""
    if surface.missing:
        mask = np.packbits(np.isfinite(surface.z).ravel(), bitorder="little").tobytes()
        members["bindata/valid.bin"] = mask
        valid = _VALID.format(valid_sum=_md5(mask))
    about = _ABOUT.format(comment=escape(one_line(comment))) if comment else ""
    ny, nx = surface.shape
    main = _MAIN.format(
        dx=surface.dx / metre, dy=surface.dy / metre, nx=nx, ny=ny, data_sum=_md5(data), valid=valid, about=about
    ).encode()
    members = {"main.xml": main, **members, "md5checksum.hex": f"{_md5(main)} *main.xml\n".encode()}
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            # a fixed date: the same surface gives the same file
            archive.writestr(zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0)), content, zipfile.ZIP_DEFLATED)


def _md5(content: bytes) -> str:
    return hashlib.md5(content, usedforsecurity=False).hexdigest()
