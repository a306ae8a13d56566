"""Figures of the room: its views, and what happens where, over the floor plan.

Home is a white square and the start a white triangle wherever they are drawn; both point where the robot looks.
"""

from collections.abc import Mapping, Sequence
from math import pi, radians
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib import patches
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from homing_lib.features import Array
from homing_lib.publish.parts import beside, curve, level, log_axis, mark, name_rows, note, panels, picture
from homing_lib.publish.style import BLUE, COLOURS, DASHED, GREEN, INK, LINES, ORANGE, TEXT_WIDTH, Look, styled
from homing_lib.rooms import Box, Pose, Room
from homing_lib.settings import Settings
from homing_lib.study.bootstrap import band
from homing_lib.study.findings import Comparison
from homing_lib.surfaces import Image


@styled
def home_view(image: Image, scaled_histogram: Array, bin_size: int) -> Figure:
    """The paper's Fig. 1: the snapshot of home and the histogram of each of its channels (eq. 11)."""
    figure, (view, *channels) = panels(1.75, 4, width_ratios=[1.05, 1, 1, 1])
    picture(view, image, "view of home")
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
    """The paper's Fig. 4: the room obliquely and from above, and what the robot sees from both ends of its path.

    In the plan, light: what the camera sees from home and from the start, up to the nearest thing or wall.
    """
    figure = plt.figure(figsize=(TEXT_WIDTH, 2.45), layout="compressed")
    left, plan, upper, lower = figure.subplot_mosaic("oph;ops", width_ratios=[2.3, 2.2, 0.9]).values()
    rows, columns = (np.flatnonzero((oblique < 255).any(axis=(axis, 2))) for axis in (1, 0))  # its margins off
    inner = oblique[rows.min() : rows.max() + 1, columns.min() : columns.max() + 1] if rows.size else oblique
    picture(left, inner, "the room")
    width, depth = room.size
    plan.imshow(top, extent=(0, width, 0, depth))
    _draw_walls(plan, room)
    plan.set(xlabel="x (m)", ylabel="y (m)", xticks=np.arange(0, width, 0.25), yticks=np.arange(0, depth + 0.01, 0.25))
    _draw_ends(plan, room, settings.body_diameter_m)
    for name, pose in (("home", room.home), ("start", room.start)):
        plan.add_patch(patches.Polygon(in_sight(pose, room, settings), color="white", alpha=0.35, linewidth=0.8))
        behind = pose.ahead(-0.07)
        note(plan, name, behind, va="center", ha="right" if behind[0] < pose.x else "left")
    for thing in room.objects:
        ahead, across = (thing.size[0] / 2, thing.size[1] / 2 + 0.05) if isinstance(thing, Box) else (0, thing.radius)
        away = 1 if thing.y >= room.home.y else -1
        at, va = (thing.x + ahead, thing.y + away * (across + 0.02)), "bottom" if away > 0 else "top"
        note(plan, thing.name, at, va=va, ha="right" if ahead else "center")
    picture(upper, home, "from home")
    picture(lower, start, "from the start")
    return figure


@styled
def paths(rows: Mapping[str, Sequence[tuple[str, Array]]], room: Room) -> Figure:
    """The paper's Fig. 5: paths over the floor plan. rows: titles; of each path a label and positions, shape (T, 2)."""
    columns = max(map(len, rows.values()))
    height = len(rows) * (TEXT_WIDTH / columns * room.size[1] / room.size[0] + 0.2)
    figure, grid = panels(height, columns, len(rows), layout="compressed")
    grid, colours = grid.reshape(len(rows), columns), (ORANGE, BLUE) * len(rows)
    for axes_row, (title, row), colour in zip(grid, rows.items(), colours, strict=False):
        for axes, (label, positions) in zip(axes_row, row, strict=False):
            draw_floor_plan(axes, room)
            path = np.vstack([room.start[:2], positions])
            axes.plot(*path.T, color=colour, linewidth=0.7, alpha=0.9)
            axes.plot(*path[-1], "o", color=colour, markeredgecolor=INK, markeredgewidth=0.6, markersize=4, zorder=5)
            axes.set_title(label, fontsize=6.5, pad=2, loc="center")
        axes_row[0].set_ylabel(title, color=colour, fontsize=8)
    return figure


@styled
def stuck(
    ways: Mapping[str, Sequence[Array]], room: Room, shares: Mapping[str, tuple[Comparison, Comparison]]
) -> Figure:
    """Where robots drive, learning on and frozen, and how often they take the same action again.

    ways: by name, of who learns and of who is frozen, steps of one trial or several (columns x, y first); shares: by
    who, that share after the view came closer, and after it did not.
    """
    figure, (*plans, again) = panels(2.35, len(ways) + 1, width_ratios=[*[1.0] * len(ways), 1.35])
    for axes, (title, several), who in zip(plans, ways.items(), ("learning on", "frozen"), strict=True):
        draw_floor_plan(axes, room)
        for way in several:
            passed = np.vstack([room.start[:2], way[:, :2]])
            axes.plot(*passed.T, color=COLOURS[who], linewidth=0.8, alpha=0.8)
            axes.plot(*passed[-1], "o", color=INK, markersize=3)
        axes.set_title(title)
    for place, (closer, farther) in enumerate(shares.values()):
        mark(again, closer, place, Look(INK, "^"), 5.5, 1.2)
        mark(again, farther, place, Look(INK, "v", full=False), 5.5, 1.2)
    again.axvline(1 / 3, **DASHED, zorder=0)
    name_rows(again, shares)
    again.set(xlim=(-0.05, 1.05), xlabel="same action again (share of steps)")
    again.set_title("▲ after the view came closer,\n▽ after it did not", fontsize=8)
    return figure


@styled
def maps(shares: Mapping[str, tuple[Array, Array, Array]], room: Room, label: str) -> Figure:
    """A share (0 to 1) at each place of a grid, drawn over the floor plan. shares: by title, x, y (m) and the share."""
    height = 0.35 + 0.9 * TEXT_WIDTH / len(shares) * room.size[1] / room.size[0]
    figure, grid = panels(height, len(shares), layout="compressed")
    for axes, (title, (x, y, values)) in zip(grid, shares.items(), strict=True):
        columns, rows = np.unique(x), np.unique(y)
        cells = np.full((len(rows), len(columns)), np.nan)
        cells[np.searchsorted(rows, y), np.searchsorted(columns, x)] = 100 * values
        half = (columns[1] - columns[0]) / 2
        extent = (columns[0] - half, columns[-1] + half, rows[0] - half, rows[-1] + half)
        shown = axes.imshow(cells, origin="lower", extent=extent, vmin=0, vmax=100)
        draw_floor_plan(axes, room)
        axes.set_title(title)
    figure.colorbar(shown, ax=list(grid), label=label, shrink=0.8)
    return figure


@styled
def tours(
    room: Room,
    homes: Sequence[Pose],
    legs: Sequence[tuple[int, Array]],
    learning: Array,
    levels: Mapping[str, float],
    frozen: Mapping[int, Comparison],
) -> Figure:
    """A tour over the floor plan, and the steps of a tour, by how many came before.

    legs: which home each seeks, and its positions, shape (T, 2), from where it begins; learning: steps of tours while
    the robots learn on, shape (robots, tours); levels: those of others, by name; frozen: after how many tours, steps.
    """
    figure, (plan, axes) = panels(2.9, 2, width_ratios=[1.15, 1.4])
    draw_floor_plan(plan, room)
    for which, pose in enumerate(homes, 1):
        _draw_home(plan, pose)
        note(plan, str(which), pose.ahead(0.08, pi / 2), ha="center", va="center", fontweight="bold")
    for place, ((goal, path), (colour, dashes)) in enumerate(zip(legs, LINES, strict=False)):
        plan.plot(*path.T, color=colour, linestyle=dashes)
        plan.plot(*path[-1], "o", color=colour, markeredgecolor=INK, markeredgewidth=0.6, markersize=4, zorder=5)
        below = f"to home {goal + 1}: {len(path) - 1} steps"
        beside(plan, below, (0, 0), (0, -11 - 10 * place), xycoords="axes fraction", color=colour)
    plan.set_title("one tour (dots: where it stopped)")
    number = np.arange(1, learning.shape[1] + 1)
    curve(axes, number, band(learning), (COLOURS["learning on"], "-"), alpha=0.35)
    beside(axes, "learning on", (number[1], learning[:, 1].mean()), (8, 2), color=COLOURS["learning on"])
    for after, steps in frozen.items():
        axes.vlines(after, steps.low, steps.high, color=COLOURS["frozen"], linewidth=1.4)
        axes.plot(after, steps.value, "s", color=COLOURS["frozen"], markersize=5)
    beside(axes, "frozen after so many", (after, steps.value), (0, -13), ha="right", color=COLOURS["frozen"])
    axes.set(xlabel="tour", ylabel="steps of a tour", xlim=(1, number[-1]), yscale="log")
    axes.set_title("with a plan")
    for name, value in levels.items():
        level(axes, value, name, at=0.72, up=-11 if name == "the climb" else 4)
    log_axis(axes, "y")
    return figure


@styled
def home(
    similarity: Array, room: Room, psi_upper: float, turned: Array, profile: Array, stops: tuple[Array, Array, Array]
) -> Figure:
    """Similarity over the room at home's heading, with the stops of robots; and by heading at home, likewise.

    similarity: shape (rows of y, columns of x), NaN where no robot fits; turned, profile: degrees and similarity;
    stops: x, y (m) and degrees from home's heading.
    """
    width, depth = room.size
    figure, (plan, heading) = panels(2.7, 2, width_ratios=[1.15, 1], layout="compressed")
    shown = plan.imshow(similarity, origin="lower", extent=(0, width, 0, depth), vmax=1)
    figure.colorbar(shown, ax=plan, label="similarity NRB", shrink=0.85)
    rows, columns = similarity.shape
    x, y = (np.arange(columns) + 0.5) * width / columns, (np.arange(rows) + 0.5) * depth / rows
    plan.contour(x, y, similarity, levels=[psi_upper], colors="white", linewidths=1.4, zorder=3)
    every = slice(None, None, max(1, len(stops[0]) // 500))
    looks = {"color": COLOURS["learning on"], "markeredgecolor": INK, "markeredgewidth": 0.3}  # the edge is for grey
    plan.plot(stops[0][every], stops[1][every], "o", markersize=1.9, **looks)
    draw_floor_plan(plan, room)
    plan.set_title("dots: where robots stopped")
    heading.plot(turned, profile, color=INK)
    heading.axhline(psi_upper, **DASHED)
    at = (0.02, psi_upper)
    beside(heading, "$\\psi_{upper}$: it\nstops above", at, (0, 14), xycoords=("axes fraction", "data"))
    count, edges = np.histogram(stops[2], bins=np.arange(-95, 96, 10))
    floor = profile.min()
    heading.bar(edges[:-1] + 5, 0.14 * count / count.max(), 8, bottom=floor, color=COLOURS["learning on"], alpha=0.6)
    heading.set(xlabel="turned from home's heading (degrees)", xlim=(-90, 90), xticks=range(-90, 91, 45))
    heading.set(ylabel="similarity NRB", title="bars: stops by heading")
    return figure


# --- The room from above ----------------------------------------------------------------------------------------------


def draw_floor_plan(axes: Axes, room: Room) -> None:
    """Walls, what stands in the room, home and the start."""
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
    _draw_ends(axes, room)
    axes.set(xlim=(-0.01, room.size[0] + 0.01), ylim=(-0.01, room.size[1] + 0.01), aspect="equal", xticks=[], yticks=[])
    axes.spines[:].set_visible(False)


def _draw_ends(axes: Axes, room: Room, diameter_m: float = 0.07) -> None:
    """Home, a square, and the start, a triangle: as wide as the robot, and pointing where it looks."""
    radius = diameter_m / 2
    _draw_home(axes, room.home, radius)
    axes.add_patch(patches.Polygon([room.start.ahead(1.3 * radius, turn) for turn in (0.0, 2.4, -2.4)], **_END))


_END: dict[str, Any] = {"closed": True, "facecolor": "white", "edgecolor": INK, "linewidth": 0.9, "zorder": 3}


def _draw_home(axes: Axes, home: Pose, radius: float = 0.035) -> None:
    axes.add_patch(patches.Polygon([home.ahead(radius * 2**0.5, pi / 4 + k * pi / 2) for k in range(4)], **_END))
    axes.plot(*zip(home[:2], home.ahead(radius), strict=True), color=INK, linewidth=1.4, zorder=4)


def _draw_walls(axes: Axes, room: Room) -> None:
    """The walls around the room in their colours, and the pictures on them."""
    width, depth = room.size
    thick = 0.035
    sides = {
        "east": (width, 0, thick, depth),
        "west": (-thick, 0, thick, depth),
        "north": (-thick, depth, width + 2 * thick, thick),
        "south": (-thick, -thick, width + 2 * thick, thick),
    }
    for name, (x, y, length, height) in sides.items():
        axes.add_patch(patches.Rectangle((x, y), length, height, color=room.walls[name].rgb, linewidth=0))
    for hung in room.pictures:
        x, y, length, height = sides[hung.wall]
        size, first = hung.size[0], hung.along - hung.size[0] / 2
        place = ((first, y), size, height) if hung.wall in ("north", "south") else ((x, first), length, size)
        axes.add_patch(patches.Rectangle(*place, facecolor=hung.texture.rgb, edgecolor="white"))
    axes.set(xlim=(-thick, width + thick), ylim=(-thick, depth + thick))


def in_sight(pose: Pose, room: Room, settings: Settings) -> Array:
    """Corners of the floor that the camera sees, shape (122, 2): itself, then where each ray of 121 is stopped."""
    eye = np.array(pose.ahead(settings.camera_offset_m))
    half = radians(settings.field_of_view_deg) / 2
    rays = 121
    angle = pose.heading + np.linspace(-half, half, rays)
    reach = np.linspace(0, float(np.hypot(*room.size)), 1500)
    x, y = (eye[:, None, None] + np.stack([np.cos(angle), np.sin(angle)])[:, :, None] * reach).round(9)
    stopped = (x < 0) | (x > room.size[0]) | (y < 0) | (y > room.size[1])
    for thing in room.objects:
        if isinstance(thing, Box):
            stopped |= (abs(x - thing.x) <= thing.size[0] / 2) & (abs(y - thing.y) <= thing.size[1] / 2)
        else:
            stopped |= np.hypot(x - thing.x, y - thing.y) <= thing.radius
    first = np.arange(rays), stopped.argmax(axis=1)
    return np.vstack([eye, np.stack([x[first], y[first]], axis=1)])
