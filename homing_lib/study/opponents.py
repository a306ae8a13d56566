"""What learning is worth: against robots that do not learn, and from anywhere; what stops it, and what it follows."""

from typing import Any

import numpy as np

from homing_lib.features import Array
from homing_lib.rooms import room_named
from homing_lib.settings import Settings
from homing_lib.study.claims import Comparison, Judged, Verdict, claim, compare, counted, interval_of, percent, whether
from homing_lib.study.measures import TRIAL_STEPS, episodes
from homing_lib.study.probes import (
    ABOUT_HOME,
    ANYWHERE,
    AT_HOME,
    CLIMBING,
    DRIVEN,
    directions,
    nearest_way,
    placed,
    rules_of_stopping,
    searched,
    where_lost,
)
from homing_lib.study.runs import episodes_of
from homing_lib.study.statistics import Interval, knife_edge, over_runs, side
from homing_lib.study.studies import FRESH, study
from homing_lib.thresholds import stopping_thresholds

# --- Studies ---------------------------------------------------------------------------------------------------------

ROOMS = ("paper", "attic", "workshop")

_CAMERA = Settings()
_COARSER = Settings(images="atlas", atlas_spacing_m=0.03)

_NOT_LEARNING = {"episodes": 1, "max_steps": TRIAL_STEPS}
_CLIMB: dict[str, Any] = {"controller": "climb", **_NOT_LEARNING}

_WAYS: dict[str, dict[str, Any]] = {
    "as published": {},
    "from everywhere": {"episodes": 100, "start": "uniform"},
    "from everywhere, constant cost": {"episodes": 100, "start": "uniform", "step_cost": "constant"},
    "from everywhere, constant cost, all updated": {
        "episodes": 100,
        "start": "uniform",
        "step_cost": "constant",
        "update": "all",
    },
    "from everywhere, constant cost, fixed 0": {
        "episodes": 100,
        "start": "uniform",
        "step_cost": "constant",
        "lambda_rule": "fixed:0",
    },
}

SEARCH = study(
    "anywhere-search",
    "How does a robot learn to come home from anywhere? Starts drawn from the whole room, a constant cost, other "
    "updates, a longer schedule, each tried with exploration that climbs. On seeds that nothing is judged by.",
    {
        f"{room}, {way}": _COARSER.with_changes(room=room, **changes)
        for room in ROOMS[:2]
        for way, changes in {**_WAYS, "climb": _CLIMB}.items()
    },
    range(4),
    searched,
)

CHOSEN = "from everywhere, constant cost, all updated"
"""What `chosen` found in the search; it and `CLIMBING` are the declared extension."""


def _after(number: int) -> dict[str, Any]:
    """The first episodes of twenty, their step size and exploration included."""
    return {"episodes": number, "first_episode_share": Settings().first_episode / number}


_WHO: dict[str, dict[str, Any]] = {
    **{f"after {number}": _after(number) for number in (5, 10, 20)},
    "extension": _WAYS[CHOSEN],
    "climb": _CLIMB,
    "random": {"controller": "random", **_NOT_LEARNING},
}

OPPONENTS = study(
    "opponents",
    "What is learning worth, from the usual start and from everywhere? Robots that stopped to learn after 5, 10 and 20 "
    "episodes, the declared extension (`anywhere-search`), a climb up the similarity and random actions.",
    {f"{room}, {who}": _COARSER.with_changes(room=room, **how) for room in ROOMS for who, how in _WHO.items()},
    FRESH[:20],
    placed,
)

LOST = study(
    "where-lost",
    "Where do robots end that do not come home, and what do they do there?",
    {room: _COARSER.with_changes(room=room) for room in ROOMS},
    FRESH[:10],
    where_lost,
)

EPISODES = 60  # of those in which learning may pay for itself

WORTH = study(
    "worth",
    "When does learning pay for itself? The steps of all episodes are counted, also those of the first, with the rates "
    "of the published schedule continued to sixty episodes, each from the usual start and each from anywhere.",
    {
        f"{room}, {controller}, {start}": _COARSER.with_changes(
            room=room, controller=controller, start=start, **_after(EPISODES)
        )
        for room in ROOMS
        for controller in ("sarsa", "climb")
        for start in ("room", "uniform")
    },
    FRESH[:20],
    episodes,
)

NEAREST = study(
    "nearest-way",
    "How many steps does the shortest way take, from the usual start and from ten places? Where a wall stops all three "
    "actions there is none without the reflex, and no number.",
    {room: _COARSER.with_changes(room=room) for room in ROOMS},
    FRESH[:3],
    nearest_way,
)

ORIENTATION = study(
    "orientation",
    "At which places and headings does a rule stop the robot: that of eq. (19), one on raw images, and one on three "
    "snapshots (claim C5)? Each at the same share of false alarms.",
    {room: _CAMERA.with_changes(room=room) for room in ROOMS[:2]},
    FRESH[:5],
    rules_of_stopping,
)

EQUIVALENCE = study(
    "equivalence",
    "For how many steps of a run do the updates point where conjugate gradient does (claim C1)?",
    {update: _COARSER.with_changes(update=update) for update in ("all", "taken")},
    FRESH[:30],
    directions,
)


# --- From anywhere: what was chosen ----------------------------------------------------------------------------------


def chosen(tried: Any) -> tuple[str, float]:
    """The way to learn and the share at which to climb that are farthest ahead of the climb from everywhere.

    Of those with which at least 97 % of the trials come home in each of the two rooms (95 % are to be reached, with all
    of an interval): the one whose steps, as a multiple of the climb's, are least in the room where they are most.
    tried: of `SEARCH`.
    """
    everywhere = tried[tried.usual == 0].copy()
    everywhere[["room", "way"]] = everywhere.condition.astype(str).str.split(", ", n=1, expand=True).to_numpy()
    of_room = everywhere.groupby(["way", "share", "room"], observed=True)[["steps", "reached"]].mean()
    of_room["ratio"] = of_room.steps / of_room.loc[("climb", 0.0)].steps
    found = of_room.drop(index="climb").groupby(["way", "share"]).agg({"ratio": "max", "reached": "min"})
    way, share = found[found.reached >= 0.97].ratio.idxmin()
    return way, round(float(share), 2)


# --- What is compared ------------------------------------------------------------------------------------------------


def trials(of: Any, condition: str, share: float = 0.0, usual: bool = False) -> Any:
    """Rows of `OPPONENTS`: of one condition, one share of climbing, from everywhere or from the usual start."""
    return of[(of.condition == condition) & np.isclose(of.share, share) & (of.usual == usual)]


def per_run(rows: Any, column: str = "steps") -> Array:
    """Mean of a column of trials, one number per run. A run that diverged, with none, counts as lost in each."""
    lost = TRIAL_STEPS if column == "steps" else 0.0
    values: Array = rows.groupby("seed", observed=True)[column].mean().reindex(list(OPPONENTS.seeds)).to_numpy(float)
    return np.where(np.isnan(values), lost, values)


def paid_back(ours: Array, theirs: Array, family: int = 1) -> Interval:
    """The episode from which on our steps, added up from the first, stay below theirs; one past the last: never.

    ours, theirs: shape (runs, episodes). The seeds are resampled. family: how many comparisons the question makes.
    """
    gap = np.cumsum(ours - theirs, axis=1)

    def since(runs: Array) -> int:
        return int(np.flatnonzero(np.r_[True, gap[runs].mean(axis=0) >= 0])[-1]) + 1

    return over_runs(since, len(gap), np.random.default_rng(0), family)


def beyond_home(rows: Any, room: str) -> Any:
    """Whether a trial began no farther back than home, for who stands there: beside it, or behind its objects."""
    home = room_named(room).home
    return (rows.x - home.x) * np.cos(home.heading) + (rows.y - home.y) * np.sin(home.heading) >= 0


FAR_M, TURNED_DEG = 0.25, 45.0
"""A stop is a false alarm farther from home than this, or turned from home's heading by more.

At .25 m the nearer of home's objects, some .2 m ahead of home, have been passed, or look half as large. At 45 degrees,
the camera's field of view, a robot at home's place sees nothing of what the snapshot shows.
"""

RULES = ("one", "three", "raw")


def false_alarms(views: Any) -> Any:
    """The views all over the room at which a stop would be one. views: rows of `ORIENTATION`, of one room."""
    return views[(views.kind == ANYWHERE) & ((views.away_m > FAR_M) | (views.turned_deg.abs() > TURNED_DEG))]


def thresholds(views: Any) -> dict[str, float]:
    """What each rule of stopping must exceed, for as many false alarms all over the room as eq. (19) gives."""
    false = false_alarms(views)
    alarms = _alarms(false)
    return {rule: float(np.sort(false[rule])[-1 - alarms]) for rule in RULES}


def _alarms(false: Any) -> int:
    return int((false.one >= stopping_thresholds(Settings().multiplier).upper).sum())


def tolerance(views: Any, rule: str, threshold: float) -> tuple[float, float]:
    """Where a rule fires: width of the headings at home's place (degrees), and area of the places that face as home
    does (square centimetres), means over seeds.
    """
    fires = views[views[rule] > threshold]
    runs = views.seed.nunique()
    straight = fires[(fires.kind == ABOUT_HOME) & (fires.turned_deg.abs() < 1)]
    return 2.0 * (fires.kind == AT_HOME).sum() / runs, 9.0 * len(straight) / runs


def stops(views: Any, rule: str, threshold: float) -> tuple[float, float]:
    """Mean distance (m) and turn (degrees) from home of the views at which a robot that drives at random is stopped."""
    drive = views[views.kind == DRIVEN]
    fires = (drive[rule] > threshold).to_numpy()
    begins = drive[fires & ~np.r_[False, fires[:-1]]]
    return float(begins.away_m.mean()), float(begins.turned_deg.abs().mean())


def _told(found: dict[str, Any]) -> str:
    return "; ".join(f"{room} {one:.2f}, {one.word}{knife_edge(*one)}" for room, one in found.items())


# --- Judges ----------------------------------------------------------------------------------------------------------


@claim("C1", "TD-conj is TD(λ) with the λ of eq. (7)", EQUIVALENCE)
def equivalence(of: Any) -> Judged:
    """Weak: with all weights updated, no episode leaves the direction before its first reset of λ. Strong: at least
    95 % of the steps follow it, with all weights updated and with those of the taken action. Partly: only the weak one.
    """
    share = {}
    for update in ("all", "taken"):
        rows = of[of.condition == update]
        sums = rows.groupby("seed", observed=True)[["steps", "unclipped", "until", "follows", "restarted"]].sum()
        share[update] = {
            name: interval_of((sums[name] / sums.steps).to_numpy(float)) for name in ("until", "follows", "restarted")
        }
    every = of[of.condition == "all"]
    weak = bool((every.until >= every.unclipped).all())
    strong = min(shares["follows"].low for shares in share.values()) >= 0.95
    return (
        ("reproduced" if strong else "partly reproduced") if weak else "not reproduced",
        f"It holds until an episode's first reset of λ{'' if weak else ', not always'}. On the robot, with all weights "
        f"updated, {percent(share['all']['until'])} % of the steps come before the direction is left; with those of "
        f"the taken action, {percent(share['taken']['until'])} %. Of a conjugate gradient that starts afresh where λ "
        f"is reset to 0, {percent(share['all']['restarted'])} % and {percent(share['taken']['restarted'])} % follow "
        "it.",
    )


@claim("C5", "the stopping rule is less sensitive to orientation", ORIENTATION)
def orientation(of: Any) -> Judged:
    """At the same share of false alarms it fires over a wider range of headings at home than a rule on raw images and
    one on three snapshots, in both rooms; partly: than the one on raw images; not reproduced: over a narrower range
    than that one in both; else not shown. A false alarm: a stop more than {FAR_M:g} m from home, or turned by more than
    {TURNED_DEG:g} degrees. Eq. (19) at its printed threshold says how many there are of the views from all over the
    room; each rule, eq. (19) too, then fires above the greatest view that leaves it as many, set anew in each sample of
    the seeds. The range is 2 degrees times the headings at which it fires, of one every 2 degrees.
    """
    told, wider = [], {"three": [], "raw": []}  # type: ignore[var-annotated]
    for room in ORIENTATION.conditions:
        views = of[of.condition == room]
        least = thresholds(views)
        at = {rule: (*tolerance(views, rule, least[rule]), *stops(views, rule, least[rule])) for rule in RULES}
        for rule, others in wider.items():
            others.append(_wider(views, rule))
        told.append(
            f"{room}: "
            + ", ".join(
                f"{name} {at[rule][0]:.0f} degrees at home and {at[rule][1]:.0f} cm² of places (stops "
                f"{100 * at[rule][2]:.0f} cm and {at[rule][3]:.0f} degrees away)"
                for rule, name in zip(RULES, ("eq. (19)", "three snapshots", "raw images"), strict=True)
            )
            + f"; wider than three snapshots by {wider['three'][-1]:+.0f} degrees, than raw images by "
            f"{wider['raw'][-1]:+.0f}"
        )
    than = {rule: counted((side(one, 0) for one in found), "above", "below") for rule, found in wider.items()}
    verdict: Verdict = "not reproduced" if than["raw"] == "no" else "not shown"
    if than["raw"] == "yes":
        verdict = "reproduced" if than["three"] == "yes" else "partly reproduced"
    return verdict, f"At the same share of false alarms, of a stop that is far or turned: {'. '.join(told)}."


def _wider(views: Any, rule: str) -> Interval:
    """By how many degrees eq. (19) tolerates more at home than another rule; seeds are resampled, thresholds anew."""
    by_seed = [rows for _, rows in views.groupby("seed", observed=True)]
    false = [false_alarms(rows) for rows in by_seed]
    alarms = np.array([_alarms(rows) for rows in false])
    at_home = [rows[rows.kind == AT_HOME] for rows in by_seed]
    columns = {
        one: ([rows[one].to_numpy() for rows in false], [rows[one].to_numpy() for rows in at_home])
        for one in ("one", rule)
    }

    def width(one: str, draws: Any) -> float:
        far, near = columns[one]
        last = -1 - alarms[draws].sum()
        least = np.partition(np.concatenate([far[draw] for draw in draws]), last)[last]
        return 2.0 * float(np.mean([(near[draw] > least).sum() for draw in draws]))

    def more(draws: Any) -> float:
        return width("one", draws) - width(rule, draws)

    return over_runs(more, len(by_seed), np.random.default_rng(0))


@claim("Q20", "is learning better than a climb up the similarity, from the usual start?", OPPONENTS, NEAREST)
def from_the_usual_start(of: Any, nearest: Any) -> Judged:
    """After 20 episodes the robot, which learns no more and explores as in the last, takes fewer steps than the climb:
    its mean of ten trials from the room's own start, each cut at {TRIAL_STEPS}. Yes: in each room (k = 3); partly: in
    some; no: in none, and comparable or more in each; else not shown.
    """
    found = {room: _against_climb(of, room, usual=True) for room in ROOMS}
    shortest = nearest[nearest.usual == 1].groupby("condition", observed=True).steps.mean()
    least = ", ".join(f"{room} {shortest[room]:.0f}" for room in ROOMS)
    learnt = ", ".join(f"{room} {per_run(trials(of, f'{room}, after 20', usual=True)).mean():.0f}" for room in ROOMS)
    return (
        whether(*found.values()),
        f"Steps of the climb's: {_told(found)}. Mean steps after learning: {learnt}; of the shortest way: {least}.",
    )


@claim("Q21", "is learning better than a climb up the similarity, from everywhere?", OPPONENTS)
def from_everywhere(of: Any) -> Judged:
    """As the question before, from everywhere: a trial at each place of a grid, with a heading of its own."""
    found = {room: _against_climb(of, room) for room in ROOMS}
    home = {
        who: ", ".join(f"{per_run(trials(of, f'{room}, {who}'), 'reached').mean():.0%}" for room in ROOMS)
        for who in _WHO
    }
    told = "; ".join(f"{who} {shares}" for who, shares in home.items())
    return whether(*found.values()), f"Steps of the climb's: {_told(found)}. Trials that reach home: {told}."


def _against_climb(of: Any, room: str, who: str = "after 20", share: float = 0.0, usual: bool = False) -> Comparison:
    ours, theirs = trials(of, f"{room}, {who}", share, usual), trials(of, f"{room}, climb", 0.0, usual)
    return compare(per_run(ours), per_run(theirs), family=len(ROOMS))


def paid_in_rooms(of: Any, start: str) -> dict[str, Interval]:
    """`paid_back` in each room, of the climb. of: the table of `WORTH`; start: "room" or "uniform"."""
    return {
        room: paid_back(
            episodes_of(of, f"{room}, sarsa, {start}"), episodes_of(of, f"{room}, climb, {start}"), len(ROOMS)
        )
        for room in ROOMS
    }


@claim("Q22", "does learning pay for itself, against a climb up the similarity?", WORTH)
def pays(of: Any) -> Judged:
    """From the usual start the steps of all episodes, added up and averaged over the robots, fall below the climb's
    within 20 episodes, in every room with the whole interval (k = 3), and stay there to the last of {EPISODES}; partly:
    within these, in some room; no: in none by then, with the whole interval; else not shown.
    """
    found = {start: paid_in_rooms(of, start) for start in ("room", "uniform")}
    paid = found["room"].values()
    soon = max(one.high for one in paid) <= Settings().episodes
    within = counted((side(one, EPISODES + 0.5) for one in paid), "below", "above")

    def told(start: str) -> str:
        each = [f"{room} {one:.0f}" if one.value <= EPISODES else f"{room} never" for room, one in found[start].items()]
        return ", ".join(each)

    return (
        "yes" if soon else "partly" if within == "yes" else within,
        f"The learner is ahead from episode (of {EPISODES}; {EPISODES + 1}: not by then): {told('room')}; where every "
        f"episode begins anywhere: {told('uniform')}.",
    )


@claim("Q23", "can it learn to come home from anywhere?", OPPONENTS)
def from_anywhere(of: Any) -> Judged:
    """The declared extension (learnt {CHOSEN}, in 100 episodes, climbing in {CLIMBING:.0%} of a trial's steps) brings
    home at least 95 % of the trials from everywhere (the whole interval) and 80 % from the worst place, in fewer steps
    than the climb, in each room (k = 3); partly: in some; no: in each it misses one of the three (the 95 % and the
    steps with the whole interval); else not shown.
    """
    where, told = [], []
    for room in ROOMS:
        ours = trials(of, f"{room}, extension", CLIMBING)
        home = interval_of(per_run(ours, "reached"), len(ROOMS))
        worst = ours.groupby(["x", "y"]).reached.mean().min()
        steps = _against_climb(of, room, "extension", CLIMBING)
        met = home.low >= 0.95 and worst >= 0.8 and steps.side == "below"
        missed = home.high < 0.95 or worst < 0.8 or steps.side == "above"
        where.append("met" if met else "missed" if missed else "open")
        edge = knife_edge(home, margins=(0.95,)) + knife_edge(*steps)
        told.append(f"{room} {percent(home)} %, worst place {worst:.0%}, {steps:.2f} of the climb's steps{edge}")
    return (
        counted(where, "met", "missed"),
        f"Learnt {CHOSEN}, in 100 episodes, climbing in {CLIMBING:.0%} of the trial's steps: {'; '.join(told)}.",
    )


@claim("Q24", "does it take that learning, or does the climbing do it?", OPPONENTS)
def learning_or_climbing(of: Any) -> Judged:
    """With the same climbing, robots that learnt by the extension (Q23) take fewer steps from everywhere than those of
    the published training. Yes: in each room (k = 3); partly: in some; no: in none, and comparable or more in each;
    else not shown.
    """
    found = {
        room: compare(
            per_run(trials(of, f"{room}, extension", CLIMBING)),
            per_run(trials(of, f"{room}, after 20", CLIMBING)),
            family=len(ROOMS),
        )
        for room in ROOMS
    }
    climb = {room: _against_climb(of, room, "after 20", CLIMBING) for room in ROOMS}
    return (
        whether(*found.values()),
        f"Steps of those after the published training: {_told(found)}. Theirs, of the climb's: {_told(climb)}.",
    )


@claim("Q25", "is it beside and behind home that the robot gets lost?", OPPONENTS)
def beside_and_behind(of: Any) -> Judged:
    """After the published training fewer trials reach home from no farther back than home than from the rest of the
    room, with the whole interval, in each room (k = 3); partly: in some; no: more in each; else not shown.
    """
    kinds = {"published": ("after 20", 0.0), "extension": ("extension", 0.0), "climbing": ("extension", CLIMBING)}
    gaps = {
        name: {room: _gap(trials(of, f"{room}, {who}", share), room) for room in ROOMS}
        for name, (who, share) in kinds.items()
    }

    def told(name: str) -> str:
        return ", ".join(f"{room} {percent(one, '+')}" for room, one in gaps[name].items())

    return (
        counted((side(one, 0) for one in gaps["published"].values()), "below", "above"),
        f"The share that reaches home differs there, in percentage points, by {told('published')}. Of robots that "
        f"learnt {CHOSEN}, and so began there too, by {told('extension')}; and "
        f"where they climb in {CLIMBING:.0%} of the steps, by {told('climbing')}.",
    )


def _gap(rows: Any, room: str) -> Interval:
    there = beyond_home(rows, room)
    return interval_of(per_run(rows[there], "reached") - per_run(rows[~there], "reached"), len(ROOMS))


@claim("Q26", "is it the walls that hold a robot that gets lost?", LOST)
def held_by_walls(of: Any) -> Judged:
    """Of the last hundred steps of lost robots more than half are spent at walls, with the whole interval, in each room
    (k = 3); partly: in some; no: less than half in each; else not shown. Of robots that have lost trials.
    """
    at_walls, told = {}, []
    for room in ROOMS:
        rows = of[(of.condition == room) & of.at_wall.notna()]
        of_run = rows.groupby("seed", observed=True).at_wall.mean().to_numpy(float)
        at_walls[room] = interval_of(of_run, len(ROOMS))
        ends = rows.assign(x=rows.end_x, y=rows.end_y)
        told.append(
            f"{room} {percent(at_walls[room])} %, within {100 * rows.spread_m.median():.0f} cm, "
            f"{beyond_home(ends, room).mean():.0%} of them beside or behind home"
        )
    return (
        counted((side(one, 0.5) for one in at_walls.values()), "above", "below"),
        f"Of their last hundred steps lost robots spend at walls: {'; '.join(told)}.",
    )
