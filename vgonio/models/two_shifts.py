"""Two weighted shifts: one of single, one of multiple reflections, where 4.5 has a single function for both.

What Clausen 2022 proposes at the end of section 4.4, in the form of this project: with s the share of light that
leaves after a single reflection (the traced decomposition of the same surface),

    m(i, o) = s · h₁ cos(w₁ θ_m) + (1 − s) · h₂ cos(w₂ θ_d)

θ_m is 0 in the mirror direction, about which single reflections are centred, θ_d, half the angle between source and
detector, is 0 in back-scattering, about which multiple reflections are. Both are symmetric in source and detector, so
the model is reciprocal where s is. Units as in `clausen_2022`.
"""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError
from ..materials import Material
from .clausen_2022 import WAVELENGTH_N_NM, require_finite, shift, shifted_terms
from .cook_torrance_1982 import reflectance
from .geometry import Geometry

Floats = NDArray[np.float64]


def slope(theta_m: ArrayLike, theta_d: ArrayLike, share: ArrayLike, h1: float, w1: float, h2: float, w2: float):
    """m in nm⁻¹ at angles θ_m, θ_d (radians) and shares s of single reflections, 0…1, broadcast."""
    share, theta_m, theta_d = (np.asarray(v, dtype=np.float64) for v in (share, theta_m, theta_d))
    return share * h1 * np.cos(w1 * theta_m) + (1.0 - share) * h2 * np.cos(w2 * theta_d)


def share_at(geometry: Geometry, single_share: float | xr.DataArray) -> Floats:
    """s at every pair of directions: a number, or an array (theta_i, theta_o) in degrees, linear between its angles.

    Outside the angles of the array its nearest edge holds. Raises InputError out of plane or for values beyond 0…1.
    """
    if not isinstance(single_share, xr.DataArray):
        values = np.asarray(single_share, dtype=np.float64)
        if not np.all((values >= 0) & (values <= 1)):
            raise InputError(f"single_share = {single_share}: a share of the light lies within 0…1")
        return np.broadcast_to(values, geometry.shape)
    from scipy.interpolate import RegularGridInterpolator

    table = single_share.sortby("theta_i").sortby("theta_o").transpose("theta_i", "theta_o")
    if not np.all((table.values >= 0) & (table.values <= 1)):
        raise InputError("single_share holds values outside 0…1 or gaps: fill them first (compare.single_share does)")
    if not np.allclose(np.sin(geometry.phi_o - geometry.phi_i), 0.0, atol=1e-9):
        raise InputError("the share of single reflections is known in the plane of incidence only")
    axes = [table[d].values for d in ("theta_i", "theta_o")]
    points = [np.clip(np.rad2deg(a), v[0], v[-1]) for a, v in zip((geometry.theta_i, geometry.theta_o), axes)]
    if any(v.size < 2 for v in axes):
        raise InputError("the share of single reflections is needed at two angles of incidence and reflection at least")
    # the weights of an interpolation add up to 1 but for rounding, and a share beyond 1 is refused when it comes back
    return np.clip(RegularGridInterpolator(axes, table.values)(np.stack(points, axis=-1)), 0.0, 1.0)


def shift_factor(
    geometry: Geometry,
    wavelength_nm: Floats,
    *,
    h1: float,
    w1: float,
    h2: float,
    w2: float,
    single_share: float | xr.DataArray,
    wavelength_n_nm: float = WAVELENGTH_N_NM,
    **_: object,
) -> Floats:
    """The shift at each pair of directions and wavelength, as it is, negative values included."""
    s = share_at(geometry, single_share)
    return shift(slope(geometry.theta_m, geometry.theta_d, s, h1, w1, h2, w2), wavelength_nm, wavelength_n_nm)


def terms(
    geometry: Geometry,
    wavelength_nm: Floats,
    *,
    alpha: float,
    h1: float,
    w1: float,
    h2: float,
    w2: float,
    single_share: float | xr.DataArray,
    p: float = 1.0,
    material: str | Material = "Al",
    eta: float | None = None,
    distribution: str = "ggx",
    wavelength_n_nm: float = WAVELENGTH_N_NM,
    clamp: bool = False,
) -> dict[str, Floats]:
    """What k_s (1) and k_d(λ) multiply: shift · D F^p G/(4 cos θ_i cos θ_o) and 1/π, as in `clausen_2022`."""
    require_finite(h1=h1, w1=w1, h2=h2, w2=w2, p=p)
    parameters = {"h1": h1, "w1": w1, "h2": h2, "w2": w2}
    factor = shift_factor(
        geometry, wavelength_nm, single_share=single_share, wavelength_n_nm=wavelength_n_nm, **parameters
    )
    f = reflectance(geometry.theta_d, wavelength_nm, material, eta) ** p
    return shifted_terms(geometry, alpha, distribution, f, factor, clamp)
