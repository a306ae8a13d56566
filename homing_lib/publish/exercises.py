"""The checks of the exercises in the notebooks, by notebook and exercise: "4.2" is notebook 4, exercise 2.

What a check is and says: `lab`.
"""

from collections.abc import Callable
from typing import get_args

import numpy as np

from homing_lib.agent import STEP_COLUMNS, Run
from homing_lib.features import Array
from homing_lib.lambdas import RULES, LambdaRule
from homing_lib.publish.lab import Wrong, check, expect
from homing_lib.settings import Settings
from homing_lib.study import walk
from homing_lib.study.measures import WINDOW
from homing_lib.study.runs import by_episode
from homing_lib.td import Form, LinearTD
from homing_lib.thresholds import Thresholds, stopping_thresholds


@check("3.1 · a run in one number")
def late_steps(late: Callable[[Run], float]) -> None:
    """It is the mean steps of the five last episodes of the plan; those that a lost run did not reach count as the cap.

    late: a run to that number.
    """
    rng = np.random.default_rng(31)
    settings = Settings(images="compact", episodes=8, max_steps=200)
    for finished in (8, 8, 6, 1):
        lengths, lost = rng.integers(20, 200, finished), 0 if finished == 8 else finished + 1
        run = Run(settings, 0, np.zeros((lengths.sum(), len(STEP_COLUMNS))), lengths, np.ones(finished, bool), lost)
        steps = by_episode([run])[0]
        mistakes = {
            "A run whose weights are lost ends early. Left out, what it did not finish makes it look good.": (
                lengths[-WINDOW:].mean()
            ),
            "Those are its first five episodes, in which it has hardly learnt.": steps[:WINDOW].mean(),
            "Those are all episodes, the first ones too, in which it has hardly learnt.": steps.mean(),
            "That is the sum, not the mean.": steps[-WINDOW:].sum(),
            "Those are the last four: of an array, [-5:] are the last five.": steps[-WINDOW + 1 :].mean(),
        }
        told = f"Episodes of {lengths.tolist()} steps, of {settings.episodes} planned, give {steps[-WINDOW:].mean():g}."
        expect(late(run), steps[-WINDOW:].mean(), mistakes, told)


@check("3.2 · steps in the band")
def share_in_band(share: Callable[[Array, Thresholds], float]) -> None:
    """It is the share of the steps that end at the lower threshold or above, and below the upper, which is home.

    share: similarities, shape (steps,), and the two thresholds to a number.
    """
    rng, psi = np.random.default_rng(32), stopping_thresholds(Settings().multiplier)
    for _ in range(5):
        nrb = np.r_[rng.uniform(2 * psi.lower - psi.upper, 2 * psi.upper - psi.lower, 30), psi.lower, psi.upper]
        inside = (nrb >= psi.lower) & (nrb < psi.upper)
        mistakes = {
            "That is how many steps, not their share of all.": inside.sum(),
            "Steps that end at home count, too: what about the upper threshold?": (nrb >= psi.lower).mean(),
            "Steps far from home count, too: what about the lower threshold?": (nrb < psi.upper).mean(),
            "At the upper threshold the robot is home.": ((nrb >= psi.lower) & (nrb <= psi.upper)).mean(),
            "At the lower threshold the reward begins: that step counts.": (
                (nrb > psi.lower) & (nrb < psi.upper)
            ).mean(),
        }
        expect(share(nrb.copy(), psi), inside.mean(), mistakes, f"Of these steps {inside.sum()} in {len(nrb)} count.")


@check("4.1 · features without overlap")
def on_orthogonal_features(ratio: Callable[[float, float, float], float]) -> None:
    """It is the λ of all three forms where features are orthogonal, of length 1 and never seen twice.

    ratio: (delta, delta_prev, discount) to a number.
    """
    rng, new = np.random.default_rng(41), np.eye(9)
    for form in get_args(Form):
        discount, before = rng.uniform(0.5, 0.95), 0.0
        learner = LinearTD(9, step_size=0.1, discount=discount, lambda_rule=RULES[form], clip=False)
        for t in range(8):
            delta = learner.update(new[t], rng.normal(), new[t + 1])
            if t:
                of, told = delta / before, f"With errors {before:.3f}, then {delta:.3f}, and γ = {discount:.3f}"
                mistakes = {
                    "γ is missing: it stands in the denominator of (7).": of,
                    "γ stands in the denominator, not before the ratio.": discount * of,
                    "That is the ratio upside down: above is the error of now.": 1 / (discount * of),
                    "That is β. λ is β times the error before over that of now, and over γ.": of**2,
                    "The sign is wrong: in form 1, Δg holds minus the g of before.": -of / discount,
                }
                expect(
                    ratio(delta, before, discount), learner.lambda_, mistakes, f"{told}, λ is {learner.lambda_:.3f}."
                )
            before = delta


@check("4.2 · a rule against λ = 0.8")
def as_good_as_a_constant(rule: LambdaRule) -> str:
    """At its best step size, and on walks that did not choose it, the rule is better than λ = 0.8 or comparable."""
    found = walk.race({"λ = 0.8": "fixed:0.8", "yours": rule}).verdicts["yours"]
    told = f"Its error is {found:.2f} of that of λ = 0.8: {found.word}."
    if found.word not in ("better", "comparable"):
        raise Wrong(f"{told} {_at_rest(rule)}")
    return told


def _at_rest(rule: LambdaRule) -> str:
    """What a rule does where nothing is learnt yet: a hint for one that loses."""
    before, now = np.eye(2)
    try:
        kept = rule(delta=0.0, phi=now, delta_prev=0.0, phi_prev=before, trace_prev=before, discount=1.0)
    except ArithmeticError:
        does = "divides by zero, and λ is 0"
    else:
        does = "forgets the whole trace" if kept <= 0 else "keeps the whole trace" if kept >= 1 else f"keeps {kept:g}"
    return f"Where both errors are 0, as at most steps of the first episodes, it {does}."
