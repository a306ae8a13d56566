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

from homing_lib.lambdas import parse
from homing_lib.sarsa import LinearQ, LinearSarsa

FEATURES, ACTIONS, STEPS, BLOCKS = 258, 3, 300, 100
BOUND_US = 12.0


def episode(cls: type[LinearSarsa], rule: str, **options: str) -> Callable[[], None]:
    """A block of updates on features in [0, 1], like those of the homing agent."""
    x = list(np.random.default_rng(0).random((STEPS + 1, FEATURES)))
    learner = cls(FEATURES, ACTIONS, step_size=1e-5, discount=1.0, lambda_rule=parse(rule).rule, **options)

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
    """(name, microseconds a step, unit, largest value allowed or None)."""
    rules = ("fixed:0.9", "fletcher-reeves", "polak-ribiere", "hestenes-stiefel")
    blocks = {f"LinearSarsa.update, {rule}": (episode(LinearSarsa, rule), BOUND_US) for rule in rules} | {
        "LinearSarsa.update, fletcher-reeves, all actions": (
            episode(LinearSarsa, "fletcher-reeves", update="all"),
            BOUND_US,
        ),
        "LinearSarsa.update, fixed:0.9, true online": (episode(LinearSarsa, "fixed:0.9", traces="dutch"), BOUND_US),
        "LinearQ.update, fletcher-reeves": (episode(LinearQ, "fletcher-reeves"), None),
        f"swifttd step, {FEATURES} features": (swift(FEATURES), None),
        f"swifttd step, {ACTIONS * FEATURES} features": (swift(ACTIONS * FEATURES), None),
    }
    best = dict.fromkeys(blocks, np.inf)
    for _ in range(BLOCKS):
        for name, (block, _bound) in blocks.items():
            start = perf_counter()
            block()
            best[name] = min(best[name], (perf_counter() - start) / STEPS * 1e6)
    for name, (_block, bound) in blocks.items():
        yield name, best[name], "us", bound


if __name__ == "__main__":
    for name, value, unit, bound in rows():
        print(f"{name:<60} {value:6.2f} {unit}" + ("" if bound is None else f"  (at most {bound:g})"))
