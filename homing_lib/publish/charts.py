"""The figures of the questions, one colour for one thing. Each takes what was found, or stored tables; `figures.save`
writes them.

Marks tell words apart: a full disc or square is fewer or more, a full diamond the same, a hollow one undecided.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from homing_lib.features import Array
from homing_lib.publish import drawing
from homing_lib.publish.drawing import COLOURS, DASHED, GREY, INK, TEXT_WIDTH, plain_log, styled
from homing_lib.rooms import Room
from homing_lib.study.bootstrap import Interval, band
from homing_lib.study.findings import Comparison, Finding

SHAPES = {"fewer": ("o", True), "more": ("s", True), "the same": ("D", True), "undecided": ("D", False)}
"""Marker, and whether it is full, by word."""


class Panel(NamedTuple):
    """Rows of intervals: by row, one for each series. reference: what they are held against; log: on such a scale."""

    label: str
    rows: Mapping[str, Sequence[Any]]
    reference: float | None = None
    log: bool = False


@styled
def forest(*panels: Panel, series: Mapping[str, str] | None = None, height: float = 0.27) -> Figure:
    """Intervals in rows, in one panel or several. series: names of those in a row, and their colours."""
    names, colours = list(series or {"": INK}), list((series or {"": INK}).values())
    rows = list(panels[0].rows)
    size = TEXT_WIDTH, 0.85 + height * len(rows)
    figure, (grid,) = plt.subplots(1, len(panels), sharey=True, squeeze=False, figsize=size)
    met = set()
    for axes, panel in zip(grid, panels, strict=True):
        for place, row in enumerate(rows):
            some = panel.rows[row]
            for number, (one, colour) in enumerate(zip(some, colours, strict=False)):
                at = place + (number - (len(some) - 1) / 2) * 0.32
                word = getattr(one, "word", "")
                met.add(word)
                mark(axes, one, at, colour, word)
        if panel.reference is not None:
            axes.axvline(panel.reference, **DASHED, zorder=0)
        axes.set_xlabel(panel.label)
        if panel.log:
            axes.set_xscale("log")
            plain_log(axes, "x", narrow=len(panels) > 3)
        axes.set_ylim(len(rows) - 0.5, -0.5)
        axes.tick_params(axis="y", length=0)
    grid[0].set_yticks(range(len(rows)), rows)
    _key(figure, dict(zip(names, colours, strict=True)) if series else {}, met)
    return figure


def mark(axes: Axes, one: Any, at: float, colour: str, word: str = "") -> None:
    """An interval in a row, its estimate in the shape of its word."""
    marker, full = SHAPES.get(word, ("o", True))
    axes.hlines(at, one.low, one.high, color=colour, linewidth=1.3)
    face = colour if full else "white"
    axes.plot(one.value, at, marker=marker, color=colour, markerfacecolor=face, markersize=4.5, linestyle="")


def _key(figure: Figure, series: Mapping[str, str], words: set[str]) -> None:
    handles = [Line2D([], [], color=colour, marker="o", markersize=4.5, label=name) for name, colour in series.items()]
    for word, (marker, full) in SHAPES.items():
        if word in words:
            look: dict[str, Any] = {"marker": marker, "color": INK, "markerfacecolor": INK if full else "white"}
            handles.append(Line2D([], [], linestyle="", markersize=4.5, label=word, **look))
    if handles:
        options: dict[str, Any] = {"loc": "outside upper left", "ncols": min(len(handles), 6), "frameon": False}
        figure.legend(handles=handles, handlelength=1.6, columnspacing=1.2, **options)


def banded(axes: Axes, table: Array, x: Sequence[float] | Array, colour: str, dashes: Any = "-") -> None:
    """Mean over the robots and its 95 % interval, shaded. table: shape (robots, len(x))."""
    middle, low, high = band(table)
    axes.fill_between(x, low, high, color=colour, alpha=0.25, linewidth=0)
    axes.plot(x, middle, color=colour, linestyle=dashes)


# --- printed ----------------------------------------------------------------------------------------------------------


@styled
def printed(found: Finding, groups: Mapping[str, Mapping[str, str]]) -> Figure:
    """Steps of the first episodes (a ring) and of the last (a mark), and of random actions in the same world (a bar).

    groups: by title, conditions by what their rows are called.
    """
    sizes = [len(rows) for rows in groups.values()]
    size = TEXT_WIDTH, 0.75 + 0.25 * sum(sizes) + 0.25 * len(sizes)
    figure, grid = plt.subplots(len(groups), 1, sharex=True, squeeze=False, height_ratios=sizes, figsize=size)
    for axes, (title, rows) in zip(grid.flat, groups.items(), strict=True):
        for place, condition in enumerate(rows.values()):
            first, last = found[f"{condition}.early"], found[f"{condition}.late"]
            chance = last.value / found[f"{condition}.of random"].value
            words = {found[f"{condition}.{against}"].verdict for against in ("of first", "of random")}
            axes.plot([first.value, last.value], [place, place], color=GREY, linewidth=0.8, zorder=0)
            axes.plot(first.value, place, "o", color=INK, markerfacecolor="white", markersize=4.5)
            axes.plot(chance, place, "|", color=COLOURS["random"], markersize=9, markeredgewidth=1.6)
            learns = words == {"fewer"}
            mark(axes, last, place, COLOURS["form 2"] if learns else COLOURS["frozen"], "fewer" if learns else "more")
        axes.set_yticks(range(len(rows)), list(rows))
        axes.set(ylim=(len(rows) - 0.5, -0.5), title=title, xscale="log")
        axes.tick_params(axis="y", length=0)
    plain_log(grid[-1, 0], "x")
    grid[-1, 0].set_xlabel("steps per episode")
    handles = [
        Line2D([], [], marker="o", color=INK, markerfacecolor="white", linestyle="", label="first five episodes"),
        Line2D([], [], marker="o", color=COLOURS["form 2"], label="last five: it learns"),
        Line2D([], [], marker="s", color=COLOURS["frozen"], label="last five: it does not"),
        Line2D([], [], marker="|", color=INK, linestyle="", markersize=9, label="random actions"),
    ]
    figure.legend(handles=handles, loc="outside upper left", ncols=4, frameon=False, columnspacing=1.0)
    return figure


@styled
def finalists(means: Mapping[str, Interval], scores: Mapping[str, float]) -> Figure:
    """Steps of the best candidates of the calibration on new seeds, with intervals, and in the search (bars)."""
    figure, axes = plt.subplots(figsize=(TEXT_WIDTH, 0.8 + 0.22 * len(means)))
    for place, (row, one) in enumerate(means.items()):
        mark(axes, one, place, INK)
        axes.plot(scores[row], place, "|", color=GREY, markersize=9, markeredgewidth=1.8)
    axes.set_yticks(range(len(means)), list(means))
    axes.set(ylim=(len(means) - 0.5, -0.5), xscale="log")
    axes.set_xlabel("steps per episode, episodes 11 to 20 (dots: on new seeds; bars: in the search)", loc="right")
    plain_log(axes, "x")
    axes.tick_params(axis="y", length=0)
    return figure


# --- learns -----------------------------------------------------------------------------------------------------------


@styled
def learns(
    atlas: Array, camera: Array, levels: Mapping[str, float], frozen: Mapping[int, Comparison], title: str = ""
) -> Figure:
    """Learning curves of the robots on the atlas and of those with the camera, shape (robots, episodes) each; levels by
    name; and what the same robots take when they are frozen, by the number of episodes after which.
    """
    figure, axes = plt.subplots(figsize=(TEXT_WIDTH, 3.1))
    number = np.arange(1, atlas.shape[1] + 1)
    for table, colour, dashes in ((atlas, COLOURS["form 2"], "-"), (camera, COLOURS["camera"], (0, (4, 1.5)))):
        banded(axes, table, number, colour, dashes)
    for after, one in frozen.items():
        axes.vlines(after, one.low, one.high, color=COLOURS["frozen"], linewidth=1.4)
        axes.plot(after, one.value, "s", color=COLOURS["frozen"], markersize=5)
        drawing.beside(axes, f"frozen after {after}", (after, one.value), (-6, 6), ha="right", color=COLOURS["frozen"])
    axes.set(xlabel="episode", ylabel="steps per episode", yscale="log", xlim=(1, number[-1] + 0.3), title=title)
    for name, value in levels.items():
        drawing.level(axes, value, name)
    plain_log(axes, "y")
    axes.xaxis.set_major_locator(MaxNLocator(6, integer=True))
    drawing.beside(axes, f"{len(atlas):,} robots on the atlas", (6.2, 240), (0, 0), color=COLOURS["form 2"])
    drawing.beside(axes, f"{len(camera)} with the camera", (1.5, 78), (0, 0), color=COLOURS["camera"])
    return figure


# --- drives -----------------------------------------------------------------------------------------------------------

WAYS = {
    "restored": "restored: weights learnt, learning on",
    "frozen": "frozen: weights learnt, no learning",
    "forgetful": "forgetful: initial weights, learning on",
    "untrained": "untrained: initial weights, no learning",
}
"""The four ways in which a robot is tried, in words."""


@styled
def drives(found: Finding, rows: Mapping[str, str], kinds: Mapping[str, str] = WAYS, what: str = "steps") -> Figure:
    """Steps of a trial in several ways, a row each. rows: names by the prefix of the finding's; kinds: ways by name."""
    figure, axes = plt.subplots(figsize=(TEXT_WIDTH, 0.85 + 0.09 * len(kinds) + 0.33 * len(rows)))
    look = {
        "restored": ("o", COLOURS["learning on"], True),
        "learning on": ("o", COLOURS["learning on"], True),
        "frozen": ("s", COLOURS["frozen"], True),
        "greedy": ("v", COLOURS["frozen"], False),
        "forgetful": ("o", COLOURS["learning on"], False),
        "untrained": ("s", COLOURS["frozen"], False),
        "climb": ("^", COLOURS["climb"], True),
        "random": ("|", COLOURS["random"], True),
    }
    for place, prefix in enumerate(rows.values()):
        every = [found[f"{prefix}.{kind}.{what}"] for kind in kinds]
        axes.plot(
            [min(one.value for one in every), max(one.value for one in every)], [place] * 2, color="0.85", zorder=0
        )
        for kind, one in zip(kinds, every, strict=True):
            marker, colour, full = look[kind]
            axes.hlines(place, one.low, one.high, color=colour, linewidth=1.5)
            face = colour if full else "white"
            size = 9 if marker == "|" else 5.5
            axes.plot(
                one.value,
                place,
                marker=marker,
                color=colour,
                markerfacecolor=face,
                markersize=size,
                markeredgewidth=1.3,
            )
    axes.set_yticks(range(len(rows)), list(rows))
    axes.set(ylim=(len(rows) - 0.5, -0.5), xscale="log", xlabel="steps of a trial (at most 2,000)")
    plain_log(axes, "x")
    axes.tick_params(axis="y", length=0)
    handles = [
        Line2D(
            [],
            [],
            marker=look[kind][0],
            color=look[kind][1],
            markerfacecolor=look[kind][1] if look[kind][2] else "white",
            linestyle="",
            label=name,
        )
        for kind, name in kinds.items()
    ]
    figure.legend(handles=handles, loc="outside upper left", ncols=2, frameon=False)
    return figure


@styled
def stuck(
    paths: Mapping[str, Sequence[Array]], room: Room, shares: Mapping[str, tuple[Comparison, Comparison]]
) -> Figure:
    """Where robots drive, learning on and frozen, and how often they take the same action again.

    paths: by title, steps of one trial or several (columns x, y first); shares: by who, that share after the view came
    closer, and after it did not.
    """
    ratios = [*[1.0] * len(paths), 1.35]
    figure, grid = plt.subplots(1, len(paths) + 1, width_ratios=ratios, figsize=(TEXT_WIDTH, 2.35))
    for axes, (title, several) in zip(grid[:-1], paths.items(), strict=True):
        drawing.draw_floor_plan(axes, room)
        colour = COLOURS["frozen"] if "rozen" in title else COLOURS["learning on"]
        for path in several:
            axes.plot(*np.vstack([room.start[:2], path[:, :2]]).T, color=colour, linewidth=0.8, alpha=0.8)
            axes.plot(*path[-1, :2], "o", color=INK, markersize=3)
        axes.set_title(title)
    axes = grid[-1]
    for place, (up, down) in enumerate(shares.values()):
        for one, marker, full in ((up, "^", True), (down, "v", False)):
            axes.hlines(place, one.low, one.high, color=INK, linewidth=1.2)
            axes.plot(one.value, place, marker, color=INK, markerfacecolor=INK if full else "white", markersize=5.5)
    axes.axvline(1 / 3, **DASHED, zorder=0)
    axes.set_yticks(range(len(shares)), list(shares))
    axes.set(ylim=(len(shares) - 0.5, -0.5), xlim=(-0.05, 1.05), xlabel="same action again (share of steps)")
    axes.set_title("▲ after the view came closer,\n▽ after it did not", fontsize=8)
    axes.tick_params(axis="y", length=0)
    return figure


# --- conjugate --------------------------------------------------------------------------------------------------------


@styled
def conjugate(found: Finding, lambda_: Array, reset: NDArray[np.bool_]) -> Figure:
    """lambda_t of one episode, its resets marked; and what becomes of the steps of all, by update."""
    figure, (trace, shares) = plt.subplots(1, 2, width_ratios=[1.7, 1], figsize=(TEXT_WIDTH, 2.1))
    step = np.arange(1, len(lambda_) + 1)
    trace.vlines(step, 0, lambda_, color=COLOURS["form 2"], linewidth=0.9)
    trace.plot(step[~reset], lambda_[~reset], "o", color=COLOURS["form 2"], markersize=3.5)
    trace.plot(step[reset], lambda_[reset], "o", color=COLOURS["form 2"], markerfacecolor="white", markersize=3.5)
    trace.set(xlabel="step of one episode", ylabel="$\\lambda_t$", ylim=(-0.05, 1.08))
    trace.set_title("hollow: reset to 0 or 1")
    rows = {
        "follows conjugate gradient": "until",
        "since the last restart": "restarted",
        "reset to 0": "to_0",
        "reset to 1": "to_1",
    }
    for place, name in enumerate(rows.values()):
        for update, colour, up in (("taken", INK, -0.15), ("all", GREY, 0.15)):
            one = found[f"{update}.{name}"]
            shares.barh(place + up, 100 * one.value, 0.28, color=colour)
            shares.hlines(place + up, 100 * one.low, 100 * one.high, color="0.5", linewidth=1)
    shares.set_yticks(range(len(rows)), list(rows))
    shares.set(ylim=(len(rows) - 0.5, -0.5), xlim=(0, 100), xlabel="steps (%)")
    shares.set_title("grey: all weights updated", loc="right")
    shares.tick_params(axis="y", length=0)
    return figure


# --- varying and rooms ------------------------------------------------------------------------------------------------

UPDATES = {"the paper's update": INK, "all weights updated": GREY}
OPPONENTS = {
    "fixed 0": "fixed0",
    "the best fixed λ": "best",
    "draws from its own λ": "draws",
    "the gate": "gate",
    "the opposite gate": "opposite",
    "form 1": "form1",
    "form 3": "form3",
    "a fixed λ at its mean": "mean",
}


def varying(found: Finding) -> Figure:
    """Form 2 against each opponent, under both updates: total steps, late steps of the typical robot, robots lost."""

    def panel(label: str, endpoint: str, reference: float, log: bool) -> Panel:
        rows = {
            name: [found[f"paper.{update}.{key}.{endpoint}"] for update in ("taken", "all")]
            for name, key in OPPONENTS.items()
        }
        return Panel(label, rows, reference, log)

    return forest(
        panel("total steps / theirs\n(left: form 2 takes fewer)", "total", 1, True),
        panel("late steps / theirs,\ntypical robot", "late", 1, True),
        panel("share lost − theirs\n(the same within .02)", "lost", 0, False),
        series=UPDATES,
    )


def own_mean(found: Finding) -> Figure:
    """Each varying rule against a fixed lambda at its own mean, under both updates: total steps."""
    rows = {
        name: [
            found[f"paper.{update}.mean.total" if key == "form2" else f"own.{update}.{key}.total"]
            for update in ("taken", "all")
        ]
        for name, key in {
            "form 2": "form2",
            "form 1": "form1",
            "form 3": "form3",
            "the gate": "gate",
            "the opposite gate": "opposite",
        }.items()
    }
    return forest(Panel("total steps / those of a fixed λ at the rule's own mean", rows, 1, True), series=UPDATES)


def rooms(found: Finding, names: Sequence[str]) -> Figure:
    """Form 2 against four opponents in each room, under both updates, and pooled over the rooms unlike the paper's."""

    def panel(label: str, key: str) -> Panel:
        rows = {room: [found[f"{room}.{update}.{key}.total"] for update in ("taken", "all")] for room in names}
        rows["four rooms, pooled"] = [found[f"pooled.{update}.{key}.total"] for update in ("taken", "all")]
        return Panel(label, rows, 1, True)

    labels = {
        "total steps /\nthose of fixed 0": "fixed0",
        "/ those of the\nbest fixed λ": "best",
        "/ those of draws": "draws",
        "/ those of the gate": "gate",
    }
    return forest(*(panel(label, key) for label, key in labels.items()), series=UPDATES)


LEARNERS = {"form 2": "form2", "fixed λ": "fixed", "standard": "standard", "standard,\nhome masked": "masked"}


def matrix(found: Finding, names: Sequence[str]) -> Figure:
    """Total steps of each learner with what suits each learner, in some rooms."""
    whose = {"as declared": "declared", **{name.replace("\n", " "): key for name, key in LEARNERS.items()}}
    panels = {
        f"{room}: total steps": np.array(
            [[found[f"matrix.{room}.{row}.{key}.steps"].value for key in LEARNERS.values()] for row in whose.values()]
        )
        for room in names
    }
    return cells(panels, list(whose), list(LEARNERS))


# --- cells ------------------------------------------------------------------------------------------------------------


@styled
def cells(panels: Mapping[str, Array], rows: Sequence[str], columns: Sequence[str]) -> Figure:
    """Steps in the cells of several tables: who drives, a column, with what suits whom, a row; the least of each row is
    bold.
    """
    size = TEXT_WIDTH, 0.75 + 0.3 * len(rows)
    figure, (grid,) = plt.subplots(1, len(panels), sharey=True, squeeze=False, figsize=size)
    everything = np.concatenate([values.ravel() for values in panels.values()])
    scale = LogNorm(everything.min(), everything.max())
    middle = np.sqrt(everything.min() * everything.max())
    for axes, (title, values) in zip(grid, panels.items(), strict=True):
        axes.pcolormesh(values, norm=scale, cmap="cividis_r", edgecolor="white", linewidth=0.8)
        for (row, column), value in np.ndenumerate(values):
            weight = "bold" if values[row].argmin() == column else "normal"
            colour = "white" if value > middle else INK
            axes.text(column + 0.5, row + 0.5, f"{value:,.0f}", ha="center", va="center", color=colour, weight=weight)
        axes.set_xticks(np.arange(len(columns)) + 0.5, columns)
        axes.set(title=title, ylim=(len(rows), 0), xlabel="who learns (bold: the fewest of a row)")
        axes.tick_params(length=0)
        axes.spines[:].set_visible(False)
    grid[0].set_yticks(np.arange(len(rows)) + 0.5, rows)
    grid[0].set_ylabel("calibrated for")
    return figure


# --- worth ------------------------------------------------------------------------------------------------------------


@styled
def worth(found: Finding, rooms: Sequence[str], episodes: Sequence[int], starts: Mapping[str, str]) -> Figure:
    """Steps of all episodes so far, as a multiple of the climb's, by episode and room. starts: titles, by name."""
    figure, (grid,) = plt.subplots(1, len(starts), sharey=True, squeeze=False, figsize=(TEXT_WIDTH, 2.7))
    for axes, (start, title) in zip(grid, starts.items(), strict=True):
        ends = {}
        for room, (colour, dashes) in zip(rooms, drawing.LINES, strict=False):
            every = [found[f"{room}.{start}.{number}"] for number in episodes]
            axes.fill_between(
                episodes, [one.low for one in every], [one.high for one in every], color=colour, alpha=0.2, lw=0
            )
            axes.plot(episodes, [one.value for one in every], color=colour, linestyle=dashes)
            ends[room] = float(episodes[-1]), every[-1].value
        axes.axhline(1, **DASHED)
        axes.set(title=title, xlabel="episodes so far", yscale="log", xlim=(episodes[0], episodes[-1]))
        plain_log(axes, "y")
        if axes is grid[-1]:
            drawing.label_ends(axes, ends)
    grid[0].set_ylabel("steps / those of the climb")
    return figure


TRIED = {
    "published training, learning on": ("published.restored", "o", "learning on", True),
    "published training, frozen": ("published.frozen", "s", "frozen", True),
    "published training, frozen and climbing": ("published.climbing", "P", "frozen", False),
    "extension, learning on": ("extension.restored", "o", "best fixed", False),
    "extension, frozen and climbing": ("extension.climbing", "P", "best fixed", True),
    "the climb": ("published.climb", "^", "climb", True),
    "random actions": ("published.random", "|", "random", True),
}
"""Who is tried in `everywhere`: names of the finding's, marker, colour, and whether it is full."""


@styled
def everywhere(found: Finding, rooms: Sequence[str]) -> Figure:
    """Steps of a trial from the room's start and from everywhere, by room: learnt and tried in several ways."""
    panels = {"start_steps": "from the room's start", "steps": "from everywhere"}
    figure, grid = plt.subplots(1, 2, sharey=True, figsize=(TEXT_WIDTH, 1.15 + 0.36 * len(rooms)))
    for axes, (column, title) in zip(grid, panels.items(), strict=True):
        for place, room in enumerate(rooms):
            for key, marker, colour, full in TRIED.values():
                one, tint = found[f"{room}.{key}.{column}"], COLOURS[colour]
                axes.hlines(place, one.low, one.high, color=tint, linewidth=1.4)
                look: dict[str, Any] = {"color": tint, "markerfacecolor": tint if full else "white"}
                axes.plot(one.value, place, marker, markersize=9 if marker == "|" else 5.5, **look)
        axes.set(title=title, xscale="log", xlabel="steps of a trial (at most 2,000)", ylim=(len(rooms) - 0.5, -0.5))
        plain_log(axes, "x", narrow=True)
        axes.tick_params(axis="y", length=0)
    grid[0].set_yticks(range(len(rooms)), list(rooms))
    handles = [
        Line2D([], [], marker=marker, color=COLOURS[colour], linestyle="", label=name)
        if full
        else Line2D([], [], marker=marker, color=COLOURS[colour], markerfacecolor="white", linestyle="", label=name)
        for name, (_, marker, colour, full) in TRIED.items()
    ]
    figure.legend(handles=handles, loc="outside upper left", ncols=2, frameon=False, columnspacing=1.0)
    return figure


@styled
def maps(panels: Mapping[str, tuple[Array, Array, Array]], room: Room, label: str) -> Figure:
    """A share (0 to 1) at each place of a grid, drawn over the floor plan. panels: by title, x, y (m) and the share."""
    size = TEXT_WIDTH, 0.35 + 0.9 * TEXT_WIDTH / len(panels) * room.size[1] / room.size[0]
    figure, (grid,) = plt.subplots(1, len(panels), squeeze=False, figsize=size, layout="compressed")
    for axes, (title, (x, y, values)) in zip(grid, panels.items(), strict=True):
        shown = axes.scatter(x, y, c=100 * values, s=62, marker="s", vmin=0, vmax=100, linewidth=0)
        drawing.draw_floor_plan(axes, room)
        axes.set_title(title)
    figure.colorbar(shown, ax=grid, label=label, shrink=0.8)
    return figure


# --- home -------------------------------------------------------------------------------------------------------------


@styled
def home(
    similarity: Array, room: Room, psi_upper: float, turned: Array, profile: Array, stops: tuple[Array, Array, Array]
) -> Figure:
    """Similarity over the room at home's heading, with the stops of robots; and by heading at home, likewise.

    similarity: shape (rows of y, columns of x), NaN where no robot fits; turned, profile: degrees and similarity;
    stops: x, y (m) and degrees from home's heading.
    """
    width, depth = room.size
    figure, (plan, heading) = plt.subplots(1, 2, figsize=(TEXT_WIDTH, 2.7), width_ratios=[1.15, 1], layout="compressed")
    shown = plan.imshow(similarity, origin="lower", extent=(0, width, 0, depth), vmax=1)
    figure.colorbar(shown, ax=plan, label="similarity NRB", shrink=0.85)
    rows, columns = similarity.shape
    x, y = (np.arange(columns) + 0.5) * width / columns, (np.arange(rows) + 0.5) * depth / rows
    plan.contour(x, y, similarity, levels=[psi_upper], colors="white", linewidths=1.4)
    every = slice(None, None, max(1, len(stops[0]) // 500))
    plan.plot(stops[0][every], stops[1][every], ".", color=COLOURS["frozen"], markersize=2, alpha=0.8)
    drawing.draw_floor_plan(plan, room)
    plan.set_title("dots: where robots stopped")
    heading.plot(turned, profile, color=INK)
    heading.axhline(psi_upper, **DASHED)
    drawing.beside(
        heading, "$\\psi_{upper}$: it stops above", (0.02, psi_upper), (0, -12), xycoords=("axes fraction", "data")
    )
    count, edges = np.histogram(stops[2], bins=np.arange(-95, 96, 10))
    floor = profile.min()
    heading.bar(edges[:-1] + 5, 0.14 * count / count.max(), 8, bottom=floor, color=COLOURS["frozen"], alpha=0.6)
    heading.set(
        xlabel="turned from home's heading (degrees)",
        ylabel="similarity NRB",
        xlim=(-90, 90),
        xticks=range(-90, 91, 45),
    )
    heading.set_title("bars: where robots looked")
    return figure
