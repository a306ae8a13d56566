"""How does the paper's lambda stand beside the methods that came before and after it?

The methods are those of `homing_lib.study.methods`. Form 2 itself with its steps bounded asks whether a conjugate
lambda buys more than stability.
"""

from collections.abc import Sequence
from itertools import product
from typing import Any

from homing_lib.settings import Settings
from homing_lib.study.choosing import STEP_SIZES, Choice
from homing_lib.study.findings import Comparison, Judged, compare_steps, exact, question
from homing_lib.study.measures import totals
from homing_lib.study.methods.base import COST
from homing_lib.study.questions import rooms, varying
from homing_lib.study.questions.varying import FORM_2
from homing_lib.study.studies import UNLEARNT, labelled, rows, study

IN_ROOMS = ("paper", "attic")
ROBOTS = range(10_000, 10_200)

LAMBDAS = "fixed:0.5", "fixed:0.9"
NONE = ("fixed:0",)  # for those that have no trace

TO_1 = (*STEP_SIZES, 1.0)
"""For what is bounded; its authors begin at 1."""


def _each(
    *controllers: str, rules: Sequence[str] = NONE, step_sizes: Sequence[float] = STEP_SIZES, update: str = "all"
) -> list[dict[str, Any]]:
    """What is chosen from, on seeds that nothing is judged by: controllers, rules of lambda and step sizes, each with
    each.
    """
    every = product(controllers, rules, step_sizes)
    return [{"controller": name, "lambda_rule": rule, "alpha0": alpha, "update": update} for name, rule, alpha in every]


METHODS = {
    "true-online": _each("true-online", rules=LAMBDAS),
    "step-size-bound": _each("step-size-bound", rules=LAMBDAS, step_sizes=TO_1),
    "swift-sarsa": _each("swift-sarsa:0.1", "swift-sarsa:0.5", rules=["fixed:0.8"]),
    "tdc": _each("tdc:0.1", "tdc:1"),
    "residual-gradient": _each("residual-gradient"),
    "natural-actor-critic": _each("natural-actor-critic:1", "natural-actor-critic:10"),
    "scaled-conjugate-gradient": _each(
        *(f"scaled-conjugate-gradient:{batch}" for batch in ("16:2", "64:2", "64:8")), step_sizes=STEP_SIZES[2:3]
    ),
    "lambda-greedy": _each("lambda-greedy"),
    "bounded form 2": _each("step-size-bound", rules=[FORM_2], step_sizes=TO_1, update="taken"),
}
JUDGED = tuple(METHODS)[:-1]
COMPARISONS = len(JUDGED) * len(IN_ROOMS)


CHOICE = Choice(
    "today-choice",
    "Which step size suits which method, in which room, and which lambda and other number where it has one?",
    {
        (room, method): [Settings(images="atlas", room=room, **values) for values in several]
        for room in IN_ROOMS
        for method, several in METHODS.items()
    },
)


TODAY = study(
    "today",
    "Methods that came before the paper and after it, each with what suits it best.",
    lambda: labelled(CHOICE.best((room, method)) for room in IN_ROOMS for method in METHODS),
    ROBOTS,
    totals,
    needs=[CHOICE.second],
)

CEILING = study(
    "today-ceiling",
    "Recursive least squares: what do the features allow? Its first matrix is declared, nothing is chosen.",
    labelled(
        Settings(images="atlas", room=room, controller="least-squares", lambda_rule="fixed:0", alpha0=1e-3)
        for room in IN_ROOMS
    ),
    ROBOTS[:30],
    totals,
)


@question(
    "today",
    "How does the paper's lambda stand beside the methods that came before and after it?",
    """In the paper's room and in the attic, form 2 under the paper's update, and each of eight methods, with what suits
    it best. A method takes fewer or more steps than form 2 if its total steps, as a multiple of form 2's, are fewer or
    more (k = 16: eight methods, two rooms). The verdict counts the methods: "n of 8 take fewer steps than form 2 in
    both rooms, m take more in both". Late steps, lost robots, the best fixed lambda with all weights updated, form 2
    with bounded steps and least squares stand beside them.""",
    TODAY,
    CEILING,
    varying.IN_PAPER,
    rooms.STUDIES["attic"][0],
    UNLEARNT,
    order=9,
)
def beside_others(methods: Any, ceiling: Any, paper: Any, attic: Any, unlearnt: Any) -> Judged:
    found: dict[str, Comparison] = {}
    for room, rules in zip(IN_ROOMS, (paper, attic), strict=True):
        form2 = rows(rules, like=varying.chosen(room, "taken", FORM_2))
        standard = rows(rules, like=varying.standard(room)).iloc[: len(ROBOTS)]
        best = {method: CHOICE.best((room, method)) for method in METHODS}
        robots = {method: rows(methods, like=one) for method, one in best.items()}
        robots |= {"standard": standard, "least-squares": rows(ceiling, room=room)}
        costs = {method: COST[one.controller] for method, one in best.items()}
        costs |= {"standard": 1, "least-squares": COST["least-squares"]}
        for method, its in robots.items():
            together = COMPARISONS if method in JUDGED else 0
            compared = varying.against(its, form2.iloc[: len(its)], room, unlearnt, together)
            if method != "standard":
                compared["of standard"] = compare_steps(its.total, standard.total.iloc[: len(its)])
            found |= {f"{room}.{method}.{endpoint}": one for endpoint, one in compared.items()}
            found[f"{room}.{method}.cost"] = exact(costs[method])
    counts = [
        sum(all(found[f"{room}.{method}.total"].verdict == word for room in IN_ROOMS) for method in JUDGED)
        for word in ("fewer", "more")
    ]
    of = f"of {len(JUDGED)}"
    return f"{counts[0]} {of} take fewer steps than form 2 in both rooms, {counts[1]} take more in both", found
