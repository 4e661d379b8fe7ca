"""One three-dimensional patch of each surrogate: shares of single and multiple reflections from waves and from rays.

python examples/wavelength_shift/patches.py --samples 1 2 3 4 5      # 10 minutes
"""

from __future__ import annotations

import argparse
import warnings

import numpy as np
import xarray as xr
from analyse import slopes
from simulate import ROOT

import vgonio as vg

WAVELENGTHS = (450.0, 600.0, 750.0)
SIDE_UM = 15.0
GONIO = vg.measure.Gonioreflectometer([60], range(-85, 86, 5), aperture_deg=5.0, coherence_um=SIDE_UM / 6)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--samples", type=int, nargs="+", default=[1])
    asked = parser.parse_args()
    for sample in asked.samples:
        surface = vg.surface.read(ROOT / "heightfields" / f"sample{sample}.npz")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            waves = GONIO.measure(
                surface, vg.wave.IteratedKirchhoff("Al", WAVELENGTHS, bounces=2, window_um=SIDE_UM, windows=1)
            )
            rays = GONIO.measure(surface, vg.geometric.RayOptics("Al", [600.0], rays=100_000))
        waves = waves.sel(theta_i=60)
        energy = waves["energy_by_bounce"].sel(wavelength=600)
        traced = rays["energy_by_bounce"].sel(theta_i=60, wavelength=600)
        share, whole = (float(e.sel(bounce=slice(2, None)).sum() / e.sum()) for e in (energy, traced))
        m = {}
        for name, brdf, p in (
            ("single", waves["brdf_by_bounce"].sel(bounce=1), 1.0),
            ("multiple", waves["brdf_by_bounce"].sel(bounce=2), 2.0),
        ):
            slope = slopes(brdf.expand_dims(theta_i=[60.0]), p).sel(theta_i=60)
            weight = (brdf.mean("wavelength") * np.cos(np.deg2rad(brdf["theta_o"]))).where(slope.notnull(), 0.0)
            m[name] = float(slope.weighted(xr.where(np.isfinite(weight), weight, 0.0)).mean())
        print(
            f"sample {sample}: multiple reflections {100 * share:.2g} % of one patch (waves), {100 * whole:.2g} % of "
            f"the sample (rays); second hits outside the patch {100 * float(waves['second_hits_outside']):.0f} %; mean "
            f"slope single {m['single']:+.1f}, multiple {m['multiple']:+.1f} % per 100 nm",
            flush=True,
        )


if __name__ == "__main__":
    main()
