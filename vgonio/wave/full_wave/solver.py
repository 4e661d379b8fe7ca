"""`FullWave`: the rigorous solver behind the interface that all solvers share."""

from __future__ import annotations

import json
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import xarray as xr

from ...dataset import brdf_dataset, versions
from ...directions import Detector, Incoming, wavelength_list
from ...errors import InputError, VgonioWarning, relative_tolerance, whole
from ...materials import Material, material
from ...surface.heightfield import Heightfield
from ...surface.spectrum import about_mean
from . import gratings, windows
from .outcome import Outcome, Task
from .panels import Floats
from .profile import require_profile

POLARISATIONS = ("TE", "TM", "both")
OF_LIGHT = {"unpolarised": ("TE", "TM"), "s": ("TE",), "p": ("TM",)}


@dataclass(frozen=True)
class FullWave:
    """Rigorous scattering by a one-dimensional profile: boundary integral equations, TE and TM, multiple scattering.

    material : name, file or Material, "perfect" included, without films;  wavelength_nm : (w,) nm
    polarisation : "TE" (s: E along the grooves), "TM" (p) or "both"; "both" follows the light in `scatter`: the mean
        for unpolarised light, TE for s, TM for p
    tol : error of brdf (or efficiency) relative to its largest value, per θ_i and λ, by a coarser solution
    windows : at most so many coherence windows along a finite profile; None takes all that tile it

    The surface has to be the same for all y (one row will do) and is continued along y; the plane of incidence is its
    cross-section (phi_i_deg 0 or 180), the source is parallel. A periodic profile is a grating: `scatter` spreads its
    orders as the coherence window does. On a finite one every window is a Gaussian beam, amplitude exp(−x²/2ℓ²) on the
    mean height, over a piece of 4 ℓ to each side. Cost grows as the square of length/λ, for the largest systems as its
    cube. In TM a right angle of a material with −3 < Re n² < −1/3 and little loss has no regular field: error_achieved
    tells.

    Raises InputError for surfaces, films and light it does not take, MaterialError outside the table, ToleranceError
    for systems that are too large.
    """

    material: str | Material = "Al"
    wavelength_nm: Any = (550.0,)
    polarisation: str = "both"
    tol: float = 1e-3
    windows: int | None = None
    progress: Callable[[float], None] | None = field(default=None, compare=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "wavelength_nm", tuple(wavelength_list(self.wavelength_nm)))
        if self.polarisation not in POLARISATIONS:
            raise InputError(f"polarisation {self.polarisation!r}: allowed are {', '.join(POLARISATIONS)}")
        relative_tolerance(self.tol)
        if self.windows is not None:
            whole("windows", self.windows, 1)
        made = material(self.material)
        if getattr(made, "layers", ()):
            raise InputError(
                f"material {made.name!r} has films: the full-wave solver takes a half-space with one refractive index"
            )
        made.check(self.wavelength_nm)
        object.__setattr__(self, "material", made)

    def index(self, wavelength_nm: float) -> complex | None:
        """n + ik, None for a perfect conductor."""
        made: Material = self.material  # type: ignore[assignment]
        return None if made.perfect else complex(made.index(wavelength_nm))

    def orders(self, surface: Heightfield, theta_i_deg: Any) -> xr.Dataset:
        """`efficiency (theta_i, order, wavelength, polarisation)` of a periodic profile: reflected power of the order
        over incident power, order m at sin θ_o = −sin θ_i − mλ/P; with balance, condition number and residual.

        Raises InputError unless the surface is periodic and the same for all y.
        """
        return gratings.orders(self, surface, theta_i_deg)

    def scatter(self, surface: Heightfield, incoming: Incoming, detector: Detector) -> xr.Dataset:
        """The BRDF of `surface`, (theta_i, detector, wavelength): power in each detector element over incident power
        and the element's projected solid angle, `brdf_by_polarisation` beside the mean, energies and balance."""
        start = time.perf_counter()
        require_profile(surface)
        surface = surface.replace(z=about_mean(surface.z))  # beams have their waist on z = 0, at the mean height
        polarisations = self.polarisations(incoming)
        sign = _azimuth(incoming)
        outcomes = []
        for n, wavelength in enumerate(self.wavelength_nm):
            solve = gratings.scattered if surface.periodic else windows.scattered
            task = Task(self, surface, incoming, detector, wavelength, polarisations, sign, self.teller(n))
            outcomes.append(solve(task))
        data = self._dataset(outcomes, surface, incoming, detector, polarisations)
        data.attrs["seconds"] = time.perf_counter() - start
        return data

    def warn(self, error: float, remarks: list[str]) -> None:
        """Say what should not be overlooked."""
        if error > self.tol:
            why = "no finer solution could be afforded" if not np.isfinite(error) else "a resonance or sharp corners"
            warnings.warn(
                f"full wave: error {error:.1e} instead of {self.tol:.1e} ({why})", VgonioWarning, stacklevel=4
            )
        for remark in remarks:
            warnings.warn(f"full wave: {remark}", VgonioWarning, stacklevel=4)

    def attributes(self, surface: Heightfield) -> dict[str, Any]:
        """What every result says of method, material and surface."""
        made: Material = self.material  # type: ignore[assignment]
        return {
            "method": "waves: rigorous boundary integral equations (Nyström on Gauss–Legendre panels), all orders of "
            "scattering, one-dimensional profile",
            "solver": "FullWave",
            "theory": "full-wave",
            "material": made.name,
            "material_source": made.source,
            "surface": surface.name,
            "tolerance_asked": self.tol,
            "backend": "scipy.linalg, LU",
            "device": "CPU",
            "versions": versions(),
        }

    # ---- parts
    def teller(self, n: int) -> Callable[[float], None]:
        """Takes the share of wavelength number `n` that is done, to `progress`."""

        def tell(part: float) -> None:
            if self.progress is not None:
                self.progress((n + part) / len(self.wavelength_nm))

        return tell

    def polarisations(self, incoming: Incoming) -> tuple[str, ...]:
        """ "TE", "TM" or both, as the light asks; InputError where light and solver exclude each other."""
        light = OF_LIGHT[incoming.polarisation]
        if self.polarisation == "both":
            return light
        if self.polarisation not in light:
            raise InputError(
                f"polarisation {self.polarisation!r} of the solver and {incoming.polarisation!r} of the light exclude "
                'each other: leave the solver\'s at "both", which follows the light'
            )
        return (self.polarisation,)

    def _dataset(
        self,
        outcomes: list[Outcome],
        surface: Heightfield,
        incoming: Incoming,
        detector: Detector,
        polarisations: tuple[str, ...],
    ) -> xr.Dataset:
        def stacked(name: str) -> Floats:  # (polarisation, theta_i, …, wavelength)
            return np.stack([getattr(one, name) for one in outcomes], axis=-1)

        over = ("theta_i", *detector.dims, "wavelength")
        each, share = ("polarisation", "theta_i", "wavelength"), ("theta_i", "wavelength")
        brdf, stderr = stacked("brdf"), stacked("stderr")
        variables: dict[str, tuple[tuple[str, ...], Any]] = {
            "brdf": (over, brdf.mean(axis=0)),
            "brdf_stderr": (over, np.sqrt((stderr**2).mean(axis=0))),
            "brdf_by_polarisation": (("polarisation", *over), brdf),
            "energy_reflected": (share, stacked("reflected").mean(axis=0)),
            "energy_absorbed": (share, stacked("absorbed").mean(axis=0)),
            "energy_lost": (share, stacked("lost").mean(axis=0)),
            "energy_balance": (each, stacked("reflected") + stacked("absorbed") + stacked("lost")),
            "condition_number": (each, stacked("condition")),
            "residual": (each, stacked("residual")),
        }
        made: Material = self.material  # type: ignore[assignment]
        macro = made.reflectance(incoming.vectors[:, 2], self.wavelength_nm, incoming.polarisation)
        variables["fresnel_macro"] = (share, macro)
        error, remarks = max(one.error for one in outcomes), [r for one in outcomes for r in one.remarks]
        self.warn(error, remarks)
        return brdf_dataset(
            variables,
            incoming.theta_deg,
            self.wavelength_nm,
            detector,
            phi_i_deg=incoming.phi_deg,
            coords={"polarisation": list(polarisations)},
            attrs=self.attributes(surface)
            | outcomes[0].attrs
            | {
                "polarisation": incoming.polarisation if self.polarisation == "both" else self.polarisation,
                "unknowns": max(one.unknowns for one in outcomes),
                "error_achieved": error,
                "error_estimate": "largest difference from the solution on coarser panels, relative to the "
                "largest value in theta_o; the error of the coarser one, it bounds that of the finer one",
                "remarks": json.dumps(remarks, ensure_ascii=False),
            },
        )


def _azimuth(incoming: Incoming) -> float:
    """cos φ_i, 1 or −1; InputError for light that does not come along the cross-section of the profile."""
    turn = float(np.cos(np.deg2rad(incoming.phi_deg)))
    if abs(abs(turn) - 1) > 1e-9:
        raise InputError(
            f"phi_i_deg = {incoming.phi_deg:g}°: the full-wave solver takes the plane of incidence across the grooves, "
            "0° or 180° (no conical diffraction)"
        )
    if incoming.divergence_deg:
        raise InputError(
            f"divergence_deg = {incoming.divergence_deg:g}°: the full-wave solver takes a parallel source; average "
            "over several theta_i_deg instead"
        )
    return float(np.sign(turn))
