"""A page to explore one result in a browser: sliders for θᵢ, λ and θₒ; one HTML file that needs nothing else."""

from __future__ import annotations

import json
import os
from pathlib import Path

import xarray as xr

from ..files import written_whole

FOLDER = Path(__file__).parent


def explorer_page(tree: xr.DataTree, path: str | os.PathLike[str]) -> Path:
    """Write a self-contained HTML page to explore a result; returns the path.

    tree : result of `vg.simulate` or `vg.open`. The page shows, for the θᵢ, λ and θₒ of its sliders: the polar lobe,
    spectra, the colours of the plane of incidence, the hemisphere and the split by reflections, as far as the result
    holds them. The numbers are in the page, in single precision; where there are more than 12 MB of them, every
    second wavelength (then angle) is left out and the page says so.
    Raises InputError for a result without a BRDF, FileFormatError where the page cannot be written.
    """
    path = Path(path)
    text = render_explorer(tree)
    with written_whole(path) as stream:
        stream.write(text.encode())
    return path


def render_explorer(tree: xr.DataTree) -> str:
    """The page as a string; see `explorer_page`."""
    import jinja2
    import markupsafe

    from .. import __version__
    from .content import Content
    from .document import rich
    from .explorer_data import embedded

    content = Content.of(tree)
    data = embedded(content)
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(FOLDER), autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True
    )
    environment.filters["rich"] = rich
    parts = {
        name.replace(".", "_"): markupsafe.Markup((FOLDER / name).read_text(encoding="utf-8"))
        for name in ("page.css", "explorer.css", "explorer.js")
    }
    return environment.get_template("explorer.html").render(
        title=content.title,
        facts=content.facts(),
        notes=data["notes"],
        sphere=bool(content.sphere),
        bounces=any(r["bounces"] for r in data["results"]),
        # "<" could end the script element
        data=markupsafe.Markup(json.dumps(data, ensure_ascii=False, allow_nan=False).replace("<", "\\u003c")),
        version=__version__,
        **parts,
    )
