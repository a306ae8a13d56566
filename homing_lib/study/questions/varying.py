"""Does a varying lambda help?

Form 2 against lambdas that lack one thing each. Fixed ones do not vary. Draws from its own lambdas know nothing of the
step, so that the timing is gone. The gate has its sign and not its size; the opposite gate has the wrong sign. As a
longer trace is another learner, each also meets a fixed lambda at its own mean. Everyone has the step size that suits
it best in its room and under its update (`CHOICE`).
"""

from collections.abc import Mapping
from functools import cache
from typing import Any

import numpy as np

from homing_lib.features import Array
from homing_lib.settings import Settings
from homing_lib.study.bootstrap import iqm, smallest_ratio
from homing_lib.study.choosing import STEP_SIZES, Choice
from homing_lib.study.engine import run
from homing_lib.study.findings import (
    OF_A_QUESTION,
    Comparison,
    Judged,
    compare_shares,
    compare_steps,
    estimate,
    exact,
    question,
    verdict_of,
)
from homing_lib.study.measures import totals, totals_of
from homing_lib.study.rules import ResampledLambda
from homing_lib.study.runs import Columns, load_table
from homing_lib.study.studies import ROBOTS, ROOMS, UNLEARNT, column, labelled, rows, study

UPDATES = ("taken", "all")

FORM_2 = "fletcher-reeves"
FIXED = tuple(f"fixed:{value:g}" for value in (0.0, 0.25, 0.5, 0.75, 0.9, 0.95))
RULES_IN_ROOMS = (FORM_2, "gate", *FIXED)
"""Who drives in every room; draws from form 2's lambdas join them."""

VARYING = {
    "form2": FORM_2,
    "form1": "hestenes-stiefel",
    "form3": "polak-ribiere",
    "gate": "gate",
    "opposite": "gate:opposite",
}
"""The rules that vary, by their names in the findings."""


def settings(room: str, update: str, rule: str, **changes: Any) -> Settings:
    """On the 2 cm lattice. With lambda 0 no other action has a trace: both updates are one, and run once."""
    update = "taken" if rule == "fixed:0" else update
    return Settings(images="atlas", room=room, update=update, lambda_rule=rule, **changes)


def _at_all_step_sizes(room: str, update: str, rule: str) -> list[Settings]:
    return [settings(room, update, rule, alpha0=alpha) for alpha in STEP_SIZES]


CASES = [(room, update) for room in ROOMS for update in UPDATES]

CHOICE = Choice(
    "varying-choice",
    "Which step size suits which rule of lambda, in which room and under which update?",
    {
        (room, update, rule): _at_all_step_sizes(room, update, rule)
        for room, update in CASES
        for rule in dict.fromkeys((*RULES_IN_ROOMS, *(VARYING.values() if room == "paper" else ())))
    },
)


def chosen(room: str, update: str, rule: str) -> Settings:
    """A rule at the step size that suits it best."""
    return CHOICE.best((room, update, rule))


def best_fixed(room: str, update: str) -> str:
    """The fixed lambda that took the fewest steps, each at its own best step size."""
    return min(FIXED, key=lambda rule: CHOICE.score((room, update, rule)))


def standard(room: str) -> Settings:
    """Standard Sarsa(lambda): all weights updated, at the fixed lambda and the step size that suit it best."""
    return chosen(room, "all", best_fixed(room, "all"))


# --- A fixed lambda at a rule's own mean ------------------------------------------------------------------------------


@cache
def own_mean(room: str, update: str, rule: str) -> str:
    """The fixed lambda that a rule has on average, at its best step size."""
    return f"fixed:{CHOICE.robots((room, update, rule))['lambda'].mean():.2f}"


def _with_own_mean(room: str) -> list[str]:
    return list(VARYING.values()) if room == "paper" else [FORM_2]


OWN = Choice(
    "varying-own",
    "Which step size suits a fixed lambda at the mean that a varying one has?",
    lambda: {
        (room, update, rule): _at_all_step_sizes(room, update, own_mean(room, update, rule))
        for room, update in CASES
        for rule in _with_own_mean(room)
    },
    needs=[CHOICE.second],
)


def chosen_own(room: str, update: str, rule: str) -> Settings:
    """That fixed lambda at the step size that suits it best."""
    return OWN.best((room, update, rule))


# --- Lambdas that know nothing of the step ----------------------------------------------------------------------------


def lambdas_met(now: Settings, seed: int) -> Columns:
    """Which lambdas a run `met`, to two digits, and how often (`count`); an episode's first step has none of its
    own."""
    result = run(now, seed)
    asked = np.setdiff1d(np.arange(len(result.steps)), result.ended - result.lengths)
    met, count = np.unique(result.column("lambda")[asked].round(2), return_counts=True)
    return {"met": met, "count": count.astype(float)}


POOL = study(
    "varying-pool",
    "Which lambdas has form 2, and how often? From these are drawn lambdas that know nothing of the step.",
    lambda: labelled(chosen(room, update, FORM_2) for room, update in CASES),
    range(20, 28),
    lambdas_met,
    needs=[CHOICE.second],
)


@cache
def pool_of(room: str, update: str) -> Any:
    return rows(load_table(POOL), room=room, update=update)


def drawn(now: Settings, seed: int) -> Columns:
    """`totals` of a run whose lambdas are drawn from the pool of its room and update, whatever the step."""
    its_own = pool_of(now.room, now.update)
    rule = ResampledLambda(its_own.met, its_own["count"], np.random.default_rng([seed, 4]))
    return totals_of(run(now, seed, lambda_rule=rule))


DRAWS = Choice(
    "varying-draws",
    "Which step size suits lambdas that are drawn from form 2's own?",
    {(room, update): _at_all_step_sizes(room, update, FORM_2) for room, update in CASES},
    measure=drawn,
    needs=[POOL],
)

# --- What is judged ---------------------------------------------------------------------------------------------------


IN_PAPER = study(
    "varying",
    "Form 2, the gates, the other forms and fixed lambdas in the paper's room, each at its own best step size.",
    lambda: labelled(
        one
        for update in UPDATES
        for one in (
            *(chosen("paper", update, rule) for rule in dict.fromkeys((*RULES_IN_ROOMS, *VARYING.values()))),
            *(chosen_own("paper", update, rule) for rule in VARYING.values()),
        )
    ),
    ROBOTS,
    totals,
    needs=[OWN.second],
)

IN_PAPER_DRAWN = study(
    "varying-drawn",
    "Lambdas drawn from form 2's own in the paper's room, at their best step size.",
    lambda: labelled(DRAWS.best(("paper", update)) for update in UPDATES),
    ROBOTS,
    drawn,
    needs=[DRAWS.second],
)

OPPONENTS = ("fixed0", "best", "draws", "gate")
"""Those that are judged together, under both updates: eight comparisons in a room."""

COMPARISONS = len(OPPONENTS) * len(UPDATES)


def robots_of(who: str, room: str, update: str, table: Any, draws: Any) -> Any:
    """One row per robot. who: a name in VARYING, or one of OPPONENTS, or "mean of" such a name."""
    if who == "draws":
        return rows(draws, room=room, update=update)
    if who.startswith("mean of "):
        wanted = chosen_own(room, update, VARYING[who.removeprefix("mean of ")])
    else:
        rule = {"fixed0": "fixed:0", "best": best_fixed(room, update), **VARYING}[who]
        wanted = chosen(room, update, rule)
    return rows(table, like=wanted)


def lost(robots: Any, room: str, unlearnt: Any) -> Array:
    """Which robots are lost: they diverged, or take more steps at the end than random actions do in their room."""
    at_random = column(unlearnt, "late", room=room, controller="random").mean()
    return np.asarray(((robots.diverged > 0) | (robots.late > at_random)).to_numpy(float))


def against(ours: Any, theirs: Any, room: str, unlearnt: Any, comparisons: int = 0) -> dict[str, Comparison]:
    """Total steps of robots, rows of `totals`, as a multiple of others'; the same with episodes cut; late steps of the
    typical robot; and who is lost.
    """
    return {
        "total": compare_steps(ours.total, theirs.total, comparisons=comparisons),
        "cut": compare_steps(ours.cut, theirs.cut),
        "late": compare_steps(ours.late, theirs.late, iqm),
        "lost": compare_shares(lost(ours, room, unlearnt), lost(theirs, room, unlearnt)),
    }


def _of_form_2(room: str, update: str, who: str, table: Any, draws: Any, unlearnt: Any) -> dict[str, Comparison]:
    """Form 2 against another."""
    ours, theirs = (robots_of(one, room, update, table, draws) for one in ("form2", who))
    found = against(ours, theirs, room, unlearnt, COMPARISONS if who in OPPONENTS else 0)
    return {f"{room}.{update}.{who.replace(' of form2', '')}.{endpoint}": one for endpoint, one in found.items()}


def of_room(room: str, table: Any, draws: Any, unlearnt: Any) -> dict[str, Comparison]:
    """Form 2 against each of OPPONENTS, and against a fixed lambda at its mean, under both updates."""
    found: dict[str, Comparison] = {}
    for update in UPDATES:
        for who in (*OPPONENTS, "mean of form2"):
            found |= _of_form_2(room, update, who, table, draws, unlearnt)
        for who in ("form2", *OPPONENTS):
            robots = robots_of(who, room, update, table, draws)
            found[f"{room}.{update}.{who}.steps"] = estimate(robots.total)
            found[f"{room}.{update}.{who}.share lost"] = estimate(lost(robots, room, unlearnt))
        found[f"{room}.{update}.smallest ratio"] = exact(detectable_ratio(room, update, len(robots)))
    return found


def detectable_ratio(room: str, update: str, robots: int) -> float:
    """The smallest ratio of total steps that so many robots would detect, said before they drive, by the choice."""
    ours, theirs = (
        CHOICE.robots((room, update, rule)).total.to_numpy(float) for rule in (FORM_2, best_fixed(room, update))
    )
    return smallest_ratio(ours, theirs, robots, COMPARISONS)


def helps(found: Mapping[str, Comparison], room: str) -> str:
    """Whether form 2 takes fewer total steps than fixed 0, the best fixed lambda and draws: yes, no or undecided."""
    words = (found[f"{room}.taken.{who}.total"].verdict for who in ("fixed0", "best", "draws"))
    return verdict_of(words, ["fewer"], ["the same", "more"], OF_A_QUESTION)


@question(
    "varying",
    "Does a varying lambda help?",
    """In the paper's room, under the paper's update: yes, if form 2 takes fewer total steps than fixed 0, than the best
    fixed lambda and than draws from its own lambdas; no, if against one of the three it takes the same or more; else
    undecided. Eight comparisons are judged together (k = 8): these, the gate, and all four where the weights of all
    actions are updated. Late steps, lost robots and the other opponents stand beside them.""",
    IN_PAPER,
    IN_PAPER_DRAWN,
    UNLEARNT,
    order=6,
)
def varying(table: Any, draws: Any, unlearnt: Any) -> Judged:
    found = of_room("paper", table, draws, unlearnt)
    for update in UPDATES:
        for who in ("opposite", "form1", "form3"):
            found |= _of_form_2("paper", update, who, table, draws, unlearnt)
        for who in ("gate", "opposite", "form1", "form3"):
            its, mean = (robots_of(name, "paper", update, table, draws) for name in (who, f"mean of {who}"))
            found[f"own.{update}.{who}.total"] = compare_steps(its.total, mean.total)
    return helps(found, "paper"), found
