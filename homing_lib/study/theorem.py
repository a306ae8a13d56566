"""The theorem behind eq. (7), tested: TD(lambda_t) beside conjugate gradient, and where its three forms must agree.

    ConjugateTD       TD-conj as what it was derived from: conjugate gradient, without trace or lambda
    distance_from_cg  how far the two are apart, step by step
    on_a_quadratic    what the forms say where the textbook's must coincide

`beta` has the textbook's formulas, which know nothing of TD.
"""

from collections.abc import Sequence
from math import isfinite
from typing import Any, Literal, NamedTuple

import numpy as np

from homing_lib.errors import one_of
from homing_lib.features import Array
from homing_lib.lambdas import RULES, LambdaRule, fletcher_reeves
from homing_lib.td import LinearTD

Form = Literal["hestenes-stiefel", "fletcher-reeves", "polak-ribiere"]


class ConjugateTD(LinearTD):
    """TD-conj as conjugate gradient: g_t = delta_t phi_t is the descent direction of half the squared TD error with its
    target held fixed (the semi-gradient), and

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

    def learn(self, phi: Array, a: int, reward: float, phi_next: Array, next_action: int, terminal: bool) -> float:
        """Learn from one step; return its TD error."""
        value_next = 0.0 if terminal else self._value_ahead(phi_next, next_action)
        delta = reward + self.discount * value_next - self.value(phi)
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

    g, g_prev: minus the gradients, shape (n,). p_prev: the previous direction, shape (n,). Undefined where the previous
    step was none.
    """
    one_of("form of beta", form, tuple(_BETA))
    return float(_BETA[form](g, g_prev, p_prev))


_BETA = {
    "hestenes-stiefel": lambda g, g_prev, p_prev: -((g - g_prev) @ g) / ((g - g_prev) @ p_prev),
    "fletcher-reeves": lambda g, g_prev, p_prev: (g @ g) / (g_prev @ g_prev),
    "polak-ribiere": lambda g, g_prev, p_prev: ((g - g_prev) @ g) / (g_prev @ g_prev),
}


class Distance(NamedTuple):
    """TD(lambda_t) beside conjugate gradient, step by step: arrays of shape (steps,).

    delta: TD errors; squares: |phi|² of the features; ratio: eq. (7) before any reset, 0 at the first step, where there
    is none; free, reset: how far delta_t e_t is from p_t, relative to |p_t|, without and with the reset to [0, 1];
    first: the step, 1, 2, ..., of the first reset, or 0.
    """

    delta: Array
    squares: Array
    ratio: Array
    free: Array
    reset: Array
    first: int


def distance_from_cg(phi: Array, reward: Array, form: Form = "fletcher-reeves", discount: float = 0.9) -> Distance:
    """Run both on the same features, shape (steps + 1, n), and rewards, shape (steps,), from weights of 0."""
    setting: dict[str, Any] = {"step_size": 1e-4, "discount": discount}
    conjugate = ConjugateTD(phi.shape[1], form=form, **setting)
    free, reset = (LinearTD(phi.shape[1], lambda_rule=RULES[form], clip=clip, **setting) for clip in (False, True))
    rows, first = [], 0
    for t in range(len(reward)):
        step = phi[t], reward[t], phi[t + 1]
        delta, p = conjugate.update(*step), conjugate.direction
        distances = [np.linalg.norm(td.update(*step) * td.trace - p) / np.linalg.norm(p) for td in (free, reset)]
        first = first or (t + 1) * reset.clipped
        rows.append((delta, phi[t] @ phi[t], free.lambda_, *distances))
    deltas, squares, ratio, without, with_reset = np.array(rows).T
    return Distance(deltas, squares, ratio, without, with_reset, first)


def on_a_quadratic(rules: Sequence[LambdaRule], rng: np.random.Generator, n: int = 5) -> tuple[Array, float]:
    """What rules say at each step but the first of conjugate gradient with exact line search, shape (n - 1, rules); and
    |g| after n steps, the minimum.

    On a random quadratic of n dimensions, whose g = b - Ax is split at random into delta phi; it follows form 2.
    """
    root, discount = rng.standard_normal((n, n)), 0.9
    a, b, x = root @ root.T + np.eye(n), rng.standard_normal(n), np.zeros(n)
    before: dict[str, Any] = {}
    lambdas = []
    for _ in range(n):
        g, delta = b - a @ x, rng.uniform(0.5, 2)
        phi = trace = g / delta
        if before:
            step = {"delta": delta, "phi": phi, "discount": discount, **before}
            lambdas.append([rule(**step) for rule in rules])
            trace = discount * fletcher_reeves(**step) * before["trace_prev"] + phi
        p = delta * trace
        x = x + (g @ p) / (p @ a @ p) * p
        before = {"delta_prev": delta, "phi_prev": phi, "trace_prev": trace}
    return np.array(lambdas), float(np.linalg.norm(b - a @ x))
