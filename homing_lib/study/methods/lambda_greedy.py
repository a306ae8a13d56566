"""lambda-greedy: White and White, A greedy approach to adapting the trace parameter for temporal difference learning,
AAMAS 2016 (arXiv 1607.00446); with its variance learnt directly, as in its authors' later code.

    g = w_return.x'          what Monte Carlo expects in x' = phi(s', a'): learnt by TD(1)
    v = w_variance.x'        its variance: learnt by TD(1) from that one's squared TD errors, discounted by gamma^2
    lambda' = (g - w.x')^2 / ((g - w.x')^2 + max(v, 0))

The trace goes on into a state as far as the bias of its value outweighs the variance of the return: the lambda that is
best for this step if all later ones use the returns themselves. w is `LinearSarsa`; w_return starts like it, w_variance
at 0.

At gamma = 1 a trace of TD(1) grows all the time, and on the robot both helpers diverge at any step size of use. So here
their steps have the bound of Dabney and Barto (`step_size_bound`); this is ours.

Cost: three learners with a trace each, two of them bounded; 4 times Sarsa(lambda).
"""

from typing import Any

import numpy as np
from scipy.linalg.blas import ddot as dot

from homing_lib.features import Array
from homing_lib.sarsa import LinearSarsa
from homing_lib.study.methods.base import register
from homing_lib.study.methods.step_size_bound import BoundedSarsa


def greedy_lambda(bias: float, variance: float, unknown: float = 0.0) -> float:
    """The lambda of a state, from what its value is wrong by and how much returns from it vary; 1 while no more than
    this is known of both.
    """
    total = bias * bias + max(variance, 0.0)
    return bias * bias / total if total > unknown else 1.0


class LambdaGreedySarsa(LinearSarsa):
    """Sarsa(lambda) with the greedy lambda; `returns` and `variance` are its helpers."""

    def __init__(self, *shape: int, **settings: Any) -> None:
        super().__init__(*shape, **settings)
        size, gamma, self._lambda_next = self._theta.size, self.discount, 0.0
        how: Any = {"step_size": self._step_size, "lambda_rule": "fixed:1", "bootstrap_terminal": True}
        initial = settings.get("initial_weight", 0.0)
        self.returns = BoundedSarsa(size, 1, discount=gamma, initial_weight=initial, **how)
        self.variance = BoundedSarsa(size, 1, discount=gamma * gamma, **how)

    def learn(self, phi_tm1: Array, a_tm1: int, r_t: float, phi_t: Array, a_t: int, terminal: bool) -> float:
        """One step, as `LinearSarsa.learn`."""
        x, x_next = np.zeros((2, *self._theta.shape))
        x[a_tm1] = phi_tm1
        if not terminal or self.bootstrap_terminal:
            x_next[a_t] = phi_t
        x, x_next = x.ravel(), x_next.ravel()
        for helper in (self.returns, self.variance):
            helper.step_size = self._step_size
            if self._step_before is None:
                helper.begin_episode()
        bias = dot(self.returns.weights[0], x_next) - dot(self._theta.reshape(-1), x_next)
        error = self.returns.learn(x, 0, r_t, x_next, 0, False)
        self.variance.learn(x, 0, error * error, x_next, 0, False)
        delta = super().learn(phi_tm1, a_tm1, r_t, phi_t, a_t, terminal)
        self._lambda_next = greedy_lambda(bias, dot(self.variance.weights[0], x_next))
        return delta

    def _lambda(self, delta: float, phi: Array) -> float:
        self.lambda_ = 0.0 if self._step_before is None else self._lambda_next
        self._step_before = delta, phi
        return self.lambda_


register("lambda-greedy", 4, LambdaGreedySarsa)
