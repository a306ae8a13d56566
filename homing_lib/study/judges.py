"""The paper's claims, C1 to C17: a predicate for each, which its judge has for docstring.

Where a claim may be read in a weak sense and in a strong one, both are judged (`graded`). Each could come out either
way. What had been seen on the seeds of `JUDGED` when a predicate was written is judged on `FRESH` ones, but for C3 and
C7.
"""

from collections.abc import Iterator
from math import asin, atan2, degrees, hypot, pi
from typing import Any

import numpy as np

from homing_lib.features import Array, bins_per_channel
from homing_lib.robot import wrapped
from homing_lib.rooms import Box, Room, room_named
from homing_lib.settings import Settings
from homing_lib.study import measures, mechanism, opponents, studies
from homing_lib.study.claims import (
    Comparison,
    Judged,
    Verdict,
    at_walls,
    change_by_episode,
    claim,
    compare,
    compare_at_best,
    early,
    first_good,
    interval_of,
    late,
    of_steps,
    percent,
)
from homing_lib.study.measures import WINDOW
from homing_lib.study.opponents import FAR_M, TURNED_DEG
from homing_lib.study.runs import episodes_of
from homing_lib.study.statistics import FEWER_RESAMPLES, MARGIN, Interval, knife_edge, ratio, side
from homing_lib.thresholds import linear, stopping_thresholds

_ATLAS = Settings(images="atlas")

AGAIN = studies.study(
    "again",
    "The model, fixed 0, and what section V.A says makes it fast, on the lattice that agrees with the camera and on "
    "seeds that nobody had seen (claims C4, C6, C11, C12, C13, C16).",
    {
        "form 2": _ATLAS,
        "fixed 0": _ATLAS.with_changes(lambda_rule="fixed:0"),
        "constant cost": _ATLAS.with_changes(step_cost="constant"),
        "no wall penalty": _ATLAS.with_changes(wall_penalty=0.0),
        "wall penalty 1": _ATLAS.with_changes(wall_penalty=1.0),
        "no learning at walls": _ATLAS.with_changes(learn_at_walls=False),
    },
    studies.FRESH,
    measures.episodes,
)

LONGER = studies.study(
    "longer",
    "Two hundred episodes on seeds that nobody had seen: does the policy settle, and on the shortest way (claim C10)?",
    {"form 2": _ATLAS.with_changes(episodes=200)},
    studies.FRESH[:30],
    measures.episodes,
)

ABDUCTED = studies.study(
    "abducted",
    "Carried away in the middle of an episode, does the robot get home as from a start at the same place (claim C9)?",
    {"20 episodes": _ATLAS},
    studies.FRESH[:20],
    measures.abductions,
)


def graded(weak: bool | None, strong: bool | None) -> Verdict:
    """A claim that is true in a weak and in a strong sense is reproduced, in the weak alone, partly. None: open."""
    if weak is None:
        return "not shown"
    return "not reproduced" if not weak else "reproduced" if strong else "partly reproduced"


def above(found: Interval, bound: float) -> bool | None:
    """Whether a number exceeds a bound, with its whole interval; None: open."""
    return {"above": True, "below": False, "open": None}[side(found, bound)]


def below(found: Interval, bound: float) -> bool | None:
    """Whether a number falls short of a bound, with its whole interval; None: open."""
    return {"below": True, "above": False, "open": None}[side(found, bound)]


def alike(found: Interval) -> bool | None:
    """Whether a ratio of steps lies within MARGIN; None: open."""
    if found.low > 1 / MARGIN and found.high < MARGIN:
        return True
    return False if found.high < 1 / MARGIN or found.low > MARGIN else None


def both(*truths: bool | None) -> bool | None:
    """Whether all hold: no, if one does not; open, if one is open."""
    return False if False in truths else None if None in truths else True


# --- Judges ----------------------------------------------------------------------------------------------------------


@claim(
    "C2",
    "a conjugate λ is better than fixed ones, or comparable: in steps, parameter change and time",
    mechanism.MECHANISM,
    mechanism.MECHANISM_ALL,
)
def conjugate_lambda(taken: Any, every: Any) -> Judged:
    """Form 2 against the best fixed λ ({mechanism.VALUES}; where all weights are updated, {mechanism.ALL_VALUES}), each
    at the step size, and the fixed one at the λ, of its fewest late steps, whatever is compared (k = 6). Weak: as good
    in late steps, under the paper's update. Strong: also in the steps of all episodes, which is its time, and in
    parameter change, and in all three where all weights are updated. As good is better or comparable; worse is not
    reproduced in that sense.
    """
    found = {
        (update, column): _against_best_fixed(of, update, column, family=6)
        for update, of in (("taken", taken), ("all", every))
        for column in ("late", "total", "change")
    }
    as_good = {"better": True, "comparable": True, "worse": False, "open": None}
    names = {"late": "late steps", "total": "steps of all episodes", "change": "parameter change"}

    def told(update: str) -> str:
        return "; ".join(
            f"{name} {found[update, column]:.2f}{knife_edge(*found[update, column], margins=(1, MARGIN))}, "
            f"{found[update, column].word}"
            for column, name in names.items()
        )

    return (
        graded(as_good[found["taken", "late"].word], both(*(as_good[one.word] for one in found.values()))),
        f"As a multiple of the best fixed λ's: {told('taken')}. Where all weights are updated: {told('all')}.",
    )


def _against_best_fixed(of: Any, update: str, column: str, family: int) -> Comparison:
    fixed = [
        name
        for name in mechanism.CORE | mechanism.FURTHER
        if name.startswith("fixed") and of.condition.str.startswith(f"paper, {name}, {update} @").any()
    ]
    late, measured = (
        (mechanism.rows(of, "form 2", update, column=one), mechanism.all_rows(of, fixed, update, column=one))
        for one in ("late", column)
    )
    return compare_at_best(*measured, family, chosen_by=late)


@claim("C3", "learning converges within 20 episodes", studies.REFERENCES, studies.LONG)
def within_twenty_episodes(references: Any, long: Any) -> Judged:
    """Weak: the last {WINDOW} of 20 episodes take fewer steps than the first {WINDOW}. Strong: and the last 20 of 200,
    in runs of their own whose step size and exploration fall ten times as slowly, take more than four fifths of those
    of the last {WINDOW} of 20 (k = 2; comparable is not fewer). On the atlas of {_ATLAS.atlas_spacing_m:g} m and
    {_ATLAS.atlas_heading_deg:g} degrees.
    """
    last = late(references, "learnt")
    of_first = compare(last, early(references, "learnt"), family=2)
    of_twenty = compare(episodes_of(long, "form 2")[:, -20:].mean(axis=1), last, family=2)
    done = min(found.low for found in of_twenty) > 0.8
    return (
        graded({"better": True, "open": None}.get(of_first.word, False), done),
        f"On the atlas, the last {WINDOW} of 20 episodes take {of_first:.2f} of the steps of the first {WINDOW}, and "
        f"the last 20 of 200 take {of_twenty:.2f} of those.",
    )


@claim(
    "C4", "a hidden goal: from one snapshot, without landmarks, the robot solves the u-turn", AGAIN, studies.REFERENCES
)
def hidden_goal(of: Any, references: Any) -> Judged:
    """Weak: from the start no part of a home object is in view (which our room sees to), and one snapshot is all that
    the robot is given.
    Strong: of a robot's last {WINDOW} episodes, at least 95 % end at home within {measures.TRIAL_STEPS} steps. Random
    actions need not; of theirs all count.
    """
    settings = Settings()
    room = room_named(settings.room)
    seen = list(in_view(room, settings.field_of_view_deg))
    last, chance = episodes_of(of, "form 2")[:, -WINDOW:], episodes_of(references, "random")
    solved, by_chance = (interval_of((steps <= measures.TRIAL_STEPS).mean(axis=1)) for steps in (last, chance))
    turn = np.nanmedian(episodes_of(of, "form 2", "angle_deg")[:, -WINDOW:])
    away = degrees(abs(wrapped(room.start.heading - room.home.heading)))
    return (
        graded(not seen and settings.snapshots == 1, above(solved, 0.95)),
        f"From the start {', '.join(seen) or 'none of the home objects'} can be seen; the robot keeps "
        f"{settings.snapshots} snapshot and compares whole views. It starts {away:.0f} degrees away from home's "
        f"heading, and of the last {WINDOW} of 20 episodes {percent(solved)} % end at home within "
        f"{measures.TRIAL_STEPS} steps{knife_edge(solved, margins=(0.95,))}, {turn:.0f} degrees off in the median; of "
        f"all {chance.shape[1]} of random actions {percent(by_chance)} %.",
    )


@claim("C6", "multipliers 11 and 12 give the thresholds .904 and .908, which tell when home is reached", AGAIN)
def thresholds_of_home(of: Any) -> Judged:
    """Weak: so eq. (19) has it (arithmetic). Strong: of a robot's stops in all 20 episodes, at least 95 % are within
    {FAR_M:g} m of home and within {TURNED_DEG:g} degrees of its heading.
    """
    upper, lower = stopping_thresholds(12)
    arithmetic = (round(lower, 3), round(upper, 3)) == (0.904, 0.908)
    reached, far, turned = (episodes_of(of, "form 2", name) for name in ("reached", "distance_m", "angle_deg"))
    stops = reached > 0
    right = interval_of((stops & (far <= FAR_M) & (turned <= TURNED_DEG)).sum(axis=1) / stops.sum(axis=1))
    typical = f"{np.median(far[stops]):.2f} m and {np.median(turned[stops]):.0f} degrees"
    return (
        graded(arithmetic, above(right, 0.95)),
        f"Eq. (19) gives {lower:.4f} and {upper:.4f} (Table I swaps them). The robot stops {typical} from home in the "
        f"median; {percent(right)} % of its stops are within {FAR_M:g} m and {TURNED_DEG:g} degrees"
        f"{knife_edge(right, margins=(0.95,))}.",
    )


@claim("C7", "bins of 3 give 258 features, a good size", studies.PARTS)
def number_of_features(parts: Any) -> Judged:
    """Weak: so eq. (14) has it (arithmetic). Strong: with fewer features, in bins of 6 and of 16, there are more late
    steps (k = 2); not, if with one of them there are fewer, or as many. The step size stays as it is, though fewer
    features make it smaller in effect.
    """
    n = Settings().n_features
    fewer = {size: of_steps(parts, f"bins of {size}", "default", family=2) for size in (6, 16)}
    worse = {"worse": True, "open": None, "better": False, "comparable": False}
    told = ", ".join(
        f"with {3 * bins_per_channel(size)} {found:.2f}{knife_edge(*found)}: {found.word}"
        for size, found in fewer.items()
    )
    return (
        graded(n == 258, both(*(worse[found.word] for found in fewer.values()))),
        f"Eq. (14) gives {n} (Fig. 2 says about 256). The last {WINDOW} episodes take, as a multiple of what they take "
        f"with {n}, {told}.",
    )


@claim("C8", "after learning, home is reached from almost anywhere", ABDUCTED, opponents.OPPONENTS)
def from_almost_anywhere(placed: Any, others: Any) -> Judged:
    """Weak: of a robot's starts at random places more than half come home within {measures.TRIAL_STEPS} steps, and of
    those on a grid over the room more than by random actions. Strong: at least 95 % of those at random places do.
    """
    share = interval_of(placed.groupby("seed").begun_home.mean().fillna(0).to_numpy(float))
    learnt, chance, climb = (opponents.trials(others, f"paper, {who}") for who in ("after 20", "random", "climb"))
    found = {name: opponents.per_run(rows, "reached") for name, rows in (("learnt", learnt), ("chance", chance))}
    more = interval_of(found["learnt"] - found["chance"])
    worst = {name: rows.groupby(["x", "y"]).reached.mean().min() for name, rows in (("l", learnt), ("c", climb))}
    return (
        graded(both(above(share, 0.5), above(more, 0)), above(share, 0.95)),
        f"After 20 episodes {percent(share)} % of starts at random places come home within {measures.TRIAL_STEPS} steps"
        f"{knife_edge(share, margins=(0.5, 0.95))}. On a grid over the room, {percent(more, '+')} points more than by "
        f"random actions from the same places ({found['chance'].mean():.0%}); from the worst place {worst['l']:.0%}. A "
        f"climb up the similarity: {climb.reached.mean():.0%}, from its worst place {worst['c']:.0%}.",
    )


@claim("C9", "a kidnapped robot recovers at once", ABDUCTED)
def kidnapped(of: Any) -> Judged:
    """Weak: carried somewhere, at most five points fewer reach home than of those that start at the same places (which
    a model without memory implies).

    Strong: and at least 95 % of those that are carried away get home, within {measures.TRIAL_STEPS} steps.
    """
    by_seed = of.fillna({"carried_home": 0, "begun_home": 0}).groupby("seed")
    carried, begun = (interval_of(by_seed[name].mean().to_numpy(float)) for name in ("carried_home", "begun_home"))
    fewer = interval_of((by_seed.carried_home.mean() - by_seed.begun_home.mean()).to_numpy(float))
    as_good = above(fewer, -0.05)
    return (
        graded(as_good, both(as_good, above(carried, 0.95))),
        f"Of the robots carried away {percent(carried)} % reach home within {measures.TRIAL_STEPS} steps"
        f"{knife_edge(carried, margins=(0.95,))}, of those that start at the same places {percent(begun)} %: "
        f"{percent(fewer, '+')} points{knife_edge(fewer, margins=(-0.05,))}. Nothing in the model remembers where it "
        "was, so there is nothing to confuse.",
    )


@claim("C10", "a policy that explores less and less converges, to an optimal one", LONGER, studies.SHORTEST)
def less_and_less_exploration(long: Any, shortest: Any) -> Judged:
    """Weak: it settles; of 200 episodes the last 50 take as many steps as the 50 before, within a factor of {MARGIN:g}.
    Strong: on an optimum; their mean is at most {MARGIN:g} times the shortest way, a mean over other seeds.
    """
    steps, least = episodes_of(long, "form 2"), float(shortest.steps.mean())
    settled = compare(steps[:, -50:].mean(axis=1), steps[:, -100:-50].mean(axis=1))
    last = interval_of(steps[:, -50:].mean(axis=1) / least)
    typical = np.median(steps[:, -50:]) / least
    rests = both(*map(alike, settled))
    return (
        graded(rests, both(rests, below(last, MARGIN))),
        f"Of 200 episodes, the last 50 take {settled:.2f} of the steps of the 50 before"
        f"{knife_edge(*settled, margins=(1 / MARGIN, MARGIN))}, and {last:.2f} of the shortest way of {least:.0f} "
        f"steps{knife_edge(last, margins=(MARGIN,))}; the typical episode (median) takes {typical:.2f} of it. "
        f"Exploration is then down to {Settings(episodes=200).step_size_rates[-1]:.0%} of its start.",
    )


@claim("C11", "the parameter change falls exponentially", AGAIN)
def exponential_change(of: Any) -> Judged:
    """Weak: it falls, by the means of the first and the last {WINDOW} episodes. Strong: also per step and by step size,
    so that neither shorter episodes nor the decay count, and the logarithm of an episode's change, a mean over the
    runs, is straighter in the episode (exponential) than in log(ep_0 + episode) (hyperbolic), by the R² of a line.
    """
    settings = Settings()
    changes = list(change_by_episode(of, settings).values())
    rng = np.random.default_rng(0)
    falls = [ratio(one[:, -WINDOW:].mean(1), one[:, :WINDOW].mean(1), rng) for one in changes]
    fell = [below(fall, 1) for fall in falls]
    exponential, hyperbolic, more = straightness(changes[0], settings.first_episode)
    return (
        graded(fell[0], both(*fell, above(more, 0))),
        f"From the first {WINDOW} episodes to the last it falls to {falls[0]:.2f}; per step, to {falls[1]:.2f}; per "
        f"step and divided by the step size, to {falls[2]:.2f}{knife_edge(*falls)}. A straight line accounts for "
        f"{exponential:.1%} of the variance of its logarithm against the episode (exponential) and {hyperbolic:.1%} "
        f"against that of ep_0 + episode (hyperbolic, as the step size): {percent(more, '+')} points apart.",
    )


@claim("C12", "a wall penalty, with learning at walls, reduces wall following", AGAIN)
def wall_penalty(of: Any) -> Judged:
    """Weak: without learning at walls, and so without any penalty, a larger share of a run's steps is spent there.
    Strong: without the penalty alone, too; and with one of 1, as much as the dearest step, still a smaller one than
    without. Ratios of means alone (k = 3).
    """
    rng = np.random.default_rng(0)
    share = {label: at_walls(of, label) for label in ("form 2", "no wall penalty", "wall penalty 1")}
    unlearnt = at_walls(of, "no learning at walls")
    learning = ratio(unlearnt, share["form 2"], rng, family=3)
    penalty = ratio(share["no wall penalty"], share["form 2"], rng, family=3)
    high = ratio(share["no wall penalty"], share["wall penalty 1"], rng, family=3)
    helps = [above(found, 1) for found in (learning, penalty, high)]
    return (
        graded(helps[0], both(*helps)),
        f"The share of the steps at walls, {share['form 2'].mean():.1f} %, is {learning:.2f} times as large without "
        f"learning there, {penalty:.2f} times without the penalty of {Settings().wall_penalty:g}; without one it is "
        f"{high:.2f} of what it is with a penalty of 1{knife_edge(learning, penalty, high)}, with which an episode "
        f"takes {of_steps(of, 'wall penalty 1', 'form 2'):.2f} of the steps.",
    )


@claim("C13", "good episodes begin around the ninth", AGAIN)
def around_the_ninth(of: Any) -> Judged:
    """Weak: the interval of the first good episode, whose mean over the runs is at most one and a half times that of
    the last {WINDOW}, holds 9 (a wide one does so easily). Strong: it lies within 7 to 11, and that of fixed 0 does not
    hold 9: it would else tell of the task, not of the model.
    """
    steps, good, plain = episodes_of(of, "form 2"), first_good(of), first_good(of, "fixed 0")
    typical = np.median(steps[:, -WINDOW:])
    relapses = (steps[:, int(good.value) :] > 3 * typical).mean()
    holds = good.low <= 9 <= good.high
    return (
        graded(holds, good.low >= 7 and good.high <= 11 and not plain.low <= 9 <= plain.high),
        f"The first good one is episode {good:.0f}{knife_edge(good, margins=(9,))}, with fixed 0 {plain:.0f}; of those "
        f"after it {relapses:.0%} take more than three times the median of the last, {typical:.0f} steps.",
    )


@claim("C15", "the second form of the threshold changes more finely than the first")
def finer_threshold() -> Judged:
    """Weak: from multiplier 11 to 12 it moves less. Strong: also from the same threshold on, where one tunes it. Both
    are arithmetic.
    """
    upper, lower = stopping_thresholds(12)
    first = linear(12) - linear(11)
    there = 1 / (pi * (1 - lower) ** 2)  # the first form's multiplier for the same threshold
    first_there = linear(there + 1) - linear(there)
    return (
        graded(upper - lower < first, upper - lower < first_there),
        f"From 11 to 12 the second form moves by {upper - lower:.4f}, the first by {first:.4f}. But the first reaches "
        f"{lower:.4f} at {there:.1f}, and one more moves it there by {first_there:.4f}. What the second form has to "
        "itself is a coarser multiplier, not a finer threshold.",
    )


@claim("C16", "a cost of 1/t helps against a constant one", AGAIN)
def falling_cost(of: Any) -> Judged:
    """With a constant cost there are more late steps; 1/t is no help if there are fewer, or as many within a factor of
    {MARGIN:g}.
    """
    found = of_steps(of, "constant cost", "form 2")
    verdicts: dict[str, Verdict] = {"worse": "reproduced", "open": "not shown"}
    return (
        verdicts.get(found.word, "not reproduced"),
        f"With a constant cost (the mean of 1/t over 100 steps) an episode takes {found:.2f} of the steps"
        f"{knife_edge(*found, margins=(1, MARGIN))}: {found.word}.",
    )


def in_view(room: Room, field_of_view_deg: float) -> Iterator[str]:
    """Home objects that stand, at least in part, within the camera's angle at the start; walls hide nothing here."""
    for thing in (one for one in room.objects if one.name in room.home_objects):
        radius = hypot(*thing.size[:2]) / 2 if isinstance(thing, Box) else thing.radius
        dx, dy = thing.x - room.start.x, thing.y - room.start.y
        bearing = abs(wrapped(atan2(dy, dx) - room.start.heading))
        if bearing - asin(min(radius / hypot(dx, dy), 1.0)) < np.radians(field_of_view_deg) / 2:
            yield thing.name


def straightness(change: Array, first_episode: float) -> tuple[float, float, Interval]:
    """Share of the variance of the mean's logarithm that a line accounts for: in the episode, and in log(ep_0 +
    episode); and their difference, runs resampled. change: shape (runs, episodes).
    """
    number = np.arange(1.0, change.shape[1] + 1)
    rng = np.random.default_rng(0)

    def shares(weights: Array) -> Array:
        logarithm = np.log(weights @ change)
        return np.array([_correlation(logarithm, x) ** 2 for x in (number, np.log(first_episode + number))])

    runs = len(change)
    exponential, hyperbolic = shares(np.full((1, runs), 1 / runs))[:, 0]
    again = shares(rng.multinomial(runs, np.full(runs, 1 / runs), size=FEWER_RESAMPLES) / runs)
    difference = Interval(exponential - hyperbolic, *np.percentile(again[0] - again[1], (2.5, 97.5)))
    return float(exponential), float(hyperbolic), difference


def _correlation(rows: Array, x: Array) -> Array:
    """Of each row with x; of a row that does not vary, 0."""
    centred, x = rows - rows.mean(axis=1, keepdims=True), x - x.mean()
    spread = np.sqrt((centred**2).sum(axis=1) * (x @ x))
    return np.asarray(np.divide(centred @ x, spread, out=np.zeros(len(rows)), where=spread > 0))
