"""Mitsuba plug-ins of the modified Cook–Torrance model and its shift extension, with importance sampling and pdf.

`cook-torrance-1982` and `clausen-2022` are the models of those names in `vgonio.models` (thesis 2.23, 3.1, 4.6 … 4.8),
with the same parameters: alpha; material (a name) or eta (a number); k_d, k_s (textures or numbers); c; h, w, t_y, p of
the shift. A BRDF below 0, which a large c or a steep shift would give, is 0.
Facets are sampled by the visible normals of GGX (Heitz 2018) and the diffuse part by the cosine; which of the two
follows from the Fresnel reflectance at the direction of view and the mean of k_d, so the choice knows no wavelength
and the pdf is one number for the four wavelengths of a path.
The classes exist once a variant is set, so they are made by a function; they are the same for scalar, llvm and cuda.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..errors import InputError
from ..materials import material
from ..models.clausen_2022 import WAVELENGTH_N_NM

#: Names of the plug-ins, as Mitsuba and `vgonio.models` know them: without and with the shift extension.
PLAIN, EXTENDED = "cook-torrance-1982", "clausen-2022"
# Mitsuba's own spectral range; narrower for materials whose table is, see `wavelength_min`, `wavelength_max`
RANGE_NM = (360.0, 830.0)
# neither lobe is left without samples while it reflects anything
LEAST_SHARE = 0.1
_registered: set[str] = set()


def register(mi: Any) -> None:
    """Register the plug-ins for the variant that is set; `mi.load_dict({"type": "clausen-2022", …})` finds them."""
    variant = mi.variant()
    if variant not in _registered:
        plain = _plain_class(mi)
        mi.register_bsdf(PLAIN, plain)
        mi.register_bsdf(EXTENDED, _extended_class(mi, plain))
        _registered.add(variant)


def spectrum(wavelength_nm: Any, values: Any) -> dict[str, Any]:
    """A Mitsuba spectrum through (n,) values at (n,) ascending wavelengths in nm; constant beyond its ends."""
    w, v = np.asarray(wavelength_nm, float), np.asarray(values, float)
    w, v = np.append(np.insert(w, 0, min(w[0], RANGE_NM[0]) - 1), max(w[-1], RANGE_NM[1]) + 1), np.pad(v, 1, "edge")
    return {
        "type": "irregular",
        "wavelengths": ", ".join(repr(float(x)) for x in w),
        "values": ", ".join(repr(float(x)) for x in v),
    }


def conductor_spectra(name: str, low_nm: float = RANGE_NM[0], high_nm: float = RANGE_NM[1]) -> dict[str, Any]:
    """n and k of a material of `vgonio.materials` as Mitsuba spectra every nanometre from low to high.

    Raises MaterialError where the table is shorter.
    """
    w = np.append(np.arange(low_nm, high_nm, 1.0), high_nm)
    index = material(name).index(w)
    return {"n": spectrum(w, index.real), "k": spectrum(w, index.imag)}


def _textures(mi: Any, props: Any) -> tuple[Any, Any]:
    """The textures of n and k of the material that `props` names."""
    low, high = (float(props.get(f"wavelength_{end}", x)) for end, x in zip(("min", "max"), RANGE_NM))
    made = conductor_spectra(str(props.get("material", "Al")), low, high)
    return mi.load_dict(made["n"]), mi.load_dict(made["k"])


def _plain_class(mi: Any) -> type:
    import drjit as dr

    class CookTorrance1982(mi.BSDF):
        """k_d/π + k_s D F G/(4 cos θ_i cos θ_o) − c with GGX (thesis 2.23, 3.1, 4.6 and 4.7)."""

        def __init__(self, props: Any) -> None:
            mi.BSDF.__init__(self, props)
            self.alpha = mi.Float(_positive("alpha", props["alpha"]))
            self.dielectric = "eta" in props
            self.perfect = not self.dielectric and str(props.get("material", "Al")) == "perfect"
            self.eta = mi.Float(_index(props["eta"]) if self.dielectric else 1.0)
            if not (self.dielectric or self.perfect):
                self.n, self.k = _textures(mi, props)
            self.diffuse = "k_d" in props
            self.k_d: Any = props.get_texture("k_d") if self.diffuse else None
            self.coloured = "k_s" in props
            self.k_s: Any = props.get_texture("k_s") if self.coloured else None
            self.c = mi.Float(_finite("c", props.get("c", 0.0)))
            # the mean of k_d steers the choice of the lobe and nothing else
            self.k_d_mean = mi.Float(float(props.get("k_d_mean", 0.5)) if self.diffuse else 0.0)
            self.read_shift(props)
            # in memory, not written into the compiled kernel: one kernel serves all values
            dr.make_opaque(self.alpha, self.eta, self.c, self.k_d_mean)
            flags = mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.FrontSide
            self.m_components = [flags | (mi.BSDFFlags.DiffuseReflection if self.diffuse else flags)]
            self.m_flags = self.m_components[0]

        def read_shift(self, props: Any) -> None:
            """The plain model has no shift."""

        def shifted(self, f: Any, m: Any, si: Any) -> Any:
            """F as it is; the extension multiplies it."""
            return f

        def traverse(self, cb: Any) -> None:
            cb.put("alpha", self.alpha, mi.ParamFlags.Differentiable)
            cb.put("eta", self.eta, mi.ParamFlags.Differentiable)
            cb.put("c", self.c, mi.ParamFlags.Differentiable)
            cb.put("k_d_mean", self.k_d_mean, mi.ParamFlags.NonDifferentiable)
            for name, texture in (("k_d", self.k_d), ("k_s", self.k_s)):
                if texture is not None:
                    cb.put(name, texture, mi.ParamFlags.Differentiable)

        def facets(self) -> Any:
            return mi.MicrofacetDistribution(mi.MicrofacetType.GGX, self.alpha, True)

        def reflectance(self, cos_d: Any, si: Any, active: Any) -> Any:
            """F at the angle between light and half vector."""
            if self.perfect:
                return mi.UnpolarizedSpectrum(1.0)
            if self.dielectric:
                return mi.UnpolarizedSpectrum(_dielectric(dr, cos_d, self.eta))
            n, k = self.n.eval(si, active), self.k.eval(si, active)
            return _conductor(dr, cos_d, n, k)

        def facet_share(self, cos_v: Any) -> Any:
            """Probability with which the facets are sampled, at the cosine of the direction of view."""
            if not self.diffuse:
                return mi.Float(1.0)
            f = _dielectric(dr, dr.maximum(cos_v, 0.0), self.eta) if self.dielectric else mi.Float(0.9)
            return dr.clip(f / (f + self.k_d_mean), LEAST_SHARE, 1.0 - LEAST_SHARE)

        def sample(self, ctx: Any, si: Any, sample1: Any, sample2: Any, active: Any = True) -> Any:
            active = mi.Mask(active) & (mi.Frame3f.cos_theta(si.wi) > 0)
            share = self.facet_share(mi.Frame3f.cos_theta(si.wi))
            normal, _ = self.facets().sample(si.wi, sample2)
            wo = mi.reflect(si.wi, normal)
            if self.diffuse:
                wo = dr.select(sample1 < share, wo, mi.warp.square_to_cosine_hemisphere(sample2))
            value, pdf = self.eval_pdf(ctx, si, wo, active)
            good = active & (pdf > 0)
            bs = dr.zeros(mi.BSDFSample3f)
            bs.wo, bs.pdf, bs.eta = wo, dr.select(good, pdf, 0.0), 1.0
            bs.sampled_component, bs.sampled_type = mi.UInt32(0), mi.UInt32(+self.m_flags)
            # divided by 1 where there is nothing: scalar numbers of Python do not divide by 0
            return bs, dr.select(good, value / dr.select(good, pdf, 1.0), 0.0)

        def eval(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            return self.eval_pdf(ctx, si, wo, active)[0]

        def pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            return self.eval_pdf(ctx, si, wo, active)[1]

        def eval_pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            cos_i, cos_o = mi.Frame3f.cos_theta(si.wi), mi.Frame3f.cos_theta(wo)
            active = mi.Mask(active) & (cos_i > 0) & (cos_o > 0)
            cos_i, cos_o = dr.select(active, cos_i, 1.0), dr.select(active, cos_o, 1.0)
            h = dr.normalize(dr.select(active, si.wi + wo, mi.Vector3f(0, 0, 1)))
            facets = self.facets()
            masked_i, masked_o = facets.smith_g1(si.wi, h), facets.smith_g1(wo, h)
            # D G₁(i)/(4 cos θ_i) is both the pdf of the visible normals and a factor of the BRDF
            visible = facets.eval(h) * masked_i / (4.0 * cos_i)
            f = self.shifted(self.reflectance(dr.dot(si.wi, h), si, active), h, si)
            value, pdf = f * (visible * masked_o), visible
            if self.coloured:
                value *= self.k_s.eval(si, active)
            if self.diffuse:
                share = self.facet_share(cos_i)
                value += (self.k_d.eval(si, active) * dr.inv_pi - self.c) * cos_o
                value = dr.maximum(value, 0.0)
                pdf = share * pdf + (1.0 - share) * cos_o * dr.inv_pi
            return dr.select(active, value, 0.0), dr.select(active, pdf, 0.0)

        def to_string(self) -> str:
            return f"{type(self).__name__}[alpha={self.alpha}, eta={self.eta}, diffuse={self.diffuse}]"

    return CookTorrance1982


def _extended_class(mi: Any, plain: type) -> type:
    import drjit as dr

    class Clausen2022(plain):  # type: ignore[valid-type, misc]
        """The plain model, its facets times 1 + (h cos(w θ_m) + t_y)(λ − λ_n) not below 0 (thesis 4.8)."""

        def read_shift(self, props: Any) -> None:
            self.h, self.w = mi.Float(_finite("h", props["h"])), mi.Float(_finite("w", props["w"]))
            self.t_y = mi.Float(_finite("t_y", props.get("t_y", 0.0)))
            self.p = _finite("p", props.get("p", 1.0))
            dr.make_opaque(self.h, self.w, self.t_y)

        def shifted(self, f: Any, m: Any, si: Any) -> Any:
            # arccos is off by 3e-4 rad near 0, where the cosine does not notice: 2e-6 of the shift; arctan2 costs more
            theta_m = dr.safe_acos(m.z)
            slope = dr.fma(self.h, dr.cos(self.w * theta_m), self.t_y)
            if self.p != 1:
                f = dr.power(f, self.p)
            return f * dr.maximum(dr.fma(slope, si.wavelengths - WAVELENGTH_N_NM, 1.0), 0.0)

        def traverse(self, cb: Any) -> None:
            plain.traverse(self, cb)  # type: ignore[attr-defined]
            for name in ("h", "w", "t_y"):
                cb.put(name, getattr(self, name), mi.ParamFlags.Differentiable)

    return Clausen2022


def _dielectric(dr: Any, c: Any, eta: Any) -> Any:
    """Reflectance of a dielectric, the form of Cook and Torrance 1982 (thesis 2.27 without its misprints)."""
    g = dr.sqrt(eta * eta + c * c - 1.0)
    first, last = (g - c) / (g + c), (c * (g + c) - 1.0) / (c * (g - c) + 1.0)
    return 0.5 * first * first * (1.0 + last * last)


def _conductor(dr: Any, c: Any, n: Any, k: Any) -> Any:
    """Unpolarised Fresnel reflectance of n + ik (thesis 2.19, 2.21) in real arithmetic."""
    c2 = c * c
    s2 = 1.0 - c2
    real = n * n - k * k - s2
    size = dr.sqrt(real * real + 4.0 * n * n * k * k)
    across = 2.0 * c * dr.sqrt(dr.maximum(0.5 * (size + real), 0.0))
    r_s = (size + c2 - across) / (size + c2 + across)
    r_p = r_s * (c2 * size + s2 * s2 - across * s2) / (c2 * size + s2 * s2 + across * s2)
    return 0.5 * (r_s + r_p)


def _finite(name: str, value: Any) -> float:
    if not np.isfinite(float(value)):
        raise InputError(f"{name} = {value} is not a finite number")
    return float(value)


def _positive(name: str, value: Any) -> float:
    if not (np.isfinite(float(value)) and float(value) > 0):
        raise InputError(f"{name} = {value}: a positive number is needed")
    return float(value)


def _index(value: Any) -> float:
    if not (np.isfinite(float(value)) and float(value) > 1):
        raise InputError(f"eta = {value}: the refractive index of a dielectric in air is above 1")
    return float(value)
