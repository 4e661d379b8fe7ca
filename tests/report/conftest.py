"""Synthetic results in the layout that simulations write: a rough metal with lobes, bounces and a shift."""

from __future__ import annotations

import json

import numpy as np
import pytest
import xarray as xr

from vgonio.dataset import brdf_dataset
from vgonio.directions import Detector

THETA_I = np.arange(0, 81, 20.0)
THETA_O = np.arange(-80, 81, 10.0)
WAVELENGTH = np.arange(380, 781, 40.0)
BOUNCES = np.arange(1, 5)


def microfacet(theta_i, theta_o, phi=0.0, alpha=0.3):
    """Beckmann lobe without masking (n_i, n_o), 1/sr; phi: azimuth of ω_o against the plane."""
    i, o = np.deg2rad(np.asarray(theta_i))[:, None], np.deg2rad(np.asarray(theta_o))[None, :]
    wi = np.stack(np.broadcast_arrays(np.sin(i), 0 * i, np.cos(i)), -1)
    p = np.deg2rad(phi)
    wo = np.stack(np.broadcast_arrays(np.sin(o) * np.cos(p), np.sin(o) * np.sin(p), np.cos(o)), -1)
    h = wi + wo
    cos_m = h[..., 2] / np.linalg.norm(h, axis=-1)
    d = np.exp(-(1 / cos_m**2 - 1) / alpha**2) / (np.pi * alpha**2 * cos_m**4)
    return d / (4 * np.cos(i) * np.maximum(np.cos(o), 0.05)) * 0.9, cos_m


def detector_and_lobe(hemisphere, theta_i=THETA_I):
    if hemisphere:
        detector = Detector.hemisphere(10)
        return detector, *microfacet(theta_i, detector.theta_deg, detector.phi_deg)
    detector = Detector.in_plane(THETA_O, 2.0)
    return detector, *microfacet(theta_i, THETA_O)


def rays(wavelength=WAVELENGTH, hemisphere=False, theta_i=THETA_I) -> xr.Dataset:
    detector, single, _ = detector_and_lobe(hemisphere, theta_i)
    dims = ("theta_i", detector.dims[0], "wavelength")
    share = 0.02 + 0.1 * np.sin(np.deg2rad(theta_i))[:, None] ** 2
    parts = np.stack([single, *(share * 0.35**b / np.pi + 0 * single for b in range(3))])
    spectrum = 0.9 - 0.05 * np.exp(-(((wavelength - 800) / 80) ** 2))
    by_bounce = parts[..., None] * np.stack([spectrum**b for b in BOUNCES])[:, None, None, :]
    brdf = by_bounce.sum(0)
    count = brdf * np.cos(np.deg2rad(np.abs(detector.theta_deg)))[None, :, None] * 2e3
    noise = np.random.default_rng(1).normal(size=brdf.shape[:2])[..., None] / np.sqrt(np.maximum(count, 1))
    by_bounce = by_bounce * (1 + np.clip(noise, -0.8, 0.8))
    brdf = by_bounce.sum(0)
    upward = np.stack([np.full((len(theta_i), len(wavelength)), x) for x in (0.82, 0.05, 0.01, 0.003)], axis=1)
    upward[:, 1] += share
    upward[:, 0] -= share
    absorbed = 1 - upward.sum(1) - 0.004
    return brdf_dataset(
        {
            "brdf": (dims, brdf),
            "brdf_stderr": (dims, brdf / np.sqrt(np.maximum(count, 1))),
            "brdf_by_bounce": (("bounce", *dims), by_bounce),
            "brdf_by_bounce_stderr": (
                ("bounce", *dims),
                by_bounce / np.sqrt(np.maximum(count * parts[..., None] / brdf, 1)),
            ),
            "energy_by_bounce": (("theta_i", "bounce", "wavelength"), upward),
            "energy_absorbed": (("theta_i", "wavelength"), absorbed),
            "energy_lost": (("theta_i", "wavelength"), np.full(absorbed.shape, 0.004)),
        },
        theta_i,
        wavelength,
        detector,
        coords={"bounce": BOUNCES},
        attrs={"method": "ray optics", "rays": 10**6, "seconds": 4.2, "seed": 0, "backend": "embree", "device": "CPU"},
    )


def waves(wavelength=WAVELENGTH, hemisphere=False, theta_i=THETA_I, theory="kirchhoff") -> xr.Dataset:
    detector, single, cos_m = detector_and_lobe(hemisphere, theta_i)
    dims = ("theta_i", detector.dims[0], "wavelength")
    slope = 1.2e-3 * np.cos(2.0 * np.arccos(cos_m)) - 2e-4
    brdf = 0.88 * single[..., None] * np.maximum(1 + slope[..., None] * (wavelength - 600), 0.05)
    error = 0.01 * brdf
    brdf = brdf * (1 + 0.01 * np.random.default_rng(2).normal(size=brdf.shape))
    reflected = 0.9 + 0.25 * np.sin(np.deg2rad(theta_i))[:, None] ** 8 + 0 * wavelength
    return brdf_dataset(
        {
            "brdf": (dims, brdf),
            "brdf_stderr": (dims, error),
            "energy_reflected": (("theta_i", "wavelength"), reflected),
        },
        theta_i,
        wavelength,
        detector,
        attrs={
            "method": "wave optics",
            "theory": theory,
            "tolerance_asked": 1e-3,
            "error_achieved": 4e-4,
            "seconds": 6.0,
        }
        | {"error_estimate": "from a few outputs recomputed"},
    )


def measured(wavelength=WAVELENGTH) -> xr.Dataset:
    data = waves(wavelength).drop_vars(["brdf_stderr", "energy_reflected"])
    diffuse = 0.05 / np.pi * (1 - 8e-4 * (wavelength - 600))
    data["brdf"] = data["brdf"] * 0.95 + xr.DataArray(diffuse, dims="wavelength", coords={"wavelength": wavelength})
    # a gonioreflectometer cannot see back into its own source
    return data.where(data["theta_o"] != data["theta_i"]).assign_attrs(method="measured", provenance="made by a test")


def surface() -> xr.Dataset:
    rng = np.random.default_rng(3)
    n, m = 160, 200
    fy, fx = np.meshgrid(np.fft.fftfreq(n), np.fft.rfftfreq(m), indexing="ij")
    noise = np.fft.rfft2(rng.normal(size=(n, m)))
    z = np.fft.irfft2(noise * np.exp(-(fx**2 + fy**2) * 400), s=(n, m))
    z = (z - z.mean()) / z.std() * 2.0
    bins = np.linspace(-8, 8, 61)
    height, slope = (bins[1:] + bins[:-1]) / 2, np.linspace(-1.2, 1.2, 61)
    frequency = np.geomspace(1e-3, 0.8, 40)
    return xr.Dataset(
        {
            "z": (("y", "x"), z.astype(np.float32), {"units": "um", "long_name": "height"}),
            "height_density": ("height", np.histogram(z, bins, density=True)[0], {"units": "um-1"}),
            "slope_density": ("slope", np.exp(-((slope / 0.29) ** 2)) / (np.sqrt(np.pi) * 0.29), {"units": "1"}),
            "psd": ("frequency", 100 * np.exp(-((frequency / 0.05) ** 2)) + 1e-4, {"units": "um4"}),
        },
        coords={
            "x": ("x", (np.arange(m) + 0.5) * 0.625, {"units": "um"}),
            "y": ("y", (np.arange(n) + 0.5) * 0.625, {"units": "um"}),
            "height": ("height", height, {"units": "um"}),
            "slope": ("slope", slope, {"units": "1"}),
            "frequency": ("frequency", frequency, {"units": "um-1"}),
        },
        attrs={
            "Sq": 2.0,
            "Sa": 1.6,
            "Sdq": 0.29,
            "Ssk": -0.1,
            "Sku": 3.0,
            "Sal": 12.0,
            "alpha": 0.29,
            "name": "synthetic",
        }
        | {"history": json.dumps(["generated for a test"]), "pitch_y_um": 0.625, "pitch_x_um": 0.625},
    )


@pytest.fixture(scope="session")
def ray_result() -> xr.Dataset:
    return rays()


@pytest.fixture(scope="session")
def wave_result() -> xr.Dataset:
    return waves()


@pytest.fixture(scope="session")
def measured_result() -> xr.Dataset:
    return measured()


@pytest.fixture(scope="session")
def hemisphere_rays() -> xr.Dataset:
    return rays(wavelength=np.array([450.0, 550.0, 650.0]), hemisphere=True, theta_i=np.array([0.0, 30.0]))


@pytest.fixture(scope="session")
def hemisphere_waves() -> xr.Dataset:
    return waves(wavelength=np.array([450.0, 550.0, 650.0]), hemisphere=True, theta_i=np.array([0.0, 30.0]))


@pytest.fixture(scope="session")
def full_result(ray_result, wave_result, measured_result, surface_summary) -> xr.DataTree:
    """All groups and attributes that `simulate` writes; the comparison is a real one."""
    from vgonio.compare.comparison import compare

    results = {"rays": ray_result, "waves": wave_result, "measured": measured_result}
    groups = {"surface": surface_summary, **results, "comparison": compare(results)}
    tree = xr.DataTree.from_dict(groups, name="synthetic")
    tree.attrs = {
        "title": "A synthetic rough metal",
        "scene": json.dumps({"light": {"theta_i_deg": [0, 10]}}),
        "provenance": json.dumps(
            {"versions": {"vgonio": "0"}, "date": "2026-01-02T03:04:05", "inputs": {"s": "a1b2c3"}}
        ),
        "plan": json.dumps(
            {
                "stages": [
                    {"name": "trace", "needed": True, "why": "one trace", "library": "embreex", "cost": "9e6 rays"},
                    {"name": "filter", "needed": False, "why": "no filter asked for", "library": "", "cost": ""},
                ],
                "warnings": ["expect speckle"],
            }
        ),
        "seconds": json.dumps({"surface": 0.2, "rays": 4.2, "waves": 6.0}),
    }
    return tree


@pytest.fixture(scope="session")
def surface_summary() -> xr.Dataset:
    return surface()
