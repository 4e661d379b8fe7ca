"""Does the red forward shift of a map sampled at 1 µm survive when the integral over the surface converges?

The thesis (4.4, 4.5) simulated sample 1 on a map with 1 µm steps and found its forward scattering reddish. Here rows of
its surrogate are evaluated three ways with one theory (Kirchhoff, single scattering): the interpolated surface to a
tolerance, plane facets between samples 1 µm apart, and flat texels of 1 µm.

    python examples/wavelength_shift/sampling.py --rows 20
"""

from __future__ import annotations

import argparse
import warnings

import numpy as np
import xarray as xr
from analyse import jackknife, side, slopes
from simulate import GONIO, WAVELENGTHS, profile

import vgonio as vg

WAYS = {"converged": ("cubic", None), "facets of 1 µm": ("linear", 1.0), "texels of 1 µm": ("nearest", 1.0)}


def resampled(surface: vg.surface.Heightfield, interpolation: str, pitch_um: float | None) -> vg.surface.Heightfield:
    """The profile at another pitch, its own spline read at the new samples."""
    if pitch_um is None:
        return surface
    count = round(surface.size_um[1] / pitch_um)
    x = (np.arange(count) + 0.5) * surface.size_um[1] / count
    z = surface.interpolant.at(x, np.zeros(count) + surface.y[0])
    return vg.surface.Heightfield(
        np.repeat(z[None], 4, axis=0), pitch_um=pitch_um, periodic=True, interpolation=interpolation
    )


def forward(brdf: xr.DataArray) -> xr.DataArray:
    """Mean slope of the forward side for each θ_i, weighted with BRDF · cos θ_o."""
    found = []
    for theta_i in (20.0, 40.0, 60.0):
        m = side(slopes(brdf, 1.0), theta_i, "forward")
        weight = side(brdf.mean("wavelength") * np.cos(np.deg2rad(brdf["theta_o"])), theta_i, "forward")
        found.append(m.weighted(weight.where(m.notnull(), 0.0)).mean("theta_o"))
    return xr.concat(found, xr.DataArray([20.0, 40.0, 60.0], dims="theta_i", name="theta_i"))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sample", type=int, default=1)
    parser.add_argument("--rows", type=int, default=20)
    asked = parser.parse_args()
    solver = vg.wave.Kirchhoff("Al", WAVELENGTHS, tol=1e-4)
    for name, (interpolation, pitch) in WAYS.items():
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            rows = [
                GONIO.measure(resampled(profile(asked.sample, 16 * r), interpolation, pitch), solver)["brdf"]
                for r in range(asked.rows)
            ]
        value, error = jackknife(xr.concat(rows, "row"), forward)
        words = ", ".join(f"{t:g}°: {v:+.2f} ± {e:.2f}" for t, v, e in zip((20, 40, 60), value.values, error.values))
        print(f"{name:16} forward shift, % per 100 nm: {words}")


if __name__ == "__main__":
    main()
