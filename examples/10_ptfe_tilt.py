"""Do measured spectra of sintered PTFE tilt at grazing angles, as Clausen 2022 says of Spectralon? NIST's data answer.

    python examples/10_ptfe_tilt.py [PTFE.data.csv] [-o ptfe.png]

PTFE.data.csv is NIST's table (Germer 2017: full Mueller BRDF of sintered PTFE, the material of Spectralon), by default
at ../shared/data/nist_ptfe. In plane it holds 108 geometries at 351, 532, 633 and 1064 nm, values to three digits.

1. Lambert, Oren–Nayar, Cook–Torrance (4.7) and the shift model (4.8) fitted, with residuals.
2. Slopes: each spectrum, over the mean spectrum of the geometries with θ_i ≤ 45° and |θ_o| ≤ 45°, which takes out the
   colour of the material, fitted with a straight line through all four wavelengths (p = 0). The scatter of those
   geometries is the error; forward and backward grazing groups are compared with it.
"""

from __future__ import annotations

import argparse
import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

import vgonio as vg
from vgonio.compare import fit_model
from vgonio.compare.model_table import parameter_text

DEFAULT = Path(os.environ.get("VGONIO_SHARED", "../shared")) / "data" / "nist_ptfe" / "PTFE.data.csv"
WAVELENGTH_N = 633.0
MODELS = ("lambert-1760", "oren-nayar-1994", "cook-torrance-1982", "clausen-2022")
# Lambert and Oren–Nayar coincide here, and so do the other two: dashes on lines
STYLES = dict(zip(MODELS, ("-", (0, (4, 3)), "-", (0, (4, 3)))))
NEAR_NORMAL = 45.0
GRAZING = 59.0
GROUPS = {
    "forward, θi ≥ 60°, θo ≤ −53°": (lambda i, o: (i > GRAZING) & (o < -53), "forward"),
    "forward, θi ≤ 45°, θo = −64°": (lambda i, o: (i < 46) & (o < -64), "forward"),
    "backward, θi ≥ 60°, θo ≥ 53°": (lambda i, o: (i > GRAZING) & (o > 53), "backward"),
    "between, θi = 75°, |θo| ≤ 45°": (lambda i, o: (i > 70) & (abs(o) <= 45), "between"),
}


def fits(data: xr.Dataset) -> dict[str, xr.Dataset]:
    """Every model; k_d(λ) is free, what is not a facet model takes no index. Errors by angle of incidence: what a model
    misses is alike in neighbouring directions."""
    found = {}
    for name in MODELS:
        fixed: dict[str, Any] = {"wavelength_n_nm": WAVELENGTH_N} if name == "clausen-2022" else {}
        found[name] = fit_model(data, name, material=None, cluster="theta_i", **fixed)
    return found


def residual_text(data: xr.Dataset, fit: xr.Dataset) -> str:
    """Relative residuals in percent: all, near the normal, grazing on both sides."""
    relative = (fit.brdf / data.brdf - 1) * 100
    i, o = xr.broadcast(data.theta_i, data.theta_o)
    parts = {
        "all": relative,
        "near normal": relative.where((i <= NEAR_NORMAL) & (abs(o) <= NEAR_NORMAL)),
        "grazing forward": relative.where((i > GRAZING) & (o < -50)),
        "grazing backward": relative.where((i > GRAZING) & (o > 50)),
    }
    rms = {k: float(np.sqrt((v**2).mean())) for k, v in parts.items()}
    bias = {k: float(v.mean()) for k, v in parts.items()}
    return ", ".join(f"{k} {rms[k]:.1f} % ({bias[k]:+.1f})" for k in parts)


def slopes(data: xr.Dataset) -> tuple[xr.DataArray, float]:
    """Slope of each spectrum in % per 100 nm relative to the mean near the normal, and the scatter of those near it."""
    i, o = xr.broadcast(data.theta_i, data.theta_o)
    normal = (i <= NEAR_NORMAL) & (abs(o) <= NEAR_NORMAL)
    relative = data.brdf / data.brdf.where(normal).mean(("theta_i", "theta_o"))
    relative = relative / relative.mean("wavelength")
    x = data.wavelength - data.wavelength.mean()
    slope = (relative * x).sum("wavelength", skipna=False) / (x**2).sum() * 1e4
    return slope, float(slope.where(normal).std())


def groups(slope: xr.DataArray, scatter: float) -> list[dict[str, Any]]:
    """Mean slope of each group with its standard error: the larger of the group's own scatter and that near normal."""
    i, o = xr.broadcast(slope.theta_i, slope.theta_o)
    rows = []
    for name, (chosen, side) in GROUPS.items():
        values = slope.where(chosen(i, o)).values
        values = values[np.isfinite(values)]
        error = max(scatter, float(values.std(ddof=1))) / np.sqrt(values.size)
        rows.append({"group": name, "side": side, "n": values.size, "slope": float(values.mean()), "error": error})
    return rows


def contrast(rows: list[dict[str, Any]]) -> tuple[float, float]:
    """Forward minus backward slope at grazing incidence, with its error."""
    a, b = (next(r for r in rows if r["group"].startswith(f"{side}, θi ≥ 60°")) for side in ("forward", "backward"))
    return a["slope"] - b["slope"], float(np.hypot(a["error"], b["error"]))


def figure(data: xr.Dataset, found: dict[str, xr.Dataset], slope: xr.DataArray, scatter: float, path: Path) -> None:
    """Above: measured and fitted BRDF at 633 nm. Below: slopes of the spectra."""
    from vgonio.report.style import FURTHER_COLOURS, INK, MUTED, angle, new_figure, styled

    @styled
    def draw() -> None:
        made = new_figure(10.0, 5.6)
        grid = made.subplots(2, 3, sharex=True, sharey="row")
        colour = dict(zip(MODELS, (MUTED, *FURTHER_COLOURS)))
        for column, theta_i in enumerate((0.0, 60.0, 75.0)):
            top, low = grid[0][column], grid[1][column]
            for name, fit in found.items():
                one = fit.brdf.sel(theta_i=theta_i, wavelength=WAVELENGTH_N).dropna("theta_o")
                top.plot(one.theta_o, one, color=colour[name], lw=1.4, label=name, ls=STYLES[name])
            one = data.brdf.sel(theta_i=theta_i, wavelength=WAVELENGTH_N)
            top.plot(one.theta_o, one, "o", color=INK, ms=3.5, label="NIST, 633 nm")
            top.set_title(f"θᵢ = {angle(theta_i)}")
            m = slope.sel(theta_i=theta_i)
            low.errorbar(m.theta_o, m, scatter, fmt="o", color=INK, ms=3.5, elinewidth=0.8)
            low.axhline(0, color=MUTED, lw=0.8)
            for ax in (top, low):
                ax.axvline(-theta_i, color=MUTED, lw=0.8, ls=(0, (4, 3)))
                ax.set_xlim(-88, 88)
                ax.set_xticks(np.arange(-60, 61, 30))
        grid[0][0].set_ylabel("BRDF (sr⁻¹)")
        grid[1][0].set_ylabel("slope (% per 100 nm)")
        made.supxlabel("angle of reflection θₒ (°); mirror direction dashed", fontsize=9)
        handles, labels = grid[0][0].get_legend_handles_labels()
        made.legend(handles, labels, loc="outside upper left", ncols=5)
        path.parent.mkdir(parents=True, exist_ok=True)
        made.savefig(path, dpi=140)

    draw()


def main(arguments: list[str] | None = None) -> dict[str, Any]:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])  # type: ignore[union-attr]
    parser.add_argument("file", nargs="?", type=Path, default=DEFAULT)
    parser.add_argument("-o", "--output", type=Path, default=Path("out/ptfe.png"))
    options = parser.parse_args(arguments)
    data = vg.measure.read(options.file)
    found = fits(data)
    for name, fit in found.items():
        print(f"{name}: {parameter_text(fit)}\n  residuals, RMS (mean): {residual_text(data, fit)}")
        for note in json.loads(fit.attrs["notes"]):
            print(f"  note: {note}")
    slope, scatter = slopes(data)
    rows = groups(slope, scatter)
    print(f"slopes in % per 100 nm, scatter of one spectrum near the normal {scatter:.2f}")
    for row in rows:
        sigma = row["slope"] / row["error"]
        print(f"  {row['group']}: {row['slope']:+.2f} ± {row['error']:.2f} ({sigma:+.1f} σ, {row['n']} spectra)")
    difference, error = contrast(rows)
    print(f"forward minus backward at grazing incidence: {difference:+.2f} ± {error:.2f} ({difference / error:.1f} σ)")
    for left_out in data.wavelength.values:
        part = contrast(groups(*slopes(data.drop_sel(wavelength=left_out))))
        print(f"  without {left_out:g} nm: {part[0]:+.2f} ± {part[1]:.2f}")
    figure(data, found, slope, scatter, options.output)
    print(f"figure: {options.output}")
    check(data, found, scatter)
    return {"rows": rows, "difference": difference, "error": error, "scatter": scatter}


def check(data: xr.Dataset, found: dict[str, xr.Dataset], scatter: float) -> None:
    """108 geometries; the richer model never fits worse; the scatter is that of three digits and 1 % of noise."""
    assert int(data.brdf.isel(wavelength=0).notnull().sum()) == 108
    costs = [found[m].attrs["cost"] for m in ("lambert-1760", "cook-torrance-1982", "clausen-2022")]
    assert costs[0] > costs[1] >= costs[2] * 0.999
    assert 0.02 < scatter < 1
    print("check: 108 geometries, richer models fit no worse, the scatter is that of three digits and 1 % of noise")


if __name__ == "__main__":
    main()
