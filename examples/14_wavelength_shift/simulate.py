"""Profiles of the surrogate samples by iterated Kirchhoff and by rays: spectra of every order of reflection.

Each row of a height field is a profile; every 16th is taken, 10 µm apart: their speckle is independent, their cavities
are not quite (Sal 19 to 28 µm), so errors over rows can be low: docs/wavelength_shift.md says by how much. One file a
row in the folder given, rows that are there are not computed again.

    python examples/14_wavelength_shift/simulate.py out/shift --samples 1 2 3 4 5 --rows 12      # 45 minutes
    python examples/14_wavelength_shift/simulate.py out/quick --quick                            # 4 s
"""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import xarray as xr

import vgonio as vg

ROOT = Path(__file__).resolve().parents[2]
WAVELENGTHS = np.arange(400.0, 751.0, 50.0)
GONIO = vg.measure.Gonioreflectometer(
    theta_i_deg=[0, 20, 40, 60], theta_o_deg=range(-85, 86, 5), aperture_deg=4.0, coherence_um=10.0
)
QUICK = vg.measure.Gonioreflectometer([40], range(-85, 86, 5), aperture_deg=4.0, coherence_um=10.0)
QUICK_WAVELENGTHS = (450.0, 600.0, 750.0)
POINTS, FINE_POINTS = 10.0, 15.0  # per wavelength; 10 change the back-scattering of fine roughness by 1.5 % at 750 nm
WINDOW_UM = 100.0  # of 60 µm, half of the second hits of sample 1 at 60° fall outside
ALLOWED = 0.05  # of the light of a flat mirror, see check
MISSED = 0.03  # of the light, at most, may meet the surface again outside its window


def profile(sample: int, row: int) -> vg.surface.Heightfield:
    """One row of a surrogate as a periodic profile."""
    field = vg.surface.read(ROOT / "heightfields" / f"sample{sample}.npz")
    z = field.z[row % field.z.shape[0]]
    return vg.surface.Heightfield(np.repeat(z[None], 4, axis=0), pitch_um=field.pitch_um, periodic=True)


def with_fine_roughness(surface: vg.surface.Heightfield, rms_um: float, seed: int) -> vg.surface.Heightfield:
    """The profile on a grid eight times finer, with roughness that no confocal microscope sees.

    Spatial wavelengths of 0.2 to 0.6 µm, PSD ∝ f⁻² in one dimension (a self-affine tail of Hurst exponent 0.5).
    """
    import scipy.fft as fft

    n, pitch = surface.z.shape[1] * 8, float(surface.pitch_um[1]) / 8
    spectrum = fft.rfft(surface.z[0])
    fine = fft.irfft(np.pad(spectrum, (0, n // 2 + 1 - spectrum.size)), n) * 8
    f = fft.rfftfreq(n, pitch)
    band = (f >= 1 / 0.6) & (f <= 1 / 0.2)
    noise = np.zeros(f.size, complex)
    noise[band] = np.exp(2j * np.pi * np.random.default_rng(seed).random(band.sum())) / f[band]
    tail = fft.irfft(noise, n)
    return vg.surface.Heightfield(
        np.repeat((fine + tail * rms_um / tail.std())[None], 4, axis=0), pitch_um=pitch, periodic=True
    )


def orders(
    surface: vg.surface.Heightfield, wavelengths: Sequence[float], windows: int = 4, gonio=GONIO, per: float = 10.0
) -> xr.Dataset:
    """BRDF from iterated Kirchhoff with `per` points per wavelength: by number of reflections on tangent planes, their
    coherent sum, and that with diffraction (`total`); the rays' shares beside it."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        waves = gonio.measure(
            surface,
            vg.wave.IteratedKirchhoff(
                "Al", wavelengths, bounces=3, window_um=WINDOW_UM, windows=windows, points_per_wavelength=per
            ),
        )
        rays = gonio.measure(surface, vg.geometric.RayOptics("Al", wavelength_nm=[600.0], rays=100_000))
    by = rays["brdf_by_bounce"].isel(wavelength=0, drop=True)
    return xr.Dataset(
        {
            "single": waves["brdf_by_bounce"].sel(bounce=1, drop=True),
            "multiple": waves["brdf_by_bounce"].sel(bounce=slice(2, None)).sum("bounce"),
            "tangent": waves["brdf"] - waves["brdf_diffraction"],
            "total": waves["brdf"],
            "energy": waves["energy_by_bounce"],
            "energy_reflected": waves["energy_reflected"],
            "fresnel_macro": waves["fresnel_macro"],
            "second_hits": waves["second_hits"],
            "second_hits_outside": waves["second_hits_outside"],
            "rays_single": by.sel(bounce=1, drop=True),
            "rays_multiple": by.sel(bounce=slice(2, None)).sum("bounce"),
        },
        attrs={n: waves.attrs[n] for n in ("error_achieved", "sweeps_done", "sweeps_change", "diffraction_left_out")},
    )


def check(data: xr.Dataset) -> float:
    """How far all light, with diffraction, is from what a flat mirror reflects, at 600 nm and up to 40°: the relief is
    gentle, and what is reflected once leaves. ALLOWED is for several reflections, speckle, and what fine roughness lets
    the metal absorb."""
    some = data.sel(wavelength=600.0, theta_i=data["theta_i"] <= 40)
    return float(abs(some["energy_reflected"] / some["fresnel_macro"] - 1).max())


def missed(data: xr.Dataset) -> float:
    """Share of the light that meets the surface again outside its window, by rays: the largest of all θ_i."""
    return float((data["second_hits"] * data["second_hits_outside"]).max())


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--samples", type=int, nargs="+", default=[1])
    parser.add_argument("--rows", type=int, default=3)
    parser.add_argument("--windows", type=int, default=4)
    parser.add_argument("--fine-nm", type=float, nargs="+", default=[0.0], help="RMS of roughness below 0.6 µm")
    parser.add_argument("--wavelengths", type=float, nargs="+", default=list(WAVELENGTHS))
    parser.add_argument("--quick", action="store_true", help="two rows, one window each, three wavelengths, 40°")
    asked = parser.parse_args(arguments)
    gonio = GONIO
    if asked.quick:
        asked.rows, asked.windows, asked.wavelengths, gonio = 2, 1, QUICK_WAVELENGTHS, QUICK
    asked.folder.mkdir(parents=True, exist_ok=True)
    jobs = [(s, r, f) for r in range(asked.rows) for s in asked.samples for f in asked.fine_nm]
    outside = []  # told at the end: a row that fails the check is a result as well, and leaving it out would choose
    for n, (sample, row, fine) in enumerate(jobs):
        path = asked.folder / f"sample{sample}_row{row:02d}_fine{fine:g}.nc"
        if not path.exists():
            surface = profile(sample, 16 * row)
            if fine:
                surface = with_fine_roughness(surface, fine / 1000, seed=1000 * sample + row)
            per = FINE_POINTS if fine else POINTS
            vg.save(orders(surface, asked.wavelengths, asked.windows, gonio, per), path)
        data = vg.open(path).to_dataset()
        off, lost = check(data), missed(data)
        print(
            f"{n + 1} of {len(jobs)}: {path.name}, check: {off:.2%} from the light of a flat mirror, "
            f"{lost:.2%} of the light is lost beyond the windows",
            flush=True,
        )
        outside += [path.name] * (off >= ALLOWED or lost >= MISSED)
    if outside:
        raise SystemExit(
            f"all rows are there, but more than {ALLOWED:.0%} from a flat mirror or more than {MISSED:.0%} lost: "
            + ", ".join(outside)
        )


if __name__ == "__main__":
    main()
