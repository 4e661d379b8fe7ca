"""Does the red forward shift of a map sampled at 1 µm survive when the integral over the surface converges?

The thesis (4.4, 4.5) simulated sample 1 on a map with 1 µm steps and found its forward scattering reddish. Here rows of
its surrogate are evaluated three ways with one theory (Kirchhoff, single scattering): the interpolated surface to a
tolerance, plane facets between samples 1 µm apart, and flat texels of 1 µm.

    python examples/14_wavelength_shift/sampling.py --rows 20      # 10 minutes; with --quick 10 s
"""

from __future__ import annotations

import argparse
import warnings

import numpy as np
import xarray as xr
from analyse import jackknife, side, slopes
from simulate import GONIO, QUICK, QUICK_WAVELENGTHS, WAVELENGTHS, profile

import vgonio as vg

BRIGHT = 1e-2  # of the lobe's largest value
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


def error_of(brdf: xr.DataArray, converged: xr.DataArray) -> float:
    """Largest difference over the largest value at the same angle of incidence and wavelength."""
    return float((abs(brdf - converged).max("theta_o") / converged.max("theta_o")).max())


def forward(brdf: xr.DataArray) -> xr.DataArray:
    """Mean slope of the bright directions of the forward side for each θ_i, weighted with BRDF · cos θ_o."""
    angles = [t for t in (20.0, 40.0, 60.0) if t in brdf["theta_i"]]
    light = brdf.mean("wavelength")
    bright = light > BRIGHT * light.max("theta_o")
    m, weight = slopes(brdf, 1.0).where(bright), light.where(bright, 0.0) * np.cos(np.deg2rad(brdf["theta_o"]))
    found = [side(m, t, "forward").weighted(side(weight, t, "forward")).mean("theta_o") for t in angles]
    return xr.concat(found, xr.DataArray(angles, dims="theta_i", name="theta_i"))


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sample", type=int, default=1)
    parser.add_argument("--rows", type=int, default=20)
    parser.add_argument("--quick", action="store_true", help="one row, three wavelengths, 40°")
    asked = parser.parse_args(arguments)
    gonio, wavelengths = (QUICK, QUICK_WAVELENGTHS) if asked.quick else (GONIO, WAVELENGTHS)
    asked.rows = 1 if asked.quick else asked.rows
    solver = vg.wave.Kirchhoff("Al", wavelengths, tol=1e-5)
    first = {}
    for name, (interpolation, pitch) in WAYS.items():
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            rows = [
                gonio.measure(resampled(profile(asked.sample, 16 * r), interpolation, pitch), solver)["brdf"]
                for r in range(asked.rows)
            ]
        first[name] = rows[0]
        value, error = jackknife(xr.concat(rows, "row"), forward)
        values = zip(value["theta_i"].values, value.values, error.values)
        words = ", ".join(f"{t:g}°: {v:+.2f} ± {e:.2f}" for t, v, e in values)
        print(f"{name:16} forward shift, % per 100 nm: {words}")
    check(first, gonio, wavelengths, asked.sample)


def check(first: dict[str, xr.DataArray], gonio, wavelengths, sample: int) -> None:
    """A tenth of the tolerance does not change the converged row; facets and flat texels do by per cents."""
    finer = gonio.measure(profile(sample, 0), vg.wave.Kirchhoff("Al", wavelengths, tol=1e-6))["brdf"]
    converged = first.pop("converged")
    off = {name: error_of(brdf, converged) for name, brdf in first.items()}
    own = error_of(finer, converged)
    assert own < 1e-4, own
    assert min(off.values()) > 0.01, off
    words = ", ".join(f"{name} {value:.1%}" for name, value in off.items())
    print(f"check: error of the converged BRDF {own:.1e} of its largest value, of {words}")


if __name__ == "__main__":
    main()
