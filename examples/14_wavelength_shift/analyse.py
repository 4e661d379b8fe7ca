"""From the files of simulate.py: slopes of the spectral shift, single and multiple reflections apart, with error bars.

    python examples/14_wavelength_shift/analyse.py out/shift -o out/shift.png

Slopes are those of thesis 4.2 at 600 nm in % per 100 nm, the exponent p of the Fresnel reflectance fixed at the number
of reflections (1, or 2 for the rest). Errors are those of the jackknife over rows, as if
these were independent. `--quick` simulates two rows of sample 1 in a folder of its own first (5 s).
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import xarray as xr

import vgonio as vg

PER_100_NM = 1e4  # nm⁻¹ → % per 100 nm
BRIGHT = 1e-2  # of the lobe's largest value: below it nothing is seen and everything is noise
PARTS = {"single": 1.0, "multiple": 2.0, "total": 1.0}


def load(folder: Path, sample: int, fine_nm: float = 0.0) -> xr.Dataset:
    """All rows of a sample, (row, theta_i, theta_o, wavelength)."""
    files = sorted(folder.glob(f"sample{sample}_row*_fine{fine_nm:g}.nc"))
    if not files:
        raise SystemExit(f"no rows of sample {sample} in {folder}: run simulate.py first")
    return xr.concat([vg.open(f).to_dataset() for f in files], "row")


def slopes(brdf: xr.DataArray, p: float) -> xr.DataArray:
    """Slope of every spectrum in % per 100 nm; NaN where a spectrum is too dark to matter."""
    bright = brdf.mean("wavelength") > BRIGHT * brdf.mean("wavelength").max("theta_o")
    fit = vg.compare.fit_local_shift(xr.Dataset({"brdf": brdf}), material="Al", p=p)
    return fit["slope"].where(bright) * PER_100_NM


def jackknife(rows: xr.DataArray, function) -> tuple[xr.DataArray, xr.DataArray]:
    """(value of the mean over rows, standard error by leaving one row out at a time)."""
    n = rows.sizes["row"]
    if n == 1:
        return (value := function(rows.mean("row"))), value * np.nan
    left_out = xr.concat([function(rows.drop_isel(row=i).mean("row")) for i in range(n)], "left_out")
    error = np.sqrt((n - 1) * ((left_out - left_out.mean("left_out")) ** 2).mean("left_out"))
    return function(rows.mean("row")), error


def side(values: xr.DataArray, theta_i: float, which: str) -> xr.DataArray:
    """Directions on the mirror's side (θ_o ≤ −10°) or on that of the source (θ_o ≥ 10°)."""
    theta = values["theta_o"]
    return values.sel(theta_i=theta_i).where((theta <= -10) if which == "forward" else (theta >= 10), drop=True)


def table(data: xr.Dataset, theta_i: float) -> list[dict[str, float | str]]:
    """Mean slope of each side of the lobe, each direction weighted with its BRDF · cos θ_o; of one row, no error."""
    rows: list[dict[str, float | str]] = []
    for which in ("forward", "back"):
        for part, p in PARTS.items():

            def mean(brdf: xr.DataArray, which: str = which, p: float = p) -> xr.DataArray:
                m = side(slopes(brdf, p), theta_i, which)
                weight = side(brdf.mean("wavelength") * np.cos(np.deg2rad(brdf["theta_o"])), theta_i, which)
                return m.weighted(weight.where(m.notnull(), 0.0)).mean("theta_o")

            value, error = jackknife(data[part], mean)
            rows.append({"side": which, "part": part, "slope": float(value), "error": float(error)})
    return rows


def shares(data: xr.Dataset, theta_i: float, which: str) -> tuple[float, float]:
    """Share of multiple reflections in the light of a side: (waves at 600 nm, rays)."""
    found = []
    for single, multiple in (("single", "multiple"), ("rays_single", "rays_multiple")):
        one, more = (data[n].mean("row") for n in (single, multiple))
        one, more = (a.sel(wavelength=600.0) if "wavelength" in a.dims else a for a in (one, more))
        cosine = np.cos(np.deg2rad(one["theta_o"]))
        one, more = (float((side(a, theta_i, which) * cosine).sum()) for a in (one, more))
        found.append(more / (one + more) if one + more else 0.0)
    return found[0], found[1]


def figure(samples: Mapping[str, xr.Dataset], theta_i: float):
    """Above: slope against θ_o, single and multiple apart; below: share of multiple reflections, waves and rays."""
    from matplotlib.figure import Figure

    made = Figure(figsize=(max(5.6, 2.6 * len(samples)), 4.8), layout="constrained")
    grid = made.subplots(2, len(samples), sharex=True, sharey="row", squeeze=False)
    colours = {"single": "#0b4a8f", "multiple": "#5aa2d9", "total": "#1a2230"}
    for column, (title, data) in zip(grid.T, samples.items()):
        for part, p in PARTS.items():
            value, error = jackknife(data[part], lambda brdf, p=p: slopes(brdf, p).sel(theta_i=theta_i))
            column[0].errorbar(
                value["theta_o"], value, error, fmt="o-" if part != "total" else "-", ms=2.5, lw=1,
                color=colours[part], label=part, elinewidth=0.6,
            )  # fmt: skip
        column[0].axhline(0, color="#b9c0ca", lw=0.8, zorder=0)
        column[0].set_title(title, fontsize=9, loc="left")
        for names, style, label in (
            (("single", "multiple"), "-", "waves, 600 nm"),
            (("rays_single", "rays_multiple"), "--", "rays"),
        ):
            one, more = (data[n].mean("row").sel(theta_i=theta_i) for n in names)
            one, more = (a.sel(wavelength=600.0) if "wavelength" in a.dims else a for a in (one, more))
            column[1].plot(one["theta_o"], 100 * more / (one + more), style, color="#1a2230", lw=1, label=label)
        for ax in column:
            ax.axvline(-theta_i, color="#5c6675", lw=0.7, ls=(0, (4, 3)), zorder=0)
            ax.set_xlim(-90, 90)
            ax.set_xticks([-60, 0, 60])
            ax.spines[["top", "right"]].set_visible(False)
    grid[0, 0].set_ylim(-40, 40)
    grid[0, 0].set_ylabel("shift (% per 100 nm)")
    grid[1, 0].set_ylabel("multiple reflections (%)")
    grid[0, 0].legend(fontsize=7.5, frameon=False)
    grid[1, 0].legend(fontsize=7.5, frameon=False)
    made.supxlabel(f"angle of reflection θₒ (°) for θᵢ = {theta_i:g}°, back-scattering to the right", fontsize=9)
    return made


def quick() -> dict[str, xr.Dataset]:
    """Two rows of sample 1 at 40°, simulated now."""
    import simulate

    with tempfile.TemporaryDirectory() as folder:
        simulate.main([folder, "--quick"])
        return {"sample 1": load(Path(folder), 1).load()}


def check() -> None:
    """The slope of a model's spectra whose slope is known: 3 % per 100 nm in every direction, to 1e-6."""
    known = vg.models.evaluate("clausen-2022", [40], np.arange(-80, 81, 10), [450, 600, 750], alpha=0.4, h=3e-4, w=0.0)
    found = slopes(known["brdf"], 1.0)
    assert abs(found - 3.0).max() < 1e-6, found
    print("check: a known slope of 3 % per 100 nm is found again")


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, nargs="?", default=Path("out/shift"))
    parser.add_argument("-o", "--output", type=Path)
    parser.add_argument("--samples", type=int, nargs="+", default=[1, 2, 3, 4, 5])
    parser.add_argument("--theta-i", type=float, default=40.0)
    parser.add_argument("--fine-nm", type=float, nargs="+", default=[0.0])
    parser.add_argument("--quick", action="store_true", help="two rows of sample 1 at 40°, simulated now")
    asked = parser.parse_args(arguments)
    if asked.quick:
        asked.theta_i, samples = 40.0, quick()
    else:
        samples = {
            f"sample {s}" + (f", {f:g} nm below 0.6 µm" if f else ""): load(asked.folder, s, f)
            for s in asked.samples
            for f in asked.fine_nm
        }
    print(f"θ_i = {asked.theta_i:g}°, shift in % per 100 nm, {next(iter(samples.values())).sizes['row']} rows")
    for title, data in samples.items():
        for row in table(data, asked.theta_i):
            line = f"{title:30} {row['side']:8}{row['part']:9}{row['slope']:+7.2f} ± {row['error']:.2f}"
            if row["part"] == "multiple":
                waves, rays = shares(data, asked.theta_i, str(row["side"]))
                line += f"   share {100 * waves:.2g} % (waves), {100 * rays:.2g} % (rays)"
            print(line)
    if asked.output:
        figure(samples, asked.theta_i).savefig(asked.output, dpi=150)
        print(f"figure: {asked.output}")
    check()


if __name__ == "__main__":
    main()
