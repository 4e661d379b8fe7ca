"""The iterated Kirchhoff approximation as a solver: reflections between mutually visible points, summed coherently."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import xarray as xr

from ...dataset import brdf_dataset, label, versions
from ...directions import Detector, Incoming, wavelength_list
from ...errors import InputError, VgonioWarning, nearest, relative_tolerance, whole
from ...materials import Material, material
from ...surface.heightfield import Heightfield
from ...units import wavenumber
from ..quadrature import Floats
from .beam import BEAMS, Beam
from .far_field import directions
from .limits import limits
from .place import Places
from .profile import Light, Orders, Stretch, reflect
from .second_hits import second_hits

COARSER = 1.5  # spacing of points in the check of their number, relative to that used
GROWING = 0.9  # power of one order over that before from which on the series counts as not converging
POLARISED = {"s": ("TE",), "p": ("TM",), "unpolarised": ("TE", "TM")}
MOST_BOUNCES = 50


@dataclass(frozen=True)
class IteratedKirchhoff:
    """Multiple reflections of waves: the Kirchhoff approximation iterated between mutually visible points.

    The field of the first reflection comes from the tangent-plane rule where the source is seen; it propagates to every
    point in sight, where the same rule makes the next reflection; the detector sums the orders coherently
    (Bruce and Dainty 1991 for two orders; Obelleiro et al. 1995, iterative physical optics).

    material : name, file or Material;  wavelength_nm : (w,) nm
    bounces : at most so many reflections
    tol : the series ends before an order whose mean square field on the surface is below this share of the first's
    window_um : full side of the patch. The amplitude falls as exp(−r²/2ℓ²) with ℓ the smaller of the light's coherence
        length and a sixth of the side. None takes six coherence lengths, in three dimensions at most 20 µm
    windows : at most so many windows, spread over the surface; None takes all of a profile, one patch in 3-D
    beam : "window", weights on the points as in `Kirchhoff`, or (profiles alone) "tapered", a beam that solves the wave
        equation, as in the full-wave solver
    shadowing : points that source or detector do not see are left out; False only for a single reflection
    points_per_wavelength : along the surface; None takes 10 on profiles, 7 on patches

    Profiles (all rows equal) are two-dimensional problems, with TE for s and TM for p. Results have `brdf_by_bounce`
    (each order by itself), `brdf_interference` (the sum of their interference terms: brdf − Σ brdf_by_bounce) and the
    like of energies. The theory is single-valued tangent planes: where it is out of range, the attribute `limits` and a
    warning say so. `scatter` raises InputError, MaterialError and ToleranceError (too many points).
    """

    material: str | Material = "Al"
    wavelength_nm: Any = (550.0,)
    bounces: int = 3
    tol: float = 1e-3
    window_um: float | None = None
    windows: int | None = None
    beam: str = "window"
    shadowing: bool = True
    points_per_wavelength: float | None = None
    seed: int = 0
    progress: Callable[[float], None] | None = field(default=None, compare=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "wavelength_nm", tuple(wavelength_list(self.wavelength_nm)))
        whole("bounces", self.bounces, 1, MOST_BOUNCES)
        relative_tolerance(self.tol)
        if self.beam not in BEAMS:
            raise InputError(f"beam {self.beam!r}: {nearest(str(self.beam), BEAMS)}")
        if self.window_um is not None:
            _positive("window_um", self.window_um, "µm")
        if self.windows is not None:
            whole("windows", self.windows, 1)
        if self.points_per_wavelength is not None:
            _positive("points_per_wavelength", self.points_per_wavelength, "points", 3.0)
        if not self.shadowing and self.bounces > 1:
            raise InputError("shadowing = False is for bounces = 1: further reflections need to know what sees what")
        whole("seed", self.seed, 0)
        object.__setattr__(self, "material", material(self.material))
        self.material.check(self.wavelength_nm)  # type: ignore[union-attr]

    def scatter(self, surface: Heightfield, incoming: Incoming, detector: Detector) -> xr.Dataset:
        """The BRDF of `surface`, (theta_i, detector, wavelength), split by the number of reflections."""
        start = time.perf_counter()
        surface.require_complete()
        if incoming.divergence_deg:
            raise InputError("iterated Kirchhoff takes parallel light: divergence_deg has to be 0")
        places = Places.of(surface, self.window_um, incoming.coherence_um, self.windows)
        if not surface.is_profile:
            raise InputError("patches come next")
        found, error = self._profile(surface, incoming, detector, places)
        data = self._dataset(surface, incoming, detector, places, found)
        reasons = limits(surface, incoming.theta_deg, self.wavelength_nm)
        if reasons:
            warnings.warn("iterated Kirchhoff: " + "; ".join(reasons), VgonioWarning, stacklevel=2)
        self._check_series(data)
        data.attrs |= {
            "error_achieved": error,
            "error_estimate": f"largest change of brdf, relative to its maximum, with points {COARSER:g} times wider "
            "apart, in one window at the first wavelength",
            "limits": "; ".join(reasons) or "none known",
            "seconds": time.perf_counter() - start,
        }
        return data

    # ---- profiles
    def _profile(
        self, surface: Heightfield, incoming: Incoming, detector: Detector, places: Places
    ) -> tuple[list[Orders], float]:
        """Orders of every window, brdf (bounces + 1, t, elements, wavelengths); and the error of the spacing."""
        sign = np.cos(np.deg2rad(incoming.phi_deg))
        azimuths = [incoming.phi_deg, *(detector.phi_deg if detector.kind == "in-plane" else ())]
        if np.any(np.abs(np.sin(np.deg2rad(azimuths))) > 1e-9):
            raise InputError("a profile keeps its light in the plane across its grooves: phi_i_deg has to be 0 or 180")
        theta = sign * np.deg2rad(incoming.theta_deg)
        per = self.points_per_wavelength or 10.0

        def orders(centre: float, half: float, wavelength: float, fineness: float) -> Orders:
            k, spacing = float(wavenumber(wavelength)), wavelength * 1e-3 / fineness
            beam = Beam(self.beam, places.length_um, half, centre)
            stretch = Stretch.of(surface, beam, spacing)
            to = directions(detector, float(sign), wavelength * 1e-3, 2 * half)
            lights = [
                Light(k, theta, polarisation, self.material, wavelength)  # type: ignore[arg-type]
                for polarisation in POLARISED[incoming.polarisation]
            ]
            return reflect(stretch, lights, to, self.bounces, self.tol, self.shadowing)

        found, steps = [], len(places.windows) * len(self.wavelength_nm)
        for n, window in enumerate(places.windows):
            spectrum = []
            for j, w in enumerate(self.wavelength_nm):
                spectrum.append(orders(window.centre[1], window.half[1], w, per))
                if self.progress:
                    self.progress((n * len(self.wavelength_nm) + j + 1) / steps)
            found.append(_stacked(spectrum))
        middle = places.windows[0]
        rough = orders(middle.centre[1], middle.half[1], self.wavelength_nm[0], per / COARSER).brdf[-1]
        fine = found[0].brdf[-1, ..., 0]
        return found, float(np.max(np.abs(rough - fine)) / max(float(fine.max()), 1e-300))

    # ---- the result
    def _dataset(
        self, surface: Heightfield, incoming: Incoming, detector: Detector, places: Places, found: list[Orders]
    ) -> xr.Dataset:
        brdf, energy = (np.stack([getattr(o, n) for o in found]) for n in ("brdf", "energy"))
        mean, energies = brdf.mean(axis=0), energy.mean(axis=0)
        over = ("theta_i", *detector.dims, "wavelength")
        bounce = np.arange(1, self.bounces + 1)
        hits = [
            second_hits(surface, places.windows[0].centre, places.windows[0].half, places.length_um, wi, self.seed)
            for wi in incoming.vectors
        ]
        variables: dict[str, tuple[tuple[str, ...], Any]] = {
            "brdf": (over, mean[-1]),
            "brdf_stderr": (over, self._stderr(brdf[:, -1], places)),
            "brdf_by_bounce": (("bounce", *over), mean[:-1]),
            "brdf_interference": (over, mean[-1] - mean[:-1].sum(axis=0)),
            "energy_by_bounce": (("theta_i", "bounce", "wavelength"), energies[:-1].swapaxes(0, 1)),
            "energy_interference": (("theta_i", "wavelength"), energies[-1] - energies[:-1].sum(axis=0)),
            "energy_reflected": (("theta_i", "wavelength"), energies[-1]),
            "fresnel_macro": (
                ("theta_i", "wavelength"),
                self.material.reflectance(  # type: ignore[union-attr]
                    incoming.vectors[:, 2], self.wavelength_nm, incoming.polarisation
                ),
            ),
            "second_hits": (("theta_i",), np.array([h[0] for h in hits])),
            "second_hits_outside": (("theta_i",), np.array([h[1] for h in hits])),
        }
        data = brdf_dataset(
            variables, incoming.theta_deg, self.wavelength_nm, detector, phi_i_deg=incoming.phi_deg,
            coords={"bounce": bounce}, attrs=self._attributes(surface, incoming, places, found),
        )  # fmt: skip
        data["bounce"].attrs["long_name"] = "number of reflections, each by itself"
        return label(data)

    def _stderr(self, brdf: Floats, places: Places) -> Floats:
        """Standard error of the mean over windows (windows, …); one window says nothing of its spread: NaN."""
        if len(brdf) < 2:
            return np.full(brdf.shape[1:], np.nan)
        return np.std(brdf, axis=0, ddof=1) / np.sqrt(places.independent)

    def _attributes(
        self, surface: Heightfield, incoming: Incoming, places: Places, found: list[Orders]
    ) -> dict[str, Any]:
        problem = "profile, two-dimensional" if surface.is_profile else "patch, three-dimensional"
        return {
            "method": f"waves: iterated Kirchhoff, at most {self.bounces} reflections, coherent sum, {problem}",
            "solver": "IteratedKirchhoff",
            "theory": "iterated-kirchhoff",
            "material": self.material.name,  # type: ignore[union-attr]
            "material_source": self.material.source,  # type: ignore[union-attr]
            "polarisation": incoming.polarisation,
            "tolerance_asked": self.tol,
            "bounces": self.bounces,
            "bounces_done": max(o.used for o in found),
            "beam": self.beam,
            "window_um": places.window_um,
            "coherence_um": places.length_um,
            "windows": places.independent,
            "windows_tiled": places.tiled,
            "windows_used": len(places.windows),
            "stderr_estimate": f"spread over {places.independent:.1f} effective independent windows"
            if len(places.windows) > 1 else "not known: one window",
            "surface": surface.name,
            "backend": "numpy",
            "device": "CPU",
            "seed": self.seed,
            "versions": versions(),
        }  # fmt: skip

    def _check_series(self, data: xr.Dataset) -> None:
        """Warn where the last order still sends out more than `tol` and hardly less than the one before."""
        done = int(data.attrs["bounces_done"])
        if done < 2:
            return
        by = data["energy_by_bounce"].values
        last, before = by[:, done - 1], by[:, done - 2]
        bad = (last > self.tol * by.sum(axis=1)) & (last > GROWING * before)
        if bad.any():
            warnings.warn(
                f"iterated Kirchhoff does not converge: reflection {done} sends out {float(last[bad].max()):.2g} of "
                f"the incident power, {float(np.max(last[bad] / before[bad])):.2g} times as much as the one before",
                VgonioWarning,
                stacklevel=3,
            )


def _stacked(spectrum: list[Orders]) -> Orders:
    return Orders(
        np.stack([o.brdf for o in spectrum], axis=-1),
        np.stack([o.energy for o in spectrum], axis=-1),
        max(o.used for o in spectrum),
    )


def _positive(name: str, value: Any, unit: str, least: float = 0.0) -> None:
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = np.nan
    if not (np.isfinite(number) and number > least):
        raise InputError(f"{name} = {value!r}: a number of {unit} above {least:g} is needed")
