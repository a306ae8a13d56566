"""What the methods share: a step in vectors of length 3 n, and how one is made known to settings."""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from scipy.linalg.blas import ddot as dot

from homing_lib import agent
from homing_lib.agent import SarsaAgent
from homing_lib.features import Array
from homing_lib.sarsa import LinearSarsa

COST: dict[str, float] = {}
"""What a step costs, by the name of the method: in vectors of length 3 n that it goes through, as a multiple of
Sarsa(lambda), which goes through its trace and its weights. Counted by hand from the formula; `make bench` measures."""


class Method(LinearSarsa):
    """A learner without a trace: x = phi(s, a), y = gamma phi(s', a'), the TD error is delta = r + w.y - w.x, and
    `change_of` says what is added to the weights w. All are of length 3 n; y is 0 where nothing follows.
    """

    def learn(self, phi_tm1: Array, a_tm1: int, r_t: float, phi_t: Array, a_t: int, terminal: bool) -> float:
        """One step, as `LinearSarsa.learn`."""
        self._last = terminal  # for `change_of`, where a batch ends with the episode
        x, y = np.zeros((2, *self._theta.shape))
        x[a_tm1] = phi_tm1
        if not terminal or self.bootstrap_terminal:
            y[a_t] = self.discount * phi_t
        x, y, w = x.ravel(), y.ravel(), self._theta.reshape(-1)
        delta: float = r_t + dot(w, y) - dot(w, x)
        change = self.change_of(delta, x, y)
        w += change
        self._changed_by(change)
        return delta

    def change_of(self, delta: float, x: Array, y: Array) -> Array:
        """What a step adds to the weights, shape (3 n,)."""
        raise NotImplementedError


def register(
    name: str, cost: float, learner: Callable[..., Any], agent_class: Any = SarsaAgent, **options: Any
) -> None:
    """Let settings know an agent of this name, which has this learner, made with these options; its cost, for COST."""
    COST[name] = cost
    agent.register(name, partial(agent_class, learner=partial(learner, **options)))
