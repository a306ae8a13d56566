"""The checks of the lab, notebooks/lab.ipynb, task by task, and what it computes beside them.

What a check is and says: `checks`. Trials are random, from a generator of a given seed.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from math import ceil, log
from numbers import Real
from typing import Any

import numpy as np
import pandas as pd

from homing_lib import lambdas
from homing_lib.features import Array
from homing_lib.settings import Settings
from homing_lib.study import engine, findings, rules, theorem, walk
from homing_lib.study.questions import drives as what_drives
from homing_lib.study.runs import episode_matrix
from homing_lib.td import LinearTD
from homing_lib.teach import checks
from homing_lib.teach.checks import SEED, Outcome, Wrong, alike, check, expect, hint

# --- Task 1: the trace -----------------------------------------------------------------------------------------------


@check("1a · the trace")
def trace(update: Any) -> None:
    """A trace made step by step is the sum of all features so far, each faded by γλ at every step since.

    update: (e, phi, lambda_t, gamma) to the new trace, arrays of shape (n,).
    """
    rng = np.random.default_rng(SEED)
    mistakes: dict[str, Callable[..., Array]] = {
        "γ is missing: the trace fades by γλ, not by λ alone.": lambda e, phi, lambda_t, gamma: lambda_t * e + phi,
        "λ is missing: the trace fades by γλ, not by γ alone.": lambda e, phi, lambda_t, gamma: gamma * e + phi,
        "The new feature has faded, too: first the old trace fades, then the feature is added.": (
            lambda e, phi, lambda_t, gamma: gamma * lambda_t * (e + phi)
        ),
        "Nothing is left of the old trace.": lambda e, phi, lambda_t, gamma: phi,
        "The trace is a sum and no average: the new feature counts in full.": (
            lambda e, phi, lambda_t, gamma: gamma * lambda_t * e + (1 - gamma * lambda_t) * phi
        ),
    }
    for _ in range(10):
        gamma, lambdas_, phi = rng.uniform(0.5, 0.95), rng.uniform(0.1, 0.9, 6), rng.normal(size=(6, 4))
        e, wrong = np.zeros(4), dict.fromkeys(mistakes, np.zeros(4))
        for t in range(6):
            before = e.copy()
            after = np.array(update(e, phi[t].copy(), lambdas_[t], gamma), dtype=float)
            if not alike(e, before):
                raise Wrong(
                    "The array e itself was changed; a learner still needs e of the step before. Make a new one."
                )
            wrong = {hint: mistake(wrong[hint], phi[t], lambdas_[t], gamma) for hint, mistake in mistakes.items()}
            unrolled = sum(np.prod(gamma * lambdas_[k + 1 : t + 1]) * phi[k] for k in range(t + 1))
            expect(after, unrolled, wrong, "The trace is not the sum of the faded features. What is e after two steps?")
            e = after


@check("1b · what is left of a feature")
def share(left: Any) -> None:
    """What is left of a feature is what the trace holds of it, if it comes once and nothing comes after it.

    left: (lambdas, gamma) to a number; lambdas: those of the steps since, shape (steps,).
    """
    rng = np.random.default_rng(SEED)
    for steps in (2, 3, 5, 1, 0):
        gamma, lambdas_ = rng.uniform(0.5, 0.95), rng.uniform(0.2, 0.9, steps)
        e = 1.0
        for lambda_t in lambdas_:
            e *= gamma * lambda_t
        last = lambdas_[-1] if steps else 1.0
        mistakes = {
            "γ is missing: at each step γλ is left, not λ.": np.prod(lambdas_),
            "γ counts once only: at each step γλ is left.": gamma * np.prod(lambdas_),
            "That is a power of one λ; each step has a λ of its own.": (gamma * last) ** steps,
            "Shares of shares are multiplied, not added.": gamma * lambdas_.sum(),
            "That is a power of the mean λ; each step has a λ of its own.": (gamma * lambdas_.mean()) ** steps
            if steps
            else 0.0,
        }
        expect(
            left(lambdas_.copy(), gamma),
            e,
            mistakes,
            f"After {steps} steps another share is left. Try one step, then two.",
        )


# --- Task 2: from beta to lambda -------------------------------------------------------------------------------------


@check("2a · from β to λ")
def from_beta(lambda_of: Any) -> None:
    """With this λ, δe is p: TD(λ) moves where conjugate gradient moves, whatever β is.

    lambda_of: (beta, delta, delta_prev, gamma) to a number.
    """
    rng = np.random.default_rng(SEED)
    for _ in range(10):
        beta, delta, delta_prev = rng.normal(size=3)
        gamma, (phi, e_prev) = rng.uniform(0.5, 0.95), rng.normal(size=(2, 4))
        p = delta * phi + beta * (delta_prev * e_prev)
        mistakes = {
            "γ is missing: the trace fades by γλ, so λ must make up for γ.": beta * delta_prev / delta,
            "The two errors are upside down: which of them multiplies the old trace in p?": (
                beta * delta / (gamma * delta_prev)
            ),
            "γ is on the wrong side of the fraction: what γλ must be is divided by γ.": (
                beta * gamma * delta_prev / delta
            ),
            "β is the share of the old direction; λ is that of the old trace, and the two errors stand between them.": (
                beta
            ),
        }
        lambda_t = lambda_of(beta, delta, delta_prev, gamma)
        if not alike(delta * (gamma * lambda_t * e_prev + phi), p):
            raise Wrong(hint(lambda_t, mistakes, "δe is not p. Put e = γλe + φ into δe = p and solve for λ."))


def on_a_quadratic(form_1: lambdas.LambdaRule) -> Array:
    """The λ of form_1, form 2 and form 3 at each step but the first of `theorem.on_a_quadratic`, shape (4, 3)."""
    forms = form_1, lambdas.fletcher_reeves, lambdas.polak_ribiere
    return theorem.on_a_quadratic(forms, np.random.default_rng(SEED))[0]


@check("2b · the lost sign")
def form_1(rule: Any) -> None:
    """With this λ the step stands at right angles to the change of the gradient, and on a quadratic with exact line
    search the three forms are one number.

    rule: form 1 as a lambda rule.
    """
    rng = np.random.default_rng(SEED)
    for _ in range(10):
        delta, delta_prev = rng.normal(size=2)
        phi, phi_prev, e = rng.normal(size=(3, 4))
        gamma = rng.uniform(0.5, 0.95)
        change = delta * phi - delta_prev * phi_prev
        late = phi - phi_prev  # δ before taken for δ, or none at all
        given = rule(delta=delta, phi=phi, delta_prev=delta_prev, phi_prev=phi_prev, trace_prev=e, discount=gamma)
        if np.ndim(given):
            raise Wrong("This is an array, and λ is one number: of two vectors, `a @ b` is one, `a * b` is none.")
        lambda_t = float(given)
        along = change @ (gamma * lambda_t * e + phi)
        if abs(along) < 1e-9 * np.linalg.norm(change) * np.linalg.norm(gamma * lambda_t * e + phi):
            continue
        mistakes = {
            "The minus is missing: with this λ, Δg·(γλe + φ) is not 0 but 2 Δg·φ.": (change @ phi)
            / (gamma * change @ e),
            "γ is missing in the denominator.": -(change @ phi) / (change @ e),
            "Δg is the change of δφ: each feature goes with the error of its own step.": -(late @ phi)
            / (gamma * late @ e),
            "The denominator asks for the trace, not for the feature before.": -(change @ phi)
            / (gamma * change @ phi_prev),
            "The numerator has δ once too often: there, Δg meets φ, not g.": -(change @ (delta * phi))
            / (gamma * change @ e),
        }
        raise Wrong(hint(lambda_t, mistakes, "δe is not at right angles to Δg. Solve (γλe + φ)·Δg = 0 for λ."))
    if not alike(table := on_a_quadratic(rule), np.tile(table[:, 1:2], 3), 1e-6):
        raise Wrong("On the quadratic it parts from forms 2 and 3.")


# --- Task 3: until the first reset -----------------------------------------------------------------------------------

STEPS = 12


GAMMA = 0.9


def parting(seed: int) -> theorem.Distance:
    """TD(λ_t) beside conjugate gradient on random features and rewards of a seed, form 2, of STEPS steps."""
    rng = np.random.default_rng(seed)
    phi, reward = rng.uniform(0.2, 1, (STEPS + 1, 5)), rng.uniform(0.3, 1, STEPS)
    reward *= np.where(rng.random(STEPS) < 0.15, -1, 1) * 0.9 ** np.arange(STEPS)
    return theorem.distance_from_cg(phi, reward, discount=GAMMA)


@check("3 · until the first reset")
def first_reset(predicted: Any, seed: int) -> str:
    """Before the step that was predicted both move alike, from it on they do not.

    predicted: a step, 1, 2, ...; seed: of `parting`.
    """
    found = parting(seed)
    if not isinstance(predicted, Real) or isinstance(predicted, bool) or predicted not in range(1, STEPS + 1):
        raise Wrong(f"A step is one whole number: 1, 2, ..., or {STEPS}.")
    predicted = round(float(predicted))
    apart = np.flatnonzero(found.reset > 1e-6)
    if apart.size and predicted == apart[0] + 1:
        return f"Here that is step {predicted}, where form 2 gives λ = {found.ratio[predicted - 1]:.2f}."
    above = np.flatnonzero(found.ratio > 1)
    no_gamma = np.flatnonzero((found.ratio * GAMMA > 1) | (found.ratio < 0))
    if predicted == 1:
        raise Wrong("At the first step there is no step before: λ is 0 there, and nothing is reset.")
    if predicted == found.first - 1:
        raise Wrong("One too early. Steps count from 1, and the ratio of step t has δ of step t above, of t - 1 below.")
    if predicted == found.first - 2:
        raise Wrong("Two too early. If you computed an array of ratios: its entry 0 belongs to step 2.")
    if above.size and predicted == above[0] + 1:
        raise Wrong("There λ passes 1, but before that it was below 0 already, which is outside [0, 1], too.")
    if no_gamma.size and predicted == no_gamma[0] + 1:
        raise Wrong("γ is missing: it stands below the line, and takes some λ past 1 that would else stay within.")
    if predicted > found.first:
        raise Wrong(
            f"Too late: a λ left [0, 1] before step {predicted}, and each direction is built on the one before."
        )
    raise Wrong(f"At step {predicted} λ is {found.ratio[predicted - 1]:.2f}, within [0, 1], and none left it before.")


# --- Task 4: 0/0 -----------------------------------------------------------------------------------------------------

GUARDS = (0, 0.8, 1)


def first_episode(rule: lambdas.LambdaRule, states: Sequence[int], on_zero: float = 0.0) -> Array:
    """The values of the 19 states after one episode of the random walk. states: one of `walk.walks`."""
    learner = LinearTD(19, step_size=0.1, discount=1.0, lambda_rule=rule, on_zero=on_zero)
    walk.follow(learner, states)
    return learner.weights


@check("4a · what a guard is")
def guards(same_as: Any, states: Sequence[int]) -> None:
    """In the first episode form 2 is TD(λ) with the fixed λ that was predicted, guard by guard.

    same_as: by guard, 0, .8 and 1, a fixed λ; states: of the walk.
    """
    _complete(same_as, GUARDS)
    wrong = {guard: _lambda_of(same_as, guard) for guard in GUARDS}
    for guard, fixed in wrong.items():
        with_guard = first_episode(lambdas.fletcher_reeves, states, guard)
        if alike(first_episode(lambdas.Fixed(fixed), states), with_guard):
            continue
        if all(alike(wrong[one], 1 - one) for one in GUARDS):
            raise Wrong("A guard is the λ that stands in, so the share that is kept, not the one that is lost.")
        if fixed == 0:
            raise Wrong(f"With the guard {guard:g}, 0/0 does not make λ 0: the guard stands in for it.")
        if len(set(wrong.values())) == 1:
            raise Wrong("The guards do not all act alike: at which steps of the first episode is the ratio defined?")
        raise Wrong(f"With the guard {guard:g} it is another λ: what are δ and the δ before, until the end is reached?")


def _complete(answers: Any, keys: Sequence[Any]) -> None:
    """Wrong for what is no dictionary with these keys."""
    if not isinstance(answers, Mapping):
        raise Wrong(f"Write a dictionary: {{{', '.join(f'{key!r}: ...' for key in keys)}}}.")
    for key in keys:
        if key not in answers:
            raise Wrong(f"{key} is missing.")


def _lambda_of(same_as: Any, guard: float) -> float:
    if not isinstance(same_as[guard], Real) or not 0 <= same_as[guard] <= 1:
        raise Wrong(f"With the guard {guard:g}: a fixed λ is a number from 0 to 1.")
    return float(same_as[guard])


@check("4b · how far one reward reaches")
def reach(changed: Any, states: Sequence[int]) -> None:
    """After the first episode as many values have changed as was predicted, guard by guard.

    changed: by guard, 0, .8 and 1, a number of states; states: of the walk.
    """
    _complete(changed, GUARDS)
    visited = len(set(states[:-1]))
    for guard in GUARDS:
        found, said = np.count_nonzero(first_episode(lambdas.fletcher_reeves, states, guard)), changed[guard]
        if said == found:
            continue
        if guard == 0:
            if said == 0:
                raise Wrong(
                    "With the guard 0 something is learnt: the last TD error is not 0, and moves the last state."
                )
            raise Wrong("With the guard 0 the trace holds the last feature alone.")
        if said == len(states) - 1:
            raise Wrong("Those are the steps; a state that is visited twice is one state.")
        if said == visited + 1:
            raise Wrong(f"One too many: {states[-1]} is beyond the end, and no state.")
        if said == 19:
            raise Wrong("A state that was not visited has no trace, whatever the guard.")
        if said < visited:
            raise Wrong(f"With the guard {guard:g}: what fades never quite reaches 0.")
        raise Wrong(f"With the guard {guard:g} only states on the way can change. Which are they?")


# --- Task 5: a rule of one's own -------------------------------------------------------------------------------------


@check("5a · a rule")
def a_rule(rule: Any) -> None:
    """It is a lambda rule: it takes the six keywords, and whatever they are it gives one finite number in [0, 1].

    rule: see `lambdas`.
    """
    try:
        lambdas.checked(rule)
    except TypeError:
        raise Wrong(
            "A rule is called by keyword: def my_rule(*, delta, delta_prev, **_), `**_` for what it ignores."
        ) from None
    rng = np.random.default_rng(SEED)
    for trial in range(300):
        delta, delta_prev = (rng.normal(size=2) * rng.choice((0.0, 1.0, 100.0), 2) + 0.0).tolist()  # -0 is 0
        arrays = dict(zip(("phi", "phi_prev", "trace_prev"), rng.normal(size=(3, 6)) * (trial % 4 > 0), strict=True))
        before = {name: array.copy() for name, array in arrays.items()}
        met = f"with δ = {delta:.3g} after {delta_prev:.3g}"
        try:
            with np.errstate(all="ignore"):
                lambda_t = rule(delta=delta, delta_prev=delta_prev, discount=0.9, **arrays)
        except ArithmeticError:
            ask = "`if delta_prev == 0: return ...`" if delta_prev == 0 else "ask for 0 before you divide."
            raise Wrong(f"It divides by 0 {met}. Say which λ stands in there: {ask}") from None
        for name, array in before.items():
            if not alike(arrays[name], array):
                raise Wrong(f"It changes {name}, which belongs to the learner: work on a copy.")
        if np.ndim(lambda_t):
            raise Wrong("It gives an array; λ is one number for the step. Of two vectors, `phi @ phi_prev` is one.")
        if np.asarray(lambda_t).dtype.kind not in "biuf":
            raise Wrong(f"It gives a {type(lambda_t).__name__}; λ is a number.")
        if not np.isfinite(lambda_t):
            raise Wrong(f"It gives {lambda_t} {met}: NumPy divides by 0 without a word. Ask for 0 before you divide.")
        if lambda_t > 1:
            raise Wrong(f"It gives {lambda_t:.3g} {met}. Cut to [0, 1] last of all, after every factor.")
        if lambda_t < 0:
            raise Wrong(f"It gives {lambda_t:.3g} {met}: below 0. max(0, ...) says what to do where the signs differ.")


HELD_OUT = range(1000, 1020)


@check("5b · the race")
def race(rule: Any) -> str:
    """On walks held out, with a step size chosen on others, the rule is not shown to be worse than λ = 0.8."""
    return raced(rule, HELD_OUT)


@check("practice")
def practice(rule: Any) -> str:
    """On the walks to practise on, the rule is not shown to be worse than λ = 0.8."""
    return raced(rule, range(100, 110))


def raced(rule: Any, judge: Sequence[int], choose: Sequence[int] = range(6)) -> str:
    """What to say of a rule that does not lose, Wrong for one that does. judge, choose: seeds as of `walk.race`."""
    found = walk.race({"λ = 0.8": lambdas.Fixed(0.8), "the rule": rule}, choose, judge)
    against = found.verdicts["the rule"]
    step_size, verdict = found.step_size["the rule"], WORDS[against.verdict]
    told = f"Its error is {against:.2f} of that of λ = 0.8, at α = {step_size:g}: {verdict}."
    if against.verdict != "more":
        return told
    undefined, kept = _asked_how_often(rule, judge, found.step_size["the rule"])
    why = "With which λ would the reward of an end reach the middle sooner?"
    if undefined > 0.2:
        why = f"In {undefined:.0%} of the steps it has no λ, and the guard is 0. What is it to be where δ before is 0?"
    elif kept < 0.4:
        why = f"Its mean λ is {kept:.2f}: it forgets too soon. At first nearly every δ is 0; what does it say then?"
    elif kept > 0.95:
        why = f"Its mean λ is {kept:.2f}: it never forgets, and blames all that ever was for the noise of today."
    raise Wrong(f"{told} {why}")


WORDS = {"fewer": "better", "more": "worse", "the same": "tie", "undecided": "tie"}
"""What a comparison is called here: a tie is all that is neither better nor worse."""


def _asked_how_often(rule: Any, seeds: Sequence[int], step_size: float) -> tuple[float, float]:
    """On the walks of these seeds: the share of the steps at which a rule has no λ, and the mean of those it has."""
    given: list[float] = []

    def noting(**step: Any) -> float:
        given.append(np.nan)
        given[-1] = rule(**step)
        return given[-1]

    for seed in seeds:
        walk.learning(noting, seed, step_size)
    has = np.clip(given, 0, 1)[~np.isnan(given)]
    return 1 - len(has) / len(given), float(has.mean()) if len(has) else 0.0


# --- Task 6: the robot -----------------------------------------------------------------------------------------------


def robot(rule: lambdas.LambdaRule, seeds: range = range(1000)) -> rules.Rules:
    """The rule drives the robot on the compact atlas, against fixed 0, form 2, the gate, and the climb up the
    similarity, which learns nothing. Where the rule is none, λ = 0.8 drives in its stead.
    """
    mine = "my rule"
    if (outcome := a_rule.judge(rule)).verdict != "proven":
        print(f"{outcome}\nFixed λ = 0.8 drives in its stead.")
        mine, rule = "λ = 0.8, stand-in", lambdas.Fixed(0.8)
    return rules.Rules({**rules.compare({mine: rule}, seeds).steps, **_rivals(seeds)})


@cache
def _rivals(seeds: range) -> Mapping[str, Array]:
    """The steps of the others, who are the same for every rule."""
    learnt = rules.compare({label: lambdas.lambda_spec(rule).rule for label, rule in RIVALS.items()}, seeds)
    climb = Settings(images="compact", controller="climb")
    climbed = engine.side_by_side(lambda seed: episode_matrix([engine.run(climb, seed)])[0], seeds, [])
    return {**learnt.steps, "the climb": np.array(climbed)}


RIVALS = {"fixed 0": "fixed:0", "form 2": "fletcher-reeves", "gate": "gate"}


def table(found: rules.Rules) -> str:
    """The drivers' total steps as a multiple of those of the rule, without verdicts, in Markdown."""
    mine = next(iter(found.steps))
    rows = [f"| driver | steps of all episodes, mean | as a multiple of {mine} |", "|---|---|---|"]
    for label, steps in found.steps.items():
        ratio = f"{found.verdicts[label]:.2f}" if label != mine else "1"
        rows.append(f"| {label} | {steps.sum(axis=1).mean():,.0f} | {ratio} |")
    return "\n".join(rows)


@check("6 · what may be said")
def read(words: Any, found: rules.Rules) -> str:
    """Better or worse is said only where the whole interval lies on one side of 1, and not all of it within a tenth.

    words: by driver, "better", "worse" or "tie": what my rule is.
    """
    _complete(words, [*found.verdicts])
    mine = {"fewer": "worse", "more": "better"}  # by what the other takes
    for label, against in found.verdicts.items():
        said, right = words[label], mine.get(against.verdict, "tie")
        if said not in ("better", "worse", "tie"):
            raise Wrong(f"{label}: say better, worse or tie.")
        if said == right:
            continue
        if against.verdict == "the same":
            raise Wrong(f"{label}: {against:.2f} lies between 0.91 and 1.1, whatever side of 1: a tie.")
        if right == "tie":
            raise Wrong(f"{label}: {against:.2f} holds 1, so that chance may have done it.")
        if said == "tie":
            raise Wrong(f"{label}: {against:.2f} lies on one side of 1, so that something may be said.")
        raise Wrong(f"{label}: the wrong way round. Above 1 the others take more steps, and mine is better.")
    return f"Mine is: {', '.join(f'{words[label]} against {label}' for label in found.verdicts)}."


# --- Task 7: the same robot, learning on and frozen ------------------------------------------------------------------

ALONE = {"the weights learnt alone": "frozen", "the updates alone": "forgetful", "both together": "restored"}
"""What a robot may have, and how it is then called in `drives`."""


def tried(seeds: range = range(200)) -> dict[str, Array]:
    """What robots do after ten of twenty episodes on the compact atlas, from the start: by kind, as in `drives`, the
    steps of a trial, one number per robot.
    """
    settings = what_drives.after(what_drives.JUDGED_AFTER, images="compact")
    each = engine.side_by_side(lambda seed: what_drives.tried(settings, seed), seeds, [])
    found = pd.concat([pd.DataFrame(one).assign(seed=seed) for seed, one in zip(seeds, each, strict=True)])
    return {kind: what_drives.outcomes(found, "steps", kind) for kind in what_drives.KINDS}


def four_ways(found: Mapping[str, Array]) -> str:
    """The steps of `tried`, with and without the weights learnt and the learning, in Markdown."""
    told = {kind: f"{findings.estimate(steps):.0f}" for kind, steps in found.items()}
    rows = [
        "| steps to home, mean | learning on | frozen |",
        "|---|---|---|",
        f"| **weights learnt** | {told['restored']} | {told['frozen']} |",
        f"| **initial weights** | {told['forgetful']} | {told['untrained']} |",
        "",
        f"The climb: {told['climb']}. Random actions: {told['random']}.",
    ]
    return "\n".join(rows)


@check("7 · what drives it")
def drives(words: Any, found: Mapping[str, Array]) -> str:
    """A part brings the robot home if with it the robot takes fewer steps than random actions, by the whole interval.

    words: by part, True or False; found: of `tried`.
    """
    _complete(words, [*ALONE])
    ratios = {part: findings.compare_steps(found[kind], found["random"]) for part, kind in ALONE.items()}
    for part, ratio in ratios.items():
        if not isinstance(words[part], bool | np.bool_):
            raise Wrong(f"{part}: say True or False.")
        if words[part] == (ratio.high < 1):
            continue
        beside = f"{part}: {ratio:.2f} times the steps of random actions"
        if ratio.high < 1 and part == "both together":
            raise Wrong(f"{beside}, which is fewer. That neither part does it alone says nothing of the two together.")
        if ratio.high < 1:
            raise Wrong(f"{beside}, which is fewer.")
        if ratio.low <= 1:
            raise Wrong(f"{beside}, which holds 1, so that chance may have done it.")
        if findings.compare_steps(found[ALONE[part]], found["untrained"]).high < 1:
            raise Wrong(f"{beside}: more. It is fewer than with neither part, but that robot is worse than chance.")
        raise Wrong(f"{beside}: more. Above 1 random actions are home sooner.")
    return f"As a multiple of random actions: {', '.join(f'{part} {ratio:.2f}' for part, ratio in ratios.items())}."


# --- What was proven, and shown --------------------------------------------------------------------------------------

TASKS = (trace, share, from_beta, form_1, first_reset, guards, reach, a_rule, race, read, drives)


def report() -> None:
    """Print what was found of each task of the lab, and how many are proven."""
    found = [checks.RECORD.get(task.title, Outcome(task.title, "blank", "Its cell was not run.")) for task in TASKS]
    order = [*checks.RECORD]
    earlier = order[: order.index(a_rule.title)] if a_rule.title in order else []
    for at, (title, verdict, _) in enumerate(found):
        if verdict == "proven" and title in earlier and title in (race.title, read.title):
            found[at] = Outcome(title, "blank", "It was answered for an earlier rule: run its cells again.")
    print(*found, sep="\n")
    print(f"{sum(outcome.verdict == 'proven' for outcome in found)} of {len(TASKS)} proven.")


def recap(seen: theorem.Distance, raced: walk.Race, found: rules.Rules, tried: Mapping[str, Array]) -> None:
    """Print what each task should have shown, in a line each. seen, raced, found, tried: what tasks 3, 4, 6 and 7
    computed."""
    steps = ceil(log(0.5) / log(0.9 * 0.8))
    print(f"1 · With γ = 0.9 and λ = 0.8, less than half of a feature is left after {steps} steps.")
    printed, form_2, _ = on_a_quadratic(lambdas.RULES["hestenes-stiefel:printed"]).T
    print(
        f"2 · On a quadratic the printed form 1 is {np.mean(printed / form_2):.0f} times form 2, so the sign got lost."
    )
    after = seen.reset[seen.first - 1 :]
    back = "it comes back" if after.min() < 1e-6 else "it does not come back: each direction is built on the one before"
    told = f"They part at step {seen.first}; from there on δe is {after.min():.1g} |p| from p, or more, and {back}."
    print(f"3 · {told if seen.first else 'No λ leaves [0, 1] here, and they do not part.'}")
    errors = {label: of_rule.mean() for label, of_rule in raced.errors.items()}
    guarded = [errors[f"form 2, guard {guard:g}"] for guard in GUARDS]
    by_guard = max(guarded) / min(guarded)
    to_fixed = guarded[0] / errors["λ = 0"], guarded[1] / errors["λ = 0.8"]
    by_ratio = max(max(one, 1 / one) for one in to_fixed)
    print(
        f"4 · From guard to guard, form 2's error differs by a factor of up to {by_guard:.2f}; guards 0 and 0.8 from "
        f"λ = 0 and 0.8 by up to {by_ratio:.2f}. The {'guard' if by_guard > by_ratio else 'ratio'} moves it more."
    )
    undefined, _ = _asked_how_often(lambdas.fletcher_reeves, HELD_OUT, raced.step_size["form 2, guard 0"])
    print(f"5 · In {undefined:.0%} of the steps of the race form 2 has no λ. What your rule says there is its guard.")
    mine = next(iter(found.steps))
    learns = found.steps[mine].mean(axis=0)
    climb = found.steps["the climb"].mean()
    caught = [*np.flatnonzero(learns <= climb), len(learns)][0]
    when = (
        f"takes as few in episode {caught + 1}" if caught < len(learns) else f"takes more in each of {caught} episodes"
    )
    print(
        f"6 · The climb takes {climb:.0f} steps per episode; {mine} {when}, and by then "
        f"{(learns[:caught] - climb).sum():.0f} more in all. The robot pays for those."
    )
    home = {kind: taken.mean() for kind, taken in tried.items()}
    print(
        f"7 · After ten episodes the robot that learns on takes {home['restored']:.0f} steps, frozen it takes "
        f"{home['frozen']:.0f}, learning from the initial weights {home['forgetful']:.0f}; the climb "
        f"{home['climb']:.0f}, random actions {home['random']:.0f}. What it learnt is "
        f"{'worse' if home['frozen'] > home['random'] else 'better'} than chance without the learning."
    )
