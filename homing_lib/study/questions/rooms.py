"""Does a varying lambda help in other rooms too, and whichever learner the model was calibrated for?

The settings that the paper leaves open were calibrated with form 2 in the paper's room, which is an advantage there.
So the same comparisons are made in five other rooms; and every learner is calibrated anew, form 2 too, with the same
budget, in two rooms, and then drives with what suits the others as well.
"""

from collections.abc import Mapping
from itertools import product
from typing import Any

from homing_lib.settings import Settings
from homing_lib.study.bootstrap import pooled, word_of
from homing_lib.study.choosing import STEP_SIZES, Choice
from homing_lib.study.findings import Comparison, Judged, compare_steps, estimate, question
from homing_lib.study.measures import totals
from homing_lib.study.questions import varying
from homing_lib.study.questions.varying import FIXED, FORM_2, OPPONENTS, UPDATES, chosen, chosen_own, robots_of
from homing_lib.study.runs import Study
from homing_lib.study.studies import ROOM_ROBOTS, ROOMS, UNLEARNT, UNLIKE, column, drawn_from, labelled, study

ROBOTS_IN = {room: range(10_000, 11_000) if room == "hall" else ROOM_ROBOTS for room in ROOMS[1:]}
"""The hall has more: its robots differ most (`smallest ratio` among the findings)."""


def _drive_in(room: str) -> tuple[Study, Study]:
    """The studies of a room: rules, and draws."""

    def rules() -> dict[str, Settings]:
        best = [chosen(room, update, rule) for update in UPDATES for rule in varying.RULES_IN_ROOMS]
        own_mean = [chosen_own(room, update, FORM_2) for update in UPDATES]
        return labelled(best + own_mean)

    def draws() -> dict[str, Settings]:
        return labelled(varying.DRAWS.best((room, update)) for update in UPDATES)

    of_rules = f"Form 2, the gate and fixed lambdas in the {room}, each at its own best step size there."
    of_draws = f"Lambdas drawn from form 2's own in the {room}, at their best step sizes."
    robots = ROBOTS_IN[room]
    return (
        study(f"rooms-{room}", of_rules, rules, robots, totals, needs=[varying.OWN.second]),
        study(f"rooms-{room}-drawn", of_draws, draws, robots, varying.drawn, needs=[varying.DRAWS.second]),
    )


STUDIES = {room: _drive_in(room) for room in ROBOTS_IN}


# --- Calibrated for whom? ---------------------------------------------------------------------------------------------

LEARNERS: dict[str, dict[str, Any]] = {
    "form2": {"lambda_rule": FORM_2},
    "fixed": {},
    "standard": {"update": "all"},
    "masked": {"update": "all", "bootstrap_terminal": False},
}
"""Form 2 and a fixed lambda under the paper's update; standard Sarsa(lambda), home bootstrapped and masked."""

CALIBRATED_IN = ("paper", "attic")

CALIBRATED: dict[str, tuple[Any, ...]] = {
    "alpha0": STEP_SIZES,
    "exploration": ("epsilon-greedy", 0.01, 0.03, 0.1),
    "epsilon0": (0.0, 0.1, 0.3),
    "first_episode_share": (0.1, 0.3, 1.0),
    "lambda_rule": FIXED,
}
"""What is drawn, unless it is the learner's own. Drive, variance and penalty stay as declared."""


CALIBRATION = Choice(
    "rooms-calibration",
    "Which step size, exploration and schedule, and which fixed lambda, suit which learner? 160 draws each.",
    {
        (room, learner): [*drawn_from(CALIBRATED, [*learner.encode()], room=room, **fixed).values()]
        for room in CALIBRATED_IN
        for learner, fixed in LEARNERS.items()
    },
    keep=16,
    seeds=range(10),
    then=range(10, 100),
)


def calibrated(room: str, learner: str) -> Settings:
    """A learner with what suits it best in a room."""
    return CALIBRATION.best((room, learner))


def with_settings_of(room: str, whose: str, learner: str) -> Settings:
    """A learner, its lambda its own, with the step size, exploration and schedule that suit another, or "declared"."""
    own = calibrated(room, learner)
    others = Settings() if whose == "declared" else calibrated(room, whose)
    names = ("alpha0", "mixture", "tau0", "epsilon0", "first_episode_share")
    return own.with_changes(**{name: getattr(others, name) for name in names})


FOR_EACH = study(
    "rooms-matrix",
    "Does it depend on whom the model was calibrated for? Each learner with what suits each.",
    lambda: labelled(
        with_settings_of(room, whose, learner)
        for room in CALIBRATED_IN
        for whose in ("declared", *LEARNERS)
        for learner in LEARNERS
    ),
    ROOM_ROBOTS,
    totals,
    needs=[CALIBRATION.second],
)


@question(
    "rooms",
    "Does a varying lambda help in other rooms, and whichever learner the model was calibrated for?",
    """In each of the six rooms, under the paper's update, as the question before (k = 8 in each room). The verdict
    counts the rooms: "in n of 6 rooms". Pooled is the geometric mean over the four rooms that are unlike the paper's.
    Beside it, the matrix: form 2 against each other learner, all with what was calibrated for one of them.""",
    UNLEARNT,
    FOR_EACH,
    varying.IN_PAPER,
    varying.IN_PAPER_DRAWN,
    *(one for pair in STUDIES.values() for one in pair),
    order=7,
)
def rooms(unlearnt: Any, matrix: Any, paper: Any, paper_draws: Any, *others: Any) -> Judged:
    every = paper, paper_draws, *others
    tables = {room: every[2 * k : 2 * k + 2] for k, room in enumerate(ROOMS)}
    found: dict[str, Comparison] = {}
    for room in ROOMS:
        table, draws = tables[room]
        found |= varying.of_room(room, table, draws, unlearnt)
    for update, who in product(UPDATES, OPPONENTS):
        found[f"pooled.{update}.{who}.total"] = _pooled(update, who, tables)
    for room, whose in product(CALIBRATED_IN, ("declared", *LEARNERS)):
        total = {one: column(matrix, "total", like=with_settings_of(room, whose, one)) for one in LEARNERS}
        found |= {f"matrix.{room}.{whose}.{learner}.steps": estimate(its) for learner, its in total.items()}
        found |= _against_form2(f"matrix.{room}.{whose}", total)
    for room in CALIBRATED_IN:
        own = {one: column(matrix, "total", like=calibrated(room, one)) for one in LEARNERS}
        found |= _against_form2(f"own.{room}", own)
    yes = sum(varying.helps(found, room) == "yes" for room in ROOMS)
    return f"in {yes} of {len(ROOMS)} rooms", found


def _pooled(update: str, who: str, tables: Mapping[str, tuple[Any, ...]]) -> Comparison:
    """Form 2's total steps as a multiple of another's, over the rooms that are unlike the paper's."""
    ours, theirs = (
        [robots_of(one, room, update, *tables[room]).total.to_numpy(float)[: len(ROOM_ROBOTS)] for room in UNLIKE]
        for one in ("form2", who)
    )
    ratio = pooled(list(zip(ours, theirs, strict=True)))
    return Comparison(*ratio, word_of(ratio))


def _against_form2(name: str, total: Mapping[str, Any]) -> dict[str, Comparison]:
    """Form 2's total steps as a multiple of each other learner's."""
    others = [learner for learner in total if learner != "form2"]
    return {f"{name}.{learner}.total": compare_steps(total["form2"], total[learner]) for learner in others}
