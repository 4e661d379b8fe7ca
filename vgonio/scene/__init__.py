"""The scene file: one TOML file says what is wanted, and is checked as a whole before any work starts.

A table that is absent is work that is not done. Every mistake is one line: the table and key, what was got, what is
allowed. This package is the only one that imports pydantic.
"""

from .reading import changed_scene, load_scene, parse_override, without_output
from .tables import TABLES, THEORIES, Light, Scene
from .values import GENERATORS, check_generator, expand

__all__ = [
    "GENERATORS",
    "TABLES",
    "THEORIES",
    "Light",
    "Scene",
    "changed_scene",
    "check_generator",
    "expand",
    "load_scene",
    "parse_override",
    "without_output",
]
