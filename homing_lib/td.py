"""Temporal-difference prediction with a linear value function: eqs. (1)-(6) of the paper.

    LinearTD        TD(lambda), accumulating traces, any lambda rule
    TrueOnlineTD    true online TD(lambda), which equals the online forward view at every step
    ConjugateTD     TD-conj as what it was derived from: conjugate gradient, without trace or lambda

The first two are the update of `sarsa.LinearSarsa` with one action. That the first and the last are the same algorithm
under the lambda of eq. (7) is the paper's central theorem. A step is `update(phi, reward, phi_next)`: phi_t, r_{t+1},
phi_{t+1}.
"""

from math import isfinite
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from homing_lib.lambdas import RULES, Array, one_of
from homing_lib.sarsa import Diverged as Diverged
from homing_lib.sarsa import LinearSarsa, finite, linear, silent

Form = Literal["hestenes-stiefel", "fletcher-reeves", "polak-ribiere"]


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
        return linear("phi", self.weights, self._features("phi", phi))

    def update(  # type: ignore[override] # one action needs no name
        self, phi: ArrayLike, reward: float, phi_next: ArrayLike | None, *, terminal: bool = False
    ) -> float:
        """Learn from one step; return its TD error. phi, phi_next: shape (n,). At a terminal step V(s') is 0."""
        return super().update(phi, 0, reward, phi_next, 0, terminal=terminal)


class TrueOnlineTD(LinearTD):
    """True online TD(lambda): van Seijen et al., True online temporal-difference learning, JMLR 17 (2016), with a
    lambda that may vary.

        e_t = gamma lambda_t e_{t-1} + (1 - alpha gamma lambda_t e_{t-1}^T phi_t) phi_t        the dutch trace
        theta_{t+1} = theta_t + alpha delta_t e_t + alpha (theta_t - theta_{t-1})^T phi_t (e_t - phi_t)
    """

    def __init__(self, n_features: int, **settings: Any) -> None:
        super().__init__(n_features, traces="dutch", **settings)


class ConjugateTD(LinearTD):
    """TD-conj as conjugate gradient: g_t = delta_t phi_t is the descent direction of the squared TD error, and

        p_t = g_t + beta_t p_{t-1}
        theta_{t+1} = theta_t + alpha p_t

    with p_t = g_t at the first step of an episode and wherever beta_t is undefined. form: that of `beta`. `direction`
    is p_t, shape (n,): by eq. (7) it equals delta_t e_t of a `LinearTD` whose rule is of that form, until the first
    lambda is clipped. `trace` stays zero, for none is needed.
    """

    def __init__(self, n_features: int, *, form: Form = "fletcher-reeves", **settings: Any) -> None:
        one_of("form of beta", form, tuple(_BETA))
        self.form = form
        super().__init__(n_features, lambda_rule=RULES[form], **settings)

    def begin_episode(self) -> None:
        super().begin_episode()
        self.direction: Array = np.zeros_like(self.weights)
        self._g_prev = self.direction

    @silent
    def update(  # type: ignore[override]
        self, phi: ArrayLike, reward: float, phi_next: ArrayLike | None, *, terminal: bool = False
    ) -> float:
        """Learn from one step; return its TD error. phi, phi_next: shape (n,). At a terminal step V(s') is 0."""
        phi = self._features("phi", phi)
        value_next = 0.0 if terminal else self._value_ahead(phi_next, 0)
        delta = finite("reward", reward) + self.discount * value_next - self.value(phi)
        g = delta * phi
        beta_t = beta(self.form, g, self._g_prev, self.direction)  # 0/0 or x/0 at a first step
        self.direction = g + beta_t * self.direction if isfinite(beta_t) else g
        change = self.step_size * self.direction
        self._theta += change
        self._g_prev = g
        self._changed_by(change)
        return delta


def beta(form: Form, g: Array, g_prev: Array, p_prev: Array) -> float:
    """How much conjugate gradient keeps of its previous direction: p_t = g_t + beta_t p_{t-1}.

    g, g_prev: minus the gradients, shape (n,). p_prev: the previous direction, shape (n,). These are the textbook
    formulas, which know nothing of TD; they are undefined where the previous step was none.
    """
    one_of("form of beta", form, tuple(_BETA))
    return float(_BETA[form](g, g_prev, p_prev))


_BETA = {
    "hestenes-stiefel": lambda g, g_prev, p_prev: -((g - g_prev) @ g) / ((g - g_prev) @ p_prev),
    "fletcher-reeves": lambda g, g_prev, p_prev: (g @ g) / (g_prev @ g_prev),
    "polak-ribiere": lambda g, g_prev, p_prev: ((g - g_prev) @ g) / (g_prev @ g_prev),
}
