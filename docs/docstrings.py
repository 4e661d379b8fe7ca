"""Our docstrings as reStructuredText: prose with lines "name : text" becomes lists, authors with years become links.

A docstring is written for whoever reads it in a terminal; nothing in it is markup but `code` and `>>>`.
"""

from __future__ import annotations

import re
from pathlib import Path

FIELD = re.compile(r"^( *)((?:`?\w+`?)(?:(?:, | or )`?\w+`?)*(?: \([^()]*\))?) : (.*)$")
NEXT_FIELD = re.compile(r";  (?=\w+ : )")
CHOICE = re.compile(r'^( +)("[\w -]+") +(.*)$')
CONSTANT = re.compile(r"((?:^#: .*\n)+)^([A-Z]\w*(?:, [A-Z]\w*)*)(?:: .*)? = ", re.M)
NAME = r"[A-ZÀ-Þ](?:[\w’-]|'(?!s\b))+"
CITED = re.compile(rf"\b({NAME})(?:'s)?((?: et al\.?| and {NAME}|, {NAME} and {NAME})?\s)(\()?(\d{{4}})\b(?(3)\))")


# one letter, Latin or Greek, with an index of up to three: θ_i, k_d, f_ref; no names such as s_um, no file names
SYMBOL = re.compile(r"(?<![\w`.])(d?[A-Za-zα-ωΑ-Ω])_(?!um\b|nm\b|deg\b)([a-zA-Z0-9]{1,3})(?![A-Za-z0-9_]|\.[A-Za-z])")


# 5.6e-7 as it is written by hand, and on one line with its unit
POWER = re.compile(r"(?<=\d)e-(\d+)(?!\w)")
RAISED = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")
UNIT = re.compile(r"(?<=\d) (?=(?:%|°|(?:nm|µm|mm|GB|MB|ms|s)\b))")


def symbols(text: str) -> list[str]:
    """The text cut at the indices of its symbols: "cos θ_i/2" → ["cos θ", "i", "/2"]; every second part is an index.
    Between a number and its unit the space becomes one that does not break, and 5e-7 becomes 5·10⁻⁷."""
    text = POWER.sub(lambda m: f"·10⁻{m[1].lstrip('0').translate(RAISED)}", UNIT.sub("\u00a0", text))
    parts, end = [], 0
    for found in SYMBOL.finditer(text):
        parts += [text[end : found.end(1)], found[2]]
        end = found.end()
    return [*parts, text[end:]]


def sources(bibliography: Path) -> dict[tuple[str, str], str]:
    """(surname, year) → key, for every author of every entry of a BibTeX file with one entry a line; and (its name, "")
    → key of what has a `shorttitle` to be called by, such as a standard."""
    found: dict[tuple[str, str], str] = {}
    for key, entry in re.findall(r"^@\w+\{(\w+),(.*)$", bibliography.read_text(encoding="utf-8"), re.M):
        names = re.search(r"author=\{((?:[^{}]|\{[^{}]*\})*)\}", entry)
        year = re.search(r"year=\{(\d{4})\}", entry)
        for name in names[1].split(" and ") if names and year else []:
            surname = name.partition(",")[0].strip("{} ")
            found.setdefault((surname, year[1]), key)
            found.setdefault((surname.split()[-1], year[1]), key)  # "af Klinteberg"
        if called := re.search(r"shorttitle=\{([^{}]*)\}", entry):
            found[called[1], ""] = key
    return found


def keys_in(text: str, known: dict[tuple[str, str], str]) -> set[str]:
    """Keys of the bibliography that a text cites: "Author and Author year", "Author (year)", or by a short title."""
    text = re.sub(r"\s+", " ", text)
    named = {key for (name, year), key in known.items() if not year and name in text}
    return named | {known[m[1], m[4]] for m in CITED.finditer(text) if (m[1], m[4]) in known}


def cited(line: str, known: dict[tuple[str, str], str]) -> str:
    """The line with every citation that the bibliography has (see `keys_in`) as a link to its entry."""

    def link(match: re.Match[str]) -> str:
        key = known.get((match[1], match[4]))
        return f":cite:t:`{key}`" if key else match[0]

    titles = "|".join(re.escape(name) for name, year in known if not year)
    named = rf"(?<![`\w])({titles})(?:[:-]\w+)*(?!\w)"  # with the part and the year of a standard
    return re.sub(named, lambda m: f"{m[0]} :cite:`{known[m[1], '']}`", CITED.sub(link, line))


def constants(package: Path) -> dict[str, dict[str, str]]:
    """Name → {module: what the lines "#: …" above it say}, of the constants at the top level of a package's modules."""
    found: dict[str, dict[str, str]] = {}
    for file in sorted(package.rglob("*.py")):
        module = ".".join(file.relative_to(package.parent).with_suffix("").parts).removesuffix(".__init__")
        for lines, names in CONSTANT.findall(file.read_text(encoding="utf-8")):
            text = "\n".join(line.removeprefix("#:").strip() for line in lines.splitlines())
            for name in names.split(", "):
                found.setdefault(name, {})[module] = text
    return found


def as_lists(lines: list[str]) -> list[str]:
    """The lines with "name : text" as items; what follows indented, or goes on in lower case, belongs to the item."""
    out: list[str] = []
    inside = ""  # the indentation of the text of the item that is being read
    for line in (part for whole in lines for part in _apart(whole)):
        field, choice = FIELD.match(line), CHOICE.match(line) if inside else None
        if field:
            out += [*([] if inside == field[1] + "  " else [""]), f"{field[1]}- **{field[2]}**: {field[3]}"]
            inside = field[1] + "  "
        elif choice and len(choice[1]) >= len(inside):
            out += ["", f"{inside}- ``{choice[2]}``: {choice[3]}", ""]
        elif inside and line.strip() and (line[0] == " " or not line[0].isupper()):
            deeper = out[-1] == "" and out[-2].startswith(f"{inside}- ``") or out[-1].startswith(f"{inside}  ")
            if deeper and out[-1] == "":
                out.pop()
            out.append(f"{inside}{'  ' if deeper else ''}{line.strip()}")
        else:
            out += ["", line] if inside and line.strip() else [line]
            inside = ""
    return out


def _apart(line: str) -> list[str]:
    """The items of one line, "a : text;  b : text", each on its own."""
    indent = line[: len(line) - len(line.lstrip())]
    first, *others = NEXT_FIELD.split(line)
    return [first, *(indent + other for other in others)] if FIELD.match(first) or others else [line]


def as_markup(lines: list[str], known: dict[tuple[str, str], str]) -> list[str]:
    """A docstring as Sphinx reads it; bars stand for absolute values there, not for substitutions."""
    return as_lists([line if line.lstrip().startswith(">>>") else cited(_escaped(line), known) for line in lines])


def _escaped(line: str) -> str:
    """Bars, and a number with a full stop at the beginning, which would begin a list."""
    return re.sub(r"^( *\d+)\.", r"\1\.", line.replace("|", "\\|"))
