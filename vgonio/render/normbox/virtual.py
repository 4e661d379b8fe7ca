"""A virtual ground truth for the Normbox: nothing in it was measured.

24 patches and the wall paint have BRDFs of the shift-extended model for dielectrics (thesis 4.8): k_d from the
ColorChecker's published reflectances (ISO 17321-1, from colour-science), roughness, index and shift drawn once from a
fixed seed. The virtual gonioreflectometer measures them in plane, cone and noise included, and the renderer makes the
reference radiances from the true BRDFs. So the truth is known, and what a fitted model misses is a fact and no guess.
It says nothing about real patches: the shift of real ones is not known to be this large or of this form.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ...dataset import brdf_dataset
from ...directions import Detector, Incoming, frames, unit_vectors
from ...measure import Gonioreflectometer
from ...models import Geometry, brdf
from ...surface.heightfield import Heightfield
from ..appearance import Appearance, of_model
from ..bsdf import EXTENDED

Floats = NDArray[np.float64]
# the thesis' instrument, 3.3.2: every 10°, cone of 2°
THETA_I_DEG = tuple(range(0, 81, 10))
THETA_O_DEG = tuple(range(-80, 81, 10))
CHART = "ISO 17321-1"
WALL_REFLECTANCE = 0.34  # L* = 65 (thesis 3.3.1: RAL 7004)
COLOUR_TEMPERATURE_K = 5000.0
RADIANCE_AT_560 = 0.02  # W/(m² sr nm)
INHOMOGENEITY = 0.03  # thesis 3.3.1


@dataclass(frozen=True)
class ModelSurface:
    """A solver whose BRDF is a formula: the mean over the detector's cone, as a measurement has it.

    noise : standard deviation of independent relative errors, drawn from `seed`
    """

    model: str
    parameters: Any
    wavelength_nm: Floats
    noise: float = 0.0
    seed: int = 0

    def scatter(self, surface: Heightfield, incoming: Incoming, detector: Detector) -> xr.Dataset:
        """Values in sr⁻¹ over theta_i, theta_o, wavelength; the surface is not looked at."""
        rays = _cone(detector)  # (m, k, 3)
        cos = np.maximum(rays[..., 2], 0.0)
        found = []
        for theta in np.radians(incoming.theta_deg):
            polar, azimuth = np.arccos(np.clip(rays[..., 2], 1e-3, 1)), np.arctan2(rays[..., 1], rays[..., 0])
            f = brdf(self.model, Geometry.of(theta, polar, 0.0, azimuth), self.wavelength_nm, **self.parameters)
            found.append(np.einsum("mkl,mk->ml", f, cos) / cos.sum(axis=1)[:, None])
        values = np.array(found)
        values *= 1 + self.noise * np.random.default_rng(self.seed).standard_normal(values.shape)
        dims = ("theta_i", "theta_o", "wavelength")
        attrs = {"method": "virtual", "source": f"{self.model}, measured by the virtual instrument"}
        return brdf_dataset({"brdf": (dims, values)}, incoming.theta_deg, self.wavelength_nm, detector, attrs=attrs)


def _cone(detector: Detector) -> Floats:
    """(m, 13, 3) directions within each cone: its centre and two rings of equal area."""
    r = np.arccos(1 - np.array([0.25, 0.75]) * (1 - np.cos(detector.half_angle_rad)))
    psi = (np.arange(6) + 0.5 * np.arange(2)[:, None]) * np.pi / 3
    local = np.concatenate([[[0.0, 0.0, 1.0]], unit_vectors(r[:, None], psi).reshape(-1, 3)])
    return np.einsum("nij,mj->nmi", frames(detector.directions), local)


def chart() -> tuple[Floats, Floats]:
    """(n_λ,) nm and (24, n_λ) reflectances of the ColorChecker, in its order (dark skin … black)."""
    import warnings

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # optional parts of colour-science that are not needed here
        import colour
    spectra = list(colour.SDS_COLOURCHECKERS[CHART].values())
    return np.asarray(spectra[0].wavelengths, float), np.array([s.values for s in spectra], float)


def true_parameters(number: int, wavelength_nm: Floats, slope: float) -> dict[str, Any]:
    """Parameters of clausen-2022 of patch 1 … 24; of the wall for 0. slope : typical h of the shift, nm⁻¹."""
    rng = np.random.default_rng(4_2022 + number)
    w, reflectance = chart()
    flat = np.full(wavelength_nm.size, WALL_REFLECTANCE)
    total = flat if number == 0 else np.interp(wavelength_nm, w, reflectance[number - 1])
    return {
        "alpha": float(rng.uniform(0.3, 0.5)),
        "eta": float(rng.uniform(1.45, 1.55)),
        "h": float(slope * rng.uniform(0.7, 1.3)),
        "w": float(rng.uniform(2.0, 3.0)),
        # what is reflected at the surface (about 4 %) is no longer there for the inside
        "k_d": np.clip(total - 0.03, 0.005, 0.95),
        "clamp": True,
    }


def true_appearance(number: int, wavelength_nm: Floats, slope: float) -> Appearance:
    """The patch as it is, for the renderer."""
    return of_model(EXTENDED, true_parameters(number, wavelength_nm, slope), wavelength_nm, f"true patch {number}")


def measured_patch(number: int, slope: float, noise: float, seed: int) -> xr.Dataset:
    """The in-plane BRDF that the virtual instrument finds; exact back-scattering is missing, as in the thesis' data."""
    w, _ = chart()
    solver = ModelSurface(EXTENDED, true_parameters(number, w, slope), w, noise, 1000 * seed + number)
    gonio = Gonioreflectometer(theta_i_deg=THETA_I_DEG, theta_o_deg=THETA_O_DEG, aperture_deg=2.0)
    data = gonio.measure(Heightfield(np.zeros((8, 8)), pitch_um=1.0, periodic=True), solver)
    hidden = np.abs(data["theta_i"] - data["theta_o"]) < 1e-6
    data["brdf"] = data["brdf"].where(~hidden)
    data.attrs["seconds"] = 0.0  # of no interest, and the same file comes out every time
    return data


def light_spectra(points: int, seed: int) -> tuple[Floats, Floats]:
    """(n_λ,) nm and (points, n_λ) W/(m² sr nm): a black body of 5000 K, each point off by its share of 3 %."""
    w, _ = chart()

    def planck(nm: Floats) -> Floats:
        return nm**-5.0 / np.expm1(1.438776877e7 / (nm * COLOUR_TEMPERATURE_K))

    spread = 1 + INHOMOGENEITY * np.random.default_rng(seed).uniform(-1, 1, points)
    return w, RADIANCE_AT_560 * np.outer(spread, planck(w) / planck(np.array([560.0])))
