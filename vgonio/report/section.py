"""A part of the page: its words, figures, tables and what is folded away."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from .style import svg
from .tables import Table

if TYPE_CHECKING:
    from markupsafe import Markup
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Picture:
    """A figure as SVG with its caption; width "wide", "half" or "third" of the page."""

    svg: Markup
    caption: str
    width: str = "wide"


@dataclass(frozen=True)
class Detail:
    """Something long that is folded away."""

    title: str
    body: str


@dataclass
class Section:
    """A part of the page; `beside` is a table to the right of the first figure, `missing` says why there is nothing."""

    key: str
    title: str
    short: str = ""
    text: list[str] = field(default_factory=list)
    pictures: list[Picture] = field(default_factory=list)
    tables: list[Table] = field(default_factory=list)
    details: list[Detail] = field(default_factory=list)
    beside: Table | None = None
    missing: str = ""

    def draw(self, figure: Figure, caption: str, width: str = "wide") -> None:
        """Add a figure; its ids on the page begin with the section's key."""
        from markupsafe import Markup

        prefix = f"{self.key}{len(self.pictures)}"
        self.pictures.append(Picture(Markup(svg(figure, caption, prefix)), caption, width))
