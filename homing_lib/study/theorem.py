"""The theorem behind eq. (7), tested: TD(lambda_t) beside conjugate gradient, and where its three forms must agree.

`beta` has the textbook's formulas, which know nothing of TD.
"""

from collections.abc import Sequence
from math import isfinite
from typing import Any, Literal, NamedTuple

import numpy as np
from scipy.linalg.blas import ddot as dot

from homing_lib.errors import one_of
from homing_lib.features import Array
from homing_lib.lambdas import LambdaRule, fletcher_reeves
from homing_lib.sarsa import silent
from homing_lib.td import LinearTD

Form = Literal["hestenes-stiefel", "fletcher-reeves", "polak-ribiere"]


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


@silent
def distance_from_cg(phi: Array, reward: Array, form: Form = "fletcher-reeves", discount: float = 0.9) -> Distance:
    """Run both on the same features, shape (steps + 1, n), and rewards, shape (steps,), from weights of 0.

    Conjugate gradient has neither trace nor lambda: g_t = delta_t phi_t is the descent direction of half the squared TD
    error with its target held fixed (the semi-gradient), and

        p_t = g_t + beta_t p_{t-1}
        theta_{t+1} = theta_t + alpha p_t

    with p_t = g_t at the first step and wherever beta_t is undefined. By eq. (7) p_t equals delta_t e_t until the first
    lambda is reset.
    """
    alpha = 1e-4
    setting: dict[str, Any] = {"lambda_rule": form, "step_size": alpha, "discount": discount}
    free, reset = (LinearTD(phi.shape[1], clip=clip, **setting) for clip in (False, True))
    theta = g_prev = p = np.zeros(phi.shape[1])
    rows, first = [], 0
    for t in range(len(reward)):
        delta = reward[t] + discount * dot(theta, phi[t + 1]) - dot(theta, phi[t])
        g = delta * phi[t]
        beta_t = beta(form, g, g_prev, p)  # 0/0 or x/0 at the first step
        p = g + beta_t * p if isfinite(beta_t) else g
        theta, g_prev = theta + alpha * p, g
        traces = (td.update(phi[t], reward[t], phi[t + 1]) * td.trace for td in (free, reset))
        distances = [np.linalg.norm(trace - p) / np.linalg.norm(p) for trace in traces]
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
