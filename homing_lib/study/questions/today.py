"""How does the paper's lambda stand beside the methods that came before and after it?

Form 2 against eight other learners (`homing_lib.study.methods`) in two rooms, each at what suits it best there: the
step size, and lambda and what else it has where it has one. Beside them stand the best fixed lambda with the weights of
all actions updated; form 2 itself with its steps bounded, which asks whether a conjugate lambda buys more than
stability; and recursive least squares, a ceiling of what the features allow.
"""

from typing import Any, NamedTuple

from homing_lib.settings import Settings
from homing_lib.study.bootstrap import iqm, smallest_ratio
from homing_lib.study.choosing import STEP_SIZES, Choice
from homing_lib.study.findings import (
    Comparison,
    Judged,
    compare_shares,
    compare_steps,
    estimate,
    exact,
    question,
)
from homing_lib.study.measures import totals
from homing_lib.study.methods.base import COST
from homing_lib.study.questions import rooms, varying
from homing_lib.study.questions.varying import FORM_2, lost
from homing_lib.study.runs import Study
from homing_lib.study.studies import UNLEARNT, labelled, later, rows, study

IN_ROOMS = ("paper", "attic")
ROBOTS = range(10_000, 10_200)

LAMBDAS = "fixed:0.5", "fixed:0.9"
NONE = ("fixed:0",)  # for those that have no trace

TO_1 = (*STEP_SIZES, 1.0)
"""For what is bounded; its authors begin at 1."""


class Candidates(NamedTuple):
    """What is chosen from, on seeds that nothing is judged by: names in settings, rules of lambda, step sizes."""

    controllers: tuple[str, ...]
    rules: tuple[str, ...] = NONE
    step_sizes: tuple[float, ...] = STEP_SIZES
    update: str = "all"

    def settings(self, room: str) -> list[Settings]:
        """Each of each, in a room."""
        return [
            Settings(images="atlas", room=room, controller=name, lambda_rule=rule, alpha0=alpha, update=self.update)
            for name in self.controllers
            for rule in self.rules
            for alpha in self.step_sizes
        ]


METHODS = {
    "true-online": Candidates(("true-online",), LAMBDAS),
    "step-size-bound": Candidates(("step-size-bound",), LAMBDAS, TO_1),
    "swift-sarsa": Candidates(("swift-sarsa:0.1", "swift-sarsa:0.5"), ("fixed:0.8",)),
    "tdc": Candidates(("tdc:0.1", "tdc:1")),
    "residual-gradient": Candidates(("residual-gradient",)),
    "natural-actor-critic": Candidates(("natural-actor-critic:1", "natural-actor-critic:10")),
    "scaled-conjugate-gradient": Candidates(
        tuple(f"scaled-conjugate-gradient:{batch}" for batch in ("16:2", "64:2", "64:8")), step_sizes=STEP_SIZES[2:3]
    ),
    "lambda-greedy": Candidates(("lambda-greedy",)),
    "bounded form 2": Candidates(("step-size-bound",), (FORM_2,), TO_1, "taken"),
}
JUDGED = tuple(METHODS)[:-1]
COMPARISONS = len(JUDGED) * len(IN_ROOMS)


def method_of(one: Settings) -> tuple[str, str]:
    """Room, and the name in METHODS."""
    return one.room, "bounded form 2" if one.lambda_rule == FORM_2 else one.controller.partition(":")[0]


CHOICE = Choice(
    "today-choice",
    "Which step size suits which method, in which room, and which lambda and other number where it has one?",
    [one for room in IN_ROOMS for some in METHODS.values() for one in some.settings(room)],
    method_of,
)


def chosen(room: str, method: str) -> Settings:
    """A method with what suits it best."""
    return CHOICE.best(METHODS[method].settings(room)[0])


@later(CHOICE.second)
def today() -> Study:
    return Study(
        "today",
        "Methods that came before the paper and after it, each with what suits it best.",
        labelled(chosen(room, method) for room in IN_ROOMS for method in METHODS),
        ROBOTS,
        totals,
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


def robots_of(method: str, room: str, tables: dict[str, Any]) -> Any:
    """One row per robot. method: of METHODS, or "form2", "standard" or "least-squares". tables: of the
    methods ("today"), of least squares ("ceiling"), and of the rules of lambda in each room, by its name.
    """
    if method == "least-squares":
        return rows(tables["ceiling"], room=room)
    if method in ("form2", "standard"):
        like = varying.standard(room) if method == "standard" else varying.chosen(room, "taken", FORM_2)
        return rows(tables[room], like=like).iloc[: len(ROBOTS)]
    return rows(tables["today"], like=chosen(room, method))


def _of_form_2(method: str, room: str, tables: dict[str, Any], unlearnt: Any) -> dict[str, Comparison]:
    """A method's steps as a multiple of form 2's: all, with episodes cut, and late ones; who is lost; and how many."""
    robots = robots_of(method, room, tables)
    form2 = robots_of("form2", room, tables).iloc[: len(robots)]
    together = COMPARISONS if method in JUDGED else 0
    gone = lost(robots, room, unlearnt)
    found = {
        "total": compare_steps(robots.total, form2.total, comparisons=together),
        "cut": compare_steps(robots.cut, form2.cut),
        "late": compare_steps(robots.late, form2.late, iqm),
        "lost": compare_shares(gone, lost(form2, room, unlearnt)),
        "steps": estimate(robots.total),
        "share lost": estimate(gone),
    }
    if method != "standard":
        standard = robots_of("standard", room, tables).iloc[: len(robots)]
        found["of standard"] = compare_steps(robots.total, standard.total)
    return {f"{room}.{method}.{endpoint}": one for endpoint, one in found.items()}


def detectable_ratio(room: str) -> float:
    """The smallest ratio of total steps that the robots would detect of any method, said before they drive."""
    form2 = varying.CHOICE.robots(varying.settings(room, "taken", FORM_2)).total.to_numpy(float)
    return max(
        smallest_ratio(CHOICE.robots(some.settings(room)[0]).total.to_numpy(float), form2, len(ROBOTS), COMPARISONS)
        for some in (METHODS[method] for method in JUDGED)
    )


@question(
    "today",
    "How does the paper's lambda stand beside the methods that came before and after it?",
    """In the paper's room and in the attic, form 2 under the paper's update, and each of eight methods, with what suits
    it best. A method takes fewer or more steps than form 2 if its total steps, as a multiple of form 2's, are fewer or
    more (k = 16: eight methods, two rooms). The verdict counts the methods: "n of 8 take fewer steps than form 2 in
    both rooms, m take more in both". Late steps, lost robots, the best fixed lambda with all weights updated, form 2
    with bounded steps and least squares stand beside them.""",
    today,
    CEILING,
    varying.in_paper,
    rooms.STUDIES["attic"][0],
    UNLEARNT,
    order=9,
)
def beside_others(methods: Any, ceiling: Any, paper: Any, attic: Any, unlearnt: Any) -> Judged:
    tables = {"today": methods, "ceiling": ceiling, "paper": paper, "attic": attic}
    found: dict[str, Comparison] = {}
    for room in IN_ROOMS:
        for method in (*METHODS, "standard", "least-squares"):
            found |= _of_form_2(method, room, tables, unlearnt)
        form2 = robots_of("form2", room, tables)
        found[f"{room}.form2.steps"] = estimate(form2.total)
        found[f"{room}.form2.share lost"] = estimate(lost(form2, room, unlearnt))
        best = {method: chosen(room, method) for method in METHODS}
        costs = {method: COST[one.controller] for method, one in best.items()}
        costs |= {"standard": 1, "least-squares": COST["least-squares"]}
        found |= {f"{room}.{method}.cost": exact(cost) for method, cost in costs.items()}
        found |= {f"{room}.{method}.step size": exact(one.alpha0) for method, one in best.items()}
        found[f"{room}.smallest ratio"] = exact(detectable_ratio(room))
    counts = [
        sum(all(found[f"{room}.{method}.total"].verdict == word for room in IN_ROOMS) for method in JUDGED)
        for word in ("fewer", "more")
    ]
    of = f"of {len(JUDGED)}"
    return f"{counts[0]} {of} take fewer steps than form 2 in both rooms, {counts[1]} take more in both", found
