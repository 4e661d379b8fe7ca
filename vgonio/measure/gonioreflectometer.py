"""The virtual gonioreflectometer: source, detector, and whatever solver is put between them."""

from __future__ import annotations

import hashlib
import time
import warnings
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import xarray as xr

from ..dataset import check
from ..directions import Detector, Incoming, angle_list, like_radians
from ..errors import InputError, VgonioWarning
from ..surface.heightfield import Heightfield


class Solver(Protocol):
    """Anything that scatters: rays, waves, or a third kind."""

    def scatter(self, surface: Heightfield, incoming: Incoming, detector: Detector) -> xr.Dataset: ...


@dataclass(frozen=True)
class Gonioreflectometer:
    """Angles, apertures and light of the instrument; all angles in degrees.

    theta_i_deg : signed angles of incidence;  theta_o_deg : signed angles of reflection in the same plane, or None for
    a hemisphere of cells of `resolution_deg`;  aperture_deg : full angle of the detector cone
    coherence_um : ℓ of the Gaussian amplitude window exp(−r²/2ℓ²), None for the whole sample as one window
    phi_i_deg : azimuth of the plane of incidence;  divergence_deg : full angle of the source's cone
    polarisation : "unpolarised", "s" or "p"

    Raises InputError for empty lists, angles of 90° and beyond, and lengths or apertures that are not positive;
    warns of angles that look like radians.
    """

    theta_i_deg: Any
    theta_o_deg: Any = None
    aperture_deg: float = 2.0
    coherence_um: float | None = 30.0
    phi_i_deg: float = 0.0
    divergence_deg: float = 0.0
    polarisation: str = "unpolarised"
    resolution_deg: float = 5.0

    def __post_init__(self) -> None:
        _ = self.incoming, self.detector  # both check what they are given
        for name in ("theta_i_deg", "theta_o_deg"):
            values = getattr(self, name)
            told = "" if values is None else like_radians(angle_list(values, name), name)
            if told:
                warnings.warn(told, VgonioWarning, stacklevel=3)

    @classmethod
    def hemisphere(cls, theta_i_deg: Any, resolution_deg: float = 5.0, **light: Any) -> Gonioreflectometer:
        """An instrument that catches everything: cells of nearly equal solid angle over the hemisphere."""
        return cls(theta_i_deg=theta_i_deg, theta_o_deg=None, resolution_deg=resolution_deg, **light)

    @property
    def incoming(self) -> Incoming:
        """The light: directions, coherence, divergence, polarisation."""
        return Incoming(self.theta_i_deg, self.phi_i_deg, self.coherence_um, self.divergence_deg, self.polarisation)

    @property
    def detector(self) -> Detector:
        """The cones in the plane, or the cells of the hemisphere."""
        if self.theta_o_deg is None:
            return Detector.hemisphere(self.resolution_deg)
        return Detector.in_plane(self.theta_o_deg, self.aperture_deg, self.phi_i_deg)

    def measure(self, surface: Heightfield, solver: Solver) -> xr.Dataset:
        """What this instrument sees of `surface` when `solver` scatters the light; seconds are in the attributes.

        Raises InputError for what is no Heightfield or no solver, and for missing points.
        """
        if not isinstance(surface, Heightfield):
            raise InputError(f"a Heightfield is needed, got {type(surface).__name__}: Heightfield(z_um, pitch_um=…)")
        if isinstance(solver, type) or not callable(getattr(solver, "scatter", None)):
            got = f"the class {solver.__name__}" if isinstance(solver, type) else repr(solver)[:60]
            raise InputError(
                f'solver: {got} scatters no light: give one as vg.wave.Kirchhoff("Al", [550]) or '
                'vg.geometric.RayOptics("Al", [550])'
            )
        surface.require_complete()
        start = time.perf_counter()
        data = check(solver.scatter(surface, self.incoming, self.detector), type(solver).__name__)
        data.attrs |= {
            "aperture_deg": float(self.aperture_deg) if self.theta_o_deg is not None else "cells of a hemisphere",
            "divergence_deg": float(self.divergence_deg),
            "surface_sq_um": float(np.std(surface.z)),
            "surface_profile": int(surface.is_profile),
            "surface_digest": hashlib.sha256(np.ascontiguousarray(surface.z).data).hexdigest()[:16],
            "seconds": time.perf_counter() - start,
        }
        return data
