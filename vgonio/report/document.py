"""The page: a result becomes one HTML file that needs nothing else, neither network nor other files."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import xarray as xr

from ..files import written_whole

if TYPE_CHECKING:
    from markupsafe import Markup

    from ..surface import Heightfield
    from .section import Section
    from .verdict import Verdict

FOLDER = Path(__file__).parent


def page(
    tree: xr.DataTree, path: str | os.PathLike[str], surface: Heightfield | xr.Dataset | None = None, plan: Any = None
) -> Path:
    """Write the report of a result as one self-contained HTML page; returns the path.

    tree : result of `vg.simulate` or `vg.open`; groups that are missing are left out on the page, with the reason
    surface : Heightfield or its summary, where the tree has no group `surface`;  plan : where the tree carries none
    The page is written under a temporary name and renamed. Raises FileFormatError where it cannot be written.
    """
    path = Path(path)
    text = render(tree, surface, plan)
    with written_whole(path) as stream:
        stream.write(text.encode())
    return path


def render(tree: xr.DataTree, surface: Heightfield | xr.Dataset | None = None, plan: Any = None) -> str:
    """The page as a string; see `page`."""
    from .content import Content
    from .sections import compose

    content = Content.of(tree, surface, plan)
    verdict, sections = compose(content)
    date = str(content.provenance.get("date", ""))[:10]
    return filled(content.title, content.facts(), verdict, sections, simulated=date)


def filled(
    title: str,
    facts: Sequence[str],
    verdict: Verdict,
    sections: Sequence[Section],
    simulated: str = "",
    kicker: str = "virtual gonioreflectometer",
    numbers: str = "the NetCDF file beside it",
) -> str:
    """The template of all pages, filled: a verdict and sections under a title, and a line on where the numbers are."""
    import jinja2
    import markupsafe

    from .. import __version__

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(FOLDER),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["rich"] = rich
    return environment.get_template("page.html").render(
        title=title,
        facts=facts,
        verdict=verdict,
        sections=sections,
        css=markupsafe.Markup((FOLDER / "page.css").read_text(encoding="utf-8")),
        version=__version__,
        date=simulated,
        kicker=kicker,
        numbers=numbers,
    )


def rich(value: Any) -> Markup:
    """Text made safe; θᵢ, θₒ and ΔE₀₀ get real subscripts, numbers stay on one line with their unit."""
    from markupsafe import Markup, escape

    text = str(escape(value))
    for letter, subscript in (("ᵢ", "i"), ("ₒ", "o"), ("ₘ", "m")):
        text = text.replace(f"θ{letter}", f"<i>θ</i><sub>{subscript}</sub>")
    text = re.sub(r"(?<=\d) (?=(?:%|nm|µm|σ|sr⁻¹)(?!\w))", "\u00a0", text)
    text = text.replace("ΔE₀₀", "Δ<i>E</i><sub>00</sub>")
    return Markup(re.sub(r"\bθ_(\w)", r"<i>θ</i><sub>\1</sub>", text))
