"""What the lab, notebooks/lab.ipynb, runs and shows beside its checks, task by task."""

from collections.abc import Mapping, Sequence
from functools import cache
from math import ceil, log, nan
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from homing_lib import lambdas
from homing_lib.features import Array
from homing_lib.publish.parts import beside, panels
from homing_lib.publish.style import BLUE, ORANGE, styled
from homing_lib.settings import Settings
from homing_lib.study import engine, findings, rules, theorem, walk
from homing_lib.study.questions import drives
from homing_lib.study.runs import episode_matrix
from homing_lib.td import LinearTD
from homing_lib.teach.checks import SEED

STEPS, GAMMA = 12, 0.9  # of task 3
GUARDS = (0, 0.8, 1)  # of task 4
FEW = 10  # robots, of which task 6 asks what they would say alone
HELD_OUT = range(1000, 1020)  # the walks of the race in task 5
RIVALS = {"fixed 0": "fixed:0", "form 2": "fletcher-reeves", "gate": "gate"}


@styled
def two_ways_down() -> Figure:
    """Steepest descent and conjugate gradient from above, down x² + 4y², each step to the lowest point ahead."""
    figure, (axes,) = panels(2.1, share=0.8)
    across, along = np.meshgrid(np.linspace(-1, 4.6, 90), np.linspace(-1.2, 1.5, 60))
    axes.contour(across, along, across**2 + 4 * along**2, levels=[0.3, 1, 3, 8, 20], colors="0.7", linewidths=0.8)
    step = np.arange(8)
    for name, x, y, color, line, at in (
        ("steepest descent", 4 * 0.6**step, (-0.6) ** step, ORANGE, (0, (4, 1.5)), (1.2, 0.55)),
        ("conjugate gradient", [4, 2.4, 0], [1, -0.6, 0], BLUE, "-", (0.2, -0.75)),
    ):
        axes.plot(x, y, color=color, linestyle=line, marker="o", markersize=3)
        beside(axes, name, at, (0, 0), color=color)
    axes.set(aspect="equal", xticks=[], yticks=[])
    return figure


def on_a_quadratic(form_1: lambdas.LambdaRule) -> Array:
    """The λ of form_1, form 2 and form 3 at each step but the first of `theorem.on_a_quadratic`, shape (4, 3)."""
    forms = form_1, lambdas.fletcher_reeves, lambdas.polak_ribiere
    return theorem.on_a_quadratic(forms, np.random.default_rng(SEED))[0]


def twelve_steps(seed: int) -> theorem.Distance:
    """TD(λ_t) beside conjugate gradient on random features and rewards of a seed, form 2, of STEPS steps."""
    rng = np.random.default_rng(seed)
    phi, reward = rng.uniform(0.2, 1, (STEPS + 1, 5)), rng.uniform(0.3, 1, STEPS)
    reward *= np.where(rng.random(STEPS) < 0.15, -1, 1) * 0.9 ** np.arange(STEPS)
    return theorem.distance_from_cg(phi, reward, discount=GAMMA)


def first_episode(rule: lambdas.LambdaRule, states: Sequence[int], on_zero: float = 0.0) -> Array:
    """The values of the 19 states after one episode of the random walk. states: one of `walk.walks`."""
    learner = LinearTD(19, step_size=0.1, discount=1.0, lambda_rule=rule, on_zero=on_zero)
    walk.follow(learner, states)
    return learner.weights


def lambdas_given(rule: Any, seeds: Sequence[int], step_size: float) -> tuple[float, float]:
    """On the walks of these seeds: the share of the steps at which a rule has no λ, and the mean of those it gives."""
    given: list[float] = []

    def noting(**step: Any) -> float:
        given.append(nan)
        given[-1] = rule(**step)
        return given[-1]

    for seed in seeds:
        walk.learning(noting, seed, step_size)
    has = np.clip(given, 0, 1)[~np.isnan(given)]
    return 1 - len(has) / len(given), float(has.mean()) if len(has) else 0.0


@cache
def rivals(seeds: range) -> Mapping[str, Array]:
    """The steps of those that the student's rule is held against, the same for every rule."""
    learnt = rules.compare(RIVALS, seeds)
    climb = Settings(images="compact", controller="climb")
    climbed = engine.side_by_side(lambda seed: episode_matrix([engine.run(climb, seed)])[0], seeds, [])
    return {**learnt.steps, "the climb": np.array(climbed)}


def mine_against(compared: rules.Rules) -> dict[str, findings.Comparison]:
    """Total steps of the first driver, the student's, as a multiple of those of each other."""
    mine, *others = compared.steps.items()
    return {label: findings.compare_steps(mine[1].sum(axis=1), steps.sum(axis=1)) for label, steps in others}


def without_verdicts(compared: rules.Rules) -> str:
    """Total steps, and those of the student's rule as a multiple of each, of a few robots and of all, in Markdown."""
    steps, *_ = compared.steps.values()
    few, ratios = mine_against(compared.of_first(FEW)), mine_against(compared)
    rows = [f"| driver | steps, mean | multiple, first {FEW} robots | multiple, all {len(steps):,} robots |"]
    rows.append("|---|---|---|---|")
    for label, steps in compared.steps.items():
        ratio = f"{few[label]:.2f} | {ratios[label]:.2f}" if label in ratios else " | "
        rows.append(f"| {label} | {steps.sum(axis=1).mean():,.0f} | {ratio} |")
    return "\n".join(rows)


def tried(seeds: range = range(200)) -> dict[str, Array]:
    """What robots do after ten of twenty episodes on the compact atlas, from the start: by kind, as in `drives`, the
    steps of a trial, one number per robot.
    """
    settings = drives.after(drives.JUDGED_AFTER, images="compact")
    robots = engine.side_by_side(lambda seed: drives.tried(settings, seed), seeds, [])
    rows = pd.concat([pd.DataFrame(robot).assign(seed=seed) for seed, robot in zip(seeds, robots, strict=True)])
    return {kind: drives.outcomes(rows, "steps", kind) for kind in drives.KINDS}


def four_ways(steps: Mapping[str, Array]) -> str:
    """The steps of `tried`, with and without the weights learnt and the learning, in Markdown."""
    mean = {kind: f"{findings.estimate(taken):.0f}" for kind, taken in steps.items()}
    return f"""\
| steps to home, mean | learning on | frozen |
|---|---|---|
| **weights learnt** | {mean["restored"]} | {mean["frozen"]} |
| **initial weights** | {mean["forgetful"]} | {mean["untrained"]} |

The climb: {mean["climb"]}. Random actions: {mean["random"]}."""


def recap(seen: theorem.Distance, raced: walk.Race, compared: rules.Rules, tried: Mapping[str, Array]) -> str:
    """What each task should have shown, from what tasks 3, 4, 6 and 7 computed: a paragraph each, in Markdown."""
    steps = ceil(log(0.5) / log(0.9 * 0.8))

    printed, form_2, _ = on_a_quadratic(lambdas.RULES["hestenes-stiefel:printed"]).T
    times = np.mean(printed / form_2)

    after = seen.reset[seen.first - 1 :].min()
    back = "it comes back" if after < 1e-6 else "it does not come back: each direction is built on the one before"
    parted = f"They part at step {seen.first}; from there on δe is {after:.1g} |p| from p, or more, and {back}."

    error = {label: errors.mean() for label, errors in raced.errors.items()}
    guarded = [error[f"form 2, guard {guard:g}"] for guard in GUARDS]
    by_guard = max(guarded) / min(guarded)
    to_fixed = guarded[0] / error["λ = 0"], guarded[1] / error["λ = 0.8"]
    by_ratio = max(max(ratio, 1 / ratio) for ratio in to_fixed)

    undefined, _ = lambdas_given(lambdas.fletcher_reeves, HELD_OUT, raced.step_size["form 2, guard 0"])

    mine, learning = next(iter(compared.steps.items()))
    excess = learning.mean(axis=0) - (climb := compared.steps["the climb"].mean())
    behind = [*np.flatnonzero(excess <= 0), len(excess)][0]
    when = f"takes as few in episode {behind + 1}" if behind < len(excess) else f"takes more in all {behind} episodes"

    taken = {kind: each.mean() for kind, each in tried.items()}
    shown = (
        f"With γ = 0.9 and λ = 0.8, less than half of a feature is left after {steps} steps.",
        f"On a quadratic the printed form 1 is {times:.0f} times form 2, so the sign got lost.",
        parted if seen.first else "No λ leaves [0, 1] here, and they do not part.",
        f"From guard to guard, form 2's error differs by a factor of up to {by_guard:.2f}; guards 0 and 0.8 from "
        f"λ = 0 and 0.8 by up to {by_ratio:.2f}. The {'guard' if by_guard > by_ratio else 'ratio'} moves it more.",
        f"In {undefined:.0%} of the steps of the race form 2 has no λ. What your rule says there is its guard.",
        f"The climb takes {climb:.0f} steps per episode; {mine} {when}, and by then {excess[:behind].sum():.0f} "
        "more in total. The robot pays for those.",
        f"After ten episodes the robot that learns on takes {taken['restored']:.0f} steps, frozen it takes "
        f"{taken['frozen']:.0f}, learning from the initial weights {taken['forgetful']:.0f}; the climb "
        f"{taken['climb']:.0f}, random actions {taken['random']:.0f}. Frozen, it is "
        f"{'worse' if taken['frozen'] > taken['random'] else 'better'} than chance.",
    )
    return "\n\n".join(f"**{task}** · {line}" for task, line in enumerate(shown, start=1))
