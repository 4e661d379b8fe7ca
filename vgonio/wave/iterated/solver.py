"""The iterated Kirchhoff approximation as a solver: reflections between mutually visible points, summed coherently."""

from __future__ import annotations

import json
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import xarray as xr

from ...dataset import brdf_dataset, label, versions
from ...directions import Detector, Incoming, wavelength_list
from ...errors import InputError, VgonioWarning, nearest, relative_tolerance, whole
from ...materials import Material, material
from ...surface.heightfield import Heightfield
from ...surface.spectrum import about_mean
from ...units import wavenumber
from .. import opencl
from ..coherence import Window
from ..quadrature import Floats
from .beam import BEAMS, Beam
from .choice import choose
from .diffraction import Diffraction
from .far_field import directions
from .far_patch import patch_reflections
from .gratings import orders
from .limits import limits
from .outcome import check_patch, check_series, check_spacing, mean, stacked, with_mueller
from .place import Places
from .profile import WEIGHTS, Light, Reflections, Stretch, reflect
from .second_hits import second_hits

COARSER = 1.5  # spacing of points in the check of their number, relative to that used
Progress = Callable[[float], None]
MOST_BOUNCES = 50
SPACED = 0.01  # error of the spacing, after sweeps, up to which nothing is said whatever tol is
METHODS = ("auto", "pairs", "blocks")


@dataclass(frozen=True)
class IteratedKirchhoff:
    """Multiple reflections of waves: the Kirchhoff approximation iterated between mutually visible points.

    The field of the first reflection comes from the tangent-plane rule where the source is seen; it propagates to every
    point in sight, where the same rule makes the next reflection; the detector sums the reflections coherently
    (Bruce and Dainty 1991 for two; Obelleiro-Basteiro et al. 1995, iterative physical optics).

    material : name, file or Material;  wavelength_nm : (w,) nm
    bounces : at most so many reflections
    sweeps : on profiles, at most so many forward–backward sweeps over the integral equation of the surface (Holliday
        1996, Kapp and Brown 1996), from the sum of reflections on: shadows with soft edges, light that creeps. What
        they add is brdf_diffraction; 0 leaves it out. Where they do not settle, and for materials and windows without a
        rule (diffraction_left_out), the sum of reflections stays
    tol : the series ends before a reflection whose mean square field on the surface is below this share of the first's
        (bounces_done), and the sweeps where they change no more than that. The spacing of the points makes an error of
        its own, error_achieved: after sweeps 1e-4 to 1e-3 on perfect, 2e-3 to 8e-3 on penetrable rough profiles, with a
        warning above 1 %; without them and on patches 0.2 to 10 %, since edges of shadows fall between the points
        wherever they are, with a warning above tol
    window_um : full side of the patch. The amplitude falls as exp(−r²/2ℓ²) with ℓ the smaller of the light's coherence
        length and a sixth of the side. None takes six coherence lengths, in three dimensions at most 20 µm, no more
        than a finite surface holds; where ℓ is not the light's, a warning and `remarks` say so
    windows : at most so many windows, spread over the surface; None takes all of a profile, one patch in 3-D
    beam : "window", weights on the points as in `Kirchhoff`, or (profiles alone) "tapered", a beam that solves the wave
        equation, as in the full-wave solver
    shadowing : points that source or detector do not see are left out; False only for a single reflection
    points_per_wavelength : along a profile, along x and y of a patch; None takes 10 and 7
    polarised : `mueller` and its standard error beside brdf
    energy : the energies, which of patches cost some thousand directions over the hemisphere; False leaves them out
    method : on patches, "pairs" sums all pairs of points that see each other, "blocks" takes points together that are
        seen as a whole from far away, with an error of the fields (pairs_error) below tol, at least 1e-3; "auto" takes
        blocks on large patches where most of what is seen is seen as a whole

    The incident power is what the lit points of the windows receive, so that the energy balance of a few windows holds.
    Profiles (all rows equal) are two-dimensional problems, with TE for s and TM for p; patches carry vector fields and
    run on an OpenCL device. Results have `brdf_by_bounce` (each by itself), `brdf_interference` (the sum of their
    interference terms) and on profiles `brdf_diffraction` (what the sweeps change in their coherent sum), which add up
    to brdf, and the like of energies. Without sweeps the theory is that of single-valued tangent planes: where it is
    out of range, the attribute `remarks` and a warning say so. `scatter` raises InputError, MaterialError and
    ToleranceError (too many points).
    """

    material: str | Material = "Al"
    wavelength_nm: Any = (550.0,)
    bounces: int = 3
    tol: float = 1e-3
    sweeps: int = 4
    window_um: float | None = None
    windows: int | None = None
    beam: str = "window"
    shadowing: bool = True
    points_per_wavelength: float | None = None
    polarised: bool = False
    energy: bool = True
    method: str = "auto"
    seed: int = 0
    progress: Callable[[float], None] | None = field(default=None, compare=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "wavelength_nm", tuple(wavelength_list(self.wavelength_nm)))
        whole("bounces", self.bounces, 1, MOST_BOUNCES)
        relative_tolerance(self.tol)
        whole("sweeps", self.sweeps, 0, MOST_BOUNCES)
        if self.sweeps == 1:
            raise InputError("sweeps = 1: 0 for none or at least 2 are needed, the second tells whether they settle")
        if self.beam not in BEAMS:
            raise InputError(f"beam {self.beam!r}: {nearest(str(self.beam), BEAMS)}")
        if self.method not in METHODS:
            raise InputError(f"method {self.method!r}: {nearest(str(self.method), METHODS)}")
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

    def orders(self, surface: Heightfield, theta_i_deg: Any) -> xr.Dataset:
        """`efficiency (theta_i, order, wavelength, polarisation)` of a periodic profile, see `iterated.gratings`."""
        return orders(self, surface, theta_i_deg)

    def scatter(self, surface: Heightfield, incoming: Incoming, detector: Detector) -> xr.Dataset:
        """The BRDF of `surface`, (theta_i, detector, wavelength), split by the number of reflections.

        Raises InputError for divergent light and for missing points.
        """
        start = time.perf_counter()
        surface.require_complete()
        surface = surface.replace(z=about_mean(surface.z))  # a tapered beam has its waist there, as in the full wave
        if incoming.divergence_deg:
            raise InputError("iterated Kirchhoff takes parallel light: divergence_deg has to be 0")
        places = Places.of(surface, self.window_um, incoming.coherence_um, self.windows)
        found, error = (self._profile if surface.is_profile else self._patches)(surface, incoming, detector, places)
        data = self._dataset(surface, incoming, detector, places, found)
        reasons = limits(surface, incoming.theta_deg, self.wavelength_nm)
        reasons += [places.cut] if places.cut else []
        if reasons:
            warnings.warn("iterated Kirchhoff: " + "; ".join(reasons), VgonioWarning, stacklevel=3)
        if self.polarised:
            data = with_mueller(data, found, places)
        if self.bounces > 1:
            check_patch(data)
        if not self.energy:
            data = data.drop_vars([n for n in data.data_vars if str(n).startswith("energy")])
        else:
            check_series(data, self.tol)
        swept = data.attrs["sweeps_done"] > 0
        check_spacing(error, max(self.tol, SPACED) if swept else self.tol, self.per(surface))
        data.attrs |= {
            "error_achieved": error,
            "error_estimate": f"largest change of brdf, relative to its maximum, with points {COARSER:g} times wider "
            "apart, in one window at the first wavelength",
            "remarks": json.dumps(reasons, ensure_ascii=False),
            "seconds": time.perf_counter() - start,
        }
        return data

    def per(self, surface: Heightfield) -> float:
        """Points per wavelength on this kind of surface."""
        return self.points_per_wavelength or (10.0 if surface.is_profile else 7.0)

    # ---- profiles
    def _profile(
        self, surface: Heightfield, incoming: Incoming, detector: Detector, places: Places
    ) -> tuple[list[Reflections], float]:
        """Reflections of every window, brdf (bounces + 1, t, elements, wavelengths); and the error of the spacing."""
        sign = np.cos(np.deg2rad(incoming.phi_deg))
        azimuths = [incoming.phi_deg, *(detector.phi_deg if detector.kind == "in-plane" else ())]
        if np.any(np.abs(np.sin(np.deg2rad(azimuths))) > 1e-9):
            raise InputError("a profile keeps its light in the plane across its grooves: phi_i_deg has to be 0 or 180")
        theta = sign * np.deg2rad(incoming.theta_deg)
        per = self.per(surface)

        def reflections(centre: float, half: float, wavelength: float, fineness: float) -> Reflections:
            k, spacing = float(wavenumber(wavelength)), wavelength * 1e-3 / fineness
            swept = self.sweeps > 0 and self.bounces > 1 and self.shadowing
            beam = Beam(self.beam, places.length_um, half, centre, along=swept)
            stretch = Stretch.of(surface, beam, spacing)
            to = directions(detector, float(sign), wavelength * 1e-3, 2 * half)
            lights = {
                name: Light(k, theta, name, self.material, wavelength)  # type: ignore[arg-type]
                for name, weight in WEIGHTS[incoming.polarisation].items()
                if weight or self.polarised
            }
            return reflect(
                stretch, lights, incoming.polarisation, to, self.bounces, self.tol, self.shadowing, self.sweeps
            )

        def one(window: Window, wavelength: float, fineness: float, report: Progress) -> Reflections:
            return reflections(window.centre[1], window.half[1], wavelength, fineness)

        return self._all(one, places, per)

    # ---- patches
    def _patches(
        self, surface: Heightfield, incoming: Incoming, detector: Detector, places: Places
    ) -> tuple[list[Reflections], float]:
        if self.beam != "window":
            raise InputError(f'beam = {self.beam!r} is for profiles: take "window"')
        if not self.shadowing:
            raise InputError("shadowing = False is for profiles: Kirchhoff(polarised=True) is that on a surface")
        if getattr(self.material, "layers", ()):
            raise InputError(
                f"material {self.material.name!r}: patches take a half-space with one refractive index, no films: take "  # type: ignore[union-attr]
                "the bare material, or a profile (all rows equal), or Kirchhoff"
            )
        per = self.per(surface)
        blocks = choose(self, surface, places).blocks

        def one(window: Window, wavelength: float, fineness: float, report: Progress) -> Reflections:
            used = fineness == per
            light = incoming if used else replace(incoming, theta_deg=incoming.theta_deg[:1])
            made, patch = patch_reflections(
                surface, window, light, detector, self.material, wavelength,  # type: ignore[arg-type]
                wavelength * 1e-3 / fineness, self.bounces, self.tol, self.seed, report, energies=self.energy and used,
                blocks=blocks and used,
            )  # fmt: skip
            made = replace(made, brdf=_last_twice(made.brdf), energy=_last_twice(made.energy))
            return replace(made, sight_error=patch.sight_error) if not used and made.used > 1 else made

        return self._all(one, places, per)

    def _all(self, one: Callable[..., Reflections], places: Places, per: float) -> tuple[list[Reflections], float]:
        """Reflections of every window, brdf (bounces + 1, t, elements, wavelengths); and the error of the spacing."""
        found, done, steps = [], 0, len(places.windows) * len(self.wavelength_nm)
        for window in places.windows:
            spectrum = []
            for w in self.wavelength_nm:

                def report(share: float, done: int = done) -> None:
                    if self.progress:
                        self.progress((done + share) / steps)

                spectrum.append(one(window, w, per, report))
                report(1.0)
                done += 1
            found.append(stacked(spectrum))
        rough = one(places.windows[0], self.wavelength_nm[0], per / COARSER, lambda f: None)
        some = slice(len(rough.caught))
        fine = found[0].brdf[-1, some, :, 0] / np.maximum(found[0].caught[some, :1], 1e-300)
        found[0] = replace(found[0], sight_error=rough.sight_error)
        change = np.abs(rough.brdf[-1] / np.maximum(rough.caught[:, None], 1e-300) - fine)
        return found, float(change.max() / max(float(fine.max()), 1e-300))

    # ---- the result
    def _dataset(
        self, surface: Heightfield, incoming: Incoming, detector: Detector, places: Places, found: list[Reflections]
    ) -> xr.Dataset:
        (brdf, stderr), (energies, _) = (mean(found, places, n) for n in ("brdf", "energy"))
        over = ("theta_i", *detector.dims, "wavelength")
        bounce = np.arange(1, self.bounces + 1)
        hits = [second_hits(surface, places.windows, places.length_um, wi, self.seed) for wi in incoming.vectors]
        variables: dict[str, tuple[tuple[str, ...], Any]] = {
            "brdf": (over, brdf[-1]),
            "brdf_stderr": (over, stderr[-1]),
            "brdf_by_bounce": (("bounce", *over), brdf[:-2]),
            "brdf_interference": (over, brdf[-2] - brdf[:-2].sum(axis=0)),
            "energy_by_bounce": (("theta_i", "bounce", "wavelength"), energies[:-2].swapaxes(0, 1)),
            "energy_interference": (("theta_i", "wavelength"), energies[-2] - energies[:-2].sum(axis=0)),
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
        if surface.is_profile:
            variables["brdf_diffraction"] = (over, brdf[-1] - brdf[-2])
            variables["energy_diffraction"] = (("theta_i", "wavelength"), energies[-1] - energies[-2])
        data = brdf_dataset(
            variables, incoming.theta_deg, self.wavelength_nm, detector, phi_i_deg=incoming.phi_deg,
            coords={"bounce": bounce}, attrs=self._attributes(surface, incoming, places, found),
        )  # fmt: skip
        data["bounce"].attrs["long_name"] = "number of reflections, each by itself"
        return label(data)

    def _attributes(
        self, surface: Heightfield, incoming: Incoming, places: Places, found: list[Reflections]
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
            "sight_error": found[0].sight_error,
            "pairs_error": max(o.pairs_error for o in found),
            **self._diffraction(found),
            "windows": places.independent,
            "windows_tiled": places.tiled,
            "windows_used": len(places.windows),
            "stderr_estimate": f"spread over {places.independent:.1f} effective independent windows"
            if len(places.windows) > 1 else "not known: one window",
            "surface": surface.name,
            "backend": "numpy" if surface.is_profile else f"OpenCL, {choose(self, surface, places).name}",
            "device": "CPU" if surface.is_profile else opencl.device().name,
            "seed": self.seed,
            "versions": versions(),
        }  # fmt: skip

    def _diffraction(self, found: list[Reflections]) -> dict[str, Any]:
        done = Diffraction.worst(o.diffraction for o in found)
        return {
            "sweeps_done": done.sweeps,
            "sweeps_change": done.change,
            "diffraction": f"sweeps over the surface as {done.rule}" if done.sweeps else "none",
            "diffraction_left_out": done.left_out,
        }


def _last_twice(a: Floats) -> Floats:
    """A patch has no diffraction: its coherent sum is all."""
    return np.concatenate([a, a[-1:]])


def _positive(name: str, value: Any, unit: str, least: float = 0.0) -> None:
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = np.nan
    if not (np.isfinite(number) and number > least):
        raise InputError(f"{name} = {value!r}: a number of {unit} above {least:g} is needed")
