"""What the scalar theories say of Gaussian rough surfaces in closed form, and first-order vector theory beside them.

Heights are normally distributed with the autocorrelation σ² exp(−r²/T²). Directions are unit vectors (…, 3) away from
the surface, wavelengths nm, lengths µm. A perfect reflector is meant (R = 1) unless a refractive index is given.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..directions import unit_vectors
from ..errors import InputError, nearest
from ..units import radians, wavenumber
from .quadrature import Floats
from .theories import THEORIES, amplitude, scattering_vector

TERMS = 9.0  # standard deviations of n around g = (q_z σ)² that the series takes


def total_integrated_scatter(
    theory: str, rms_um: ArrayLike, theta_i_deg: ArrayLike, wavelength_nm: ArrayLike
) -> Floats:
    """Scattered over reflected power, 1 − exp(−(4πσ cos θ_i/λ)²), broadcast; without cos θ_i for "harvey-shack".

    Davies 1954, Bennett and Porteus 1961. For correlation lengths T ≥ 5λ and θ_i ≤ 60°: below, part of the scattered
    waves would be evanescent, and the power that the theories find is no longer what came in.
    """
    _known(theory)
    cos_i = np.cos(radians(np.asarray(theta_i_deg, float))) if theory != "harvey-shack" else 1.0
    q_z = 2 * wavenumber(np.asarray(wavelength_nm, float)) * cos_i
    return np.asarray(-np.expm1(-((q_z * np.asarray(rms_um, float)) ** 2)))


def coherent_share(theory: str, rms_um: ArrayLike, theta_i_deg: ArrayLike, wavelength_nm: ArrayLike) -> Floats:
    """Share of the reflected power that stays in the mirror direction, exp(−(q_z σ)²), for any slopes."""
    return np.asarray(1 - total_integrated_scatter(theory, rms_um, theta_i_deg, wavelength_nm))


def gaussian_spectrum(q: ArrayLike, rms_um: float, correlation_um: float) -> Floats:
    """W(q) = ∫ σ² exp(−r²/T²) exp(−iq·r) d²r = πσ²T² exp(−q²T²/4), µm⁴; q (…, ≥ 2) rad/µm, x and y count."""
    q2 = np.sum(np.asarray(q, float)[..., :2] ** 2, axis=-1)
    return np.asarray(np.pi * (rms_um * correlation_um) ** 2 * np.exp(-q2 * correlation_um**2 / 4))


def mean_intensity(q: Floats, rms_um: float, correlation_um: float, coherence_um: float) -> Floats:
    """⟨|S(q)|²⟩/A_w in µm² for a Gaussian window of ℓ = `coherence_um`, q (m, 3) rad/µm.

    ∫ exp(−g(1 − exp(−r²/T²))) exp(−r²/4ℓ²) exp(−iq·r) d²r with g = (q_z σ)², as the series over n of
    exp(−g) gⁿ/n! · π/a_n · exp(−(q_x² + q_y²)/4a_n), a_n = n/T² + 1/4ℓ² (Beckmann and Spizzichino 1963, 5.3;
    n = 0 is the coherent part).
    """
    from scipy.special import gammaln

    g = (q[:, 2] * rms_um) ** 2
    top = float(g.max(initial=0.0))
    n = np.arange(max(0, int(g.min(initial=0.0) - TERMS * np.sqrt(top) - 1)), int(top + TERMS * np.sqrt(top) + 20))
    a = n / correlation_um**2 + 1 / (4 * coherence_um**2)
    q2 = np.sum(q[:, :2] ** 2, axis=1)
    found = np.zeros(len(q))
    for nn, an, log_factorial in zip(n, a, gammaln(n + 1.0)):
        log_g = nn * np.log(np.maximum(g, 1e-300)) if nn else 0.0
        found += np.pi / an * np.exp(log_g - g - log_factorial - q2 / (4 * an))
    return found


def beckmann(
    theory: str,
    wi: Floats,
    wo: Floats,
    wavelength_nm: float,
    rms_um: float,
    correlation_um: float,
    coherence_um: float,
) -> Floats:
    """(m,) ensemble mean of the BRDF of a Gaussian surface, sr⁻¹, towards wo (m, 3), through a Gaussian window."""
    _known(theory)
    wi, wo = np.broadcast_arrays(np.asarray(wi, float), np.asarray(wo, float))
    k = np.full(len(wo), float(wavenumber(wavelength_nm)))
    q = scattering_vector(theory, k, wi, wo)
    mean = mean_intensity(q, rms_um, correlation_um, coherence_um)
    return _prefactor(wi, wo, wavelength_nm) * amplitude(theory, wi, wo) ** 2 * mean


def lost_across(coherence_um: float, aperture_deg: float, wavelength_nm: float) -> float:
    """Share of a profile's light beside a cone (full angle in degrees) that the window exp(−r²/2ℓ²) puts there.

    Across the plane of incidence |S|² is exp(−(k ℓ s_y)²), s_y the direction cosine, whatever the profile; over a cone
    on a lobe that is wide against it: 1 − ∫₀¹ erf(k ℓ sin a √(1 − t²)) dt, a half the angle.
    """
    from scipy.special import erf

    t = (np.arange(2000) + 0.5) / 2000
    width = float(wavenumber(wavelength_nm)) * coherence_um * float(np.sin(radians(aperture_deg / 2)))
    return float(1 - np.mean(erf(width * np.sqrt(1 - t**2))))


# ---- slightly rough surfaces: everything in proportion to the spectral density at q
def linearised(theory: str, wi: Floats, wo: Floats, wavelength_nm: float, spectrum: ArrayLike) -> Floats:
    """The scalar theory to first order in q_z z: k²/(4π²) C²/(cos θ_i cos θ_o) q_z² W(q), sr⁻¹; spectrum W (…,) µm⁴."""
    _known(theory)
    wi, wo = np.broadcast_arrays(np.asarray(wi, float), np.asarray(wo, float))
    k = np.full(wo.shape[:-1], float(wavenumber(wavelength_nm)))
    q_z = scattering_vector(theory, k, wi, wo)[..., 2]
    c = amplitude(theory, wi, wo)
    return np.asarray(_prefactor(wi, wo, wavelength_nm) * c**2 * q_z**2 * np.asarray(spectrum, float))


def rayleigh_rice(
    polarisation: str, wi: Floats, wo: Floats, wavelength_nm: float, spectrum: ArrayLike, index: complex | None = None
) -> Floats:
    """First-order vector perturbation, (16π²/λ⁴) cos θ_i cos θ_o Q W(q), sr⁻¹, same polarisation in and out, in the
    plane of incidence; spectrum W (…,) µm⁴, index n + ik or None for a perfect conductor.

    Rice 1951; Q as in Stover 1995 (Church 1979):
    s: |(ε − 1)/((c_i + e_i)(c_o + e_o))|², 1 on a perfect conductor;
    p: |(ε − 1)(e_i e_o + ε s_i s_o)/((ε c_i + e_i)(ε c_o + e_o))|², ((1 + s_i s_o)/(c_i c_o))² on a perfect conductor,
    with signed sines s (one axis for both directions, so − for Stover's +), e = √(ε − s²).
    Raises InputError for another polarisation or directions that leave the plane of incidence.
    """
    wi, wo = np.broadcast_arrays(np.asarray(wi, float), np.asarray(wo, float))
    if np.abs(wi[..., 0] * wo[..., 1] - wi[..., 1] * wo[..., 0]).max(initial=0.0) > 1e-9:
        raise InputError("rayleigh_rice is for directions in the plane of incidence: these leave it")
    if polarisation not in ("s", "p"):
        raise InputError(f"polarisation {polarisation!r}: {nearest(str(polarisation), ('s', 'p'))}")
    c_i, c_o = wi[..., 2], wo[..., 2]
    sines = wi[..., 0] * wo[..., 0] + wi[..., 1] * wo[..., 1]  # s_i s_o, with its sign
    if index is None:
        q = np.ones_like(c_o) if polarisation == "s" else ((1 + sines) / (c_i * c_o)) ** 2
    else:
        eps = complex(index) ** 2
        e_i, e_o = np.sqrt(eps - 1 + c_i**2), np.sqrt(eps - 1 + c_o**2)
        if polarisation == "s":
            factor = 1 / ((c_i + e_i) * (c_o + e_o))
        else:
            factor = (e_i * e_o + eps * sines) / ((eps * c_i + e_i) * (eps * c_o + e_o))
        q = np.abs((eps - 1) * factor) ** 2
    k = float(wavenumber(wavelength_nm))
    return np.asarray(k**4 / np.pi**2 * c_i * c_o * q * np.asarray(spectrum, float))


def parting(theta_i_deg: float, theta_o_deg: ArrayLike) -> dict[str, Floats]:
    """Where theories of slightly rough surfaces part ways: each over Rayleigh–Rice for s, in the plane of incidence.

    theta_o_deg : (m,) signed, −θ_i is the mirror direction, θ_i back-scattering. Neither the surface nor the
    wavelength matters, a perfect conductor is meant. Keys: the three theories (linearised) and "rayleigh-rice p". At
    60° retro Kirchhoff is 1/cos⁴60° = 16 times the s-polarised result.
    """
    theta_o = np.atleast_1d(np.asarray(theta_o_deg, float))
    wo = unit_vectors(radians(theta_o))
    wi = np.broadcast_to(unit_vectors(radians(np.array([theta_i_deg])))[0], wo.shape)
    s = rayleigh_rice("s", wi, wo, 1000.0, 1.0)
    found = {t: linearised(t, wi, wo, 1000.0, 1.0) / s for t in THEORIES}
    return found | {"rayleigh-rice p": rayleigh_rice("p", wi, wo, 1000.0, 1.0) / s}


def _prefactor(wi: Floats, wo: Floats, wavelength_nm: float) -> Floats:
    return np.asarray(float(wavenumber(wavelength_nm)) ** 2 / (4 * np.pi**2) / (wi[..., 2] * wo[..., 2]))


def _known(theory: str) -> None:
    if theory not in THEORIES:
        raise InputError(f"theory {theory!r}: {nearest(str(theory), THEORIES)}")
