"""The checks of the lab, notebooks/lab.ipynb, task by task.

What a check is and says: `checks`. Here stand the usual mistakes, in lab.toml the hint to each, by task and mistake.
Trials are random, from a generator of a given seed.
"""

import tomllib
from collections.abc import Mapping, Sequence
from itertools import count
from math import nan
from numbers import Real
from pathlib import Path
from typing import Any

import numpy as np
from IPython.display import display
from numpy.typing import NDArray

from homing_lib import lambdas
from homing_lib.features import Array
from homing_lib.study import engine, findings, rules, walk
from homing_lib.study.compiling import load
from homing_lib.teach import checks, experiments
from homing_lib.teach.checks import SEED, Behind, Outcome, Wrong, alike, check, complete, first_of, mistake_in, must
from homing_lib.teach.experiments import FEW, GAMMA, GUARDS, STEPS, first_episode, mine_against

HINTS: dict[str, dict[str, str]] = tomllib.loads(Path(__file__).with_name("lab.toml").read_text(encoding="utf-8"))


def hint(task: str, mistake: str, **values: Any) -> str:
    """What to say of a mistake. values: what fills the braces of its hint."""
    return HINTS[task][mistake].format(**values)


@check("1a · the trace")
def trace(update: Any) -> None:
    """A trace made step by step is the sum of all features so far, each faded by γλ at every step since.

    update: (e, phi, lambda_t, gamma) to the new trace, arrays of shape (n,).
    """
    rng = np.random.default_rng(SEED)
    for _ in range(10):
        gamma, lambdas_, phi = rng.uniform(0.5, 0.95), rng.uniform(0.1, 0.9, 6), rng.normal(size=(6, 4))
        e = np.zeros(4)
        for t in range(6):
            before, fade = e.copy(), gamma * lambdas_[t]
            after = np.array(update(e, phi[t].copy(), lambdas_[t], gamma), dtype=float)
            must(alike(e, before), hint("trace", "in-place"))
            must(after.shape == e.shape, hint("trace", "shape", shape=after.shape))
            mistakes = {
                "no-gamma": lambdas_[t] * e + phi[t],
                "no-lambda": gamma * e + phi[t],
                "faded-feature": fade * (e + phi[t]),
                "scaled-feature": fade * e + lambdas_[t] * phi[t],
                "minus": fade * e - phi[t],
                "average": fade * e + (1 - fade) * phi[t],
            }
            right = sum(np.prod(gamma * lambdas_[k + 1 : t + 1]) * phi[k] for k in range(t + 1))
            must(alike(after, right), hint("trace", mistake_in(after, mistakes)))
            e = after


@check("1b · what is left of a feature")
def share(left: Any) -> None:
    """What is left of a feature is what the trace holds of it, if it comes once and nothing comes after it.

    left: (lambdas, gamma) to a number; lambdas: those of the steps since, shape (steps,).
    """
    rng = np.random.default_rng(SEED)
    for steps in (3, 2, 5, 1):  # three first: with two, γ once less is γ once
        gamma, lambdas_ = rng.uniform(0.5, 0.95), rng.uniform(0.2, 0.9, steps)
        e = 1.0
        for lambda_t in lambdas_:
            e *= gamma * lambda_t
        answer = left(lambdas_.copy(), gamma)
        mistakes = {
            "no-gamma": np.prod(lambdas_),
            "gamma-once": gamma * np.prod(lambdas_),
            "power-of-last": (gamma * lambdas_[-1]) ** steps,
            "sum": gamma * lambdas_.sum(),
        }
        must(alike(answer, e), hint("share", mistake_in(answer, mistakes), steps=steps))
    must(alike(left(np.zeros(0), 0.9), 1.0), hint("share", "no-steps"))


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
        lambda_t = lambda_of(beta, delta, delta_prev, gamma)
        mistakes = {
            "no-gamma": beta * delta_prev / delta,
            "upside-down": beta * delta / (gamma * delta_prev),
            "gamma-above": beta * gamma * delta_prev / delta,
            "beta": beta / gamma if alike(lambda_t, beta / gamma) else beta,
        }
        must(alike(delta * (gamma * lambda_t * e_prev + phi), p), hint("from-beta", mistake_in(lambda_t, mistakes)))


@check("2b · the lost sign")
def form_1(rule: Any) -> None:
    """With this λ the step stands at right angles to the change of the gradient.

    rule: form 1 as a lambda rule.
    """
    rng = np.random.default_rng(SEED)
    for _ in range(10):
        delta, delta_prev = rng.normal(size=2)
        phi, phi_prev, e = rng.normal(size=(3, 4))
        gamma = rng.uniform(0.5, 0.95)
        change = delta * phi - delta_prev * phi_prev
        late = phi - phi_prev  # one error for both, or none
        step = {"delta": delta, "phi": phi, "delta_prev": delta_prev, "phi_prev": phi_prev}
        try:
            lambda_t = rule(**step, trace_prev=e, discount=gamma)
        except ValueError as error:
            if "matmul" not in str(error):
                raise
            raise Wrong(hint("form-1", "no-features")) from None  # of a number and a vector there is no dot product
        if np.ndim(lambda_t):
            cancelled = alike(np.abs(lambda_t), np.abs(phi / (gamma * e)))
            raise Wrong(hint("form-1", "cancels" if cancelled else "array"))
        mistakes = {
            "no-minus": (change @ phi) / (gamma * change @ e),
            "no-gamma": -(change @ phi) / (change @ e),
            "one-error": -(late @ phi) / (gamma * late @ e),
            "feature-for-trace": -(change @ phi) / (gamma * change @ phi_prev),
        }
        direction = gamma * float(lambda_t) * e + phi
        right_angle = abs(change @ direction) <= 1e-9 * np.linalg.norm(change) * np.linalg.norm(direction)
        must(right_angle, hint("form-1", mistake_in(lambda_t, mistakes)))


@check("3 · until the first reset")
def first_reset(predicted: Any, seed: int) -> str:
    """Before the step that was predicted both move alike, from it on they do not.

    predicted: a step, 1, 2, ...; seed: of `experiments.twelve_steps`.
    """
    number = isinstance(predicted, Real) and not isinstance(predicted, bool)
    must(number and predicted in range(1, STEPS + 1), hint("first-reset", "no-step", steps=STEPS))
    step, seen = round(float(predicted)), experiments.twelve_steps(seed)
    ratio = seen.ratio[step - 1]
    mistakes = {
        "first-step": 1,
        "one-early": seen.first - 1,
        "two-early": seen.first - 2,
        "above-1": first_step(seen.ratio > 1),
        "no-gamma": first_step((seen.ratio * GAMMA > 1) | (seen.ratio < 0)),
    }
    if (mistake := mistake_in(step, mistakes)) == "otherwise" and 0 < seen.first < step:
        mistake = "late"
    must(step == first_step(seen.reset > 1e-6), hint("first-reset", mistake, step=step, ratio=ratio))
    return f"Here that is step {step}, where form 2 gives λ = {ratio:.2f}."


def first_step(where: NDArray[np.bool_]) -> float:
    """The first step, 1, 2, ..., at which something holds; NaN if there is none."""
    return float(where.argmax()) + 1 if where.any() else nan


@check("4a · what a guard is")
def guards(same_as: Any, states: Sequence[int]) -> None:
    """In the first episode form 2 is TD(λ) with the fixed λ that was predicted, guard by guard.

    same_as: by guard, 0, .8 and 1, a fixed λ; states: of the walk.
    """
    complete(same_as, GUARDS)
    for guard in GUARDS:
        number = isinstance(same_as[guard], Real)
        must(number and 0 <= same_as[guard] <= 1, hint("guards", "no-lambda", guard=guard))
    for guard in GUARDS:
        mistakes = {
            "share-lost": all(alike(same_as[each], 1 - each) for each in GUARDS),
            "zero": same_as[guard] == 0,
            "all-alike": len({float(same_as[each]) for each in GUARDS}) == 1,
        }
        fixed = first_episode(lambdas.Fixed(float(same_as[guard])), states)
        guarded = first_episode(lambdas.fletcher_reeves, states, guard)
        must(alike(fixed, guarded), hint("guards", first_of(mistakes), guard=guard))


@check("4b · how far one reward reaches")
def reach(changed: Any, states: Sequence[int]) -> None:
    """After the first episode as many values have changed as was predicted, guard by guard.

    changed: by guard, 0, .8 and 1, a number of states; states: of the walk.
    """
    complete(changed, GUARDS)
    visited = len(set(states[:-1]))
    for guard in GUARDS:
        answer = changed[guard]
        mistakes = {
            "last-alone": guard == 0,
            "steps": answer in (len(states) - 1, len(states)),
            "end": answer == visited + 1,
            "too-few": answer < visited,
        }
        right = np.count_nonzero(first_episode(lambdas.fletcher_reeves, states, guard))
        must(answer == right, hint("reach", first_of(mistakes), guard=guard, end=states[-1]))


def known_by(rule: Any) -> tuple[Any, ...]:
    """What tells a rule from others: its code, and what it gives at 300 random steps. Raises Wrong for what is none."""
    given = []
    try:
        lambdas.checked(rule)
    except TypeError:
        raise Wrong(hint("rule", "no-keywords")) from None
    rng = np.random.default_rng(SEED)
    for trial in range(300):
        delta, delta_prev = (rng.normal(size=2) * rng.choice((0.0, 1.0, 100.0), 2) + 0.0).tolist()  # -0 is 0
        arrays = dict(zip(("phi", "phi_prev", "trace_prev"), rng.normal(size=(3, 6)) * (trial % 4 > 0), strict=True))
        before = {name: array.copy() for name, array in arrays.items()}
        case = f"with δ = {delta:.3g} after {delta_prev:.3g}"
        try:
            with np.errstate(all="ignore"):
                value, again = (rule(delta=delta, delta_prev=delta_prev, discount=0.9, **arrays) for _ in range(2))
        except ArithmeticError:
            raise Wrong(hint("rule", "divides" if delta_prev else "divides-by-before", case=case)) from None
        for name, array in before.items():
            must(alike(arrays[name], array), hint("rule", "changes", name=name))
        must(np.ndim(value) == 0, hint("rule", "array"))
        must(np.asarray(value).dtype.kind in "biuf", hint("rule", "no-number", kind=type(value).__name__))
        must(np.isfinite(value), hint("rule", "not-finite", value=value, case=case))
        must(0 <= value <= 1, hint("rule", "below-0" if value < 0 else "above-1", value=float(value), case=case))
        must(again == value, hint("rule", "by-chance", value=float(value), again=float(again)))
        given.append(float(value))
    must(len({*given}) > 1, hint("rule", "constant", value=given[0]))
    return getattr(getattr(rule, "__wrapped__", rule), "__code__", None), given


@check("5a · a rule", about=known_by)
def a_rule(rule: Any) -> None:
    """It takes the six keywords, and gives one finite number in [0, 1] that depends on them, and on nothing else.

    rule: see `lambdas`.
    """
    known_by(rule)


WORDS = {"fewer": "better", "more": "worse", "the same": "tie", "undecided": "tie"}
"""What a comparison is called here: a tie is all that is neither better nor worse."""
RACES = count(1)


@check("5b · the race", about=known_by)
def race(rule: Any) -> str:
    """On walks held out, with a step size chosen on others, the rule is not shown to be worse than λ = 0.8."""
    return raced(rule, experiments.HELD_OUT)


@check("practice")
def practice(rule: Any) -> str:
    """On the walks to practise on, the rule is not shown to be worse than λ = 0.8."""
    return raced(rule, range(100, 110))


def raced(rule: Any, judge: Sequence[int]) -> str:
    """The result of a rule that does not lose; raises `Behind` for one that does. judge: as in `walk.race`."""
    known_by(rule)  # what is no rule does not race
    if judge == experiments.HELD_OUT:
        print(f"Race no. {next(RACES)}.")
    result = walk.race({"λ = 0.8": lambdas.Fixed(0.8), "the rule": rule}, judge=judge)
    against, step_size = result.verdicts["the rule"], result.step_size["the rule"]
    line = f"Its error is {against:.2f} times that of λ = 0.8, at α = {step_size:g}: {WORDS[against.verdict]}."
    if against.verdict != "more":
        return line
    undefined, mean = experiments.lambdas_given(rule, judge, step_size)
    reason = first_of({"undefined": undefined > 0.2, "forgets": mean < 0.4, "never-forgets": mean > 0.95})
    raise Behind(f"{line} {hint('race', reason, undefined=undefined, mean=mean)}")


def robot(rule: lambdas.LambdaRule, seeds: range = range(1000)) -> rules.Rules:
    """The rule drives the robot on the compact atlas, against fixed 0, form 2, the gate, and the climb, which learns
    nothing. What is no rule is replaced by λ = 0.8.
    """
    mine, checks.ABOUT["robot"] = "my rule", None
    if (outcome := a_rule.judge(rule)).verdict != "proven":
        display(outcome)  # type: ignore[no-untyped-call]
        print("Fixed λ = 0.8 drives in its stead.")
        mine, rule = "λ = 0.8, stand-in", lambdas.Fixed(0.8)
    else:
        checks.ABOUT["robot"] = known_by(rule)
        if load() and not engine.compiles(rule):
            print(HINTS["robot"]["slow"])
    return rules.Rules({**rules.compare({mine: rule}, seeds).steps, **experiments.rivals(seeds)})


@check("6 · what may be said", about=lambda *_: checks.ABOUT.get("robot"))
def read(few: Any, all_: Any, compared: rules.Rules) -> str:
    """Better or worse is said only where the whole interval lies on one side of 1, and not all of it within a tenth.

    few, all_: by driver, "better", "worse" or "tie": what my rule is, after the first robots and after all.
    """
    for words, seen in ((few, compared.of_first(FEW)), (all_, compared)):
        ratios, robots = mine_against(seen), f"{len(next(iter(seen.steps.values()))):,} robots"
        complete(words, [*ratios])
        for driver, ratio in ratios.items():
            said, right = str(words[driver]).strip().lower(), WORDS[ratio.verdict]
            mistakes = {
                "no-word": said not in WORDS.values(),
                "alike": ratio.verdict == "the same",
                "chance": right == "tie",
                "one-side": said == "tie",
            }
            must(said == right, hint("read", first_of(mistakes), driver=f"{driver}, {robots}", ratio=ratio))
    return f"After {robots}: {', '.join(f'{WORDS[one.verdict]} against {label}' for label, one in ratios.items())}."


ALONE = {"the weights learnt alone": "frozen", "the updates alone": "forgetful", "both together": "restored"}
"""What a robot may have, and how it is then called in `drives`."""


@check("7 · what drives it")
def drives(words: Any, steps: Mapping[str, Array]) -> str:
    """A part brings the robot home if with it the robot takes fewer steps than random actions, by the whole interval.

    words: by part, True or False; steps: of `experiments.tried`.
    """
    complete(words, [*ALONE])
    ratios = {part: findings.compare_steps(steps[kind], steps["random"]) for part, kind in ALONE.items()}
    for part, ratio in ratios.items():
        must(isinstance(words[part], bool | np.bool_), hint("drives", "no-truth", part=part))
        mistakes = {
            "together": ratio.high < 1 and part == "both together",
            "fewer": ratio.high < 1,
            "chance": ratio.low <= 1,
            "than-neither": findings.compare_steps(steps[ALONE[part]], steps["untrained"]).high < 1,
        }
        must(words[part] == (ratio.high < 1), hint("drives", first_of(mistakes), part=part, ratio=ratio))
    return f"As a multiple of random actions: {', '.join(f'{part} {ratio:.2f}' for part, ratio in ratios.items())}."


TASKS = (trace, share, from_beta, form_1, first_reset, guards, reach, a_rule, race, read, drives)


def report() -> None:
    """Show the outcome of each task of the lab, and print how many are proven."""
    outcomes = [checks.RECORD.get(task.title, Outcome(task.title, "blank", "Its cell was not run.")) for task in TASKS]
    rule = checks.ABOUT.get(a_rule.title)
    for task, again in ((race, "race-again"), (read, "read-again")):
        at = TASKS.index(task)
        if outcomes[at].verdict in ("proven", "behind") and checks.ABOUT[task.title] != rule:
            outcomes[at] = Outcome(task.title, "blank", HINTS["robot"][again])
    for outcome in outcomes:
        display(outcome)  # type: ignore[no-untyped-call]
    print(f"{sum(outcome.verdict == 'proven' for outcome in outcomes)} of {len(TASKS)} proven.")
