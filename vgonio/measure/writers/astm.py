"""ASTM E1392 and E2387 text as `measure.readers.astm` reads it: radians (as Foo 1997), a column for each wavelength."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import xarray as xr

from ...errors import InputError
from ...files import written_whole
from ...units import radians
from .rows import directions_of, spectra_of


def write(dataset: xr.Dataset, path: str | os.PathLike[str], *, digits: int = 9) -> Path:
    """Write the pairs of directions whose spectrum is finite; pairs with gaps are left out, the format has none.

    Raises InputError when no pair is complete.
    """
    values = spectra_of(dataset)
    if values is None:
        raise InputError("the BRDF to write holds no finite value")
    kept = np.isfinite(values).all(axis=-1)
    if not kept.any():
        raise InputError("no pair of directions has values at all wavelengths: an ASTM file has no place for gaps")
    angles, spectra = radians(directions_of(dataset)[kept]), values[kept]
    names = ",".join(f"{w:.10g}nm" for w in dataset["wavelength"].values)
    head = [
        "ASTM E2387",
        f"SOURCE {str(dataset.attrs.get('source', 'vgonio')).splitlines()[0]}",
        "ANGLE_UNITS radians",
        f"NUM_POINTS {len(spectra)}",
        f"VARS theta_i,phi_i,theta_s,phi_s,{names}",
    ]
    lines = [",".join([*(f"{v:.10f}" for v in a), *(f"{v:.{digits}g}" for v in f)]) for a, f in zip(angles, spectra)]
    path = Path(path)
    with written_whole(path) as stream:
        stream.write(("\n".join(head + lines) + "\n").encode())
    return path
