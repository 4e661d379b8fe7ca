"""Pictures on disk: EXR with colour and spectra, PNG for people; written whole or not at all."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ..compare import colour
from ..files import written_whole
from .preview import rgb
from .variants import mitsuba

Floats = NDArray[np.float64]
EXR_VARIANT = "scalar_rgb"  # bitmaps are the same in every variant; one has to be set


def write_exr(path: str | os.PathLike[str], data: xr.Dataset, material: str) -> Path:
    """One material's picture as OpenEXR: linear sRGB (R, G, B, not clipped, Y = 1 at exposure 1) and its spectrum.

    Spectral channels are named as in Fichet 2021, "S0.550,000000nm", radiance under white lights of one unit.
    """
    mi = mitsuba()
    if mi.variant() is None:
        mi.set_variant(EXR_VARIANT)
    one = data.sel(material=material)
    linear = colour.linear_srgb(one["tristimulus"].values)
    pixels = np.concatenate([linear, one["radiance"].values], axis=-1).astype(np.float32)
    names = [f"S0.{w:.6f}nm".replace(".", ",").replace("S0,", "S0.", 1) for w in one["wavelength"].values]
    bitmap = mi.Bitmap(pixels, pixel_format=mi.Bitmap.PixelFormat.MultiChannel, channel_names=["R", "G", "B", *names])
    metadata = bitmap.metadata()
    metadata["spectralLayoutVersion"] = "1.0"
    metadata["emissiveUnits"] = "1"
    metadata["material"] = material
    stream = mi.MemoryStream()
    bitmap.write(stream, mi.Bitmap.FileFormat.OpenEXR)
    with written_whole(path) as file:
        file.write(stream.raw_buffer())
    return Path(path)


def write_png(path: str | os.PathLike[str], data: xr.Dataset, material: str) -> Path:
    """One material's picture as PNG, sRGB at the common exposure."""
    from matplotlib.image import imsave

    names = [str(m) for m in data["material"].values]
    with written_whole(path) as file:
        imsave(file, np.rint(255 * rgb(data)[names.index(material)]).astype(np.uint8), format="png")
    return Path(path)
