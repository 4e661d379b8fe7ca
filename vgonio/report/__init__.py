"""6. Look at it: the figures, and one HTML page that needs nothing else."""

from . import figures
from .display_document import display_page
from .document import page, render

__all__ = ["display_page", "figures", "page", "render"]
