"""Does the algorithm learn as it is printed, and which substitution rescues it?

The letter: squares about zero in eq. (9), the mixture of eq. (22) as printed, features overwritten (Fig. 2), alpha_0 of
Table I. Its epsilon_0 of 6 is no probability and is read as .3, here too; the temperature has no value, and is 1.
"""

from typing import Any

from homing_lib.settings import Settings
from homing_lib.study.findings import OF_A_QUESTION, Comparison, Judged, compare_steps, estimate, question, verdict_of
from homing_lib.study.measures import totals
from homing_lib.study.studies import ROBOTS, column, study

OURS = Settings(images="atlas")

SUBSTITUTIONS: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "variance about the mean": ({"centre": "zero"}, {"centre": "mean"}),
    "plain epsilon-greedy": ({"mixture": "literal", "tau0": 1.0}, {"mixture": "epsilon-greedy", "tau0": OURS.tau0}),
    "features kept": ({"overwrite_features": True}, {"overwrite_features": False}),
    "step size of the text": ({"alpha0": 1.25e-2}, {"alpha0": 1.25e-3}),
}
"""What replaces the letter, in the order of the paper's sections: settings as printed, and ours."""

LETTER = Settings().with_changes(
    **{name: value for printed, _ in SUBSTITUTIONS.values() for name, value in printed.items()}
)
"""All as printed, with the camera: `homing run --as-printed`."""

_ON_ATLAS = LETTER.with_changes(images="atlas")


def _cascade() -> dict[str, Settings]:
    now, rows = _ON_ATLAS, {"the letter": _ON_ATLAS}
    for name, (_, ours) in SUBSTITUTIONS.items():
        now = now.with_changes(**ours)
        rows[f"+ {name}"] = now
    assert now == OURS
    return rows


CASCADE = _cascade()
ALONE = {f"only {name}": _ON_ATLAS.with_changes(**ours) for name, (_, ours) in SUBSTITUTIONS.items()}
UNDONE = {f"all but {name}": OURS.with_changes(**printed) for name, (printed, _) in SUBSTITUTIONS.items()}

READINGS: dict[str, dict[str, Any]] = {
    "E3 form 1": {"lambda_rule": "hestenes-stiefel"},
    "E3 form 1, printed sign": {"lambda_rule": "hestenes-stiefel:printed"},
    "E4 alpha_0 of the formula": {"alpha0": 1.25e-4},
    "E5 epsilon_0 at its bound": {"epsilon0": 1.0},
    "E9 sigma^2 per bin": {"variance": "per-bin"},
    "E9 sigma^2 per bin, about zero": {"variance": "per-bin", "centre": "zero"},
    "E13 lambda 1 where undefined": {"lambda_rule": "fletcher-reeves:on_zero=1"},
    "E18 mixture as printed, tau .03": {"mixture": "literal", "tau0": 0.03},
    "E18 mixture normalised, tau .03": {"mixture": "normalised"},
    "E19 home masked": {"bootstrap_terminal": False},
    "E20 all actions updated": {"update": "all"},
}
"""Other readings of the print, each alone, as a change of ours."""

_RANDOM = {
    f"random, {centre}, {variance}": OURS.with_changes(controller="random", centre=centre, variance=variance)
    for centre in ("zero", "mean")
    for variance in ("pooled", "per-bin")
}

PRINTED = study(
    "printed",
    "From the letter to ours, one substitution after the other; each alone, added to the letter and taken from ours; "
    "and other readings of the print.",
    {
        **CASCADE,
        "the letter, tau .03": _ON_ATLAS.with_changes(tau0=0.03),
        "the letter, alpha_0 of the formula": _ON_ATLAS.with_changes(alpha0=1.25e-4),
        **{name: settings for name, settings in (ALONE | UNDONE).items() if settings not in CASCADE.values()},
        **{name: OURS.with_changes(**changes) for name, changes in READINGS.items()},
        **_RANDOM,
    },
    ROBOTS[:200],
    totals,
)

_OURS_LABEL = f"+ {[*SUBSTITUTIONS][-1]}"

LETTERS = ("the letter", "the letter, tau .03")


@question(
    "printed",
    "Does the algorithm learn as it is printed?",
    """A robot learns if its last five episodes take fewer steps than its first five, and than random actions in the
    same world (ratios of means). Yes, if the letter does, with the temperature 1 and with .03; no, if with neither it
    does, and each time one of the two comparisons says the same or more; else undecided (k = 4). Every other row is
    judged by the same two comparisons, beside the verdict.""",
    PRINTED,
    order=1,
)
def printed(table: Any) -> Judged:
    found: dict[str, Comparison] = {}
    ours = column(table, "total", condition=_OURS_LABEL)
    for name, settings in PRINTED.conditions.items():
        early, late = (column(table, one, condition=name) for one in ("early", "late"))
        found[f"{name}.early"], found[f"{name}.late"] = estimate(early), estimate(late)
        if settings.controller == "random":
            continue
        chance = column(table, "late", condition=f"random, {settings.centre}, {settings.variance}")
        together = 4 if name in LETTERS else 0
        found[f"{name}.of first"] = compare_steps(late, early, comparisons=together)
        found[f"{name}.of random"] = compare_steps(late, chance, comparisons=together)
        if name != _OURS_LABEL:
            found[f"{name}.of ours.total"] = compare_steps(column(table, "total", condition=name), ours)
    at_each = {learns(found, name) for name in LETTERS}
    return at_each.pop() if len(at_each) == 1 else "undecided", found


def learns(found: dict[str, Comparison], name: str) -> str:
    """Whether a row does: yes, no or undecided."""
    words = (found[f"{name}.{against}"].verdict for against in ("of first", "of random"))
    return verdict_of(words, ["fewer"], ["the same", "more"], OF_A_QUESTION)
