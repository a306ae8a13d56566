"""All figures, in one style. A plot function takes data and returns a figure; `save` alone writes files.

Colours are Okabe and Ito's, which the colour-blind tell apart; lines differ in style or weight too, for grey prints.
"""

import os
from collections.abc import Callable, Mapping, Sequence
from functools import wraps
from math import cos, degrees, radians, sin
from pathlib import Path
from typing import Any, ParamSpec

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
from matplotlib import patches
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator
from numpy.typing import NDArray

from homing_lib.features import Array
from homing_lib.rooms import Box, Pose, Room
from homing_lib.settings import Settings
from homing_lib.storage import ROOT
from homing_lib.study.statistics import Interval
from homing_lib.thresholds import Thresholds

Image = NDArray[np.uint8]
P = ParamSpec("P")

TEXT_WIDTH = 6.3
"""Of the report, in inches."""

BLUE, ORANGE, GREEN, SKY, GREY, INK = "#0072B2", "#D55E00", "#009E73", "#56B4E9", "#8A8A8A", "#222222"

STYLE: dict[Any, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 7.5,
    "axes.titlesize": 8,
    "axes.titlelocation": "left",
    "axes.labelsize": 7.5,
    "axes.linewidth": 0.6,
    "axes.edgecolor": INK,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "lines.linewidth": 1.4,
    "lines.solid_capstyle": "round",
    "text.color": INK,
    "axes.labelcolor": INK,
    "figure.dpi": 150,
    "figure.constrained_layout.use": True,
    "savefig.dpi": 200,
    "pdf.fonttype": 42,
    "image.cmap": "cividis",
    "image.interpolation": "nearest",
}


def save(figure: Figure, figures_dir: str | Path | None, name: str) -> None:
    """Write figures_dir/name.pdf and .png, each beside its place and then renamed. The same figure, the same bytes.

    Without a folder nothing is written: a notebook that is run by hand only shows its figures.
    """
    if figures_dir is None:
        return
    for kind, metadata in (("pdf", {"CreationDate": None}), ("png", {"Software": None})):
        path = Path(figures_dir) / f"{name}.{kind}"
        part = path.with_name(f".{path.name}.{os.getpid()}.part")
        try:
            with plt.rc_context(STYLE):
                figure.savefig(part, format=kind, metadata=metadata)
            part.replace(path)
        finally:
            part.unlink(missing_ok=True)


def stored(name: str) -> None:
    """Show in a notebook the stored figure of this name, where it cannot be drawn: it needs the camera."""
    from IPython.display import Image as Shown
    from IPython.display import display

    print(f"Drawn earlier: figures/{name}.png needs PyBullet, which this Python lacks.")
    display(Shown(ROOT / "figures" / f"{name}.png"))


def styled(plot: Callable[P, Figure]) -> Callable[P, Figure]:
    @wraps(plot)
    def styled(*args: P.args, **kwargs: P.kwargs) -> Figure:
        with plt.rc_context(STYLE):
            figure = plot(*args, **kwargs)
            interactive = plt.isinteractive()
        # The first figure loads the backend. A notebook's then switches interactive mode on, without which it shows
        # nothing more; leaving the context would switch it off again.
        matplotlib.interactive(interactive)
        return figure

    return styled


# --- The world --------------------------------------------------------------------------------------------------------


@styled
def home_view(image: Image, scaled_histogram: Array, bin_size: int) -> Figure:
    """Figure 1: the snapshot of home and the histogram of each of its channels (eq. 11)."""
    figure = plt.figure(figsize=(TEXT_WIDTH, 1.75))
    view, *channels = figure.subplots(1, 4, width_ratios=[1.05, 1, 1, 1])
    _picture(view, image, "view of home")
    bins = scaled_histogram.reshape(3, -1)
    edges = bin_size * np.arange(bins.shape[1] + 1)
    for axes, name, colour, shares in zip(channels, ("red", "green", "blue"), (ORANGE, GREEN, BLUE), bins, strict=True):
        axes.stairs(100 * shares, edges, fill=True, color=colour, alpha=0.35, linewidth=0)
        axes.stairs(100 * shares, edges, color=colour, linewidth=0.8)
        axes.set(title=name, xlim=(0, 256), ylim=(0, 105 * bins.max()), xticks=[0, 128, 255])
        axes.set_xlabel("intensity")
    for axes in channels[1:]:
        axes.set_yticklabels([])
    channels[0].set_ylabel("pixels in the bin (%)")
    return figure


@styled
def room_views(top: Image, from_home: Image, from_start: Image, room: Room, settings: Settings) -> Figure:
    """Figure 4: the room from above, with the robot at both ends of its way, and what it sees there."""
    width, depth = room.size
    figure = plt.figure(figsize=(TEXT_WIDTH, 3.55), layout="compressed")
    plan, home, start = figure.subplot_mosaic([["plan", "home"], ["plan", "start"]], width_ratios=[2.3, 1]).values()
    plan.imshow(top, extent=(0, width, 0, depth), alpha=0.8)
    _in_metres(plan, room)
    for name, pose, fill in (("home", room.home, "white"), ("start", room.start, SKY)):
        _field_of_view(plan, pose, settings)
        draw_robot(plan, pose, settings.body_diameter_m, fill)
        _note(plan, name, (pose.x, pose.y - 0.055), va="top", ha="center")
    for thing in room.objects:
        ahead, across = (thing.size[0] / 2, thing.size[1] / 2) if isinstance(thing, Box) else (0, thing.radius)
        at = min(thing.x + ahead, width - 0.02), thing.y + across + 0.015
        _note(plan, thing.name, at, va="bottom", ha="right" if ahead else "center")
    _picture(home, from_home, "seen from home")
    _picture(start, from_start, "seen from the start")
    return figure


@styled
def similarity_map(similarity: Array, room: Room, thresholds: Thresholds, body_m: float = 0.07) -> Figure:
    """Similarity to home over the room, at home's heading, shape (rows of y, columns of x); NaN where no robot fits."""
    width, depth = room.size
    figure = plt.figure(figsize=(0.62 * TEXT_WIDTH, 3.0), layout="compressed")
    axes = figure.subplots()
    shown = axes.imshow(similarity, origin="lower", extent=(0, width, 0, depth), vmax=1)
    figure.colorbar(shown, label="similarity NRB")
    rows, columns = similarity.shape
    x, y = (np.arange(columns) + 0.5) * width / columns, (np.arange(rows) + 0.5) * depth / rows
    axes.contour(x, y, similarity, levels=[thresholds.upper], colors="white", linewidths=1.2)
    draw_floor_plan(axes, room)
    _in_metres(axes, room)
    draw_robot(axes, room.home, body_m, "white")
    _note(axes, f"inside the white line:\nNRB ≥ {thresholds.upper:.4f}", (0.03, 0.03), va="bottom", ha="left")
    return figure


@styled
def similarity_by_heading(
    heading_deg: Array, similarity: Array, thresholds: Thresholds, fit: tuple[Array, str] | None = None
) -> Figure:
    """Similarity at home against the heading's difference from the snapshot's; fit: a fitted curve and its name."""
    figure = plt.figure(figsize=(0.8 * TEXT_WIDTH, 2.4))
    axes = figure.subplots()
    axes.plot(heading_deg, similarity, color=BLUE)
    side = heading_deg.size // 6
    axes.annotate("measured", (heading_deg[side], similarity[side]), (0, 12), textcoords="offset points", color=BLUE)
    if fit:
        curve, name = fit
        axes.plot(heading_deg, curve, color=ORANGE, linestyle=(0, (4, 2)))
        side = heading_deg.size // 2 + heading_deg.size // 8
        axes.annotate(name, (heading_deg[side], curve[side]), (8, 6), textcoords="offset points", color=ORANGE)
    _level(axes, thresholds.upper, f"$\\psi_{{upper}}$ = {thresholds.upper:.4f}")
    axes.set(xlabel="heading from home's (degrees)", ylabel="similarity NRB", xlim=(-180, 180), ylim=(None, 1.03))
    axes.set_xticks(range(-180, 181, 60))
    return figure


# --- The stopping rule ------------------------------------------------------------------------------------------------


@styled
def threshold_forms(multiplier: Array, linear: Array, square_root: Array, chosen: Mapping[int, float]) -> Figure:
    """Figure 3: both printed forms of the threshold against the multiplier, and how much one more changes them.

    multiplier: consecutive whole numbers; chosen: the thresholds in use by their multipliers.
    """
    figure = plt.figure(figsize=(TEXT_WIDTH, 2.4))
    level, rate = figure.subplots(1, 2)
    forms = (
        (linear, "$1-(m\\pi)^{-1/2}$", ORANGE, (0, (4, 2)), (6, -14)),
        (square_root, "$1-(\\pi\\sqrt{m})^{-1}$", BLUE, "-", (24, 8)),
    )
    for values, name, colour, dashes, offset in forms:
        level.plot(multiplier, values, color=colour, linestyle=dashes)
        place = multiplier.size // 3
        level.annotate(name, (multiplier[place], values[place]), offset, textcoords="offset points", color=colour)
        rate.plot(multiplier[1:], np.diff(values), color=colour, linestyle=dashes)
    for number, value in chosen.items():
        level.plot(number, value, "o", color=BLUE, markersize=4)
    text = "\n".join(f"$m$ = {number}: {value:.4f}" for number, value in sorted(chosen.items(), reverse=True))
    level.text(0.52, 0.3, f"in use:\n{text}", transform=level.transAxes, color=BLUE)
    level.set(
        xlabel="multiplier $m$", ylabel="threshold $\\psi$ (similarity)", xlim=(0, multiplier[-1]), ylim=(None, 1)
    )
    times = float(np.mean(np.diff(linear) / np.diff(square_root)))
    middle = multiplier.size // 3
    rate.annotate(
        f"the second form changes\n{times:.2f} times more finely",
        (multiplier[middle], np.diff(square_root)[middle - 1]),
        (0.05, 0.08),
        textcoords="axes fraction",
        arrowprops=_LEADER,
        color=BLUE,
    )
    rate.set(
        xlabel="multiplier $m$", ylabel="rise of $\\psi$ from $m-1$ to $m$", yscale="log", xlim=(0, multiplier[-1])
    )
    return figure


@styled
def passing_shares(shares: Mapping[str, float], selective: Sequence[str] = ()) -> Figure:
    """Share of random poses that pass for home, by the reading of sigma^2; those in `selective` stand out."""
    figure = plt.figure(figsize=(0.8 * TEXT_WIDTH, 0.42 + 0.3 * len(shares)))
    axes = figure.subplots()
    places = np.arange(len(shares))[::-1]
    colours = [BLUE if name in selective else GREY for name in shares]
    axes.barh(places, [100 * share for share in shares.values()], height=0.62, color=colours)
    for place, share in zip(places, shares.values(), strict=True):
        axes.annotate(f"{100 * share:.1f} %", (100 * share, place), (4, 0), textcoords="offset points", va="center")
    axes.set_yticks(places, list(shares))
    axes.tick_params(axis="y", length=0)
    axes.set(xlabel="random poses that pass for home (%)", xlim=(0, 112 * max(*shares.values(), 0.01)))
    return figure


# --- Homing -----------------------------------------------------------------------------------------------------------


@styled
def paths(rows: Mapping[str, Sequence[tuple[str, Array]]], room: Room) -> Figure:
    """Figure 5: ways over the floor plan. rows: titles and, a column each, a label and positions of shape (T, 2)."""
    columns = max(len(row) for row in rows.values())
    panel = TEXT_WIDTH / columns
    height = len(rows) * (panel * room.size[1] / room.size[0] + 0.2)
    figure = plt.figure(figsize=(TEXT_WIDTH, height), layout="compressed")
    grid = np.atleast_2d(figure.subplots(len(rows), columns, squeeze=False))
    for axes_row, (title, row), colour in zip(grid, rows.items(), (ORANGE, BLUE) * len(rows), strict=False):
        for axes, (label, positions) in zip(axes_row, row, strict=False):
            draw_floor_plan(axes, room)
            way = np.vstack([room.start[:2], positions])
            axes.plot(way[:, 0], way[:, 1], color=colour, linewidth=0.6, alpha=0.9)
            draw_robot(axes, room.home, 0.07, "white")
            axes.plot(*room.start[:2], "o", color=INK, markersize=3.5)
            axes.plot(*way[-1], "s", color="white", markeredgecolor=INK, markeredgewidth=0.8, markersize=4, zorder=5)
            axes.set_title(label, fontsize=6.5, pad=2, loc="center")
            axes.set(xticks=[], yticks=[])
        axes_row[0].set_ylabel(title, color=colour, fontsize=8)
    return figure


@styled
def learning_curves(
    steps: Array,
    rewards: Array,
    changes: Array,
    random_rewards: Array,
    step_size_rate: Array,
    first: Interval,
    last: Interval,
    random: Interval,
    window: int,
) -> Figure:
    """Figure 6: steps, reward and parameter change an episode, mean and range of the runs, shape (runs, episodes).

    random_rewards: of the uniform random policy; step_size_rate: the step size of each episode as a share of the
    first's; first, last, random: mean steps over the first and last `window` episodes, and of the random policy.
    """
    figure = plt.figure(figsize=(TEXT_WIDTH, 4.3))
    panels = figure.subplot_mosaic([["steps", "steps"], ["rewards", "changes"]], height_ratios=[1.35, 1])
    episodes = np.arange(1, steps.shape[1] + 1)

    top = panels["steps"]
    _mean_and_range(top, episodes, steps)
    top.axhspan(random.low, random.high, color=GREY, alpha=0.25, linewidth=0)
    top.axhline(random.value, color=INK, linestyle=(0, (5, 2)), linewidth=1)
    _note(
        top,
        f"uniform random policy: {_steps(random)}",
        (episodes[-1] + 0.4, 1.08 * random.high),
        va="bottom",
        ha="right",
    )
    for window_episodes, mean, name in ((episodes[:window], first, "first"), (episodes[-window:], last, "last")):
        ends = window_episodes[0] - 0.4, window_episodes[-1] + 0.4
        top.hlines(mean.value, *ends, color=ORANGE, linewidth=2.2)
        _note(top, f"{name} {window}: {_steps(mean)}", (ends[0], steps.min() * 0.82), va="top", ha="left", color=ORANGE)
    top.set(
        title=f"Steps an episode: mean and range of {len(steps)} runs",
        ylabel="steps",
        yscale="log",
        ylim=(steps.min() * 0.5, None),
    )
    top.set_yticks([], minor=True)
    top.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    top.yaxis.set_major_formatter("{x:g}")

    middle = panels["rewards"]
    _mean_and_range(middle, episodes, rewards)
    level = float(np.nanmean(random_rewards))
    middle.axhline(level, color=INK, linestyle=(0, (5, 2)), linewidth=1)
    middle.annotate("uniform random policy", (1, level), (0, -4), textcoords="offset points", va="top")
    middle.set(title="Reward an episode", ylabel="summed reward")

    right = panels["changes"]
    _mean_and_range(right, episodes, changes)
    share = step_size_rate * np.nanmean(changes[:, 0]) / step_size_rate[0]
    right.plot(episodes, share, color=INK, linestyle=(0, (1, 1.5)), linewidth=1)
    right.annotate(
        "the step size's own fall",
        (episodes[-1], share[-1]),
        (0, 26),
        textcoords="offset points",
        ha="right",
        arrowprops=_LEADER,
    )
    right.set(title="Parameter change an episode", ylabel="summed $|\\Delta\\theta|$", yscale="log")
    for axes in panels.values():
        axes.set(xlabel="episode", xlim=(0.4, episodes[-1] + 0.6), xticks=episodes[[0, *range(4, episodes.size, 5)]])
    return figure


@styled
def lambda_trace(lambda_: Array, clipped: Array, similarity: Array, thresholds: Thresholds) -> Figure:
    """Lambda at every step of an episode, and which values eq. (7) would have put outside [0, 1]."""
    figure = plt.figure(figsize=(TEXT_WIDTH, 2.6))
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=[1.3, 1])
    step = np.arange(1, lambda_.size + 1)
    cut = clipped.astype(bool)
    upper.vlines(step, 0, lambda_, color=SKY, linewidth=0.8)
    upper.plot(step[~cut], lambda_[~cut], "o", color=BLUE, markersize=2.5)
    upper.plot(step[cut], lambda_[cut], "x", color=ORANGE, markersize=3, markeredgewidth=0.7)
    upper.set(ylabel="$\\lambda_t$", ylim=(-0.08, 1.08), yticks=[0, 0.5, 1])
    upper.set_title(f"dots: as eq. (7) gives it; crosses: reset to 0 or 1 ({cut.mean():.0%} of the steps)")
    lower.plot(step, similarity, color=BLUE, linewidth=1)
    lower.set(xlabel="step", ylabel="similarity NRB", xlim=(0, step[-1] + 1), ylim=(None, 1))
    _level(lower, thresholds.upper, "$\\psi_{upper}$")
    return figure


# --- Parts ------------------------------------------------------------------------------------------------------------

_LEADER = {"arrowstyle": "-", "color": GREY, "linewidth": 0.6, "shrinkA": 1, "shrinkB": 3}


def _picture(axes: Axes, image: Image, title: str) -> None:
    axes.imshow(image[:, :, :3])
    axes.set(title=title, xticks=[], yticks=[])
    axes.spines[:].set_visible(False)


def draw_floor_plan(axes: Axes, room: Room) -> None:
    """Walls and what stands in the room."""
    axes.add_patch(patches.Rectangle((0, 0), *room.size, fill=False, edgecolor=INK, linewidth=1))
    for thing in room.objects:
        shape: patches.Patch
        if isinstance(thing, Box):
            length, width, _ = thing.size
            shape = patches.Rectangle((thing.x - length / 2, thing.y - width / 2), length, width)
        else:
            shape = patches.Circle((thing.x, thing.y), thing.radius)
        shape.set(facecolor="#C8C8C8", edgecolor=INK, linewidth=0.5)
        axes.add_patch(shape)
    axes.set(xlim=(-0.01, room.size[0] + 0.01), ylim=(-0.01, room.size[1] + 0.01), aspect="equal")
    axes.spines[:].set_visible(False)


def _in_metres(axes: Axes, room: Room) -> None:
    axes.set(xlabel="x (m)", ylabel="y (m)", xlim=(0, room.size[0]), ylim=(0, room.size[1]))
    axes.set(xticks=np.arange(0, room.size[0], 0.25), yticks=np.arange(0, room.size[1] + 0.01, 0.25))


def draw_robot(axes: Axes, pose: Pose, diameter: float, fill: str) -> None:
    radius = diameter / 2
    axes.add_patch(patches.Circle(pose[:2], radius, facecolor=fill, edgecolor=INK, linewidth=0.9, zorder=3))
    tip = pose.x + radius * cos(pose.heading), pose.y + radius * sin(pose.heading)
    axes.plot([pose.x, tip[0]], [pose.y, tip[1]], color=INK, linewidth=1.4, zorder=4)


def _field_of_view(axes: Axes, pose: Pose, settings: Settings) -> None:
    eye = np.array(pose[:2]) + settings.camera_offset_m * np.array([cos(pose.heading), sin(pose.heading)])
    heading, half = degrees(pose.heading), settings.field_of_view_deg / 2
    reach = 3.0  # beyond every wall; the axes cut it
    axes.add_patch(
        patches.Wedge(tuple(eye), reach, heading - half, heading + half, color="white", alpha=0.3, linewidth=0)
    )
    for side in (heading - half, heading + half):
        end = eye + reach * np.array([cos(radians(side)), sin(radians(side))])
        axes.plot(*zip(eye, end, strict=True), color="white", linewidth=0.8)


def _mean_and_range(axes: Axes, episodes: NDArray[np.int64], table: Array) -> None:
    finished = np.ma.masked_invalid(table)  # in an episode that no run finished there is nothing to draw
    axes.fill_between(episodes, finished.min(axis=0), finished.max(axis=0), color=SKY, alpha=0.3, linewidth=0)
    axes.plot(episodes, finished.mean(axis=0), "o-", color=BLUE, markersize=3)


def _level(axes: Axes, value: float, name: str) -> None:
    axes.axhline(value, color=INK, linestyle=(0, (5, 2)), linewidth=0.8)
    axes.annotate(name, (0.01, value), (0, 2), xycoords=("axes fraction", "data"), textcoords="offset points")


def _note(axes: Axes, text: str, at: tuple[float, float], **options: Any) -> None:
    """Text on a light ground, so that it can be read over a picture."""
    ground = {"boxstyle": "round,pad=0.18", "facecolor": "white", "alpha": 0.75, "linewidth": 0}
    axes.text(*at, text, fontsize=7, bbox=ground, zorder=5, **options)


def _steps(mean: Interval) -> str:
    return f"{mean.value:.0f} steps [{mean.low:.0f}, {mean.high:.0f}]"
