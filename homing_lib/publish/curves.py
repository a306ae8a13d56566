"""Curves over episodes and step sizes, mean and interval, each with its name at its end."""

from collections.abc import Mapping, Sequence
from itertools import cycle
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from homing_lib.features import Array
from homing_lib.publish.parts import beside, curve, handle, key, label_ends, level, log_axis, note, panels
from homing_lib.publish.style import BLUE, COLOURS, DASHED, GREY, INK, LINES, ORANGE, SKY, TEXT_WIDTH, Look, styled
from homing_lib.study.bootstrap import Interval, band
from homing_lib.study.findings import Comparison, Finding
from homing_lib.study.headline import Headline
from homing_lib.study.measures import WINDOW
from homing_lib.study.questions.simple import FROZEN, OF_SHORTEST, OF_SHORTEST_FROZEN, TIMES


@styled
def learning_curves(steps: Array, rewards: Array, changes: Array, random_rewards: Array, found: Headline) -> Figure:
    """The paper's Fig. 6: steps, reward and parameter change per episode: mean and range of the runs.

    steps, rewards, changes: shape (runs, episodes); random_rewards: of random actions; found: their headline.
    """
    first, last, random, rates = found.first, found.last, found.random, found.settings.step_size_rates
    figure = plt.figure(figsize=(TEXT_WIDTH, 4.3))
    top, middle, right = figure.subplot_mosaic("ss;rc", height_ratios=[1.35, 1]).values()
    episodes = np.arange(1, steps.shape[1] + 1)

    _mean_and_range(top, episodes, steps)
    top.axhspan(random.low, random.high, color=GREY, alpha=0.25, linewidth=0)
    top.axhline(random.value, **DASHED)
    at = episodes[-1] + 0.4, 1.08 * random.high
    note(top, f"random actions: {_steps(random)}", at, va="bottom", ha="right")
    for part, mean, name in ((slice(None, WINDOW), first, "first"), (slice(-WINDOW, None), last, "last")):
        ends = episodes[part][0] - 0.4, episodes[part][-1] + 0.4
        below = 0.85 * steps[:, part].min()
        top.hlines(mean.value, *ends, color=ORANGE, linewidth=2.2)
        top.vlines(ends[0], below, mean.value, color=ORANGE, linewidth=0.6)
        note(top, f"{name} {WINDOW}: {_steps(mean)}", (ends[0], below), va="top", ha="left", color=ORANGE)
    falls = f"Steps per episode fall from {first.value:.0f} to {last.value:.0f}"
    top.set_title(falls if last.high < first.low else "Steps per episode: no fall shown")
    log_axis(top, "y")
    top.set(ylabel=f"steps: mean and range of {len(steps)} runs", ylim=(steps.min() * 0.5, None))

    _mean_and_range(middle, episodes, rewards)
    level(middle, float(np.nanmean(random_rewards)), "random actions", at=0.55)
    middle.set(title="Reward per episode: mean and range", ylabel="summed reward")

    _mean_and_range(right, episodes, changes)
    share = rates * np.nanmean(changes[:, 0]) / rates[0]
    right.plot(episodes, share, color=INK, linestyle=(0, (1, 1.5)), linewidth=1)
    beside(right, "the step size's own fall", (episodes[-1], share[-1]), (0, 11), ha="right")
    right.set(title="Parameter change: mean and range", ylabel="summed $|\\Delta\\theta|$", yscale="log")
    for axes in figure.axes:
        axes.set(xlabel="episode", xlim=(0.4, episodes[-1] + 0.6), xticks=episodes[[0, *range(4, episodes.size, 5)]])
    return figure


def _mean_and_range(axes: Axes, episodes: NDArray[np.int64], table: Array) -> None:
    finished = np.ma.masked_invalid(table)  # in an episode that no run finished there is nothing to draw
    axes.fill_between(episodes, finished.min(axis=0), finished.max(axis=0), color=SKY, alpha=0.3, linewidth=0)
    axes.plot(episodes, finished.mean(axis=0), "o-", color=BLUE, markersize=3)


def _steps(mean: Interval) -> str:
    return f"{mean.value:.0f} steps [{mean.low:.0f}, {mean.high:.0f}]"


@styled
def learns(atlas: Array, camera: Array, levels: Mapping[str, float], frozen: Mapping[int, Comparison]) -> Figure:
    """Learning curves of the robots on the atlas and of those with the camera, shape (robots, episodes) each; levels by
    name; and what the same robots take when they are frozen, by the number of episodes after which.
    """
    figure, (axes,) = panels(3.1)
    episodes = np.arange(1, atlas.shape[1] + 1)
    curve(axes, episodes, band(atlas), (COLOURS["form 2"], "-"), alpha=0.25)
    curve(axes, episodes, band(camera), (COLOURS["camera"], (0, (4, 1.5))), alpha=0.25)
    for after, steps in frozen.items():
        axes.vlines(after, steps.low, steps.high, color=COLOURS["frozen"], linewidth=1.4)
        axes.plot(after, steps.value, "s", color=COLOURS["frozen"], markersize=5)
        at = after, steps.value
        beside(axes, f"frozen after {after}", at, (-6, 6), ha="right", color=COLOURS["frozen"])
    axes.set(xlabel="episode", ylabel="steps per episode", xlim=(1, episodes[-1] + 0.3), yscale="log")
    for name, value in levels.items():
        level(axes, value, name)
    log_axis(axes, "y")
    axes.xaxis.set_major_locator(MaxNLocator(6, integer=True))
    beside(axes, f"{len(atlas):,} robots on the atlas", (6.2, 240), (0, 0), color=COLOURS["form 2"])
    beside(axes, f"{len(camera)} with the camera", (12.5, 23), (0, 0), color=COLOURS["camera"])
    return figure


@styled
def instead(at: Array, robots: Mapping[str, Array], levels: Mapping[str, float]) -> Figure:
    """Learning curves over environment steps: steps of the next ten episodes, mean of the robots and 95 % interval.

    at: environment steps, shape (n,); robots: shape (robots, n), by a name that begins with the thing whose colour it
    has: its first is thick, solid and dash-dotted by turns, others are thin and dashed. levels: by name.
    """
    figure, (axes,) = panels(3.6)
    ends: dict[str, tuple[float, float]] = {}
    colours: list[str] = []
    firsts, others = ("-", (0, (6, 1.5, 1, 1.5))), ((0, (4, 1.5)), (0, (1, 1)))
    for name, steps in robots.items():
        colour = next(COLOURS[thing] for thing in COLOURS if name.startswith(thing))
        earlier = colours.count(colour)
        dashes: Any = others[earlier - 1] if earlier else firsts[len(set(colours)) % 2]
        curve(axes, at, band(steps), (colour, dashes), alpha=0.08 if earlier else 0.2)
        axes.lines[-1].set_linewidth(1 if earlier else 1.8)
        ends[name], colours = (float(at[-1]), float(steps[:, -1].mean())), [*colours, colour]
    axes.set(xlabel="environment steps so far", ylabel="steps of an episode", xlim=(at[0], at[-1]), xscale="log")
    for name, value in levels.items():
        level(axes, value, name, bbox={"facecolor": "white", "alpha": 0.8, "linewidth": 0, "pad": 1})
    log_axis(axes, "y")
    axes.xaxis.set_major_formatter("{x:,.0f}")
    label_ends(axes, ends, colours)
    return figure


@styled
def by_episode(title: str, tables: Mapping[str, Array], ylabel: str) -> Figure:
    """Mean and 95 % interval over the runs, by episode. tables: by label, shape (runs, episodes)."""
    figure, (axes,) = panels(2.7)
    ends = {}
    for (name, table), line in zip(tables.items(), cycle(LINES), strict=False):
        episodes = np.arange(1, table.shape[1] + 1)
        curve(axes, episodes, band(table), line)
        ends[name] = float(episodes[-1]), float(table[:, -1].mean())
    axes.set(title=title, xlabel="episode", ylabel=ylabel, xlim=(1, max(1.5, *(x for x, _ in ends.values()))))
    axes.xaxis.set_major_locator(MaxNLocator(6, integer=True))
    label_ends(axes, ends)
    return figure


@styled
def worth(finding: Finding, rooms: Sequence[str], episodes: Sequence[int], starts: Mapping[str, str]) -> Figure:
    """Steps of all episodes so far, as a multiple of the climb's, by episode and room. starts: titles, by name."""
    figure, grid = panels(2.7, len(starts), sharey=True)
    for axes, (start, title) in zip(grid, starts.items(), strict=True):
        ends = {}
        for room, line in zip(rooms, cycle(LINES), strict=False):
            ratios = np.array([finding[f"{room}.{start}.{number}"].interval for number in episodes])
            curve(axes, episodes, ratios.T, line)
            ends[room] = float(episodes[-1]), float(ratios[-1, 0])
        axes.axhline(1, **DASHED)
        axes.set(title=title, xlabel="episodes so far", xlim=(episodes[0], episodes[-1]))
        log_axis(axes, "y")
    label_ends(axes, ends)
    grid[0].set_ylabel("steps / those of the climb")
    return figure


@styled
def simple(learning: Mapping[str, Array], frozen: Mapping[str, Array], shortest: float) -> Figure:
    """Who learns within how many steps of the environment, and who then comes home frozen.

    learning: steps of the episode under way at TIMES, shape (robots, times); frozen: steps of each robot's greedy
    trial, infinite if it did not come home; both by "simple", "form 2" and "standard". shortest: steps of that way.
    """
    figure, (left, right) = panels(2.9, 2, width_ratios=[1.3, 1])
    names = {"simple": "the page", "form 2": "form 2", "standard": "standard Sarsa(λ)"}
    handles = []
    for (who, taken), (_, dashes) in zip(learning.items(), LINES, strict=False):
        # Not the mean: whoever takes long is met under way more often.
        curve(left, TIMES, np.percentile(taken, (50, 25, 75), axis=0), (COLOURS[who], dashes))
        steps = np.sort(frozen[who])
        home = 100 * np.arange(1, len(steps) + 1) / len(steps)
        right.step(steps, home, where="post", color=COLOURS[who], linestyle=dashes)
        handles.append(handle(names[who], Look(COLOURS[who], ""), dashes=dashes))
    log_axis(left, "y")
    left.set(
        ylabel="steps of the episode under way\n(median and middle half of the robots)",
        xlabel="steps of the environment",
        xlim=(TIMES[0], TIMES[-1]),
    )
    for multiple in (1.0, OF_SHORTEST):
        left.axhline(multiple * shortest, **DASHED)
    beside(
        left,
        f"shortest way, and {OF_SHORTEST:g} times it",
        (0.99, shortest),
        (0, -11),
        ha="right",
        xycoords=("axes fraction", "data"),
    )
    left.set_ylim(bottom=0.55 * shortest)
    right.axvline(OF_SHORTEST_FROZEN * shortest, **DASHED)
    right.set(ylabel="robots that are home (%)", xlabel="steps, frozen and greedy", ylim=(0, 102))
    right.set_xlim(0.75 * shortest, 10 * shortest)
    log_axis(right, "x", narrow=True)
    beside(right, f"{OF_SHORTEST_FROZEN:g} times the shortest way", (OF_SHORTEST_FROZEN * shortest, 2), (4, 0))
    left.set_title("Learning on")
    right.set_title(f"Frozen after {FROZEN:,} steps, greedy")
    key(figure, handles, len(handles), handlelength=3)
    return figure


@styled
def over_step_sizes(step_sizes: Array, errors: Mapping[str, Array], ylabel: str, top: float) -> Figure:
    """A measure of runs against the step size. errors: by rule, shape (runs, step sizes); above `top`, not drawn."""
    figure, (axes,) = panels(3.1)
    ends: dict[str, tuple[float, float]] = {}
    for (name, table), line in zip(errors.items(), cycle(LINES), strict=False):
        mean, low, high = band(np.minimum(table, 1e6))
        drawn = mean <= top
        if not drawn.any():
            ends[f"{name}: beyond {top:g}"] = step_sizes[0], top
            continue
        curve(axes, step_sizes[drawn], np.array([mean, low, np.minimum(high, top)])[:, drawn], line)
        best = mean.argmin()
        axes.plot(step_sizes[best], mean[best], "o", color=line[0], markersize=4)
        ends[name] = step_sizes[drawn][-1], mean[drawn][-1]
    axes.set(xlabel="step size $\\alpha$", ylabel=ylabel, xscale="log", ylim=(None, top))
    axes.set_title(f"Each has a best step size of its own (dots); errors above {top:g} are not drawn")
    axes.set_xticks(step_sizes, [f"{size:g}" for size in step_sizes])
    axes.minorticks_off()
    label_ends(axes, ends)
    return figure
