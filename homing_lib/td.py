"""Temporal-difference prediction with a linear value function, eqs. (1)-(6): `sarsa.LinearSarsa` with one action.

A step is `update(phi, reward, phi_next)`: phi_t, r_{t+1}, phi_{t+1}. Under the lambda of eq. (7), unclipped, `LinearTD`
is conjugate gradient: the theorem on which the paper builds, tested by `study.theorem`.
"""

from typing import Any

from numpy.typing import ArrayLike

from homing_lib.lambdas import Array
from homing_lib.sarsa import LinearSarsa, value_of


class LinearTD(LinearSarsa):
    """TD(lambda) with any lambda rule: eqs. (1)-(6).

        delta_t = r_{t+1} + gamma V(s_{t+1}) - V(s_t)        (1)
        e_t = gamma lambda_t e_{t-1} + phi_t                 (4), (6)
        theta_{t+1} = theta_t + alpha delta_t e_t            (3), (5)

    `begin_episode` before each episode, `update` at each step; `weights` and `trace` have shape (n,). Settings, all by
    keyword: step_size, discount, lambda_rule, initial_weight, clip, on_zero, as in `sarsa.LinearSarsa`.
    """

    def __init__(self, n_features: int, **settings: Any) -> None:
        super().__init__(n_features, 1, **settings)

    @property
    def weights(self) -> Array:
        """theta, shape (n,)."""
        return self._theta[0]

    @property
    def trace(self) -> Array:
        """e, shape (n,)."""
        return self._e[0]

    def value(self, phi: ArrayLike) -> float:
        """Eq. (2): V(s) = theta^T phi(s). phi: shape (n,)."""
        return value_of(self.weights, self._features("phi", phi))

    def update(  # type: ignore[override] # one action needs no name
        self, phi: ArrayLike, reward: float, phi_next: ArrayLike | None, *, terminal: bool = False
    ) -> float:
        """Learn from one step; return its TD error. phi, phi_next: shape (n,). At a terminal step V(s') is 0."""
        return super().update(phi, 0, reward, phi_next, 0, terminal=terminal)


class TrueOnlineTD(LinearTD):
    """True online TD(lambda), which equals the online forward view at every step, with a lambda that may vary.

    van Seijen et al., True online temporal-difference learning, JMLR 17 (2016).

        e_t = gamma lambda_t e_{t-1} + (1 - alpha gamma lambda_t e_{t-1}^T phi_t) phi_t        the dutch trace
        theta_{t+1} = theta_t + alpha delta_t e_t + alpha (theta_t - theta_{t-1})^T phi_t (e_t - phi_t)
    """

    def __init__(self, n_features: int, **settings: Any) -> None:
        super().__init__(n_features, traces="dutch", **settings)
