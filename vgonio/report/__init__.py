"""6. Look at it: the figures, and one HTML page that needs nothing else."""

from . import figures
from .document import page, render

__all__ = ["figures", "page", "render"]
