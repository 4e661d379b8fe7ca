"""From the files of simulate.py: slopes of the spectral shift, single and multiple reflections apart, with error bars.

    python examples/14_wavelength_shift/analyse.py out/shift -o out/shift.png

Slopes are those of thesis 4.2 at 600 nm in % per 100 nm, the exponent p of the Fresnel reflectance fixed at the number
of reflections (1, or 2 for the rest). Errors are those of the jackknife over rows, or over blocks of three neighbours
where that is larger. `--quick` simulates two rows of sample 1 in a folder of its own first (5 s).
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
BRIGHT = 2e-3  # of the lobe's largest value: directions that are drawn
PART = 1e-2  # of the light of a direction: parts that are drawn there
BLOCK, FEWEST = 3, 3  # neighbouring rows in a block, 30 µm; as many blocks tell something of their spread
PARTS = {"single": 1.0, "multiple": 2.0, "tangent": 1.0, "total": 1.0}
BRDFS = (*PARTS, "rays_single", "rays_multiple")
STYLES: dict[str, dict] = {
    "single": {"fmt": "o-", "lw": 1, "color": "#0b4a8f", "label": "single reflections"},
    "multiple": {"fmt": "o-", "lw": 1, "color": "#5aa2d9", "label": "multiple reflections"},
    "tangent": {"fmt": "--", "lw": 1, "color": "#8a93a0", "label": "all, tangent planes alone"},
    "total": {"fmt": "-", "lw": 1.6, "color": "#1a2230", "label": "all, with diffraction"},
}


def load(folder: Path, sample: int, fine_nm: float = 0.0) -> xr.Dataset:
    """All rows of a sample, (row, theta_i, theta_o, wavelength)."""
    files = sorted(folder.glob(f"sample{sample}_row*_fine{fine_nm:g}.nc"))
    if not files:
        raise SystemExit(f"no rows of sample {sample} in {folder}: run simulate.py first")
    return xr.concat([vg.open(f).to_dataset() for f in files], "row")


def slopes(brdf: xr.DataArray, p: float) -> xr.DataArray:
    """Slope of every spectrum in % per 100 nm."""
    fit = vg.compare.fit_local_shift(xr.Dataset({"brdf": brdf}), material="Al", p=p)
    return fit["slope"] * PER_100_NM


def drawn(data: xr.Dataset, part: str) -> xr.DataArray:
    """Directions where there is light, and this part is some of it."""
    light, some = (data[name].mean(("row", "wavelength")) for name in ("total", part))
    return (light > BRIGHT * light.max("theta_o")) & (some > PART * light)


def jackknife(rows: xr.DataArray, function) -> tuple[xr.DataArray, xr.DataArray]:
    """(value of the mean over rows, standard error by leaving one row out at a time)."""
    n = rows.sizes["row"]
    if n == 1:
        return (value := function(rows.mean("row"))), value * np.nan
    left_out = xr.concat([function(rows.drop_isel(row=i).mean("row")) for i in range(n)], "left_out")
    error = np.sqrt((n - 1) * ((left_out - left_out.mean("left_out")) ** 2).mean("left_out"))
    return function(rows.mean("row")), error


def with_error(rows: xr.DataArray, function) -> tuple[xr.DataArray, xr.DataArray]:
    """(value, standard error): the larger of two jackknives, over rows and over blocks of neighbours, which share
    cavities; of too few rows for FEWEST blocks that over rows."""
    value, error = jackknife(rows, function)
    whole = rows.sizes["row"] // BLOCK * BLOCK
    if whole < FEWEST * BLOCK:
        return value, error
    blocks = rows.isel(row=slice(0, whole)).coarsen(row=BLOCK).mean()
    other = jackknife(blocks, function)[1]
    return value, error.where(error > other, other)


def side(values: xr.DataArray, theta_i: float, which: str) -> xr.DataArray:
    """Directions on the mirror's side (θ_o ≤ −10°) or on that of the source (θ_o ≥ 10°)."""
    theta = values["theta_o"]
    return values.sel(theta_i=theta_i).where((theta <= -10) if which == "forward" else (theta >= 10), drop=True)


def side_slope(brdf: xr.DataArray, theta_i: float, which: str, p: float) -> xr.DataArray:
    """Slope of all light of a side: Σ BRDF · cos θ_o, from every direction the Fresnel reflectance taken out."""
    some = side(brdf, theta_i, which)
    facet = np.cos(np.deg2rad(theta_i - some["theta_o"].values) / 2)
    fresnel = vg.materials.material("Al").reflectance(facet, some["wavelength"].values)
    weight = np.cos(np.deg2rad(some["theta_o"].values))[:, None] / fresnel**p
    light = (some * xr.DataArray(weight, dims=("theta_o", "wavelength"))).sum("theta_o")
    spectrum = light.expand_dims(theta_i=[theta_i], theta_o=[0.0])
    fit = vg.compare.fit_local_shift(xr.Dataset({"brdf": spectrum}), material=None, p=0.0)
    return fit["slope"].squeeze(drop=True) * PER_100_NM


def table(data: xr.Dataset, theta_i: float) -> list[dict[str, float | str]]:
    """Slope of the light of each side of the lobe, of every part; of one row, no error."""
    rows: list[dict[str, float | str]] = []
    for which in ("forward", "back"):
        for part, p in PARTS.items():
            value, error = with_error(data[part], lambda b, w=which, p=p: side_slope(b, theta_i, w, p))
            rows.append({"side": which, "part": part, "slope": float(value), "error": float(error)})
    return rows


def added(fine: xr.Dataset, relief: xr.Dataset, theta_i: float, which: str) -> tuple[float, float]:
    """(slope of all light with fine roughness minus that without, standard error): of the same rows, so that what is
    chance among rows hardly enters."""
    both = xr.concat([relief["total"], fine["total"]], "fine", join="exact")

    def difference(b: xr.DataArray) -> xr.DataArray:
        without, with_it = (side_slope(b.isel(fine=k), theta_i, which, PARTS["total"]) for k in (0, 1))
        return with_it - without

    value, error = with_error(both, difference)
    return float(value), float(error)


def shares(data: xr.Dataset, theta_i: float, which: str) -> dict[str, float]:
    """Shares in the light of a side: multiple reflections by waves at 600 nm and by rays, the change by diffraction
    (Σ|Δ| over all wavelengths); and the side's own share in all light."""
    cosine = np.cos(np.deg2rad(data["theta_o"]))
    light = data.mean("row") * cosine
    some = xr.Dataset({name: side(light[name], theta_i, which) for name in BRDFS})
    total = some.sum()
    yellow = some.sel(wavelength=600.0).sum()
    return {
        "waves": float(yellow["multiple"] / (yellow["single"] + yellow["multiple"])),
        "rays": float(total["rays_multiple"] / (total["rays_single"] + total["rays_multiple"])),
        "diffraction": float(abs(some["total"] - some["tangent"]).sum() / total["total"]),
        "side": float(total["total"] / light["total"].sel(theta_i=theta_i).sum()),
    }


def figure(samples: Mapping[str, xr.Dataset], theta_i: float, highest: float = 60.0):
    """Above: slope against θ_o, by parts; below: shares of multiple reflections and of diffraction at 600 nm, up to
    `highest` %."""
    from matplotlib.figure import Figure

    made = Figure(figsize=(max(7.0, 2.6 * len(samples)), 5.2), layout="constrained")
    grid = made.subplots(2, len(samples), sharex=True, sharey="row", squeeze=False)
    for column, (title, data) in zip(grid.T, samples.items()):
        for part, p in PARTS.items():
            found = with_error(data[part], lambda brdf, p=p: slopes(brdf, p).sel(theta_i=theta_i))
            value, error = (a.where(drawn(data, part).sel(theta_i=theta_i)) for a in found)
            column[0].errorbar(value["theta_o"], value, error, ms=2.5, elinewidth=0.6, **STYLES[part])
        column[0].axhline(0, color="#b9c0ca", lw=0.8, zorder=0)
        column[0].set_title(title, fontsize=9, loc="left")
        draw_shares(column[1], data.where(drawn(data, "total")).mean("row").sel(theta_i=theta_i))
        for ax in column:
            ax.axvline(-theta_i, color="#5c6675", lw=0.7, ls=(0, (4, 3)), zorder=0)
            ax.set_xlim(-90, 90)
            ax.set_xticks([-60, 0, 60])
            ax.spines[["top", "right"]].set_visible(False)
    grid[0, 0].set_ylim(-60, 40)
    grid[0, 0].set_ylabel("shift (% per 100 nm)")
    grid[1, 0].set_ylim(0, min(highest, grid[1, 0].get_ylim()[1]))
    grid[1, 0].set_ylabel("of the light at 600 nm (%)")
    labelled = [pair for ax in grid[:, 0] for pair in zip(*ax.get_legend_handles_labels())]
    made.legend(*zip(*labelled), loc="outside upper left", ncols=4, fontsize=7.5, frameon=False)
    made.supxlabel(f"angle of reflection θₒ (°) for θᵢ = {theta_i:g}°, back-scattering to the right", fontsize=9)
    return made


def draw_shares(ax, data: xr.Dataset) -> None:
    """Multiple reflections over the sum of single and multiple ones, by waves and by rays; change by diffraction over
    all."""
    waves = data.sel(wavelength=600.0)
    theta_o = data["theta_o"]
    shares = waves["multiple"] / (waves["single"] + waves["multiple"])
    rays = data["rays_multiple"] / (data["rays_single"] + data["rays_multiple"])
    change = abs(waves["total"] - waves["tangent"]) / waves["total"]
    ax.plot(theta_o, 100 * shares, color="#1a2230", lw=1, label="multiple reflections, waves")
    ax.plot(theta_o, 100 * rays, "--", color="#1a2230", lw=1, label="multiple reflections, rays")
    ax.plot(theta_o, 100 * change, color="#c2571a", lw=1, label="change by diffraction")


def told(samples: Mapping[str, xr.Dataset], theta_i: float) -> None:
    """What fine roughness adds to the slopes of a sample's relief, where both are there."""
    for title, data in samples.items():
        relief = samples.get(title.split(",")[0])
        if relief is None or relief is data or relief.sizes["row"] < data.sizes["row"]:
            continue
        for which in ("forward", "back"):
            value, error = added(data, relief.isel(row=slice(0, data.sizes["row"])), theta_i, which)
            print(f"{title:30} {which:8}minus the relief alone {value:+7.2f} ± {error:.2f}")


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
    parser.add_argument("--highest", type=float, default=60.0, help="largest share drawn, in %%")
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
            of = shares(data, asked.theta_i, str(row["side"]))
            if row["part"] == "multiple":
                line += f"   share {of['waves']:.2%} (waves), {of['rays']:.2%} (rays)"
            if row["part"] == "total":
                line += f"   changed by diffraction {of['diffraction']:.2%}, {of['side']:.2%} of all light"
            print(line)
    told(samples, asked.theta_i)
    if asked.output:
        figure(samples, asked.theta_i, asked.highest).savefig(asked.output, dpi=150)
        print(f"figure: {asked.output}")
    check()


if __name__ == "__main__":
    main()
