"""Figures of numbers in rows, each with its 95 % interval."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from matplotlib.figure import Figure

from homing_lib.publish.parts import handle, key, log_axis, mark, name_rows, panels
from homing_lib.publish.style import COLOURS, DASHED, GREY, INK, SHAPES, Look, shown_as, styled
from homing_lib.study.bootstrap import Interval
from homing_lib.study.findings import Comparison, Finding

UPDATES = {"the paper's update": "taken", "all weights updated": "all"}
"""The two updates, as a finding names them; black and grey."""


class Panel(NamedTuple):
    """Rows of intervals: by row, one for each series. reference: what they are held against; if 0, the scale is linear,
    else logarithmic.
    """

    label: str
    rows: Mapping[str, Sequence[Comparison | Interval]]
    reference: float = 1


@styled
def forest(*blocks: Panel, series: Sequence[str] = ()) -> Figure:
    """Intervals in rows, in one panel or several. series: names of those in a row, the first black, the second grey."""
    rows = list(blocks[0].rows)
    figure, grid = panels(0.85 + 0.27 * len(rows), len(blocks), sharey=True)
    met = set()
    for axes, block in zip(grid, blocks, strict=True):
        for place, row in enumerate(rows):
            beside = block.rows[row]
            for number, (interval, colour) in enumerate(zip(beside, (INK, GREY), strict=False)):
                met.add(word := getattr(interval, "verdict", ""))
                mark(axes, interval, place + (number - (len(beside) - 1) / 2) * 0.32, shown_as(word, colour))
        axes.axvline(block.reference, **DASHED, zorder=0)
        axes.set_xlabel(block.label)
        if block.reference != 0:
            log_axis(axes, "x", narrow=len(blocks) > 3 or max(map(len, rows)) > 30)
        name_rows(axes, rows)
    handles = [handle(name, Look(colour), 4.5, "-") for name, colour in zip(series, (INK, GREY), strict=False)]
    handles += [handle(word, shown_as(word), 4.5) for word in SHAPES if word in met]
    if handles:
        key(figure, handles, min(len(handles), 6), handlelength=1.6, columnspacing=1.2)
    return figure


# --- printed ----------------------------------------------------------------------------------------------------------

LEARNS, FAILS = Look(COLOURS["form 2"]), Look(COLOURS["frozen"], "s")
FIRST, CHANCE = Look(INK, "o", full=False), Look(COLOURS["random"], "|")


@styled
def printed(finding: Finding, groups: Mapping[str, Mapping[str, str]]) -> Figure:
    """Steps of the first episodes (a ring) and of the last (a mark), and of random actions in the same world (a bar).

    groups: by title, conditions by what their rows are called.
    """
    sizes = [len(rows) for rows in groups.values()]
    height = 0.75 + 0.21 * sum(sizes) + 0.25 * len(sizes)
    figure, grid = panels(height, rows=len(groups), sharex=True, height_ratios=sizes)
    for axes, (title, rows) in zip(grid, groups.items(), strict=True):
        for place, condition in enumerate(rows.values()):
            first, last = finding[f"{condition}.early"], finding[f"{condition}.late"]
            chance = last.value / finding[f"{condition}.of random"].value
            words = {finding[f"{condition}.{against}"].verdict for against in ("of first", "of random")}
            axes.plot([first.value, last.value], [place, place], color=GREY, linewidth=0.8, zorder=0)
            axes.plot(first.value, place, **FIRST.line(7))
            axes.plot(chance, place, **CHANCE.line(9), markeredgewidth=1.6)
            mark(axes, last, place, LEARNS if words == {"fewer"} else FAILS)
        name_rows(axes, [row.replace("epsilon", "ε") for row in rows])
        axes.set_title(title)
    log_axis(axes, "x")
    axes.set_xlabel("steps per episode")
    handles = [
        handle("first five episodes", FIRST),
        handle("last five: it learns", LEARNS, dashes="-"),
        handle("last five: it does not", FAILS, dashes="-"),
        handle("random actions", CHANCE, 9),
    ]
    key(figure, handles, 4, columnspacing=1.0)
    return figure


# --- drives, and worth: robots tried in several ways ------------------------------------------------------------------

WAYS = {
    "restored": "restored: weights learnt, learning on",
    "frozen": "frozen: weights learnt, no learning",
    "forgetful": "forgetful: initial weights, learning on",
    "untrained": "untrained: initial weights, no learning",
}
"""The four ways in which a robot is tried, in words."""

LOOKS = {
    "restored": Look(COLOURS["learning on"]),
    "frozen": Look(COLOURS["frozen"], "s"),
    "greedy": Look(COLOURS["frozen"], "v", full=False),
    "forgetful": Look(COLOURS["learning on"], full=False),
    "untrained": Look(COLOURS["frozen"], "s", full=False),
    "climb": Look(COLOURS["climb"], "^"),
    "random": Look(COLOURS["random"], "|"),
}
"""How those are marked, and others beside them."""

TRIED = {
    "form 2, restored": ("published.restored", LOOKS["restored"]),
    "form 2, frozen": ("published.frozen", LOOKS["frozen"]),
    "form 2, frozen and climbing": ("published.climbing", Look(COLOURS["frozen"], "P")),
    "extension, restored": ("extension.restored", Look(COLOURS["extension"], full=False)),
    "extension, frozen and climbing": ("extension.climbing", Look(COLOURS["extension"], "P", full=False)),
    "the climb": ("published.climb", LOOKS["climb"]),
    "random actions": ("published.random", LOOKS["random"]),
}
"""Who is tried in `everywhere`: how the finding names it, and how it is marked."""

TRIAL = "steps of a trial (at most 2,000)"


@styled
def drives(finding: Finding, rows: Mapping[str, str], kinds: Mapping[str, str] = WAYS) -> Figure:
    """Steps of a trial in several ways, a row each. rows: names by the prefix of the finding's; kinds: ways by name."""
    figure, (axes,) = panels(0.85 + 0.09 * len(kinds) + 0.33 * len(rows))
    for place, prefix in enumerate(rows.values()):
        steps = {kind: finding[f"{prefix}.{kind}.steps"] for kind in kinds}
        ends = [extreme(tried.value for tried in steps.values()) for extreme in (min, max)]
        axes.plot(ends, [place, place], color="0.85", zorder=0)
        for kind, tried in steps.items():
            mark(axes, tried, place, LOOKS[kind], 5.5, 1.5, markeredgewidth=1.3, linestyle="-")
    name_rows(axes, rows)
    axes.set_xlabel(TRIAL)
    log_axis(axes, "x")
    key(figure, [handle(name, LOOKS[kind]) for kind, name in kinds.items()], 2)
    return figure


@styled
def everywhere(finding: Finding, rooms: Sequence[str]) -> Figure:
    """Steps of a trial from the room's start and from everywhere, by room: learnt and tried in several ways."""
    figure, grid = panels(1.15 + 0.6 * len(rooms), 2, sharey=True)
    starts = {"start_steps": "from the room's start", "steps": "from everywhere"}
    for axes, (column, title) in zip(grid, starts.items(), strict=True):
        for place, room in enumerate(rooms):
            for number, (name, look) in enumerate(TRIED.values(), -3):
                mark(axes, finding[f"{room}.{name}.{column}"], place + 0.11 * number, look, 5.5, 1.4)
        name_rows(axes, rooms)
        axes.set(title=title, xlabel=TRIAL)
        log_axis(axes, "x", narrow=True)
    key(figure, [handle(name, look) for name, (_, look) in TRIED.items()], 2, columnspacing=1.0)
    return figure


# --- varying and rooms: form 2 against opponents ----------------------------------------------------------------------

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


def under_both(finding: Finding, rows: Mapping[str, str]) -> dict[str, list[Comparison]]:
    """By row, what was found under each update. rows: names in the finding, with {} for that of the update."""
    return {row: [finding[name.format(update)] for update in UPDATES.values()] for row, name in rows.items()}


def varying(finding: Finding) -> Figure:
    """Form 2 against each opponent, under both updates: total steps, late steps of the typical robot, robots lost."""

    def rows(endpoint: str) -> dict[str, list[Comparison]]:
        return under_both(finding, {row: f"paper.{{}}.{name}.{endpoint}" for row, name in OPPONENTS.items()})

    return forest(
        Panel("total steps / theirs\n(left: form 2 takes fewer)", rows("total")),
        Panel("late steps / theirs,\ntypical robot", rows("late")),
        Panel("share lost − theirs\n(the same within .02)", rows("lost"), reference=0),
        series=list(UPDATES),
    )


def rooms(finding: Finding, names: Sequence[str]) -> Figure:
    """Form 2 against four opponents in each room, under both updates, and pooled over the rooms unlike the paper's."""

    def panel(label: str, opponent: str) -> Panel:
        places = {name: name for name in names} | {"four rooms, pooled": "pooled"}
        rows = {row: f"{place}.{{}}.{opponent}.total" for row, place in places.items()}
        return Panel(label, under_both(finding, rows))

    return forest(
        panel("total steps /\nthose of fixed 0", "fixed0"),
        panel("/ those of the\nbest fixed λ", "best"),
        panel("/ those of draws", "draws"),
        panel("/ those of the gate", "gate"),
        series=list(UPDATES),
    )


# --- today: form 2 beside other learners ------------------------------------------------------------------------------

LEARNERS = {
    "swift-sarsa": "Swift-Sarsa (2025)",
    "true-online": "true online Sarsa(λ) (2016)",
    "lambda-greedy": "λ-greedy (2016)",
    "step-size-bound": "bound on the step size (2012)",
    "natural-actor-critic": "natural actor-critic (2009)",
    "tdc": "TDC (2009)",
    "scaled-conjugate-gradient": "scaled conjugate gradient (2001)",
    "residual-gradient": "residual gradient (1995)",
    "standard": "standard Sarsa(λ)",
    "bounded form 2": "form 2, steps bounded",
    "least-squares": "least squares (a ceiling)",
}
"""Those of `today`, by their names in the finding: the youngest first, then what stands beside them."""


def today(finding: Finding) -> Figure:
    """Each method against form 2 in two rooms: total steps, late steps of the typical robot, robots lost. Beside its
    name what a step costs, as a multiple of Sarsa(lambda): in the paper's room and, where it differs, in the attic.
    """

    def rows(endpoint: str) -> dict[str, list[Comparison]]:
        return {
            f"{row}, {cost(name)}": [finding[f"{room}.{name}.{endpoint}"] for room in ("paper", "attic")]
            for name, row in LEARNERS.items()
        }

    def cost(name: str) -> str:
        each = dict.fromkeys(f"{finding[f'{room}.{name}.cost'].value:,.4g}" for room in ("paper", "attic"))
        return f"{' and '.join(each)} ×"

    return forest(
        Panel("total steps /\nform 2's\n(left: fewer)", rows("total")),
        Panel("late steps / form 2's,\ntypical robot", rows("late")),
        Panel("share lost − form 2's\n(the same within .02)", rows("lost"), reference=0),
        series=["the paper's room", "the attic"],
    )
