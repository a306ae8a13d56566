"""What a step of the other learners costs, beside Sarsa(lambda) in Python: 3 actions, 258 features, one core."""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # read once, when numpy is loaded

from collections.abc import Callable, Iterator
from importlib.util import find_spec
from time import perf_counter

import numpy as np

from homing_lib.agent import AGENTS
from homing_lib.settings import Settings
from homing_lib.study import methods  # noqa: F401, so that settings know them by name
from homing_lib.study.methods.base import COST

STEPS, BLOCKS = 100, 20


def steps_of(name: str) -> Callable[[], None]:
    """A block of steps, values of each view included, as an agent makes them."""
    settings = Settings(controller=name, lambda_rule="fixed:0.8", update="all", alpha0=1e-6)
    agent = AGENTS[name](settings, np.random.default_rng(0))
    phi = list(np.random.default_rng(0).random((STEPS + 1, settings.n_features)))

    def block() -> None:
        agent.begin_episode(1)
        action = agent.choose(phi[0])
        for t in range(STEPS):
            next_action = agent.choose(phi[t + 1])
            agent.learn(phi[t], action, -0.1, phi[t + 1], next_action, False, False)
            action = next_action

    return block


def rows() -> Iterator[tuple[str, float, str, float | None]]:
    """(name, value, unit, None)."""
    names = [name for name in COST if not name.startswith("swift") or find_spec("swiftsarsa")]
    blocks = {name: steps_of(name) for name in ("sarsa", *names)}
    best = dict.fromkeys(blocks, np.inf)
    for _ in range(BLOCKS):
        for name, block in blocks.items():
            start = perf_counter()
            block()
            best[name] = min(best[name], (perf_counter() - start) / STEPS * 1e6)
    for name, value in best.items():
        counted = f", counted {COST[name]:g} times" if name in COST else ""
        yield f"step of {name}{counted}", value, "us", None
        yield f"step of {name} / of sarsa", value / best["sarsa"], "", None
