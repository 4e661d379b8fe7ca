"""May iterated Kirchhoff be trusted with roughness finer than the wavelength? Profiles by the full-wave solver.

Pieces of rows of sample 1, with and without fine roughness, lit by the same tapered beams: the slope of the shift from
the full wave, from iterated Kirchhoff with diffraction, from its tangent planes alone and from their single
reflections, side by side. One file a piece in the folder given, pieces that are there are not computed again.

    python examples/14_wavelength_shift/rigorous.py out/rigorous --rows 4 --fine-nm 0 10      # 5 minutes
    python examples/14_wavelength_shift/rigorous.py --quick                                   # 10 s
"""

from __future__ import annotations

import argparse
import tempfile
import warnings
from pathlib import Path

import numpy as np
import xarray as xr
from analyse import jackknife, side, side_slope
from simulate import FINE_POINTS, profile, with_fine_roughness

import vgonio as vg

LENGTH_UM, COHERENCE_UM = 31.8, 4.0  # below 32 µm both solvers take one window in the middle, of all the piece
WAVELENGTHS = (450.0, 600.0, 750.0)
GONIO = vg.measure.Gonioreflectometer([20, 40, 60], range(-85, 86, 5), aperture_deg=5.0, coherence_um=COHERENCE_UM)


def piece(row: int, fine_nm: float) -> vg.surface.Heightfield:
    """The first 32 µm of a row: one window."""
    surface = profile(1, 16 * row)
    # the same grid with and without: 1 pm of roughness is none
    fine = with_fine_roughness(surface, max(fine_nm, 1e-3) / 1000, seed=1000 + row)
    count = round(LENGTH_UM / fine.dx)
    return vg.surface.Heightfield(fine.z[:, :count], pitch_um=fine.dx, periodic=False)


def theories(surface: vg.surface.Heightfield) -> xr.Dataset:
    """BRDF (θ_i, θ_o, λ) of the same windows by four theories."""
    iterated = vg.wave.IteratedKirchhoff(
        "Al", WAVELENGTHS, bounces=3, beam="tapered", window_um=surface.size_um[1], points_per_wavelength=FINE_POINTS
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        exact = GONIO.measure(surface, vg.wave.FullWave("Al", WAVELENGTHS, tol=1e-2))
        waves = GONIO.measure(surface, iterated)
    return xr.Dataset(
        {
            "full wave": exact["brdf"],
            "with diffraction": waves["brdf"],
            "tangent planes": waves["brdf"] - waves["brdf_diffraction"],
            "their single reflections": waves["brdf_by_bounce"].sel(bounce=1, drop=True),
        }
    )


def load(folder: Path, rows: int, fine_nm: float) -> xr.Dataset:
    """All pieces with one fine roughness, (row, …), simulated where they are not there."""
    folder.mkdir(parents=True, exist_ok=True)
    for row in range(rows):
        path = folder / f"piece{row:02d}_fine{fine_nm:g}.nc"
        if not path.exists():
            vg.save(theories(piece(row, fine_nm)), path)
            print(path.name, flush=True)
    return xr.concat([vg.open(f).to_dataset().load() for f in sorted(folder.glob(f"piece*_fine{fine_nm:g}.nc"))], "row")


def error_of(brdf: xr.DataArray, exact: xr.DataArray) -> float:
    """Σ|Δ| · cos θ_o over Σ of the exact one."""
    cosine = np.cos(np.deg2rad(exact["theta_o"]))
    return float((abs(brdf - exact) * cosine).sum() / (exact * cosine).sum())


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, nargs="?", default=Path("out/rigorous"))
    parser.add_argument("--rows", type=int, default=2)
    parser.add_argument("--fine-nm", type=float, nargs="+", default=[0.0, 10.0])
    parser.add_argument("--quick", action="store_true", help="one row without fine roughness, in a folder of its own")
    asked = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as own:
        if asked.quick:
            asked.rows, asked.fine_nm, asked.folder = 1, [0.0], Path(own)
        for fine in asked.fine_nm:
            report(load(asked.folder, asked.rows, fine), fine)


def report(data: xr.Dataset, fine_nm: float) -> None:
    """Slopes and errors of every theory; the check where there is no fine roughness."""
    exact = data["full wave"]
    for theta_i in GONIO.theta_i_deg:
        for which in ("forward", "back"):
            print(f"{fine_nm:g} nm below 0.6 µm, θ_i = {theta_i:g}°, {which}, {data.sizes['row']} pieces")
            for name, brdf in data.data_vars.items():
                value, error = jackknife(brdf, lambda b, t=theta_i, w=which: side_slope(b, t, w, 1.0))
                off = error_of(side(brdf, theta_i, which), side(exact, theta_i, which))
                print(f"  {name:26}{float(value):+7.2f} ± {float(error):.2f} % per 100 nm, error of the BRDF {off:.3f}")
    if fine_nm == 0:
        off = error_of(data["with diffraction"], exact)
        assert off < 0.05, off
        print(f"check: without roughness finer than the wavelength {off:.1%} from the full wave, 5 % are allowed")


if __name__ == "__main__":
    main()
