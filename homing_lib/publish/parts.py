"""What several figures are made of: panels, rows, marks, curves, keys, words, and axes."""

from collections.abc import Iterable, Mapping
from itertools import cycle
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, NullFormatter, NullLocator

from homing_lib.publish.style import DASHED, LINES, TEXT_WIDTH, Look
from homing_lib.study.bootstrap import Interval
from homing_lib.study.findings import Comparison


def panels(height: float, columns: int = 1, rows: int = 1, *, share: float = 1, **options: Any) -> tuple[Figure, Any]:
    """A figure so many inches high and as wide as that share of the text; its axes row by row, in one array."""
    size = share * TEXT_WIDTH, height
    figure, grid = plt.subplots(rows, columns, squeeze=False, figsize=size, **options)
    return figure, grid.ravel()


def name_rows(axes: Axes, names: Iterable[str]) -> None:
    """A row for each name at 0, 1, ..., from the top down."""
    names = list(names)
    axes.set_yticks(range(len(names)), names)
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.tick_params(axis="y", length=0)


def mark(
    axes: Axes,
    interval: Interval | Comparison,
    at: float,
    look: Look,
    size: float = 4.5,
    width: float = 1.3,
    **options: Any,
) -> None:
    """An interval in the row at this height: a line of this width, and its estimate."""
    axes.hlines(at, interval.low, interval.high, color=look.colour, linewidth=width)
    axes.plot(interval.value, at, **look.line(9 if look.marker == "|" else size) | options)


def curve(axes: Axes, x: Any, middle_and_ends: Any, line: tuple[str, Any], alpha: float = 0.2) -> None:
    """A curve in this colour and these dashes, its interval shaded. middle_and_ends: shape (3, len(x))."""
    (middle, low, high), (colour, dashes) = middle_and_ends, line
    axes.fill_between(x, low, high, color=colour, alpha=alpha, linewidth=0)
    axes.plot(x, middle, color=colour, linestyle=dashes)


def handle(name: str, look: Look, size: float = 6, dashes: Any = "") -> Line2D:
    """A line of a key."""
    return Line2D([], [], label=name, **look.line(size, dashes))


def key(figure: Figure, handles: list[Line2D], columns: int, **options: Any) -> None:
    """What marks mean, above all panels."""
    figure.legend(handles=handles, loc="outside upper left", ncols=columns, **options)


def picture(axes: Axes, image: Any, title: str) -> None:
    """An image without axes. image: shape (height, width, 3 or 4)."""
    axes.imshow(image[:, :, :3])
    axes.set(title=title, xticks=[], yticks=[])
    axes.spines[:].set_visible(False)


def level(axes: Axes, value: float, name: str, at: float = 0.01, up: float = 4, **options: Any) -> None:
    """A horizontal line that has a name; at: where the name begins, as a share of the width; up: points above it."""
    axes.axhline(value, **DASHED)
    beside(axes, name, (at, value), (0, up), xycoords=("axes fraction", "data"), **options)


def beside(axes: Axes, text: str, at: tuple[float, float], points: tuple[float, float], **options: Any) -> None:
    """Text that stands so many points right of a place and above it."""
    axes.annotate(text, at, points, textcoords="offset points", **options)


def note(axes: Axes, text: str, at: tuple[float, float], **options: Any) -> None:
    """Text on a light ground, so that it can be read over a picture."""
    ground = {"boxstyle": "round,pad=0.18", "facecolor": "white", "alpha": 0.75, "linewidth": 0}
    axes.text(*at, text, fontsize=8, bbox=ground, zorder=5, **options)


def label_ends(axes: Axes, ends: Mapping[str, tuple[float, float]], colours: Iterable[str] = ()) -> None:
    """Names of curves, in these colours, or coloured as LINES, right of their ends; moved apart where they would
    overlap, and then tied.
    """
    axes.figure.canvas.draw()
    scale = axes.figure.dpi / 72
    least = 1e-12 if axes.get_yscale() == "log" else -np.inf
    heights = {name: axes.transData.transform((1, max(y, least)))[1] / scale for name, (_, y) in ends.items()}
    tints = dict(zip(ends, cycle(colours or (colour for colour, _ in LINES)), strict=False))
    tie: dict[str, Any] = {"arrowstyle": "-", "linewidth": 0.5, "shrinkA": 0, "shrinkB": 1, "relpos": (0, 0.5)}
    place = -np.inf
    for name in sorted(ends, key=lambda name: heights[name]):
        place = max(heights[name], place + 9.5)
        moved, tint = place - heights[name], tints[name]
        tied, right = (tie | {"color": tint}, 11) if moved > 3 else (None, 5)
        beside(axes, name, ends[name], (right, moved), va="center", color=tint, annotation_clip=False, arrowprops=tied)


def log_axis(axes: Axes, which: str, *, narrow: bool = False) -> None:
    """Make the axis "x" or "y" logarithmic, with 10, 20, 50, 100 written out, and more where it spans little.

    narrow: on a small panel, where fewer numbers fit.
    """
    axes.set(**{f"{which}scale": "log"})
    axis = axes.yaxis if which == "y" else axes.xaxis
    low, high = axis.get_view_interval()
    wide = bool(high > (20 if narrow else 8) * low)
    fine = (1, 1.2, 1.5, 2, 2.5, 3, 4, 5, 6, 8)
    if high < 2.5 * low:
        steps = fine if high > (1.5 if narrow else 1.7) * low else (1, 1.1, 1.2, 1.3, *range(5, 10))
    else:
        steps = ((1, 2, 5), (1, 3))[wide] if narrow else (fine, (1, 2, 5))[wide]
    axis.set_major_locator(LogLocator(subs=steps))
    axis.set_minor_locator(LogLocator(subs=tuple(range(1, 10))) if wide or narrow else NullLocator())
    axis.set_major_formatter("{x:g}")
    axis.set_minor_formatter(NullFormatter())
