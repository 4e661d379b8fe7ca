"""How figures look and how they get into a page: one style, Unicode labels, SVG whose text stays text.

Labels write θᵢ and θₒ with Unicode subscripts, so a notebook draws them without mathtext; in a page they become
proper subscripts in the page's own font.
"""

from __future__ import annotations

import functools
import io
import re
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

INK, MUTED, GRID = "#1a2230", "#5c6675", "#e3e7ec"
# Okabe and Ito (2008), told apart by colour-blind readers as well
RESULT_COLOURS = {"rays": "#d55e00", "waves": "#0072b2", "measured": "#1a2230"}
FURTHER_COLOURS = ("#009e73", "#cc79a7", "#e69f00", "#56b4e9")
SINGLE_COLOUR, MULTIPLE_COLOURS = "#0b4a8f", ("#5aa2d9", "#a5cdec", "#d3e6f5")  # dark and light as thesis 4.10
ABSORBED_COLOUR, LOST_COLOUR, MARK_COLOUR = "#c9c4b8", "#d55e00", "#b9c0ca"

STYLE: dict[Any, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 9.0,
    "axes.titlesize": 9.0,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": 9.0,
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "legend.fontsize": 8.5,
    "legend.frameon": False,
    "text.color": INK,
    "axes.labelcolor": INK,
    "axes.edgecolor": MUTED,
    "xtick.color": MUTED,
    "ytick.color": MUTED,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "axes.linewidth": 0.7,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": GRID,
    "grid.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "lines.linewidth": 1.5,
    "hatch.linewidth": 0.5,
    "figure.facecolor": "white",
    "svg.fonttype": "none",
    "svg.hashsalt": "vgonio",  # the same result gives the same page
    "image.interpolation": "none",
}
SVG_PER_INCH = 104  # CSS pixels on the page: 9 pt text appears at 13 px
NOTEBOOK_DPI = 88  # a figure of full width, 10 inches, is 880 pixels wide in a notebook
F = TypeVar("F", bound=Callable[..., Any])


def styled(draw: F) -> F:
    """Run a function that makes a figure under the style of the report; nothing global is left changed."""

    @functools.wraps(draw)
    def wrapped(*args: Any, **kwargs: Any) -> Any:
        import matplotlib as mpl

        with mpl.rc_context(STYLE):
            return draw(*args, **kwargs)

    return wrapped  # type: ignore[return-value]


def new_figure(width: float, height: float) -> Figure:
    """An empty figure of that size in inches, without pyplot and its global state; notebooks show it all the same."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    # what IPython asks an object for; it draws a Figure by itself only once pyplot is loaded
    setattr(figure, "_repr_png_", functools.partial(png, figure))  # noqa: B010 (no attribute of Figure)
    return figure


@styled
def png(figure: Figure, dpi: float = NOTEBOOK_DPI) -> bytes:
    """The figure as a PNG file; the same figure gives the same bytes."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=dpi, metadata={"Software": None})
    return buffer.getvalue()


def panels(count: int, *, width: float = 10.0, height: float = 2.05, most: int = 3) -> tuple[Figure, list[Axes]]:
    """A grid of `count` panels that share both axes, at most `most` in a row; the empty places are taken away."""
    columns = min(most, count)
    rows = -(-count // columns)
    figure = new_figure(width if columns > 1 else 5.4, rows * height + 0.75)
    grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    axes = list(grid.ravel())
    for empty in axes[count:]:
        empty.set_axis_off()
    for above in axes[max(0, count - columns) : count]:
        above.tick_params(labelbottom=True)
    return figure, axes[:count]


def colours(names: Sequence[str]) -> dict[str, str]:
    """A colour for each result, no two alike while there are enough."""
    further = iter(FURTHER_COLOURS * (1 + len(names)))
    return {name: RESULT_COLOURS.get(name) or next(further) for name in names}


def dashes(names: Sequence[str]) -> dict[str, Any]:
    """A line for each result: further waves are dashed, so that those that lie exactly beneath still show."""
    further = [name for name in names if name.startswith("waves_")]
    return {name: (0, (4, 3 + 2 * further.index(name))) if name in further else "-" for name in names}


def bounce_colours(count: int) -> list[str]:
    """A dark blue for single reflections, ever lighter ones for 2, 3, … reflections."""
    from matplotlib.colors import LinearSegmentedColormap, to_hex

    if count <= 4:
        return [SINGLE_COLOUR, *MULTIPLE_COLOURS][:count]
    shades = LinearSegmentedColormap.from_list("bounces", MULTIPLE_COLOURS)
    return [SINGLE_COLOUR, *(to_hex(shades(x)) for x in np.linspace(0, 1, count - 1))]


def angle(value: float) -> str:
    """−40° with a real minus sign."""
    return f"{value:g}°".replace("-", "−")


def some(values: np.ndarray, most: int) -> np.ndarray:
    """At most `most` of the values, evenly chosen, first and last among them."""
    return (
        values if len(values) <= most else values[np.unique(np.linspace(0, len(values) - 1, most).round().astype(int))]
    )


def edges(centres: Sequence[float] | np.ndarray, lowest: float = -90.0, highest: float = 90.0) -> np.ndarray:
    """(n + 1,) borders half-way between (n,) ascending centres; a single centre gets a cell 10 wide."""
    c = np.asarray(centres, float)
    if c.size == 1:
        return np.array([c[0] - 5.0, c[0] + 5.0])
    middle = (c[1:] + c[:-1]) / 2
    return np.clip(np.concatenate([[2 * c[0] - middle[0]], middle, [2 * c[-1] - middle[-1]]]), lowest, highest)


SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def power_of_ten(value: float, _: int = 0) -> str:
    return "10" + str(round(np.log10(value))).translate(SUPERSCRIPT) if value > 0 else ""


def powers_of_ten(axis: Any) -> None:
    """Label the decades of a logarithmic axis as 10⁻³ in plain Unicode."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axis.set_major_locator(LogLocator(numticks=6))
    axis.set_major_formatter(FuncFormatter(power_of_ten))
    axis.set_minor_formatter(NullFormatter())


def logarithmic(ax: Axes, which: str, low: float, high: float) -> None:
    """Make the x or y axis logarithmic over low … high; fewer than two decades are labelled at 1, 2 and 5 as well."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    getattr(ax, f"set_{which}scale")("log")
    getattr(ax, f"set_{which}lim")(low, high)
    axis = getattr(ax, f"{which}axis")
    powers_of_ten(axis)
    if high < 100 * low:
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_formatter(NullFormatter())


def angle_axis(axes: Sequence[Axes], low: float = -90, high: float = 90) -> None:
    """Signed angle of reflection along x, ticks every 30°."""
    for ax in axes:
        ax.set_xlim(low, high)
        ax.set_xticks(np.arange(-60, 61, 30))


MIRROR: dict[str, Any] = {"color": MUTED, "lw": 0.8, "ls": (0, (4, 3))}
BACK: dict[str, Any] = {"color": MUTED, "lw": 0.8, "ls": (0, (1, 2))}
MIRROR_WORDS, BACK_WORDS = "mirror direction", "back-scattering"


def directions_marked(ax: Axes, theta_i: float) -> None:
    """Thin lines at the mirror direction (dashed) and at back-scattering (dotted)."""
    ax.axvline(-theta_i, **MIRROR, zorder=1.5)
    if theta_i:
        ax.axvline(theta_i, **BACK, zorder=1.5)


def directions_named() -> list[Line2D]:
    """What those lines are, for a legend."""
    from matplotlib.lines import Line2D as Line

    return [Line([], [], **line, label=words) for line, words in ((MIRROR, MIRROR_WORDS), (BACK, BACK_WORDS))]


@styled
def svg(figure: Figure, description: str, prefix: str) -> str:
    """The figure as an inline <svg> element: no foreign references, ids that begin with `prefix`, the page's font."""
    buffer = io.StringIO()
    figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None, "Format": None, "Type": None})
    text = buffer.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.S)
    text = re.sub(r"<!--.*?-->", "", text, flags=re.S)
    text = re.sub(r'\sid="image[0-9a-f]+"', "", text)  # equal images have equal ids, and nothing refers to them
    width = float(figure.get_size_inches()[0]) * SVG_PER_INCH
    head = re.match(r"<svg[^>]*>", text)
    box = re.search(r'viewBox="[^"]*"', head.group(0)) if head else None
    opening = (
        f'<svg {box.group(0) if box else ""} role="img" aria-label="{_quoted(description)}" '
        f'style="width:{width:.0f}px" class="figure">'
    )
    text = text[head.end() if head else 0 :]
    text = re.sub(r'\bid="([^"]+)"', rf'id="{prefix}-\1"', text)
    text = re.sub(r'(xlink:href="|url\()#', rf"\1#{prefix}-", text).replace("xlink:href", "href")
    text = re.sub(r"font: (?:(\d+|bold|italic) )?([\d.]+)px [^;\"]*", _font, text)  # matplotlib before 3.10
    text = re.sub(r"font-family: [^;\"]*;?\s*", "", text)
    return opening + re.sub(r"\n\s*", "\n", _subscripts(text))


def _font(match: re.Match[str]) -> str:
    weight = match.group(1)
    return f"font-size: {match.group(2)}px" + (f"; font-weight: {weight}" if weight else "")


def _subscripts(text: str) -> str:
    for letter, subscript in (("ᵢ", "i"), ("ₒ", "o"), ("ₘ", "m")):
        text = text.replace(
            f"θ{letter}",
            f'<tspan font-style="italic">θ</tspan><tspan dy="0.25em" font-size="72%">{subscript}</tspan>'
            '<tspan dy="-0.18em">\u200b</tspan>',
        )
    return text


def _quoted(text: str) -> str:
    return text.replace("&", "&amp;").replace('"', "&quot;").replace("<", "&lt;")
