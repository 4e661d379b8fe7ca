"""One three-dimensional patch of each surrogate: shares of single and multiple reflections from waves and from rays.

python examples/14_wavelength_shift/patches.py --samples 1 2 3 4 5      # 10 minutes
python examples/14_wavelength_shift/patches.py --quick                  # a patch of 6 µm of sample 5
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
QUICK_SIDE_UM = 6.0


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--samples", type=int, nargs="+", default=[1])
    parser.add_argument("--quick", action="store_true", help=f"a patch of {QUICK_SIDE_UM:g} µm of sample 5")
    asked = parser.parse_args(arguments)
    length = QUICK_SIDE_UM if asked.quick else SIDE_UM
    asked.samples = [5] if asked.quick else asked.samples
    gonio = vg.measure.Gonioreflectometer([60], range(-85, 86, 5), aperture_deg=5.0, coherence_um=length / 6)
    for sample in asked.samples:
        surface = vg.surface.read(ROOT / "heightfields" / f"sample{sample}.npz")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            waves = gonio.measure(
                surface, vg.wave.IteratedKirchhoff("Al", WAVELENGTHS, bounces=2, window_um=length, windows=1)
            )
            rays = gonio.measure(surface, vg.geometric.RayOptics("Al", [600.0], rays=100_000))
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
        # what is reflected once leaves, or is hit again: no more than a mirror reflects, but for the patch's edges
        once = float(energy.sel(bounce=1) / waves["fresnel_macro"].sel(wavelength=600))
        assert 0.5 < once < 1.05, once
        print(f"check: the first reflection has {once:.1%} of the light of a flat mirror")


if __name__ == "__main__":
    main()
