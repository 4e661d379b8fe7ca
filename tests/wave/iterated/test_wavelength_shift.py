"""The example on the wavelength shift: its surfaces are what they are said to be, its slopes those of known spectra."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import vgonio as vg

FOLDER = Path(__file__).resolve().parents[3] / "examples" / "14_wavelength_shift"


@pytest.fixture(scope="module")
def example():
    """The modules of the example, imported as its scripts import each other."""
    sys.path.insert(0, str(FOLDER))
    try:
        import analyse
        import sampling
        import simulate

        yield {"simulate": simulate, "analyse": analyse, "sampling": sampling}
    finally:
        sys.path.remove(str(FOLDER))
        for name in ("analyse", "sampling", "simulate"):
            sys.modules.pop(name, None)


def test_fine_roughness_is_what_the_microscope_does_not_see(example):
    simulate = example["simulate"]
    coarse = simulate.profile(1, 0)
    fine = simulate.with_fine_roughness(coarse, 0.010, seed=3)
    added = fine.z[0] - simulate.with_fine_roughness(coarse, 1e-9, seed=3).z[0]
    assert added.std() == pytest.approx(0.010, rel=1e-6)
    spectrum = np.abs(np.fft.rfft(added)) ** 2
    f = np.fft.rfftfreq(added.size, fine.dx)
    inside = (f >= 1 / 0.6 - 1e-9) & (f <= 1 / 0.2 + 1e-9)
    assert spectrum[~inside].sum() < 1e-12 * spectrum.sum()
    # PSD ∝ f⁻²
    order = np.polyfit(np.log(f[inside]), np.log(spectrum[inside]), 1)[0]
    assert order == pytest.approx(-2.0, abs=0.01)
    # the relief that was seen is the same: the profile's own samples, read off the finer grid
    again = np.fft.irfft(np.fft.rfft(fine.z[0])[: coarse.z.shape[1] // 2 + 1] / 8, coarse.z.shape[1])
    assert np.abs(again - coarse.z[0]).max() < 1e-9


def test_rows_that_fail_the_check_are_kept_and_named_at_the_end(example, tmp_path, monkeypatch):
    """Of three rows one lacks 6 % of a flat mirror's light at 40°, the others 4 %; at 60° 20 % do not count. Of the
    third 4 % meet the surface again outside their window (a tenth of 40 %), of the second 2 %."""
    simulate, lost, second = example["simulate"], iter([0.06, 0.04, 0.04]), iter([0.0, 0.2, 0.4])

    def orders(*_):
        mirror = xr.DataArray([[0.9, 0.9]], coords={"wavelength": [600.0], "theta_i": [40.0, 60.0]})
        left, hits, outside = (
            xr.DataArray(two, coords={"theta_i": [40.0, 60.0]})
            for two in ([1 - next(lost), 0.8], [0.0, next(second)], [1.0, 0.1])
        )
        energies = {"energy_reflected": mirror * left, "fresnel_macro": mirror}
        return xr.Dataset(energies | {"second_hits": hits, "second_hits_outside": outside})

    monkeypatch.setattr(simulate, "orders", orders)
    with pytest.raises(SystemExit, match=r"than 5% .*than 3% lost: sample1_row00_fine0.nc, .*row02_fine0.nc$"):
        simulate.main([str(tmp_path), "--rows", "3"])
    assert len(list(tmp_path.glob("*.nc"))) == 3


def test_what_fine_roughness_adds_is_paired_by_rows(example):
    """Rows whose slopes differ by 5 % per 100 nm among themselves, fine roughness adds 2 to each: 2 ± 0."""
    analyse, wavelength = example["analyse"], np.arange(400.0, 751.0, 50.0)

    def rows(more: float) -> xr.Dataset:
        slope = np.linspace(-5, 5, 4)[:, None] + more
        brdf = 1 + slope * 1e-4 * (wavelength - 600)
        reflectance = vg.materials.material("Al").reflectance(np.cos(np.deg2rad([40.0])), wavelength)[0]
        coords = {"theta_i": [40.0], "theta_o": [-40.0], "wavelength": wavelength}
        return xr.Dataset({"total": (("row", *coords), (brdf * reflectance)[:, None, None])}, coords)

    value, error = analyse.added(rows(2.0), rows(0.0), 40.0, "forward")
    assert value == pytest.approx(2.0, abs=1e-6)
    assert error < 1e-6
    assert analyse.with_error(rows(0.0)["total"], lambda b: analyse.side_slope(b, 40.0, "forward", 1.0))[1] > 1


def test_slopes_of_known_spectra(example):
    analyse = example["analyse"]
    wavelength = np.arange(400.0, 751.0, 50.0)
    fresnel = vg.materials.material("Al").reflectance(np.cos(np.deg2rad([40.0])), wavelength)[0]
    theta_o = np.array([-60.0, -40.0, 0.0])
    # θ_i = 40°: the half angle is 50, 40 (mirror: 0) … so the reflectance at the half vector differs by direction
    f = np.stack([(1 + 0.0007 * (wavelength - 600)) * fresnel] * 3)[None]
    brdf = xr.DataArray(
        f, dims=("theta_i", "theta_o", "wavelength"),
        coords={"theta_i": [40.0], "theta_o": theta_o, "wavelength": wavelength},
    )  # fmt: skip
    found = analyse.slopes(brdf, 1.0).values[0]
    # aluminium's spectrum hardly changes between 0 and 50°: 7 % per 100 nm to 0.2
    np.testing.assert_allclose(found, 7.0, atol=0.2)
    # the same for the light of a side, where each direction's own reflectance is taken out: exactly, squared as well
    for p, which, side in ((1, "forward", slice(0, 2)), (2, "back", slice(3, 4))):
        theta_o = np.array([-60.0, -40.0, 0.0, 60.0])
        facet = vg.materials.material("Al").reflectance(np.cos(np.deg2rad(40.0 - theta_o) / 2), wavelength)
        slope = np.where(np.isin(np.arange(4), np.arange(4)[side]), 0.0007, 0.002)[:, None]
        f = (1 + slope * (wavelength - 600)) * facet**p * np.array([1.0, 3.0, 20.0, 0.1])[:, None]
        brdf = xr.DataArray(
            f[None], dims=("theta_i", "theta_o", "wavelength"),
            coords={"theta_i": [40.0], "theta_o": theta_o, "wavelength": wavelength},
        )  # fmt: skip
        assert float(analyse.side_slope(brdf, 40.0, which, p)) == pytest.approx(7.0, rel=1e-9)


def test_jackknife_is_the_standard_error_of_a_mean(example):
    rows = xr.DataArray(np.random.default_rng(1).normal(size=(20, 3)), dims=("row", "x"))
    value, error = example["analyse"].jackknife(rows, lambda r: r)
    np.testing.assert_allclose(value, rows.mean("row"))
    np.testing.assert_allclose(error, rows.std("row", ddof=1) / np.sqrt(20))
    # rows that are three times the same are a third as many
    thrice = rows.isel(row=np.repeat(np.arange(4), 3))
    four = rows.isel(row=slice(0, 4))
    value, error = example["analyse"].with_error(thrice, lambda r: r)
    np.testing.assert_allclose(value, four.mean("row"))
    np.testing.assert_allclose(error, four.std("row", ddof=1) / np.sqrt(4))


def test_resampled_profile_keeps_the_relief(example):
    surface = example["simulate"].profile(1, 0)
    coarse = example["sampling"].resampled(surface, "linear", 1.0)
    assert coarse.size_um[1] == pytest.approx(surface.size_um[1])
    assert coarse.z[0].std() == pytest.approx(surface.z[0].std(), rel=0.01)


def test_a_small_run_to_the_figure(example, tmp_path, monkeypatch):
    simulate, analyse = example["simulate"], example["analyse"]
    vg.save(
        simulate.orders(simulate.profile(1, 0), [500.0, 600.0, 700.0], windows=1), tmp_path / "sample1_row00_fine0.nc"
    )
    data = analyse.load(tmp_path, 1)
    # loss by absorption alone: 8 … 9 % a reflection
    total = data["energy"].sum("bounce").values
    assert np.all((total > 0.8) & (total < 0.95))
    assert len(analyse.table(data, 40.0)) == 8
    analyse.figure({"sample 1": data}, 40.0).savefig(tmp_path / "figure.png")
    assert (tmp_path / "figure.png").stat().st_size > 20_000
