"""Forest plots: intervals in rows, in one column or several.

A mark says what was found: a blue disc is better, an orange square worse, a full grey diamond comparable, a hollow one
open. Where a table of verdicts goes with a plot, the marks are by these, never by a second judgement.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from homing_lib.features import Array
from homing_lib.publish.drawing import BLUE, DASHED, GREY, INK, ORANGE, TEXT_WIDTH, plain_log, styled
from homing_lib.study.claims import Comparison, compare
from homing_lib.study.measures import WINDOW
from homing_lib.study.statistics import Interval, interval, iqm, side

PLAIN: dict[str, Any] = {"marker": "o", "color": INK, "linestyle": "", "markersize": 4.5}
MARKS = {
    "better": PLAIN | {"color": BLUE},
    "worse": PLAIN | {"marker": "s", "color": ORANGE},
    "comparable": PLAIN | {"marker": "D", "color": GREY},
    "open": PLAIN | {"marker": "D", "color": GREY, "markerfacecolor": "white"},
}
"""By verdict: told apart in grey, too."""

RING = PLAIN | {"markerfacecolor": "white", "markersize": 4}


class Column(NamedTuple):
    """A column of a forest plot: intervals by row, what they are, and what they are held against.

    also: a second estimate of each row, drawn as a bar across. text: how numbers are written beside a single column.
    more: more is better. words: the verdict on each row, where it is another than the side of the reference on which
    the interval lies.
    """

    label: str
    intervals: Mapping[str, Interval]
    reference: float | None = None
    log: bool = False
    also: Mapping[str, float] = {}
    text: str = ".0f"
    more: bool = False
    words: Mapping[str, str] = {}

    def word(self, row: str) -> str:
        """The verdict on a row; empty if it is held against nothing."""
        if self.words or self.reference is None:
            return self.words.get(row, "")
        where = side(self.intervals[row], self.reference)
        return "open" if where == "open" else "better" if (where == "above") == self.more else "worse"


def compared(label: str, rows: Mapping[str, Comparison], *, key: bool = True) -> Column:
    """A column of comparisons, marked by their own words. key: its label says what marks and bars are."""
    label = f"{label}\n(marks: IQM, bars: mean)" if key else label
    intervals = {row: found.typical for row, found in rows.items()}
    also = {row: found.mean.value for row, found in rows.items()}
    words = {row: found.word for row, found in rows.items()}
    return Column(label, intervals, 1.0, log=True, also=also, text=".2f", words=words)


@styled
def forest(*columns: Column, ylabel: str = "", height: float = 0.19, shared: bool = False, title: str = "") -> Figure:
    """Rows of intervals, in one column or several; shared: columns on the same scale; title: over all of them."""
    rows = list(columns[0].intervals)
    size = TEXT_WIDTH, 0.9 + 0.2 * bool(title) + height * len(rows)
    figure, (grid,) = plt.subplots(1, len(columns), sharex=shared, sharey=True, squeeze=False, figsize=size)
    for axes, column in zip(grid, columns, strict=True):
        draw_column(axes, column, rows, narrow=len(columns) > 1)
    grid[0].set_yticks(range(len(rows)), [_greek(row) for row in rows])
    grid[0].set_ylabel(ylabel)
    met = {column.word(row) for column in columns for row in column.intervals}
    shown = [Line2D([], [], **mark, label=word) for word, mark in MARKS.items() if word in met]
    if shown and len(columns) > 1:
        options: dict[str, Any] = {"loc": f"outside {'lower' if title else 'upper'} right"}
        figure.legend(handles=shown, ncols=len(shown), frameon=False, fontsize=7, **options)
    if title:
        figure.suptitle(title, x=0.01, ha="left")
    return figure


@styled
def first_to_last(
    panels: Mapping[str, Mapping[str, tuple[Array, Array]]], level: tuple[str, float] | None = None, family: int = 0
) -> Figure:
    """Steps of the first episodes (a ring) and of the last (a mark: are they fewer?), rows in panels side by side.

    panels: by title and row, the steps of the first and of the last WINDOW episodes, one number per run each; drawn is
    the IQM. The verdict is `compare`'s for a family of as many comparisons, by default as there are rows. level: a
    line, and what it is.
    """
    most, family = max(map(len, panels.values())), family or sum(map(len, panels.values()))
    alike = len({tuple(rows) for rows in panels.values()}) == 1
    size = TEXT_WIDTH, 0.95 + 0.21 * most
    figure, (grid,) = plt.subplots(1, len(panels), sharex=True, sharey=alike, squeeze=False, figsize=size)
    for axes, (title, rows) in zip(grid, panels.items(), strict=True):
        words = {row: compare(last, first, family).word for row, (first, last) in rows.items()}
        for place, (row, pair) in enumerate(rows.items()):
            for above, steps, mark in zip((-0.16, 0.16), pair, (RING, MARKS[words[row]]), strict=True):
                found = interval(steps, np.random.default_rng(0), iqm)
                axes.hlines(place + above, found.low, found.high, color=mark["color"], linewidth=1.2)
                axes.plot(found.value, place + above, **mark)
        if level:
            axes.axvline(level[1], **DASHED, zorder=0)
        falls = sum(word == "better" for word in words.values())
        axes.set_title(f"{title}{': ' if title else ''}{falls} of {len(rows)} take fewer")
        axes.set(xscale="log", ylim=(len(rows) - 0.4, -0.6))
        axes.set_yticks(range(len(rows)), [_greek(row) for row in rows])
        axes.tick_params(axis="y", length=0)
        axes.grid(axis="y", color=GREY, alpha=0.25, linewidth=0.5)
    for axes in grid:
        plain_log(axes, "x", narrow=len(panels) > 1)
    dashed = f"; dashed: {level[0]}" if level else ""
    figure.supxlabel(f"steps per episode (ring: first {WINDOW}; mark: last {WINDOW}{dashed})", fontsize=7.5)
    return figure


def draw_column(axes: Axes, column: Column, rows: Sequence[str], *, narrow: bool) -> None:
    """Draw a column; rows: their order; narrow: no numbers beside it."""
    for place, row in enumerate(rows):
        if row not in column.intervals:
            continue
        found, mark = column.intervals[row], MARKS.get(column.word(row), PLAIN)
        axes.hlines(place, found.low, found.high, color=mark["color"], linewidth=1.6)
        axes.plot(found.value, place, **mark)
        if row in column.also:
            axes.plot(column.also[row], place, "|", color=INK, markersize=8, markeredgewidth=1.2)
        if not narrow:
            text = f"{found:{column.text}} {column.words.get(row, '')}"
            axes.text(1.02, place, text, transform=axes.get_yaxis_transform(), va="center", fontsize=7)
    if column.reference is not None:
        axes.axvline(column.reference, **DASHED, zorder=0)
    counts = Counter(column.words.values())
    grid = axes.get_gridspec()
    between = "\n" if grid and grid.ncols > 3 else ", "
    axes.set_title(between.join(f"{counts[word]} {word}" for word in MARKS if counts[word]))
    axes.set(xlabel=column.label, ylim=(len(rows) - 0.4, -0.6))
    if column.log:
        axes.set_xscale("log")
        plain_log(axes, "x", narrow=narrow)
    else:
        axes.xaxis.set_major_locator(MaxNLocator(6, steps=[1, 2, 5, 10]))
    axes.grid(axis="y", color=GREY, alpha=0.25, linewidth=0.5)
    axes.tick_params(axis="y", length=0)


def _greek(label: str) -> str:
    """Symbols as the paper sets them."""
    for name, symbol in _SYMBOLS.items():
        label = label.replace(name, symbol)
    return label


_SYMBOLS = {
    "alpha_0": "α₀",
    "alpha": "α",
    "epsilon_0": "ε₀",
    "theta_0": "θ₀",
    "sigma^2": "σ²",
    "tau ": "τ ",
    "lambda": "λ",
}
