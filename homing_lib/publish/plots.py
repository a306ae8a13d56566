"""Plots of the studies, in the style of `figures`: many runs, and every number with its 95 % interval.

Where an interval is held against a reference, it is drawn as a blue disc if all of it lies on the good side (below, for
steps), as an orange square if all of it lies on the bad side, and as an open grey diamond if it holds the reference:
the shapes are for grey prints.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter, NullLocator

from homing_lib.features import Array
from homing_lib.publish.figures import (
    BLUE,
    GREEN,
    GREY,
    INK,
    ORANGE,
    SKY,
    TEXT_WIDTH,
    draw_floor_plan,
    draw_robot,
    styled,
)
from homing_lib.rooms import Room
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

_MARKS = {"good": ("o", BLUE, BLUE), "bad": ("s", ORANGE, ORANGE), "open": ("D", GREY, "white")}


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
        axes.plot([0.5, steps + 0.5], [0.5, steps + 0.5], color=BLUE, linewidth=0.8)
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
    panels[-1].annotate("reset to [0, 1]", (0.97, 0.93), xycoords="axes fraction", ha="right", va="top", color=ORANGE)
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
    for (name, table), (colour, dashes) in zip(errors.items(), LINES, strict=False):
        mean, low, high = band(np.minimum(table, 1e6), np.random.default_rng(0))
        drawn = mean <= top
        if not drawn.any():
            ends[f"{name}: beyond {top:g}"] = step_sizes[0], top
            continue
        axes.fill_between(step_sizes[drawn], low[drawn], np.minimum(high, top)[drawn], color=colour, alpha=0.2, lw=0)
        axes.plot(step_sizes[drawn], mean[drawn], color=colour, linestyle=dashes)
        best = int(np.argmin(mean))
        axes.plot(step_sizes[best], mean[best], "o", color=colour, markersize=4)
        last = int(np.flatnonzero(drawn)[-1])
        ends[name] = step_sizes[last], float(mean[last])
    axes.set(xlabel="step size $\\alpha$", ylabel=ylabel, xscale="log", ylim=(None, top))
    axes.set_title("dots: each rule at its best step size; bands: 95 % intervals of the mean")
    axes.set_xticks(step_sizes, [f"{size:g}" for size in step_sizes])
    axes.minorticks_off()
    _label_ends(axes, ends, [colour for colour, _ in LINES])
    return figure


@styled
def curves(
    panels: Mapping[str, Mapping[str, Array]],
    ylabel: str,
    *,
    levels: Mapping[str, float] | None = None,
    log: bool = True,
    shared: bool = True,
    each: int = 1,
) -> Figure:
    """Mean and 95 % interval over the runs, by episode. panels: tables of shape (runs, episodes) by title and label.

    levels: horizontal lines by name, drawn in every panel; each: how many episodes a column of the tables stands for.
    """
    figure = plt.figure(figsize=(TEXT_WIDTH, 2.7))
    grid = np.atleast_1d(figure.subplots(1, len(panels), sharey=shared))
    for axes, (title, tables) in zip(grid, panels.items(), strict=True):
        ends: dict[str, tuple[float, float]] = {}
        for (name, table), (colour, dashes) in zip(tables.items(), LINES, strict=False):
            mean, low, high = band(table, np.random.default_rng(0))
            episode = each * np.arange(mean.size) + (each + 1) / 2
            axes.fill_between(episode, low, high, color=colour, alpha=0.2, linewidth=0)
            axes.plot(episode, mean, color=colour, linestyle=dashes)
            ends[name] = float(episode[-1]), float(mean[-1])
        axes.set(title=title, xlabel="episode", xlim=(1, None))
        axes.xaxis.set_major_locator(MaxNLocator(6, integer=True))
        if log:
            axes.set_yscale("log")
            _plain_log(axes, "y")
        for name, level in (levels or {}).items():
            axes.axhline(level, color=INK, linestyle=(0, (5, 2)), linewidth=0.8)
            axes.annotate(name, (0.02, level), (0, 2), xycoords=("axes fraction", "data"), textcoords="offset points")
        _label_ends(axes, ends, [colour for colour, _ in LINES])
    grid[0].set_ylabel(ylabel)
    return figure


# --- Intervals --------------------------------------------------------------------------------------------------------


class Column(NamedTuple):
    """A column of a forest plot: intervals by row, what they are, and what they are held against.

    also: a second estimate of each row, drawn as a bar across. text: how numbers are written beside a single column.
    more: more is better.
    """

    label: str
    intervals: Mapping[str, Interval]
    reference: float | None = None
    log: bool = False
    also: Mapping[str, float] | None = None
    text: str = ".0f"
    more: bool = False

    def mark(self, found: Interval) -> tuple[str, str, str]:
        """Shape, edge and face of an interval."""
        where = "below" if self.reference is None else side(found, self.reference)
        return _MARKS["open" if where == "open" else "bad" if (where == "above") != self.more else "good"]


@styled
def forest(*columns: Column, height: float = 0.19, shared: bool = False) -> Figure:
    """Rows of intervals, in one column or several; shared: columns on the same scale."""
    rows = list(columns[0].intervals)
    figure = plt.figure(figsize=(TEXT_WIDTH, 0.75 + height * len(rows)))
    grid = np.atleast_1d(figure.subplots(1, len(columns), sharex=shared, sharey=True))
    for axes, column in zip(grid, columns, strict=True):
        for place, row in enumerate(rows):
            if row not in column.intervals:
                continue
            found = column.intervals[row]
            shape, edge, face = column.mark(found)
            axes.hlines(place, found.low, found.high, color=edge, linewidth=1.6)
            axes.plot(found.value, place, shape, color=edge, markerfacecolor=face, markersize=4.5)
            if column.also and row in column.also:
                axes.plot(column.also[row], place, "|", color=INK, markersize=8, markeredgewidth=1.2)
            if len(columns) == 1:
                text = f"{found:{column.text}}"
                axes.text(1.02, place, text, transform=axes.get_yaxis_transform(), va="center", fontsize=7)
        if column.reference is not None:
            axes.axvline(column.reference, color=INK, linestyle=(0, (5, 2)), linewidth=0.8, zorder=0)
        axes.set(xlabel=column.label, ylim=(len(rows) - 0.4, -0.6))
        if column.log:
            axes.set_xscale("log")
            _plain_log(axes, "x", narrow=len(columns) > 1)
        axes.grid(axis="y", color=GREY, alpha=0.25, linewidth=0.5)
        axes.tick_params(axis="y", length=0)
    grid[0].set_yticks(range(len(rows)), rows)
    return figure


@styled
def heat_map(
    rows: Sequence[str], columns: Sequence[str], values: Array, notes: Mapping[tuple[int, int], str]
) -> Figure:
    """Steps by rule and step size, written into the cells; notes: a second line of a cell, such as its divergences."""
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
    figure.colorbar(shown, label="steps an episode").ax.yaxis.set_major_formatter("{x:g}")
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
        axes.set_ylabel("steps an episode")
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
    for place, ((name, error), (colour, dashes)) in enumerate(zip(errors.items(), LINES, strict=False)):
        ordered = np.sort(error)
        share = 100 * np.arange(1, ordered.size + 1) / ordered.size
        axes.plot(ordered, share, color=colour, linestyle=dashes)
        height = 45 + 18 * place
        at = float(np.quantile(error, height / 100))
        axes.annotate(name, (at, height), (6, -2), textcoords="offset points", color=colour, va="top", bbox=_GROUND)
    axes.axvline(band_width, color=INK, linestyle=(0, (5, 2)), linewidth=0.8)
    axes.annotate("$\\psi_{upper}-\\psi_{lower}$", (band_width, 4), (4, 0), textcoords="offset points")
    axes.set(
        xlabel="|NRB of the atlas − NRB of the camera|", ylabel="random poses (%)", xlim=(0, widest), ylim=(0, 101)
    )
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
        draw_floor_plan(axes, room)
        shown = axes.scatter(x, y, c=values, s=95, marker="s", vmin=least, vmax=most, linewidth=0)
        draw_robot(axes, room.home, 0.07, "white")
        axes.plot(*room.start[:2], "^", color="white", markeredgecolor=INK, markersize=5)
        axes.set(title=title, xticks=[], yticks=[])
        figure.colorbar(shown, ax=axes, label=label, shrink=0.8)
    return figure


@styled
def similarity_by_light(light: Array, similarity: Array, psi_upper: float) -> Figure:
    """NRB of home under other light than that of the snapshot, shape (lights,) each, and where it still passes."""
    figure = plt.figure(figsize=(TEXT_WIDTH, 2.2))
    axes = figure.subplots()
    axes.fill_between(light, 0, 1, where=similarity >= psi_upper, transform=axes.get_xaxis_transform(), color="0.92")
    axes.plot(light, similarity, color=BLUE)
    axes.axhline(psi_upper, color=INK, linestyle=(0, (5, 2)), linewidth=0.8)
    axes.annotate(
        "$\\psi_{upper}$", (0.01, psi_upper), (0, 2), xycoords=("axes fraction", "data"), textcoords="offset points"
    )
    axes.annotate("passes", (1, 0.05), xycoords=axes.get_xaxis_transform(), ha="center")
    axes.set(xlabel="brightness, as a share of that of the snapshot", ylabel="NRB of home", xlim=(light[0], light[-1]))
    return figure


# --- Parts ------------------------------------------------------------------------------------------------------------


_GROUND = {"boxstyle": "round,pad=0.15", "facecolor": "white", "alpha": 0.8, "linewidth": 0}


def _label_ends(axes: Axes, ends: Mapping[str, tuple[float, float]], colours: Sequence[str]) -> None:
    """Names of curves to the right of their ends, moved apart where they would overlap."""
    axes.figure.canvas.draw()
    scale = axes.get_figure().dpi / 72  # type: ignore[union-attr]
    heights = {name: axes.transData.transform((1, max(y, 1e-12)))[1] / scale for name, (_, y) in ends.items()}
    tint = dict(zip(ends, colours, strict=False))
    place = -np.inf
    for name in sorted(ends, key=lambda name: heights[name]):
        place = max(heights[name], place + 9.5)
        axes.annotate(
            name,
            ends[name],
            (5, place - heights[name]),
            textcoords="offset points",
            va="center",
            color=tint[name],
            annotation_clip=False,
        )


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
