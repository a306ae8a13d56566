"""Incremental natural actor-critic: Bhatnagar, Sutton, Ghavamzadeh and Lee, Natural actor-critic algorithms,
Automatica 45 (2009), their third algorithm. The paper's reference [1].

    delta = r + gamma v.phi' - v.phi                 v: a value for each state, shape (n,)
    v += alpha delta phi
    psi = grad log pi(a | s)                         of the actor's weights, shape (3, n)
    w += alpha (delta - psi.w) psi                   the natural gradient, by least squares
    actor += beta w

The policy is the softmax of actor.phi: it explores by itself, so that there is no epsilon. The source maximises the
average reward, and subtracts it; here an episode ends, and the return counts, as for all others. The critic starts at
theta_0, the actor at 0 (every action alike). beta is a multiple of alpha, which the name in settings says.

Cost: psi, and w and the actor's weights through it; 2 times Sarsa(lambda).
"""

from typing import Any

import numpy as np
from scipy.linalg.blas import ddot as dot

from homing_lib.agent import SarsaAgent
from homing_lib.features import Array
from homing_lib.policy import sample, softmax
from homing_lib.sarsa import LinearSarsa
from homing_lib.study.methods.base import register


class ActorCritic(LinearSarsa):
    """Its `weights` are the actor's. ratio: beta / alpha."""

    def __init__(self, n: int, actions: int, *, ratio: float, **settings: Any) -> None:
        super().__init__(n, actions, **{**settings, "initial_weight": 0.0})
        self.ratio, self.w = ratio, np.zeros((actions, n))
        self.v = np.full(n, settings.get("initial_weight", 0.0))

    def policy(self, phi: Array) -> list[float]:
        """The probability of each action."""
        return softmax(self.value_list(phi), 1.0)

    def learn(self, phi_tm1: Array, a_tm1: int, r_t: float, phi_t: Array, a_t: int, terminal: bool) -> float:
        """One step, as `LinearSarsa.learn`."""
        alpha = self._step_size
        psi = np.outer([-share for share in self.policy(phi_tm1)], phi_tm1)
        psi[a_tm1] += phi_tm1
        ahead = dot(self.v, phi_t) if not terminal or self.bootstrap_terminal else 0.0
        delta: float = r_t + self.discount * ahead - dot(self.v, phi_tm1)
        self.v += alpha * delta * phi_tm1
        self.w += alpha * (delta - dot(psi.ravel(), self.w.ravel())) * psi
        change = self.ratio * alpha * self.w
        self._theta += change
        self._changed_by(change.ravel())
        return delta


class ActorCriticAgent(SarsaAgent):
    """Draws its actions from the actor's policy."""

    learner: ActorCritic

    def choose(self, phi: Array) -> int:
        """An action of the softmax."""
        return sample(self.learner.policy(phi), self.rng)


for ratio in (1, 10):
    register(f"natural-actor-critic:{ratio:g}", 2, ActorCritic, ActorCriticAgent, ratio=ratio)
