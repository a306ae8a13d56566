"""What a step of learning costs: 3 actions and 258 features on one core, beside another implementation.

Blocks of steps take turns and the best of each is reported, as `timeit` advises: whatever else the machine does at the
time can only add to it.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # read once, when numpy is loaded

from collections.abc import Callable, Iterator
from time import perf_counter

import numpy as np
import swifttd

from homing_lib.lambdas import lambda_spec
from homing_lib.sarsa import LinearQ, LinearSarsa

FEATURES, ACTIONS, STEPS, BLOCKS = 258, 3, 300, 100
PEER, BOUND = f"swifttd step, {ACTIONS * FEATURES} features", 0.5  # of a compiled learner with as many weights


def episode(cls: type[LinearSarsa], rule: str, **options: str) -> Callable[[], None]:
    """A block of updates on features in [0, 1], like those of the homing agent."""
    x = list(np.random.default_rng(0).random((STEPS + 1, FEATURES)))
    learner = cls(FEATURES, ACTIONS, step_size=1e-5, discount=1.0, lambda_rule=lambda_spec(rule).rule, **options)

    def block() -> None:
        learner.begin_episode()
        for t in range(STEPS):
            learner.update(x[t], t % ACTIONS, 0.1, x[t + 1], (t + 1) % ACTIONS)

    return block


def swift(features: int) -> Callable[[], None]:
    """A block of steps of SwiftTD as true online TD(0.9), in C++; it takes lists faster than arrays."""
    x = np.random.default_rng(0).random((STEPS, features)).tolist()
    learner = swifttd.SwiftTDNonSparse(features, 0.9, 1e-5, 1.0, 1e-12, 1e6, 1.0, 0.0, 1e-12)

    def block() -> None:
        for x_t in x:
            learner.step(x_t, 0.1)

    return block


def rows() -> Iterator[tuple[str, float, str, float | None]]:
    """(name, microseconds a step or ratio of two, unit, largest value allowed or None)."""
    learners = {
        f"LinearSarsa.update, {rule}": episode(LinearSarsa, rule)
        for rule in ("fixed:0.9", "fletcher-reeves", "polak-ribiere", "hestenes-stiefel")
    } | {
        "LinearSarsa.update, fletcher-reeves, all actions": episode(LinearSarsa, "fletcher-reeves", update="all"),
        "LinearSarsa.update, fixed:0.9, true online": episode(LinearSarsa, "fixed:0.9", traces="dutch"),
    }
    blocks = learners | {
        "LinearQ.update, fletcher-reeves": episode(LinearQ, "fletcher-reeves"),
        f"swifttd step, {FEATURES} features": swift(FEATURES),
        PEER: swift(ACTIONS * FEATURES),
    }
    best = dict.fromkeys(blocks, np.inf)
    for _ in range(BLOCKS):
        for name, block in blocks.items():
            start = perf_counter()
            block()
            best[name] = min(best[name], (perf_counter() - start) / STEPS * 1e6)
    for name, value in best.items():
        yield name, value, "us", None
    for name in learners:
        yield f"{name} / {PEER}", best[name] / best[PEER], "", BOUND
