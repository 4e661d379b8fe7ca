"""Write measured_virtual.json: a formula with noise in the place of a measurement, for the demo to compare with.

The in-plane BRDF of the shift-extended Cook–Torrance model (Clausen 2022, thesis equation 4.8) for aluminium, with 2 %
of multiplicative noise, in the file format of a gonioreflectometer. It is no measurement, and the file says so.

    python examples/demo/make_measured.py [PATH]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import xarray as xr

from vgonio import models
from vgonio.measure import formats

# alpha: GGX fitted to the measured in-plane BRDF of the thesis' sample 1 (6.5 bar) by the Rust tool vgonio, 0.3638.
# h: so that the Fresnel term alone is off by a ΔE₀₀ of up to 12, as thesis section 4.4 says of sample 1.
# w: the slope changes its sign at θ_m = 30°.
PARAMETERS = {"alpha": 0.364, "h": 1.8e-3, "w": 3.0, "material": "Al"}
THETA_I = np.arange(0.0, 81, 10)
THETA_O = np.arange(-85.0, 86, 5)
WAVELENGTH = np.arange(380.0, 781, 20)
NOISE = 0.02
SEED = 20221101
DEFAULT = Path(__file__).with_name("measured_virtual.json")
PROVENANCE = (
    "NOT A MEASUREMENT. Made by examples/demo/make_measured.py of vgonio: shift-extended Cook-Torrance model "
    "(Clausen 2022, equation 4.8) with alpha = {alpha}, h = {h} per nm, w = {w}, aluminium of Cheng 2016, times "
    f"1 + {NOISE} N(0, 1), seed {SEED}. standardError is {NOISE} times the value without noise."
)


def virtual_measurement(seed: int = SEED) -> xr.Dataset:
    """Dataset (theta_i, theta_o, wavelength) of the model times noise, without the exact back-scattering pairs."""
    data = models.evaluate("clausen-2022", THETA_I, THETA_O, WAVELENGTH, **PARAMETERS)
    truth = data["brdf"]
    noise = np.random.default_rng(seed).standard_normal(truth.shape)
    measured = data["theta_i"] != data["theta_o"]
    data["brdf"] = (truth * (1 + NOISE * noise)).where(measured)
    data["brdf_stderr"] = (NOISE * truth).where(measured)
    return data


def main(path: str | Path = DEFAULT) -> Path:
    return formats.write(virtual_measurement(), path, provenance=PROVENANCE.format(**PARAMETERS), digits=4)


if __name__ == "__main__":
    print(main(*sys.argv[1:2]))
