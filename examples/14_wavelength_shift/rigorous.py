"""May iterated Kirchhoff be trusted with roughness finer than the wavelength? Profiles by the full-wave solver.

Pieces of rows of sample 1, with and without fine roughness, lit by the same tapered beams: the slope of the shift from
both solvers, side by side.

    python examples/14_wavelength_shift/rigorous.py --rows 6 --fine-nm 0 10 20      # 20 minutes
    python examples/14_wavelength_shift/rigorous.py --quick                         # 10 s
"""

from __future__ import annotations

import argparse
import warnings

import numpy as np
import xarray as xr
from analyse import jackknife, side, slopes
from simulate import profile, with_fine_roughness

import vgonio as vg

LENGTH_UM, COHERENCE_UM = 32.0, 4.0
WAVELENGTHS = (450.0, 600.0, 750.0)
GONIO = vg.measure.Gonioreflectometer([40], range(-85, 86, 5), aperture_deg=5.0, coherence_um=COHERENCE_UM)


def piece(row: int, fine_nm: float) -> vg.surface.Heightfield:
    """The first 32 µm of a row: two overlapping windows."""
    surface = profile(1, 16 * row)
    # the same grid with and without: 1 pm of roughness is none
    fine = with_fine_roughness(surface, max(fine_nm, 1e-3) / 1000, seed=1000 + row)
    count = round(LENGTH_UM / fine.dx)
    return vg.surface.Heightfield(fine.z[:, :count], pitch_um=fine.dx, periodic=False)


def both(surface: vg.surface.Heightfield) -> xr.Dataset:
    """BRDF (θ_o, λ) of the same windows: rigorous, iterated, and the single reflections of the latter."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        exact = GONIO.measure(surface, vg.wave.FullWave("Al", WAVELENGTHS, tol=1e-2))
        waves = GONIO.measure(surface, vg.wave.IteratedKirchhoff("Al", WAVELENGTHS, bounces=3, beam="tapered"))
    return xr.Dataset(
        {
            "full wave": exact["brdf"],
            "iterated": waves["brdf"],
            "single": waves["brdf_by_bounce"].sel(bounce=1, drop=True),
        }
    )


def mean(brdf: xr.DataArray, which: str) -> xr.DataArray:
    m = side(slopes(brdf, 1.0), 40.0, which)
    weight = side(brdf.mean("wavelength") * np.cos(np.deg2rad(brdf["theta_o"])), 40.0, which)
    return m.weighted(weight.where(m.notnull(), 0.0)).mean("theta_o")


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rows", type=int, default=2)
    parser.add_argument("--fine-nm", type=float, nargs="+", default=[0.0, 10.0])
    parser.add_argument("--quick", action="store_true", help="one row without fine roughness")
    asked = parser.parse_args(arguments)
    if asked.quick:
        asked.rows, asked.fine_nm = 1, [0.0]
    for fine in asked.fine_nm:
        data = xr.concat([both(piece(r, fine)) for r in range(asked.rows)], "row")
        print(f"{fine:g} nm below 0.6 µm, θ_i = 40°, % per 100 nm")
        for which in ("forward", "back"):
            values = {name: jackknife(data[name], lambda b, w=which: mean(b, w)) for name in data.data_vars}
            print(f"  {which:8}", *(f"{n}: {float(v):+.2f} ± {float(e):.2f}  " for n, (v, e) in values.items()))
        difference = data["iterated"] - data["full wave"]
        for name, b in (("iterated", difference), ("single", data["single"] - data["full wave"])):
            error = np.sqrt((b**2).sum() / (data["full wave"] ** 2).sum())
            print(f"  {name}: error of the BRDF against full wave {float(error):.3f}", flush=True)
            if fine == 0:
                assert error < 0.05, error
    if 0 in asked.fine_nm:
        print("check: without roughness finer than the wavelength tangent-plane theory is within 5 % of the full wave")


if __name__ == "__main__":
    main()
