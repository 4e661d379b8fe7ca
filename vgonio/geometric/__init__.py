"""2a. Rays: traced over the triangulated surface, with Fresnel reflection and book-keeping by number of reflections."""

from . import microfacet
from .rays import RayOptics

__all__ = ["RayOptics", "microfacet"]
