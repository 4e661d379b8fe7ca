"""The pages: they build without a warning, and what they tell people to type exists."""

from __future__ import annotations

import ast
import functools
import importlib
import inspect
import re
import shlex
import subprocess
import sys
import textwrap
import tomllib
from pathlib import Path
from types import ModuleType

import click
import pytest
import typer.main

from vgonio.scene import TABLES, load_scene
from vgonio.surface import __all__ as SURFACE_NAMES

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", *sorted(DOCS.rglob("*.md"))]
REST = {
    "material": {"name": "Al"},
    "light": {"wavelength_nm": [550], "theta_i_deg": [0]},
    "detector": {"theta_o_deg": [0]},
    "wave": {"theory": "kirchhoff"},
}
FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.M | re.S)


def blocks(language: str) -> list:
    """Code blocks of one language on all pages, each named by its page."""
    return [
        pytest.param(code, id=f"{page.relative_to(ROOT)}-{number}")
        for page in PAGES
        for number, (kind, code) in enumerate(FENCE.findall(page.read_text(encoding="utf-8")))
        if kind == language
    ]


def commands() -> list[str]:
    """Lines of plain code blocks, and code in the text with options, that begin with `vgonio`; comments left away."""
    found = set()
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        lines = [line for kind, code in FENCE.findall(text) if not kind for line in code.splitlines()]
        lines += re.findall(r"`(vgonio [^`\n]+)`", FENCE.sub("", text))
        found |= {part.strip() for line in lines for part in line.split("&&") if part.strip().startswith("vgonio ")}
    return sorted(found)


@functools.cache
def program() -> click.Command:
    from vgonio.cli.app import app

    return typer.main.get_command(app)


def unknown(line: str) -> str:
    """What of a command line does not exist: a command or an option; "" where all of it does."""
    words = shlex.split(line, comments=True)[1:]
    command = program()
    while words and hasattr(command, "commands"):
        if words[0] in ("…", "--help", "--version"):
            return ""
        for name in (names := words.pop(0).split("|")):
            if name not in command.commands:
                return f"command {name}"
        command = command.commands[names[0]]
    options = {o for p in command.params for o in (*p.opts, *p.secondary_opts)} | {"--help", "-h"}
    return next((w for w in words if re.match(r"--?[a-z]", w) and w.partition("=")[0] not in options), "")


@pytest.mark.parametrize("line", commands())
def test_commands_and_options_exist(line: str) -> None:
    assert unknown(line) == ""


def test_a_wrong_command_line_is_found() -> None:
    assert unknown("vgonio simulat scene.toml") == "command simulat"
    assert unknown("vgonio plan scene.toml --jsn") == "--jsn"
    assert unknown("vgonio surface make gaussian --set a=1 -o x.npz   # so") == ""
    assert len(commands()) > 30, "the pages have some forty command lines; fewer means that they are not found any more"


@pytest.mark.parametrize("code", blocks("toml"))
def test_toml_is_a_scene_or_a_study(code: str) -> None:
    data = tomllib.loads(code)
    if "vary" in data:
        from vgonio.studies.study import KEYS

        assert set(data) <= set(KEYS)
        assert {key.partition(".")[0] for key in data["vary"]} <= set(TABLES)
    elif set(data) == {"surface"}:  # one table, to be put into a scene
        load_scene({**REST, **data})
    else:
        load_scene(data)


@pytest.mark.parametrize("code", blocks("python"))
def test_python_compiles_and_names_what_exists(code: str) -> None:
    import vgonio

    compile(code, "page", "exec")
    for chain in set(re.findall(r"\bvg((?:\.\w+)+)", code)):
        thing = vgonio
        for name in chain[1:].split("."):
            thing = getattr(thing, name)  # AttributeError names the page's mistake


@pytest.mark.parametrize("page", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_links_and_pictures_exist(page: Path) -> None:
    text = FENCE.sub("", page.read_text(encoding="utf-8"))
    targets = [t.partition("#")[0] for t in re.findall(r"\]\(([^)\s]+)\)", text) if "://" not in t]
    assert [t for t in targets if t and not (page.parent / t).exists()] == []


def test_how_to_cite_is_what_the_citation_file_says() -> None:
    """Title and version of CITATION.cff, which GitHub reads, are those of the BibTeX entry and of the program."""
    from vgonio import __version__

    cff = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    entry = (DOCS / "citing.md").read_text(encoding="utf-8")
    title, version = (re.search(rf'^{key}: "?(.+?)"?$', cff, re.M)[1] for key in ("title", "version"))
    assert version == __version__
    assert f"version = {{{version}}}" in entry
    assert f"title = {{{title}}}" in entry


def test_docstrings_become_lists_and_links() -> None:
    sys.path.insert(0, str(DOCS))
    try:
        from docstrings import as_markup, sources
    finally:
        sys.path.remove(str(DOCS))
    known = sources(ROOT / "BIBLIOGRAPHY.bib")
    assert known["Spizzichino", "1963"] == known["Beckmann", "1963"] == "beckmann1963"
    assert as_markup(["Weideman's (1994), ISO 2813:2014"], known) == [
        ":cite:t:`weideman1994`, ISO 2813:2014 :cite:`iso2813`"
    ]
    assert as_markup(["1. The surface", "a or b : two"], known) == ["1\\. The surface", "", "- **a or b**: two"]
    lines = ["|S|² (Yan 2018; Nobody 1900).", "a : one;  b : two", "    goes on", "Then prose."]
    assert as_markup(lines, known) == [
        "\\|S\\|² (:cite:t:`yan2018`; Nobody 1900).",
        *("", "- **a**: one", "- **b**: two", "  goes on"),
        *("", "Then prose."),
    ]


def test_symbols_get_their_indices() -> None:
    sys.path.insert(0, str(DOCS))
    try:
        from docstrings import symbols
    finally:
        sys.path.remove(str(DOCS))
    assert symbols("q_z = k (cos θ_i)") == ["q", "z", " = k (cos θ", "i", ")"]
    for name in ("s_um", "theta_i", "k_nm", "x_axis", "file_a.csv"):
        assert symbols(name) == [name]
    assert symbols("5 % of 3 samples") == ["5\u00a0% of 3 samples"]
    assert symbols("R_s² below 5.6e-17") == ["R", "s", "² below 5.6·10⁻¹⁷"]


def test_no_line_is_lost_as_a_comment() -> None:
    """MyST takes a line that begins with a per cent sign for a comment, and the page lacks what it says."""
    lost = [
        f"{p.name}: {line}" for p in PAGES for line in p.read_text(encoding="utf-8").splitlines() if line[:1] == "%"
    ]
    for script in (ROOT / "examples").glob("*.py"):
        lines = script.read_text(encoding="utf-8").splitlines()
        lost += [f"{script.name}: {line}" for line in lines if re.match(r"# %(?!%)", line)]
    assert lost == []


# what stands before a year and is no author
NO_AUTHORS = {"CIE", "RGB", "Arizona", "TOG", "SIGGRAPH", "EGSR", "ISO", "RAL"}


@pytest.fixture
def citations():
    """The module that finds citations, and the bibliography's entries."""
    sys.path.insert(0, str(DOCS))
    try:
        import docstrings
    finally:
        sys.path.remove(str(DOCS))
    return docstrings, docstrings.sources(ROOT / "BIBLIOGRAPHY.bib")


def test_every_source_is_cited(citations) -> None:
    """Each entry of BIBLIOGRAPHY.bib, by author and year or by its short title, in the code, its tests or a page."""
    docstrings, known = citations
    files = [*(ROOT / "docs").rglob("*.md"), ROOT / "CONVENTIONS.md"]
    files += [f for folder in ("vgonio", "tests", "benchmarks", "examples") for f in (ROOT / folder).rglob("*.py")]
    files += (ROOT / "vgonio").rglob("*.cl")
    text = "\n".join(f.read_text(encoding="utf-8") for f in files)
    entries = set(re.findall(r"^@\w+\{(\w+),", (ROOT / "BIBLIOGRAPHY.bib").read_text(encoding="utf-8"), re.M))
    assert len(entries) > 80
    assert entries - docstrings.keys_in(text, known) == set()


def test_every_citation_has_its_source(citations) -> None:
    """Authors with a year in a docstring have an entry in BIBLIOGRAPHY.bib, so that the page links to it."""
    docstrings, known = citations
    missing, found = set(), 0
    for file in (ROOT / "vgonio").rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef | ast.ClassDef | ast.Module):
                text = re.sub(r"\s+", " ", ast.get_docstring(node) or "")
                for match in docstrings.CITED.finditer(text):
                    found += 1
                    if (match[1], match[4]) not in known and match[1] not in NO_AUTHORS:
                        missing.add(f"{match[0]} in {file.relative_to(ROOT)}")
    assert missing == set()
    assert found > 60


@pytest.fixture(scope="session")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The pages, built as `make docs` does: a warning is an error."""
    for module in ("sphinx", "myst_nb", "furo", "sphinxcontrib.bibtex"):
        pytest.importorskip(module, reason=f"no {module}: pip install 'vgonio[docs]'")
    folder = tmp_path_factory.mktemp("docs")
    options = ["-W", "--keep-going", "-n", "-q", "-d", str(folder / "trees")]
    done = subprocess.run(
        [sys.executable, "-m", "sphinx", *options, str(DOCS), str(folder / "html")],
        capture_output=True,
        text=True,
        timeout=1200,
    )
    assert done.returncode == 0, done.stderr
    return folder / "html"


def test_pages_build_without_a_warning(built: Path) -> None:
    api = (built / "api" / "surface.html").read_text(encoding="utf-8")
    assert [name for name in SURFACE_NAMES if f'id="vgonio.surface.{name}"' not in api] == []
    # names that their module loads only when asked are there as well
    assert 'id="vgonio.measure.calibrate"' in (built / "api" / "measure.html").read_text(encoding="utf-8")


def test_constants_say_what_they_are(built: Path, citations) -> None:
    """A public constant has lines "#: …" where it is defined, and they are on its module's page."""
    docstrings, _ = citations
    written, found = docstrings.constants(ROOT / "vgonio"), 0
    for module in public_modules():
        page = (built / "api" / f"{module.__name__.split('.')[1]}.html").read_text(encoding="utf-8")
        for name in getattr(module, "__all__", ()):
            if not callable(thing := getattr(module, name)) and not inspect.ismodule(thing):
                assert [m for m in written.get(name, ()) if m.startswith(module.__name__)], f"{module.__name__}.{name}"
                assert f'id="{module.__name__}.{name}"' in page
                found += 1
    assert found >= 5


# ---- docstrings of all public names
def public_modules() -> list[ModuleType]:
    pages = sorted((DOCS / "api").glob("*.md"))
    names = [n for p in pages for n in re.findall(r"automodule:: ([\w.]+)", p.read_text(encoding="utf-8"))]
    return [importlib.import_module(name) for name in names if name != "vgonio"]


def public_functions() -> list:
    """Functions, classes and their public methods and properties of every module in docs/api."""
    found = {}
    for module in public_modules():
        own = [n for n, o in vars(module).items() if n[0] != "_" and getattr(o, "__module__", "") == module.__name__]
        for name in getattr(module, "__all__", own):
            thing = getattr(module, name)
            if not callable(thing):
                continue
            found[f"{module.__name__}.{name}"] = thing
            for part, method in vars(thing).items() if inspect.isclass(thing) else ():
                method = method.__func__ if isinstance(method, classmethod | staticmethod) else method
                method = method.fget if isinstance(method, property) else getattr(method, "func", method)
                if part[0] != "_" and inspect.isfunction(method):
                    found[f"{module.__name__}.{name}.{part}"] = method
    return [pytest.param(thing, id=name) for name, thing in found.items()]


SHAPE_OR_UNIT = re.compile(r"\((…|\w+),( ?(…|\w+))*\)|radian|degree|\bnm\b|µm")


@pytest.mark.parametrize("thing", public_functions())
def test_docstrings_say_errors_shapes_and_units(thing) -> None:
    """There is one; it speaks of errors where the function raises them itself, and of each argument that is an array:
    its name, unless the name has the unit, or a shape or a unit."""
    text = thing.__doc__ or ""
    assert text
    if inspect.isclass(thing):
        assert not text.startswith(f"{thing.__name__}("), "that is the signature, written by dataclasses"
        return
    tree = ast.parse(textwrap.dedent(inspect.getsource(thing)))
    raised = [n.exc for n in ast.walk(tree) if isinstance(n, ast.Raise) and n.exc is not None]
    errors = {n for e in raised if (n := getattr(getattr(e, "func", e), "id", "")).endswith("Error")}
    assert not errors or re.search("|".join([*errors, "[Rr]aises", "[Rr]efus"]), text), f"says nothing of {errors}"
    for parameter in inspect.signature(thing).parameters.values():
        if re.search("ArrayLike|Floats|NDArray", str(parameter.annotation)):
            named = re.search(rf"\b{parameter.name}\b", text) or re.search("_(um|deg|nm)$", parameter.name)
            assert named or SHAPE_OR_UNIT.search(text), f"says nothing of {parameter}"


def test_the_table_of_proofs_is_whole(built: Path) -> None:
    rows = (DOCS / "validated.csv").read_text(encoding="utf-8").splitlines()[1:]
    page = (built / "validated.html").read_text(encoding="utf-8")
    assert page.count("<tr") - page.count("<thead") == len(rows) > 70
