"""The Normbox (thesis, chapter 3): a reference scene, measured or virtual, against which a renderer is held."""

from .box import Box, Scene
from .settings import Settings, load
from .validation import validate

__all__ = ["Box", "Scene", "Settings", "load", "validate"]
