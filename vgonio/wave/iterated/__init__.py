"""Reflections that follow each other: the Kirchhoff approximation iterated between mutually visible points."""

from .solver import IteratedKirchhoff

__all__ = ["IteratedKirchhoff"]
