"""Plots of the studies: many runs, and every number with its 95 % interval.

A mark says what was found: a blue disc is better, an orange square worse, a full grey diamond comparable, a hollow one
open. Where a table of verdicts goes with a plot, the marks are by these, never by a second judgement.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple, Protocol

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter, NullLocator

from homing_lib.features import Array
from homing_lib.publish.drawing import (
    BLUE,
    DASHED,
    GREEN,
    GREY,
    INK,
    ORANGE,
    SKY,
    TEXT_WIDTH,
    draw_floor_plan,
    level,
    styled,
)
from homing_lib.rooms import Room
from homing_lib.study.claims import Comparison
from homing_lib.study.statistics import Interval, band, side

LINES = (
    (BLUE, "-"),
    (ORANGE, (0, (4, 1.5))),
    (GREEN, (0, (1, 1))),
    (INK, (0, (6, 1.5, 1, 1.5))),
    ("#CC79A7", (0, (2, 1))),
    (GREY, (0, (8, 2))),
    (SKY, "-"),
)
"""Colours and dashes of several curves in one panel, in order."""

MARKS = {
    "better": ("o", BLUE, BLUE),
    "worse": ("s", ORANGE, ORANGE),
    "comparable": ("D", GREY, GREY),
    "open": ("D", GREY, "white"),
}
"""Shape, edge and face by verdict: told apart in grey, too."""


# --- A class's first encounter with lambda ---------------------------------------------------------------------------


@styled
def trace_depth(traces: Mapping[str, Array]) -> Figure:
    """How much of each past step is left in the trace. traces: by rule, shape (steps, past steps), NaN for later."""
    figure = plt.figure(figsize=(TEXT_WIDTH, 2.35))
    panels = np.atleast_1d(figure.subplots(1, len(traces), sharey=True))
    for axes, (name, trace) in zip(panels, traces.items(), strict=True):
        steps = len(trace)
        edges = np.arange(steps + 1) + 0.5
        shown = axes.pcolormesh(edges, edges, trace.T, vmin=0, vmax=1, cmap="Greys", rasterized=True)
        axes.set(title=name, xlabel="step $t$", aspect="equal")
    panels[0].set_ylabel("past step $k$")
    figure.colorbar(shown, ax=list(panels), label="share of $\\phi_k$ in $e_t$", shrink=0.8)
    return figure


@styled
def parting(errors: Mapping[str, tuple[Array, Array]], first_clips: Mapping[str, int]) -> Figure:
    """How far TD-conj stands from conjugate gradient at each step: by form, without and with the reset to [0, 1].

    first_clips: the first step at which each form was reset.
    """
    figure = plt.figure(figsize=(TEXT_WIDTH, 2.3))
    panels = np.atleast_1d(figure.subplots(1, len(errors), sharey=True))
    for axes, (name, (free, reset)) in zip(panels, errors.items(), strict=True):
        step, floor = np.arange(1, free.size + 1), 1e-18
        axes.plot(step, np.maximum(reset, floor), color=ORANGE, linestyle=(0, (4, 1.5)))
        axes.plot(step, np.maximum(free, floor), color=BLUE)
        axes.axvline(first_clips[name], color=GREY, linewidth=0.8)
        axes.annotate("first reset", (first_clips[name], 1e-8), (4, 0), textcoords="offset points", rotation=90)
        axes.set(title=name, xlabel="step $t$", yscale="log", ylim=(floor / 3, 1e3), xlim=(1, step[-1]))
        axes.set_xticks(step[:: max(1, step.size // 4)])
    panels[-1].annotate("reset to [0, 1]", (0.97, 0.83), xycoords="axes fraction", ha="right", va="top", color=ORANGE)
    panels[-1].annotate("as (7) gives it", (0.97, 0.2), xycoords="axes fraction", ha="right", color=BLUE)
    panels[0].set_ylabel("relative distance from $p_t$")
    return figure


# --- Curves -----------------------------------------------------------------------------------------------------------


@styled
def over_step_sizes(step_sizes: Array, errors: Mapping[str, Array], ylabel: str, top: float) -> Figure:
    """A measure of runs against the step size. errors: by rule, shape (runs, step sizes); above `top`, not drawn."""
    figure = plt.figure(figsize=(TEXT_WIDTH, 3.1))
    axes = figure.subplots()
    ends: dict[str, tuple[float, float]] = {}
    least = (np.inf, "", 0.0)
    for (name, table), (colour, dashes) in zip(errors.items(), LINES, strict=False):
        mean, low, high = band(np.minimum(table, 1e6), np.random.default_rng(0))
        drawn = mean <= top
        if not drawn.any():
            ends[f"{name}: beyond {top:g}"] = step_sizes[0], top
            continue
        axes.fill_between(step_sizes[drawn], low[drawn], np.minimum(high, top)[drawn], color=colour, alpha=0.2, lw=0)
        axes.plot(step_sizes[drawn], mean[drawn], color=colour, linestyle=dashes)
        best = int(np.argmin(mean))
        least = min(least, (float(mean[best]), name, float(step_sizes[best])))
        axes.plot(step_sizes[best], mean[best], "o", color=colour, markersize=4)
        last = int(np.flatnonzero(drawn)[-1])
        ends[name] = step_sizes[last], float(mean[last])
    axes.set(xlabel="step size $\\alpha$", ylabel=ylabel, xscale="log", ylim=(None, top))
    axes.set_title(f"Least with {least[1]}: {least[0]:.2f} at {least[2]:g} (dots: the best step size of each)")
    axes.set_xticks(step_sizes, [f"{size:g}" for size in step_sizes])
    axes.minorticks_off()
    _label_ends(axes, ends, [colour for colour, _ in LINES])
    return figure


@styled
def curves(
    panels: Mapping[str, Mapping[str, Array]],
    ylabel: str | Sequence[str],
    *,
    levels: Mapping[str, float] | None = None,
    log: bool = True,
    each: int = 1,
) -> Figure:
    """Mean and 95 % interval over the runs, by episode. panels: tables of shape (runs, episodes) by title and label.

    ylabel: of all panels, which then share their scale, or one each; levels: horizontal lines by name, drawn in every
    panel; each: how many episodes a column of the tables stands for.
    """
    figure = plt.figure(figsize=(TEXT_WIDTH, 2.7))
    shared = isinstance(ylabel, str)
    grid = np.atleast_1d(figure.subplots(1, len(panels), sharey=shared))
    alike = len({tuple(tables) for tables in panels.values()}) == 1
    for place, (axes, (title, tables)) in enumerate(zip(grid, panels.items(), strict=True)):
        ends = _learning(axes, tables, each)
        axes.set_title(title)
        if log:
            axes.set_yscale("log")
            _plain_log(axes, "y")
        for name, value in (levels or {}).items():
            level(axes, value, name)
        if place == len(grid) - 1 or not alike:  # once is enough where every panel shows the same
            _label_ends(axes, ends, [colour for colour, _ in LINES])
        if not shared or place == 0:
            axes.set_ylabel(ylabel if isinstance(ylabel, str) else ylabel[place])
    return figure


def _learning(axes: Axes, tables: Mapping[str, Array], each: int = 1) -> dict[str, tuple[float, float]]:
    """Draw mean and interval by episode; returns where each curve ends."""
    ends = {}
    for (name, table), (colour, dashes) in zip(tables.items(), LINES, strict=False):
        mean, low, high = band(table, np.random.default_rng(0))
        episode = each * np.arange(mean.size) + (each + 1) / 2
        axes.fill_between(episode, low, high, color=colour, alpha=0.2, linewidth=0)
        axes.plot(episode, mean, color=colour, linestyle=dashes)
        ends[name] = float(episode[-1]), float(mean[-1])
    axes.set(xlabel="episode", xlim=(1, max(1.5, *(x for x, _ in ends.values()))))
    axes.xaxis.set_major_locator(MaxNLocator(6, integer=True))
    return ends


class Compared(Protocol):
    """Rules over the same seeds: steps of shape (seeds, episodes), and what each is against the first, by label."""

    @property
    def steps(self) -> Mapping[str, Array]: ...
    @property
    def verdicts(self) -> Mapping[str, tuple[str, Interval]]: ...


@styled
def rules(compared: Compared) -> Figure:
    """How rules learn, with 95 % intervals, and the late steps of each as a multiple of the first's."""
    reference = next(iter(compared.steps))
    figure = plt.figure(figsize=(TEXT_WIDTH, 2.5))
    learning, against = figure.subplots(1, 2, width_ratios=[1.5, 1])
    ends = _learning(learning, compared.steps)
    seeds = len(compared.steps[reference])
    learning.set(title=f"mean of {seeds} seeds", ylabel="steps per episode", yscale="log")
    _plain_log(learning, "y")
    _label_ends(learning, ends, [colour for colour, _ in LINES])
    words = {label: word for label, (word, _) in compared.verdicts.items() if label != reference}
    found = {label: compared.verdicts[label][1] for label in words}
    _forest(against, Column(f"late steps / those of {reference}", found, 1.0, log=True, words=words), narrow=True)
    against.set_yticks(range(len(found)), list(found))
    return figure


# --- Intervals --------------------------------------------------------------------------------------------------------


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
    also: Mapping[str, float] | None = None
    text: str = ".0f"
    more: bool = False
    words: Mapping[str, str] | None = None

    def word(self, row: str) -> str | None:
        """The verdict on a row; None if it is held against nothing."""
        if self.words is not None:
            return self.words[row]
        if self.reference is None:
            return None
        where = side(self.intervals[row], self.reference)
        return "open" if where == "open" else "better" if (where == "above") == self.more else "worse"


def compared(label: str, rows: Mapping[str, Comparison]) -> Column:
    """A column of comparisons, marked by their own words."""
    return Column(
        f"{label}\n(marks: interquartile means; bars: means)",
        {row: found.typical for row, found in rows.items()},
        1.0,
        log=True,
        also={row: found.mean.value for row, found in rows.items()},
        text=".2f",
        words={row: found.word for row, found in rows.items()},
    )


@styled
def forest(*columns: Column, ylabel: str = "", height: float = 0.19, shared: bool = False) -> Figure:
    """Rows of intervals, in one column or several; shared: columns on the same scale."""
    rows = list(columns[0].intervals)
    figure = plt.figure(figsize=(TEXT_WIDTH, 0.9 + height * len(rows)))
    grid = np.atleast_1d(figure.subplots(1, len(columns), sharex=shared, sharey=True))
    for axes, column in zip(grid, columns, strict=True):
        _forest(axes, column, rows, narrow=len(columns) > 1)
    grid[0].set_yticks(range(len(rows)), [_greek(row) for row in rows])
    grid[0].set_ylabel(ylabel)
    met = {column.word(row) for column in columns for row in column.intervals}
    handles = [
        Line2D([], [], linestyle="", marker=shape, color=edge, markerfacecolor=face, markersize=4.5, label=word)
        for word, (shape, edge, face) in MARKS.items()
        if word in met
    ]
    if handles and len(columns) > 1:
        figure.legend(handles=handles, loc="outside upper right", ncols=len(handles), frameon=False, fontsize=7)
    return figure


def _forest(axes: Axes, column: Column, rows: Sequence[str] | None = None, *, narrow: bool = False) -> None:
    """Draw a column; rows: the order, by default that of its intervals; narrow: no numbers beside it."""
    rows = list(column.intervals) if rows is None else rows
    for place, row in enumerate(rows):
        if row not in column.intervals:
            continue
        found, word = column.intervals[row], column.word(row)
        shape, edge, face = MARKS[word] if word else ("o", INK, INK)
        axes.hlines(place, found.low, found.high, color=edge, linewidth=1.6)
        axes.plot(found.value, place, shape, color=edge, markerfacecolor=face, markersize=4.5)
        if column.also and row in column.also:
            axes.plot(column.also[row], place, "|", color=INK, markersize=8, markeredgewidth=1.2)
        if not narrow:
            text = f"{found:{column.text}} {column.words[row] if column.words else ''}"
            axes.text(1.02, place, text, transform=axes.get_yaxis_transform(), va="center", fontsize=7)
    if column.reference is not None:
        axes.axvline(column.reference, **DASHED, zorder=0)
    if column.words:
        counts = ((sum(found == word for found in column.words.values()), word) for word in MARKS)
        axes.set_title(", ".join(f"{count} {word}" for count, word in counts if count))
    axes.set(xlabel=column.label, ylim=(len(rows) - 0.4, -0.6))
    if column.log:
        axes.set_xscale("log")
        _plain_log(axes, "x", narrow=narrow)
    else:
        axes.xaxis.set_major_locator(MaxNLocator(6, steps=[1, 2, 5, 10]))
    axes.grid(axis="y", color=GREY, alpha=0.25, linewidth=0.5)
    axes.tick_params(axis="y", length=0)


@styled
def heat_map(
    rows: Sequence[str], columns: Sequence[str], values: Array, notes: Mapping[tuple[int, int], str]
) -> Figure:
    """Steps by rule and step size, written into the cells; notes: what stands behind, such as how many diverged."""
    figure = plt.figure(figsize=(TEXT_WIDTH, 0.7 + 0.3 * len(rows)))
    axes = figure.subplots()
    shown = axes.pcolormesh(values, norm=LogNorm(), cmap="cividis_r", edgecolor="white", linewidth=0.8)
    middle = np.sqrt(values.min() * values.max())
    best = values.argmin(axis=1)
    for (row, column), value in np.ndenumerate(values):
        text = f"{value:.0f}" + (f"  ({notes[row, column]})" if (row, column) in notes else "")
        axes.text(
            column + 0.5,
            row + 0.5,
            text,
            ha="center",
            va="center",
            fontsize=7,
            color="white" if value > middle else INK,
            weight="bold" if best[row] == column else "normal",
        )
    axes.set_yticks(np.arange(len(rows)) + 0.5, rows)
    axes.set_xticks(np.arange(len(columns)) + 0.5, columns)
    axes.set(xlabel="initial step size $\\alpha_0$", ylim=(len(rows), 0))
    axes.tick_params(length=0)
    axes.spines[:].set_visible(False)
    axes.set_title("bold: each at its best step size" + ("; in brackets: runs lost" if notes else ""))
    figure.colorbar(shown, label="steps per episode").ax.yaxis.set_major_formatter("{x:g}")
    return figure


# --- Calibration ------------------------------------------------------------------------------------------------------


@styled
def marginals(choices: Mapping[str, Mapping[str, Array]], chosen: Mapping[str, str], top: float) -> Figure:
    """Scores of the candidates by each of their choices, with the median; the value chosen stands out.

    choices: by setting and value, the scores of all candidates that have it; top: the worst score there is.
    """
    columns = 4
    rows = -(-len(choices) // columns)
    figure = plt.figure(figsize=(TEXT_WIDTH, 1.75 * rows))
    grid = figure.subplots(rows, columns, sharey=True).ravel()
    rng = np.random.default_rng(0)
    for axes, (name, by_value) in zip(grid, choices.items(), strict=False):
        for place, (value, scores) in enumerate(by_value.items()):
            colour = BLUE if value == chosen[name] else GREY
            axes.plot(
                place + rng.uniform(-0.22, 0.22, scores.size), scores, ".", color=colour, markersize=2.5, alpha=0.7
            )
            axes.hlines(np.median(scores), place - 0.38, place + 0.38, color=colour, linewidth=1.8)
        axes.set(title=name, yscale="log", ylim=(None, 1.15 * top), xlim=(-0.6, len(by_value) - 0.4))
        crowded = sum(map(len, by_value)) > 20
        axes.set_xticks(range(len(by_value)), list(by_value), fontsize=6 if crowded else 7, rotation=35 * crowded)
        _plain_log(axes, "y")
    for axes in grid[::columns]:
        axes.set_ylabel("steps per episode")
    for axes in grid[len(choices) :]:
        axes.set_visible(False)
    return figure


# --- Atlas ------------------------------------------------------------------------------------------------------------


@styled
def lattice_errors(errors: Mapping[str, Array], band_width: float) -> Figure:
    """Cumulative shares of the error of the similarity, by lattice; band_width: between the two thresholds."""
    figure = plt.figure(figsize=(0.85 * TEXT_WIDTH, 2.6))
    axes = figure.subplots()
    widest = max(float(np.quantile(error, 0.995)) for error in errors.values())
    within = {name: float((error < band_width).mean()) for name, error in errors.items()}
    for (name, error), (colour, dashes) in zip(errors.items(), LINES, strict=False):
        ordered = np.sort(error)
        share = 100 * np.arange(1, ordered.size + 1) / ordered.size
        axes.plot(ordered, share, color=colour, linestyle=dashes, label=f"{name} ({within[name]:.0%} within the band)")
    lines, names = axes.get_legend_handles_labels()
    order = sorted(range(len(lines)), key=lambda place: -list(within.values())[place])  # as the curves lie
    axes.legend(
        [lines[place] for place in order],
        [names[place] for place in order],
        loc="lower right",
        frameon=False,
        labelcolor="linecolor",
        handlelength=3,
    )
    axes.axvline(band_width, **DASHED)
    axes.annotate("$\\psi_{upper}-\\psi_{lower}$,\nthe band", (band_width, 4), (4, 0), textcoords="offset points")
    least, most = min(within.values()), max(within.values())
    axes.set(
        xlabel="|NRB of the atlas − NRB of the camera|", ylabel="random poses (%)", xlim=(0, widest), ylim=(0, 101)
    )
    axes.set_title(f"At {least:.0%} to {most:.0%} of the poses the atlas errs by less than the thresholds' band")
    return figure


# --- After learning ---------------------------------------------------------------------------------------------------


@styled
def over_room(maps: Mapping[str, tuple[Array, Array, Array]], room: Room, label: str) -> Figure:
    """A number at each start, drawn over the floor plan. maps: by title, x, y (m) and the number, one a place."""
    figure = plt.figure(figsize=(TEXT_WIDTH, 2.7), layout="compressed")
    grid = np.atleast_1d(figure.subplots(1, len(maps)))
    least = min(float(values.min()) for _, _, values in maps.values())
    most = max(float(values.max()) for _, _, values in maps.values())
    for axes, (title, (x, y, values)) in zip(grid, maps.items(), strict=True):
        shown = axes.scatter(x, y, c=values, s=95, marker="s", vmin=least, vmax=most, linewidth=0)
        draw_floor_plan(axes, room)
        axes.set_title(f"{title}: {values.mean():.0f} on average")
    figure.colorbar(shown, ax=list(grid), label=label, shrink=0.8)
    return figure


@styled
def similarity_by_light(light: Array, similarity: Array, psi_upper: float) -> Figure:
    """NRB of home under other light than that of the snapshot, shape (lights,) each, and where it still passes."""
    figure = plt.figure(figsize=(TEXT_WIDTH, 2.2))
    axes = figure.subplots()
    axes.fill_between(light, 0, 1, where=similarity >= psi_upper, transform=axes.get_xaxis_transform(), color="0.92")
    axes.plot(light, similarity, color=BLUE)
    level(axes, psi_upper, "$\\psi_{upper}$")
    axes.annotate("passes", (1, 0.05), xycoords=axes.get_xaxis_transform(), ha="center")
    axes.set(xlabel="brightness, as a share of that of the snapshot", ylabel="NRB of home", xlim=(light[0], light[-1]))
    passing = light[similarity >= psi_upper]
    if passing.size:
        axes.set_title(f"Home passes for home from {passing.min():.2f} to {passing.max():.2f} of its brightness")
    return figure


# --- Parts ------------------------------------------------------------------------------------------------------------


def _label_ends(axes: Axes, ends: Mapping[str, tuple[float, float]], colours: Sequence[str]) -> None:
    """Names of curves to the right of their ends, moved apart where they would overlap, and then tied to them."""
    axes.figure.canvas.draw()
    scale = axes.get_figure().dpi / 72  # type: ignore[union-attr]
    heights = {name: axes.transData.transform((1, max(y, 1e-12)))[1] / scale for name, (_, y) in ends.items()}
    tint = dict(zip(ends, colours, strict=False))
    place = -np.inf
    for name in sorted(ends, key=lambda name: heights[name]):
        place = max(heights[name], place + 9.5)
        moved = place - heights[name]
        axes.annotate(
            name,
            ends[name],
            (11 if moved > 3 else 5, moved),
            textcoords="offset points",
            va="center",
            color=tint[name],
            annotation_clip=False,
            arrowprops=_TIE | {"color": tint[name]} if moved > 3 else None,
        )


_TIE = {"arrowstyle": "-", "linewidth": 0.5, "shrinkA": 0, "shrinkB": 1, "relpos": (0, 0.5)}


def _greek(label: str) -> str:
    """Symbols as the paper sets them."""
    for name, symbol in (("alpha_0", "α₀"), ("epsilon_0", "ε₀"), ("theta_0", "θ₀"), ("sigma^2", "σ²"), ("tau ", "τ ")):
        label = label.replace(name, symbol)
    return label


def _plain_log(axes: Axes, which: str, *, narrow: bool = False) -> None:
    """A logarithmic axis with 10, 20, 50, 100 written out, and more where it is short."""
    axis = axes.yaxis if which == "y" else axes.xaxis
    low, high = axis.get_view_interval()
    wide = bool(high > (20 if narrow else 8) * low)
    steps = ((1, 2, 5), (1, 3)) if narrow else ((1, 1.2, 1.5, 2, 2.5, 3, 4, 5, 6, 8), (1, 2, 5))
    axis.set_major_locator(LogLocator(subs=steps[wide]))
    axis.set_minor_locator(LogLocator(subs=tuple(range(1, 10))) if wide or narrow else NullLocator())
    axis.set_major_formatter("{x:g}")
    axis.set_minor_formatter(NullFormatter())
