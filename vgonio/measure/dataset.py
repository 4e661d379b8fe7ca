"""The common dataset lives in `vgonio.dataset`, below the solvers that return it."""

from ..dataset import COORDINATES, VARIABLES, brdf_dataset, check, detector_coords, label, plain, versions

__all__ = ["COORDINATES", "VARIABLES", "brdf_dataset", "check", "detector_coords", "label", "plain", "versions"]
