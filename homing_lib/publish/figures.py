"""The figures of the world, of the stopping rule and of homing. A plot function takes data and returns a figure.

`save` alone writes files. The plots of the studies are in `plots`, the style in `drawing`.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib import patches
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from homing_lib.features import Array
from homing_lib.publish import drawing
from homing_lib.publish.drawing import BLUE, DASHED, GREEN, GREY, INK, ORANGE, SKY, STYLE, TEXT_WIDTH, Image, styled
from homing_lib.rooms import Box, Room
from homing_lib.settings import Settings
from homing_lib.storage import ROOT, atomic_write
from homing_lib.study import findings
from homing_lib.study.bootstrap import Interval


def save(figure: Figure, figures_dir: str | Path | None, name: str) -> None:
    """Write figures_dir/name.pdf and .png, each beside its place and then renamed. The same figure, the same bytes.

    Without a folder nothing is written: a notebook that is run by hand only shows its figures.
    """
    if figures_dir is None:
        return
    for kind, metadata in (("pdf", {"CreationDate": None}), ("png", {"Software": None})):
        with atomic_write(Path(figures_dir) / f"{name}.{kind}") as part, plt.rc_context(STYLE):
            figure.savefig(part, format=kind, metadata=metadata)


def show(name: str, figure: Figure, figures_dir: str | Path | None) -> None:
    """In a notebook: the verdict on a question, its predicate, and its figure, which is saved under its name."""
    from IPython import display

    save(figure, figures_dir, name)
    display.display(display.Markdown(str(findings.finding(name))))  # type: ignore[no-untyped-call]


def stored(name: str) -> None:
    """Show in a notebook the stored figure of this name, where it cannot be drawn: it needs the camera."""
    from IPython import display

    path = ROOT / "figures" / f"{name}.png"
    print(f"This needs PyBullet, which this Python lacks. Drawn earlier: figures/{name}.png")
    if path.exists():
        display.display(display.Image(path))  # type: ignore[no-untyped-call]


@styled
def home_view(image: Image, scaled_histogram: Array, bin_size: int) -> Figure:
    """Figure 1: the snapshot of home and the histogram of each of its channels (eq. 11)."""
    figure, (view, *channels) = plt.subplots(1, 4, figsize=(TEXT_WIDTH, 1.75), width_ratios=[1.05, 1, 1, 1])
    drawing.picture(view, image, "view of home")
    bins = scaled_histogram.reshape(3, -1)
    edges = bin_size * np.arange(bins.shape[1] + 1)
    for axes, name, colour, shares in zip(channels, ("red", "green", "blue"), (ORANGE, GREEN, BLUE), bins, strict=True):
        axes.stairs(100 * shares, edges, fill=True, color=colour, alpha=0.35, linewidth=0)
        axes.stairs(100 * shares, edges, color=colour, linewidth=0.8)
        axes.set(title=name, xlabel="intensity", xlim=(0, 256), ylim=(0, 105 * bins.max()), xticks=[0, 128, 255])
    plt.setp(channels[1:], yticklabels=[])
    channels[0].set_ylabel("pixels in the bin (%)")
    return figure


@styled
def room_views(oblique: Image, top: Image, home: Image, start: Image, room: Room, settings: Settings) -> Figure:
    """Figure 4: the room obliquely and straight from above, and what the robot sees from both ends of its path.

    In the plan, light: what the camera overlooks from home and from the start, up to the nearest thing or wall.
    """
    figure = plt.figure(figsize=(TEXT_WIDTH, 2.45), layout="compressed")
    left, plan, upper, lower = figure.subplot_mosaic("oph;ops", width_ratios=[2.3, 2.2, 0.9]).values()
    rows, columns = (np.flatnonzero((oblique < 255).any(axis=(axis, 2))) for axis in (1, 0))  # its margins off
    inner = oblique[rows.min() : rows.max() + 1, columns.min() : columns.max() + 1] if rows.size else oblique
    drawing.picture(left, inner, "the room")
    plan.imshow(top, extent=(0, room.size[0], 0, room.size[1]))
    drawing.draw_walls(plan, room)
    drawing.in_metres(plan, room)
    drawing.draw_ends(plan, room, settings.body_diameter_m)
    for name, pose in (("home", room.home), ("start", room.start)):
        seen = drawing.in_sight(pose, room, settings)
        plan.add_patch(patches.Polygon(seen, color="white", alpha=0.35, linewidth=0.8))
        drawing.note(plan, name, (pose.x, pose.y - 0.06), va="top", ha="center")
    for thing in room.objects:
        ahead, across = (thing.size[0] / 2, thing.size[1] / 2) if isinstance(thing, Box) else (0, thing.radius)
        away = 1 if thing.y >= room.home.y else -1
        at, va = (thing.x + ahead, thing.y + away * (across + 0.02)), "bottom" if away > 0 else "top"
        drawing.note(plan, thing.name, at, va=va, ha="right" if ahead else "center")
    drawing.picture(upper, home, "from home")
    drawing.picture(lower, start, "from the start")
    return figure


@styled
def threshold_forms(multiplier: Array, linear: Array, square_root: Array, chosen: Mapping[int, float]) -> Figure:
    """Figure 3: both printed forms of the threshold against the multiplier, and how much one more changes them.

    multiplier: consecutive whole numbers; chosen: the thresholds in use by their multipliers.
    """
    figure, (height, rate) = plt.subplots(1, 2, figsize=(TEXT_WIDTH, 2.4))
    forms = (
        (linear, "$1-(m\\pi)^{-1/2}$", ORANGE, (0, (4, 2)), (0, -5), "top"),
        (square_root, "$1-(\\pi\\sqrt{m})^{-1}$", BLUE, "-", (0, 4), "bottom"),
    )
    for values, name, colour, dashes, offset, side in forms:
        height.plot(multiplier, values, color=colour, linestyle=dashes)
        drawing.beside(height, name, (multiplier[-1], values[-1]), offset, ha="right", va=side, color=colour)
        rate.plot(multiplier[1:], np.diff(values), color=colour, linestyle=dashes)
    for number, value in chosen.items():
        height.plot(number, value, "o", color=BLUE, markersize=4)
    used = ",\n".join(f"{value:.4f} at $m$ = {number}" for number, value in sorted(chosen.items(), reverse=True))
    place = min(chosen), min(chosen.values())
    drawing.beside(height, f"in use: {used}", place, (0, 7), ha="center", color=BLUE)
    height.set(ylabel="threshold $\\psi$ (similarity)", ylim=(None, 1.06), yticks=np.arange(0.5, 1.01, 0.1))
    times = float(np.mean(np.diff(linear) / np.diff(square_root)))
    middle = multiplier.size // 2
    place = multiplier[middle], np.diff(square_root)[middle - 1]
    drawing.beside(rate, f"{times:.2f} times finer", place, (-4, -4), ha="right", va="top", color=BLUE)
    rate.set(ylabel="rise of $\\psi$ from $m-1$ to $m$", yscale="log")
    plt.setp((height, rate), xlabel="multiplier $m$", xlim=(0, multiplier[-1]))
    return figure


@styled
def passing_shares(shares: Mapping[str, float], selective: Sequence[str] = ()) -> Figure:
    """Share of random poses that pass for home, by the reading of sigma^2; those in `selective` stand out."""
    figure, axes = plt.subplots(figsize=(0.8 * TEXT_WIDTH, 0.42 + 0.3 * len(shares)))
    places, percent = np.arange(len(shares))[::-1], 100 * np.array(list(shares.values()))
    colours = [BLUE if name in selective else GREY for name in shares]
    bars = axes.barh(places, percent, height=0.62, color=colours, tick_label=list(shares))
    axes.bar_label(bars, fmt="%.1f %%", padding=4)
    axes.tick_params(axis="y", length=0)
    axes.set(xlabel="random poses that pass for home (%)", xlim=(0, 1.12 * max(*percent, 1)))
    if selective:
        passing = " and ".join(f"{shares[name]:.1%}" for name in selective)
        axes.set_title(f"With σ² as it is used here, {passing} of random poses pass for home")
    return figure


@styled
def paths(rows: Mapping[str, Sequence[tuple[str, Array]]], room: Room) -> Figure:
    """Figure 5: paths over the floor plan. rows: titles; of each path a label and the positions, shape (T, 2)."""
    columns = max(map(len, rows.values()))
    size = TEXT_WIDTH, len(rows) * (TEXT_WIDTH / columns * room.size[1] / room.size[0] + 0.2)
    figure, grid = plt.subplots(len(rows), columns, squeeze=False, figsize=size, layout="compressed")
    for axes_row, (title, row), colour in zip(grid, rows.items(), (ORANGE, BLUE) * len(rows), strict=False):
        for axes, (label, positions) in zip(axes_row, row, strict=False):
            drawing.draw_floor_plan(axes, room)
            path = np.vstack([room.start[:2], positions])
            axes.plot(*path.T, color=colour, linewidth=0.7, alpha=0.9)
            axes.plot(*path[-1], "o", color=colour, markeredgecolor=INK, markeredgewidth=0.6, markersize=4, zorder=5)
            axes.set_title(label, fontsize=6.5, pad=2, loc="center")
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
    """Figure 6: steps, reward and parameter change per episode: mean and range of the runs, shape (runs, episodes).

    random_rewards: of the uniform random policy; step_size_rate: the step size of each episode as a share of the
    first's; first, last, random: mean steps over the first and last `window` episodes, and of the random policy.
    """
    figure = plt.figure(figsize=(TEXT_WIDTH, 4.3))
    top, middle, right = figure.subplot_mosaic("ss;rc", height_ratios=[1.35, 1]).values()
    episodes = np.arange(1, steps.shape[1] + 1)

    _mean_and_range(top, episodes, steps)
    top.axhspan(random.low, random.high, color=GREY, alpha=0.25, linewidth=0)
    top.axhline(random.value, **DASHED)
    at = episodes[-1] + 0.4, 1.08 * random.high
    drawing.note(top, f"uniform random policy: {_steps(random)}", at, va="bottom", ha="right")
    for part, mean, name in ((slice(None, window), first, "first"), (slice(-window, None), last, "last")):
        ends = episodes[part][0] - 0.4, episodes[part][-1] + 0.4
        below = 0.85 * steps[:, part].min()
        top.hlines(mean.value, *ends, color=ORANGE, linewidth=2.2)
        top.vlines(ends[0], below, mean.value, color=ORANGE, linewidth=0.6)
        drawing.note(top, f"{name} {window}: {_steps(mean)}", (ends[0], below), va="top", ha="left", color=ORANGE)
    falls = f"Steps per episode fall from {first.value:.0f} to {last.value:.0f}"
    top.set_title(falls if last.high < first.low else "Steps per episode: no fall shown")
    top.set(ylabel=f"steps: mean and range of {len(steps)} runs", yscale="log", ylim=(steps.min() * 0.5, None))
    drawing.plain_log(top, "y")

    _mean_and_range(middle, episodes, rewards)
    drawing.level(middle, float(np.nanmean(random_rewards)), "uniform random policy", at=0.55)
    middle.set(title="Reward per episode", ylabel="summed reward")

    _mean_and_range(right, episodes, changes)
    share = step_size_rate * np.nanmean(changes[:, 0]) / step_size_rate[0]
    right.plot(episodes, share, color=INK, linestyle=(0, (1, 1.5)), linewidth=1)
    drawing.beside(right, "the step size's own fall", (episodes[-1], share[-1]), (0, 11), ha="right")
    right.set(title="Parameter change per episode", ylabel="summed $|\\Delta\\theta|$", yscale="log")
    for axes in figure.axes:
        axes.set(xlabel="episode", xlim=(0.4, episodes[-1] + 0.6), xticks=episodes[[0, *range(4, episodes.size, 5)]])
    return figure


def _mean_and_range(axes: Axes, episodes: NDArray[np.int64], table: Array) -> None:
    finished = np.ma.masked_invalid(table)  # in an episode that no run finished there is nothing to draw
    axes.fill_between(episodes, finished.min(axis=0), finished.max(axis=0), color=SKY, alpha=0.3, linewidth=0)
    axes.plot(episodes, finished.mean(axis=0), "o-", color=BLUE, markersize=3)


def _steps(mean: Interval) -> str:
    return f"{mean.value:.0f} steps [{mean.low:.0f}, {mean.high:.0f}]"
