"""The one style of all figures, and what several of them draw: the room from above, levels, notes.

Colours are Okabe and Ito's, which the colour-blind tell apart; lines differ in style or weight too, for grey prints.
Home is a white square and the start a white triangle wherever they are drawn; both point where the robot looks.
"""

from collections.abc import Callable, Mapping
from functools import wraps
from math import cos, pi, radians, sin
from typing import Any, ParamSpec

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
from matplotlib import patches
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter, NullLocator
from numpy.typing import NDArray

from homing_lib.features import Array
from homing_lib.rooms import Box, Pose, Room
from homing_lib.settings import Settings

Image = NDArray[np.uint8]
P = ParamSpec("P")

TEXT_WIDTH = 6.3  # inches, of the report

BLUE, ORANGE, GREEN, SKY, GREY, INK = "#0072B2", "#D55E00", "#009E73", "#56B4E9", "#8A8A8A", "#222222"
_DASHES = "-", (0, (4, 1.5)), (0, (1, 1)), (0, (6, 1.5, 1, 1.5)), (0, (2, 1)), (0, (8, 2)), "-"
LINES = tuple(zip((BLUE, ORANGE, GREEN, INK, "#CC79A7", GREY, SKY), _DASHES, strict=True))
"""Colours and dashes of several curves in one panel, in order."""

COLOURS = {
    "form 2": BLUE,
    "fixed 0": ORANGE,
    "best fixed": GREEN,
    "standard": "#CC79A7",
    "climb": GREY,
    "random": INK,
    "learning on": SKY,
    "frozen": "#E69F00",
    "camera": "#7A5195",
}
"""One for each thing, in all figures."""

DASHED: dict[str, Any] = {"color": INK, "linestyle": (0, (5, 2)), "linewidth": 0.8}
"""A level that something is held against."""

STYLE: dict[Any, Any] = {
    "font.family": "DejaVu Sans",
    **dict.fromkeys(("font.size", "axes.labelsize", "axes.titlesize", "legend.fontsize"), 8),
    "axes.titlelocation": "left",
    **dict.fromkeys(("axes.linewidth", "xtick.major.width", "ytick.major.width"), 0.6),
    **dict.fromkeys(("axes.edgecolor", "axes.labelcolor", "text.color"), INK),
    **dict.fromkeys(("axes.spines.top", "axes.spines.right"), False),
    "lines.linewidth": 1.4,
    "lines.solid_capstyle": "round",
    "figure.dpi": 150,
    "figure.constrained_layout.use": True,
    "savefig.dpi": 200,
    "pdf.fonttype": 42,
    "image.cmap": "cividis",
    "image.interpolation": "nearest",
}


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
    draw_ends(axes, room)
    axes.set(xlim=(-0.01, room.size[0] + 0.01), ylim=(-0.01, room.size[1] + 0.01), aspect="equal", xticks=[], yticks=[])
    axes.spines[:].set_visible(False)


def draw_ends(axes: Axes, room: Room, diameter_m: float = 0.07) -> None:
    """Home, a square, and the start, a triangle: as wide as the robot, and pointing where it looks."""
    radius = diameter_m / 2
    look: dict[str, Any] = {"closed": True, "facecolor": "white", "edgecolor": INK, "linewidth": 0.9, "zorder": 3}
    home, start = room.home, room.start
    axes.add_patch(patches.Polygon([_ahead(home, radius * 2**0.5, pi / 4 + k * pi / 2) for k in range(4)], **look))
    axes.plot(*zip(home[:2], _ahead(home, radius), strict=True), color=INK, linewidth=1.4, zorder=4)
    axes.add_patch(patches.Polygon([_ahead(start, 1.3 * radius, turn) for turn in (0.0, 2.4, -2.4)], **look))


def draw_walls(axes: Axes, room: Room, thick: float = 0.035) -> None:
    """The walls around the room in their colours, and the pictures on them."""
    width, depth = room.size
    sides = {
        "east": (width, 0, thick, depth),
        "west": (-thick, 0, thick, depth),
        "north": (-thick, depth, width + 2 * thick, thick),
        "south": (-thick, -thick, width + 2 * thick, thick),
    }
    for name, (x, y, length, height) in sides.items():
        axes.add_patch(patches.Rectangle((x, y), length, height, color=room.walls[name].rgb, linewidth=0))
    for picture in room.pictures:
        x, y, length, height = sides[picture.wall]
        size, first = picture.size[0], picture.along - picture.size[0] / 2
        place = ((first, y), size, height) if picture.wall in ("north", "south") else ((x, first), length, size)
        axes.add_patch(patches.Rectangle(*place, facecolor=picture.texture.rgb, edgecolor="white"))
    axes.set(xlim=(-thick, width + thick), ylim=(-thick, depth + thick))


def in_sight(pose: Pose, room: Room, settings: Settings, rays: int = 121) -> Array:
    """Corners of the floor that the camera overlooks, shape (rays + 1, 2): itself, then where each ray is stopped."""
    eye = np.array(_ahead(pose, settings.camera_offset_m))
    half = radians(settings.field_of_view_deg) / 2
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


def in_metres(axes: Axes, room: Room) -> None:
    axes.set(xlabel="x (m)", ylabel="y (m)")
    axes.set(xticks=np.arange(0, room.size[0], 0.25), yticks=np.arange(0, room.size[1] + 0.01, 0.25))


def _ahead(pose: Pose, metres: float, turn: float = 0.0) -> tuple[float, float]:
    return pose.x + metres * cos(pose.heading + turn), pose.y + metres * sin(pose.heading + turn)


def picture(axes: Axes, image: Image, title: str) -> None:
    axes.imshow(image[:, :, :3])
    axes.set(title=title, xticks=[], yticks=[])
    axes.spines[:].set_visible(False)


def level(axes: Axes, value: float, name: str, at: float = 0.01) -> None:
    """A horizontal line that has a name; at: where the name begins, as a share of the width."""
    axes.axhline(value, **DASHED)
    beside(axes, name, (at, value), (0, 4), xycoords=("axes fraction", "data"))


def beside(axes: Axes, text: str, at: tuple[float, float], points: tuple[float, float], **options: Any) -> None:
    """Text that stands so many points right of a place and above it."""
    axes.annotate(text, at, points, textcoords="offset points", **options)


def note(axes: Axes, text: str, at: tuple[float, float], **options: Any) -> None:
    """Text on a light ground, so that it can be read over a picture."""
    ground = {"boxstyle": "round,pad=0.18", "facecolor": "white", "alpha": 0.75, "linewidth": 0}
    axes.text(*at, text, fontsize=8, bbox=ground, zorder=5, **options)


def label_ends(axes: Axes, ends: Mapping[str, tuple[float, float]]) -> None:
    """Names of curves, coloured as LINES, right of their ends; moved apart where they would overlap, and then tied."""
    axes.figure.canvas.draw()
    scale = axes.figure.dpi / 72
    least = 1e-12 if axes.get_yscale() == "log" else -np.inf
    heights = {name: axes.transData.transform((1, max(y, least)))[1] / scale for name, (_, y) in ends.items()}
    tints = dict(zip(ends, (colour for colour, _ in LINES), strict=False))
    tie: dict[str, Any] = {"arrowstyle": "-", "linewidth": 0.5, "shrinkA": 0, "shrinkB": 1, "relpos": (0, 0.5)}
    place = -np.inf
    for name in sorted(ends, key=lambda name: heights[name]):
        place = max(heights[name], place + 9.5)
        moved, tint = place - heights[name], tints[name]
        tied, right = (tie | {"color": tint}, 11) if moved > 3 else (None, 5)
        beside(axes, name, ends[name], (right, moved), va="center", color=tint, annotation_clip=False, arrowprops=tied)


def plain_log(axes: Axes, which: str, *, narrow: bool = False) -> None:
    """A logarithmic axis with 10, 20, 50, 100 written out, and more where it is short."""
    axis = axes.yaxis if which == "y" else axes.xaxis
    low, high = axis.get_view_interval()
    wide = bool(high > (20 if narrow else 8) * low)
    fine = (1, 1.2, 1.5, 2, 2.5, 3, 4, 5, 6, 8)
    if high < 2.5 * low:
        steps = fine if high > 1.7 * low else (1, 1.1, 1.2, 1.3, *range(5, 10))
    else:
        steps = ((1, 2, 5), (1, 3))[wide] if narrow else (fine, (1, 2, 5))[wide]
    axis.set_major_locator(LogLocator(subs=steps))
    axis.set_minor_locator(LogLocator(subs=tuple(range(1, 10))) if wide or narrow else NullLocator())
    axis.set_major_formatter("{x:g}")
    axis.set_minor_formatter(NullFormatter())
