"""Plots of the studies: many runs, and every mean with its 95 % interval. Intervals in rows are in `forests`."""

from collections.abc import Mapping, Sequence
from math import ceil

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from homing_lib.features import Array
from homing_lib.publish import drawing
from homing_lib.publish.charts import mark
from homing_lib.publish.drawing import BLUE, DASHED, GREY, INK, LINES, ORANGE, TEXT_WIDTH, styled
from homing_lib.study.bootstrap import band
from homing_lib.study.rules import Rules
from homing_lib.study.theorem import Distance

Tables = Mapping[str, Array]  # by label, shape (runs, episodes)


@styled
def trace_depth(traces: Mapping[str, Array]) -> Figure:
    """How much of each past step is left in the trace. traces: by rule, shape (steps, past steps), NaN for later."""
    figure, (panels,) = plt.subplots(1, len(traces), sharey=True, squeeze=False, figsize=(TEXT_WIDTH, 2.35))
    for axes, (name, trace) in zip(panels, traces.items(), strict=True):
        edges = np.arange(len(trace) + 1) + 0.5
        shown = axes.pcolormesh(edges, edges, trace.T, vmin=0, vmax=1, cmap="Greys", rasterized=True)
        axes.set(title=name, xlabel="step $t$", aspect="equal")
    panels[0].set_ylabel("past step $k$")
    figure.colorbar(shown, ax=panels, label="share of $\\phi_k$ in $e_t$", shrink=0.8)
    return figure


@styled
def parting(found: Mapping[str, Distance]) -> Figure:
    """How far TD-conj stands from conjugate gradient at each step: by form, without and with the reset to [0, 1]."""
    figure, (panels,) = plt.subplots(1, len(found), sharey=True, squeeze=False, figsize=(TEXT_WIDTH, 2.3))
    for axes, (name, of) in zip(panels, found.items(), strict=True):
        step, floor = np.arange(1, of.free.size + 1), 1e-18
        axes.plot(step, np.maximum(of.reset, floor), color=ORANGE, linestyle=(0, (4, 1.5)))
        axes.plot(step, np.maximum(of.free, floor), color=BLUE)
        axes.axvline(of.first, color=GREY, linewidth=0.8)
        drawing.beside(axes, "first reset", (of.first, 1e-8), (4, 0), rotation=90)
        axes.set(title=name, xlabel="step $t$", yscale="log", ylim=(floor / 3, 1e3), xlim=(1, step[-1]))
        axes.set_xticks(step[:: max(1, step.size // 4)])
    panels[-1].annotate("reset to [0, 1]", (0.97, 0.83), xycoords="axes fraction", ha="right", va="top", color=ORANGE)
    panels[-1].annotate("without a reset", (0.97, 0.2), xycoords="axes fraction", ha="right", color=BLUE)
    panels[0].set_ylabel("relative distance from $p_t$")
    return figure


@styled
def over_step_sizes(step_sizes: Array, errors: Mapping[str, Array], ylabel: str, top: float) -> Figure:
    """A measure of runs against the step size. errors: by rule, shape (runs, step sizes); above `top`, not drawn."""
    figure, axes = plt.subplots(figsize=(TEXT_WIDTH, 3.1))
    ends: dict[str, tuple[float, float]] = {}
    least = (np.inf, "", 0.0)
    for (name, table), (colour, dashes) in zip(errors.items(), LINES, strict=False):
        mean, low, high = band(np.minimum(table, 1e6))
        drawn = mean <= top
        if not drawn.any():
            ends[f"{name}: beyond {top:g}"] = step_sizes[0], top
            continue
        axes.fill_between(step_sizes[drawn], low[drawn], np.minimum(high, top)[drawn], color=colour, alpha=0.2, lw=0)
        axes.plot(step_sizes[drawn], mean[drawn], color=colour, linestyle=dashes)
        best = mean.argmin()
        least = min(least, (mean[best], name, step_sizes[best]))
        axes.plot(step_sizes[best], mean[best], "o", color=colour, markersize=4)
        ends[name] = step_sizes[drawn][-1], mean[drawn][-1]
    axes.set(xlabel="step size $\\alpha$", ylabel=ylabel, xscale="log", ylim=(None, top))
    axes.set_title(f"Least with {least[1]}: {least[0]:.2f} at {least[2]:g} (dots: the best step size of each)")
    axes.set_xticks(step_sizes, [f"{size:g}" for size in step_sizes])
    axes.minorticks_off()
    drawing.label_ends(axes, ends)
    return figure


@styled
def curves(
    panels: Mapping[str, Tables],
    ylabel: str | Sequence[str],
    levels: Mapping[str, float] | None = None,
    each: int = 1,
    log: bool = True,
) -> Figure:
    """Mean and 95 % interval over the runs, by episode. panels: tables by title and label.

    ylabel: of all panels, which then share their scale, or one each; levels: horizontal lines by name, drawn in every
    panel; each: how many episodes a column of the tables stands for; log: of what is positive, on a logarithmic scale.
    """
    shared = isinstance(ylabel, str)
    labels = [ylabel, *[""] * (len(panels) - 1)] if isinstance(ylabel, str) else ylabel
    figure, (grid,) = plt.subplots(1, len(panels), sharey=shared, squeeze=False, figsize=(TEXT_WIDTH, 2.7))
    alike = len({tuple(tables) for tables in panels.values()}) == 1
    for axes, label, (title, tables) in zip(grid, labels, panels.items(), strict=True):
        ends = _learning(axes, tables, each, log)
        axes.set_title(title)
        for name, value in (levels or {}).items():
            drawing.level(axes, value, name)
        if axes is grid[-1] or not alike:  # once is enough where every panel shows the same
            drawing.label_ends(axes, ends)
        axes.set_ylabel(label)
    return figure


def _learning(axes: Axes, tables: Tables, each: int = 1, log: bool = True) -> dict[str, tuple[float, float]]:
    """Draw mean and interval by episode; returns where each curve ends."""
    ends = {}
    for (name, table), (colour, dashes) in zip(tables.items(), LINES, strict=False):
        mean, low, high = band(table)
        episode = each * np.arange(mean.size) + (each + 1) / 2
        axes.fill_between(episode, low, high, color=colour, alpha=0.2, linewidth=0)
        axes.plot(episode, mean, color=colour, linestyle=dashes)
        ends[name] = float(episode[-1]), float(mean[-1])
    axes.set(xlabel="episode", xlim=(1, max(1.5, *(x for x, _ in ends.values()))))
    axes.xaxis.set_major_locator(MaxNLocator(6, integer=True))
    if log:
        axes.set_yscale("log")
        drawing.plain_log(axes, "y")
    return ends


@styled
def rules(found: Rules) -> Figure:
    """How rules learn, and the total and the late steps of each as a multiple of the first's."""
    (first, steps), *_ = found.steps.items()
    figure, (learning, against) = plt.subplots(1, 2, width_ratios=[1.4, 1], figsize=(TEXT_WIDTH, 2.6))
    ends = _learning(learning, found.steps)
    learning.set(title=f"mean of {len(steps)} robots", ylabel="steps per episode")
    drawing.label_ends(learning, ends)
    labels = list(found.verdicts)
    for place, label in enumerate(labels):
        for up, colour, of in ((-0.14, INK, found.verdicts), (0.14, GREY, found.late)):
            mark(against, of[label], place + up, colour, of[label].verdict)
    against.axvline(1, **drawing.DASHED, zorder=0)
    against.set(xscale="log", ylim=(len(labels) - 0.5, -0.5), title="left of 1: fewer steps")
    drawing.plain_log(against, "x", narrow=True)
    against.set_yticks(range(len(labels)), labels)
    against.set_xlabel(f"steps / those of {first}\n(black: total; grey: last five, typical)", loc="right")
    return figure


@styled
def marginals(choices: Mapping[str, Mapping[str, Array]], chosen: Mapping[str, str], top: float) -> Figure:
    """Scores of the candidates by each of their choices, with the median; the value chosen stands out.

    choices: by setting and value, the scores of all candidates that have it; top: the worst score there is.
    """
    rows = ceil(len(choices) / 4)
    figure, grid = plt.subplots(rows, 4, sharey=True, squeeze=False, figsize=(TEXT_WIDTH, 1.75 * rows))
    rng = np.random.default_rng(0)
    for axes, (name, by_value) in zip(grid.flat, choices.items(), strict=False):
        for place, (value, scores) in enumerate(by_value.items()):
            colour = BLUE if value == chosen[name] else GREY
            spread = place + rng.uniform(-0.22, 0.22, scores.size)
            axes.plot(spread, scores, ".", color=colour, markersize=2.5, alpha=0.7)
            axes.hlines(np.median(scores), place - 0.38, place + 0.38, color=colour, linewidth=1.8)
        axes.set(title=name, yscale="log", ylim=(None, 1.15 * top), xlim=(-0.6, len(by_value) - 0.4))
        crowded = sum(map(len, by_value)) > 20
        axes.set_xticks(range(len(by_value)), list(by_value), fontsize=6 if crowded else 7, rotation=35 * crowded)
        drawing.plain_log(axes, "y")
    plt.setp(grid[:, 0], ylabel="steps per episode")
    for axes in grid.flat[len(choices) :]:
        axes.set_visible(False)
    return figure


@styled
def lattice_errors(errors: Mapping[str, Array], band_width: float) -> Figure:
    """Cumulative shares of the error of the similarity, by lattice; band_width: between the two thresholds."""
    figure, axes = plt.subplots(figsize=(0.85 * TEXT_WIDTH, 2.6))
    widest = max(float(np.quantile(error, 0.995)) for error in errors.values())
    within = {name: float((error < band_width).mean()) for name, error in errors.items()}
    downwards = sorted(errors, key=lambda name: -within[name])  # as the curves lie
    for name, (colour, dashes) in zip(downwards, LINES, strict=False):
        share = 100 * np.arange(1, errors[name].size + 1) / errors[name].size
        label = f"{name} ({within[name]:.0%} within the band)"
        axes.plot(np.sort(errors[name]), share, color=colour, linestyle=dashes, label=label)
    axes.legend(loc="lower right", frameon=False, labelcolor="linecolor", handlelength=3)
    axes.axvline(band_width, **DASHED)
    drawing.beside(axes, "$\\psi_{upper}-\\psi_{lower}$,\nthe band", (band_width, 4), (4, 0))
    least, most = min(within.values()), max(within.values())
    axes.set(xlabel="|NRB of the atlas − NRB of the camera|", xlim=(0, widest))
    axes.set(ylabel="random poses (%)", ylim=(0, 101))
    axes.set_title(f"At {least:.0%} to {most:.0%} of the poses the atlas errs by less than the thresholds' band")
    return figure
