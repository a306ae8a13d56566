"""A bound on the step size: Dabney and Barto, Adaptive step-size for online temporal difference learning, AAAI 2012.

    alpha = min(alpha, 1 / |e.(gamma x' - x)|)          x = phi(s, a), x' = phi(s', a')

A step changes its own TD error by the factor 1 + alpha e.(gamma x' - x). Within the bound, and where that product is
negative, the error keeps its sign: no step overshoots. The bound only falls, from step to step and from episode to
episode. The authors begin at alpha = 1; here the step size of the settings, which falls by eq. (23), is a second bound.

It bounds `LinearSarsa` with any rule of lambda and either update; e are the traces of the weights that move. With form
2 it asks whether a conjugate lambda buys more than stability.

Cost: one more product with the trace; 1.5 times Sarsa(lambda).
"""

from math import inf
from typing import Any

from scipy.linalg.blas import ddot as dot

from homing_lib.features import Array
from homing_lib.sarsa import LinearSarsa
from homing_lib.study.methods.base import register


class BoundedSarsa(LinearSarsa):
    """Sarsa(lambda) that takes no longer step than its bound."""

    bound = inf

    def _step_along(self, e: Array, phi_sa: Array, moves: Any, ahead: Any) -> float:
        ascent = -phi_sa
        if ahead:
            phi_next, a_next = ahead
            ascent[a_next] += self.discount * phi_next
        along = abs(dot(e[moves].ravel(), ascent[moves].ravel()))
        if along > 0:
            self.bound = min(self.bound, 1 / along)
        return min(self._step_size, self.bound)


register("step-size-bound", 1.5, BoundedSarsa)
