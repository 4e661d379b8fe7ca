"""Our docstrings as reStructuredText: prose with lines "name : text" becomes lists, authors with years become links.

A docstring is written for whoever reads it in a terminal; nothing in it is markup but `code` and `>>>`.
"""

from __future__ import annotations

import re
from pathlib import Path

FIELD = re.compile(r"^( *)((?:`?\w+`?)(?:, `?\w+`?)*(?: \([^()]*\))?) : (.*)$")
NEXT_FIELD = re.compile(r";  (?=\w+ : )")
CHOICE = re.compile(r'^( +)("[\w -]+") +(.*)$')
CITED = re.compile(
    r"\b([A-ZÀ-Þ][\w’-]+)((?: et al\.?| and [A-ZÀ-Þ][\w’-]+|, [A-ZÀ-Þ][\w’-]+ and [A-ZÀ-Þ][\w’-]+)? )(\d{4})\b"
)


def sources(bibliography: Path) -> dict[tuple[str, str], str]:
    """(surname, year) → key, for every author of every entry of a BibTeX file with one entry a line."""
    found: dict[tuple[str, str], str] = {}
    for key, entry in re.findall(r"^@\w+\{(\w+),(.*)$", bibliography.read_text(encoding="utf-8"), re.M):
        names = re.search(r"author=\{((?:[^{}]|\{[^{}]*\})*)\}", entry)
        year = re.search(r"year=\{(\d{4})\}", entry)
        for name in names[1].split(" and ") if names and year else []:
            found.setdefault((name.partition(",")[0].strip("{} "), year[1]), key)
    return found


def cited(line: str, known: dict[tuple[str, str], str]) -> str:
    """The line with every "Author and Author year" that the bibliography has as a link to its entry."""

    def link(match: re.Match[str]) -> str:
        key = known.get((match[1], match[3]))
        return f":cite:t:`{key}`" if key else match[0]

    return CITED.sub(link, line)


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
    return as_lists(
        [line if line.lstrip().startswith(">>>") else cited(line.replace("|", "\\|"), known) for line in lines]
    )
