"""Claims of the paper that no question asks: parts of the model, the shape of its learning, the earlier model."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from homing_lib.features import Array
from homing_lib.settings import Settings
from homing_lib.study.bootstrap import SAME, Interval, bootstrap, iqm, mean
from homing_lib.study.engine import run
from homing_lib.study.findings import Comparison, Judged, compare_steps, question, side_of, verdict_of
from homing_lib.study.measures import WINDOW, curve, totals
from homing_lib.study.questions import learns, varying
from homing_lib.study.runs import Columns, episode_matrix, episodes_of
from homing_lib.study.studies import ROBOTS, ROOM_ROBOTS, column, study

_ATLAS = Settings(images="atlas")
_THIRD = 4.167e-4  # of the default step size

PARTS = study(
    "claims-parts",
    "What section V.A says makes it fast, one part taken away at a time; and three snapshots, at the same step size "
    "and at a third of it, since three times the features make it three times as large in effect.",
    {
        "ours": _ATLAS,
        "constant cost": _ATLAS.with_changes(step_cost="constant"),
        "no approach reward": _ATLAS.with_changes(approach_reward=False),
        "no wall penalty": _ATLAS.with_changes(wall_penalty=0.0),
        "no learning at walls": _ATLAS.with_changes(learn_at_walls=False),
        "three snapshots": _ATLAS.with_changes(snapshots=3),
        "three snapshots, a third of the step": _ATLAS.with_changes(snapshots=3, alpha0=_THIRD),
    },
    ROOM_ROBOTS,
    totals,
)


def changes(settings: Settings, seed: int) -> Columns:
    """One row per `episode`: `change`, the sum of the lengths of the weights' changes, and `steps`."""
    made = run(settings, seed)
    change, taken = episode_matrix([made], "change")[0], episode_matrix([made])[0]
    return {"episode": np.arange(1.0, len(taken) + 1), "change": change, "steps": taken}


CHANGES = study("claims-change", "How does the parameter change fall?", {"form 2": _ATLAS}, ROOM_ROBOTS, changes)

_EARLIER = _ATLAS.with_changes(
    episodes=300,
    snapshots=3,
    step_cost="constant",
    approach_reward=False,
    learn_at_walls=False,
    lambda_rule="fixed:0",
)
"""Three snapshots, a constant cost, no learning at walls; the fixed lambda that took the fewest steps on seeds 0-4."""

EARLIER = study(
    "claims-earlier",
    "Does the paper's model need tens of episodes where the earlier one took hundreds? Three hundred episodes each.",
    {
        "this model": _ATLAS.with_changes(episodes=300),
        "earlier": _EARLIER,
        "earlier, a third of the step": _EARLIER.with_changes(alpha0=_THIRD),
    },
    ROBOTS[:100],
    curve,
)


@question(
    "C2",
    "A conjugate lambda is better than fixed ones, or comparable: in steps, parameter change and time.",
    """Learning on, in the paper's room, under its update, form 2 against the best fixed lambda, both at their own best
    step size: late steps (interquartile means), total steps, which are its time, and parameter change (k = 3).
    Supported, if each is the same or fewer; contradicted, if one is more; else inconclusive.""",
    varying.IN_PAPER,
)
def conjugate_lambda(table: Any) -> Judged:
    ours, fixed = (varying.robots_of(who, "paper", "taken", table, None) for who in ("form2", "best"))
    found = {
        name: compare_steps(ours[name], fixed[name], statistic, comparisons=3)
        for name, statistic in (("late", iqm), ("total", mean), ("change", mean))
    }
    return verdict_of((one.verdict for one in found.values()), ["the same", "fewer"], ["more"]), found


@question(
    "C10",
    "A policy that explores less and less converges, to an optimal one.",
    """Learning on, the rates of the schedule of twenty continued to a hundred episodes. Supported, if episodes 81 to
    100 take the same steps as 61 to 80, and at most a tenth more than the shortest way (interquartile means, the whole
    interval, k = 2); contradicted, if they take fewer or more than those before, or exceed the shortest way by more
    than a tenth; else inconclusive.""",
    learns.ATLAS,
    learns.SHORTEST,
)
def less_and_less_exploration(atlas: Any, shortest: Any) -> Judged:
    taken = episodes_of(atlas, "form 2")
    last, before = taken[:, 80:].mean(axis=1), taken[:, 60:80].mean(axis=1)
    least = np.full_like(last, column(shortest, "steps", room="paper").mean())
    settled = compare_steps(last, before, iqm, comparisons=2)
    of_the_shortest = compare_steps(last, least, iqm, comparisons=2)
    words = settled.verdict, side_of(of_the_shortest, SAME)
    verdict = verdict_of(words, ["the same", "below"], ["fewer", "more", "above"])
    return verdict, {"settled": settled, "of the shortest": of_the_shortest}


@question(
    "C11",
    "The parameter change falls exponentially.",
    """Learning on. From the first five episodes to the last five it falls, also per step and divided by the step size,
    and the logarithm of an episode's mean change is straighter in the episode (exponential) than in log(ep_0 + episode)
    (hyperbolic), by the R squared of a line (k = 4). Supported, if all four hold; contradicted, if one of the falls is
    none, or the hyperbola is straighter; else inconclusive.""",
    CHANGES,
)
def exponential_change(table: Any) -> Judged:
    change, taken = episodes_of(table, "form 2", "change"), episodes_of(table, "form 2")
    rates = _ATLAS.alpha0 * _ATLAS.step_size_rates
    falls = {"episode": change, "step": change / taken, "step, by the step size": change / taken / rates}
    found = {
        name: compare_steps(one[:, -WINDOW:].mean(axis=1), one[:, :WINDOW].mean(axis=1), comparisons=4)
        for name, one in falls.items()
    }
    straighter = straightness(change, _ATLAS.first_episode)
    shape = side_of(straighter, 0.0, "exponential", "hyperbolic")
    found["straighter"] = Comparison(*straighter, shape, 4)
    words = (one.verdict for one in found.values())
    return verdict_of(words, ["fewer", "exponential"], ["the same", "more", "hyperbolic"]), found


def straightness(change: Array, first_episode: float) -> Interval:
    """By how much more of its variance a line accounts for where the logarithm of the mean change stands against the
    episode than where it stands against log(ep_0 + episode). change: shape (robots, episodes).
    """
    number = np.arange(1.0, change.shape[1] + 1)

    def more(counts: Array) -> Array:
        logarithm = np.log(mean(change, counts))
        exponential, hyperbolic = (_correlation(logarithm, x) ** 2 for x in (number, np.log(first_episode + number)))
        return exponential - hyperbolic

    return bootstrap(more, len(change), 4)


def _correlation(many: Array, x: Array) -> Array:
    """Of each row with x; of a row that does not vary, 0."""
    centred, x = many - many.mean(axis=1, keepdims=True), x - x.mean()
    spread = np.sqrt((centred**2).sum(axis=1) * (x @ x))
    return np.asarray(np.divide(centred @ x, spread, out=np.zeros(len(many)), where=spread > 0))


def _of_ours(table: Any, name: str, condition: str, comparisons: int = 1) -> Comparison:
    """A column of `PARTS` where one is taken away, as a multiple of ours."""
    without, ours = (column(table, name, condition=one) for one in (condition, "ours"))
    return compare_steps(without, ours, comparisons=comparisons)


def _if_more(words: Iterable[str]) -> str:
    """What becomes of a claim that holds where more steps are taken."""
    return verdict_of(words, ["more"], ["the same", "fewer"])


@question(
    "C12",
    "A wall penalty, with learning at walls, reduces wall following.",
    """Learning on. Of a robot's steps, a larger share is spent at walls without learning there, and without the penalty
    (ratios of means, k = 2). Supported, if both; contradicted, if without either it is the same or smaller; else
    inconclusive.""",
    PARTS,
)
def wall_penalty(table: Any) -> Judged:
    found = {name: _of_ours(table, "at_wall", name, 2) for name in ("no learning at walls", "no wall penalty")}
    return _if_more(one.verdict for one in found.values()), found


@question(
    "C14",
    "One snapshot does better than three.",
    """Learning on. With three snapshots the robot takes more total steps, at the better of two step sizes, the same and
    a third of it (by total steps). Supported, if more; contradicted, if the same or fewer; else inconclusive.""",
    PARTS,
)
def one_snapshot(table: Any) -> Judged:
    names = ("three snapshots", "three snapshots, a third of the step")
    found = {name: _of_ours(table, "total", name) for name in names}
    best = min(found.values(), key=lambda one: one.value)
    return _if_more([best.verdict]), found


@question(
    "C16",
    "A cost of 1/t helps against a constant one.",
    """Learning on. With a constant cost, the mean of 1/t over 100 steps, the robot takes more total steps: supported;
    the same or fewer: contradicted; else inconclusive.""",
    PARTS,
)
def falling_cost(table: Any) -> Judged:
    found = {name: _of_ours(table, "total", name, k) for name, k in (("constant cost", 1), ("no approach reward", 0))}
    return _if_more([found["constant cost"].verdict]), found


@question(
    "C17",
    "Tens of episodes suffice where the earlier model took hundreds.",
    """Learning on, three hundred episodes. The first good episode is the first whose steps, a mean over the robots, are
    at most one and a half times those of the last five. Supported, if that of this model comes before the hundredth and
    that of the earlier one, at both step sizes, not before it; contradicted, if at either step size that of the earlier
    model comes before the hundredth, too, or this model's does not; else inconclusive. All with the whole interval.""",
    EARLIER,
)
def tens_of_episodes(table: Any) -> Judged:
    found = {}
    for name in EARLIER.conditions:
        good = learns.first_good(episodes_of(table, name))
        word = "tens" if good.high < 100 else "hundreds" if good.low >= 100 else "undecided"
        found[name] = Comparison(*good, word, 1)
    ours, *earlier = (one.verdict for one in found.values())
    if ours == "hundreds" or "tens" in earlier:
        return "contradicted", found
    return "supported" if ours == "tens" and {*earlier} == {"hundreds"} else "inconclusive", found
