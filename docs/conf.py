"""How Sphinx builds these pages: `make docs`, warnings are errors."""

from __future__ import annotations

import importlib
import re
import sys
from pathlib import Path

from docutils import nodes
from sphinx.pycode import ModuleAnalyzer
from sphinx.util.inspect import TypeAliasForwardRef

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "docs")]

from docstrings import as_markup, constants, sources, symbols  # noqa: E402

from vgonio import __version__  # noqa: E402

project = "vgonio"
author = "vgonio developers"
copyright = "vgonio developers, MIT licence"
version = release = __version__

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.viewcode", "sphinxcontrib.bibtex"]
html_theme = "furo"
html_title = f"vgonio {__version__}"
html_show_sphinx = False
html_static_path = ["_static"]
html_css_files = ["pages.css"]
smartquotes = False  # names in quotes are typed as they stand

myst_heading_anchors = 3
exclude_patterns = ["validated_table.md"]  # a part of validated.md
nb_execution_mode = "off"  # `make notebooks` has stored the outputs, and the tests run them
bibtex_bibfiles = ["../BIBLIOGRAPHY.bib"]
bibtex_default_style = "plain"
bibtex_reference_style = "author_year"

# docstrings name code in single backquotes
default_role = "literal"
autodoc_default_options = {"members": True, "member-order": "groupwise"}
autodoc_typehints_format = "short"
autodoc_type_aliases = {name: name for name in ("ArrayLike", "Floats", "Complex", "Mapping", "Sequence", "Callable")}
TypeAliasForwardRef.__repr__ = lambda self: self.name  # inside of tuple[…] and beside | it would show itself
# types of other packages, and names that only type checkers see: nothing on these pages to link to
nitpick_ignore_regex = [("py:.*", r".*")]


KNOWN = sources(ROOT / "BIBLIOGRAPHY.bib")
CONSTANTS = constants(ROOT / "vgonio")


def _show_constants(app) -> None:
    """What is written above a constant where it is defined, also for the module that hands it on in its `__all__`."""
    for page in sorted((ROOT / "docs" / "api").glob("*.md")):
        for name in re.findall(r"automodule:: ([\w.]+)", page.read_text(encoding="utf-8")):
            module, analysed = importlib.import_module(name), ModuleAnalyzer.for_module(name)
            analysed.analyze()
            for constant in getattr(module, "__all__", ()):
                for place, text in CONSTANTS.get(constant, {}).items():
                    if place.startswith(f"{name}."):
                        hide = [":meta hide-value:"] if len(repr(getattr(module, constant))) > 60 else []
                        analysed.attr_docs["", constant] = [*text.splitlines(), "", *hide, ""]


def _prepare(app, what, name, obj, options, lines: list[str]) -> None:
    lines[:] = as_markup(lines, KNOWN)


def _copies(app) -> None:
    """The notebooks below the pages, where Sphinx looks for them; a link would not survive archives and Windows."""
    folder = ROOT / "docs" / "notebooks"
    folder.mkdir(exist_ok=True)
    wanted = {folder / p.name: p.read_bytes() for p in (ROOT / "notebooks").glob("*.ipynb")}
    for old in set(folder.glob("*.ipynb")) - set(wanted):
        old.unlink()
    for copy, content in wanted.items():
        if not copy.is_file() or copy.read_bytes() != content:
            copy.write_bytes(content)


NOTEBOOK = re.compile(r"\[([^\]]*)\]\((?:\.\./)+notebooks/(\w+)\.ipynb\)")


def _notebooks(app, name: str, source: list[str]) -> None:
    """Links to the notebooks, which as the files stand lead to their folder, lead to their pages."""
    source[0] = NOTEBOOK.sub(r"{doc}`\1 </notebooks/\2>`", source[0])


def _subscripts(app, tree: nodes.document, name: str) -> None:
    """θ_i in the text as θ with a small i, 5 % on one line; code, names of arguments and links stay as they are."""
    kept = (nodes.literal, nodes.literal_block, nodes.strong, nodes.raw, nodes.FixedTextElement, nodes.reference)
    for text in list(tree.findall(nodes.Text)):
        above, inside = text.parent, []
        while above is not None:
            inside.append(above)
            above = above.parent
        parts = symbols(text.astext())
        if parts != [text] and not any(isinstance(n, kept) or n.tagname.startswith("desc_sig") for n in inside):
            made = [nodes.subscript("", t) if n % 2 else nodes.Text(t) for n, t in enumerate(parts)]
            text.parent.replace(text, [m for m in made if m.astext()])


def _alternatives(app, tree: nodes.document, name: str) -> None:
    """Pictures that a notebook's cell made are named by the section that they stand in."""
    for image in tree.findall(nodes.image) if name.startswith("notebooks/") else ():
        section = image.parent
        while section is not None and not isinstance(section, nodes.section):
            section = section.parent
        if section is not None and not image.get("alt"):
            image["alt"] = f"Figure made by the code above it: {section.next_node(nodes.title).astext()}"


def setup(app) -> None:
    app.connect("builder-inited", _copies)
    app.connect("source-read", _notebooks)
    app.connect("doctree-resolved", _subscripts)
    app.connect("doctree-resolved", _alternatives)
    app.connect("builder-inited", _show_constants)
    app.connect("autodoc-process-docstring", _prepare)
