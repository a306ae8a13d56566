"""The theorem behind eq. (7), tried: TD(lambda_t) beside conjugate gradient, and where its three forms must agree."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from homing_lib.features import Array
from homing_lib.lambdas import RULES, LambdaRule, fletcher_reeves
from homing_lib.td import ConjugateTD, Form, LinearTD


class Parting(NamedTuple):
    """TD(lambda_t) beside conjugate gradient, step by step: arrays of shape (steps,).

    delta: TD errors; squares: |phi|² of the features; ratio: eq. (7) before any reset, 0 at the first step, where there
    is none; free, reset: relative distances of delta_t e_t from p_t, without and with the reset to [0, 1]; first: the
    step, 1, 2, ..., of the first reset, or 0.
    """

    delta: Array
    squares: Array
    ratio: Array
    free: Array
    reset: Array
    first: int


def parting(phi: Array, reward: Array, form: Form = "fletcher-reeves", discount: float = 0.9) -> Parting:
    """Of both, on the same features, shape (steps + 1, n), and rewards, shape (steps,), from weights of 0."""
    setting: dict[str, Any] = {"step_size": 1e-4, "discount": discount}
    conjugate = ConjugateTD(phi.shape[1], form=form, **setting)
    free, reset = (LinearTD(phi.shape[1], lambda_rule=RULES[form], clip=clip, **setting) for clip in (False, True))
    rows, first = [], 0
    for t in range(len(reward)):
        step = phi[t], reward[t], phi[t + 1]
        delta, p = conjugate.update(*step), conjugate.direction
        apart = [np.linalg.norm(td.update(*step) * td.trace - p) / np.linalg.norm(p) for td in (free, reset)]
        first = first or (t + 1) * reset.clipped
        rows.append((delta, phi[t] @ phi[t], free.lambda_, *apart))
    deltas, squares, ratio, free_of, reset_of = np.array(rows).T
    return Parting(deltas, squares, ratio, free_of, reset_of, first)


def on_a_quadratic(rules: Sequence[LambdaRule], rng: np.random.Generator, n: int = 5) -> tuple[Array, float]:
    """What rules say at each step but the first of conjugate gradient with exact line search, shape (n - 1, rules); and
    |g| after n steps, the minimum.

    On a random quadratic of n dimensions, whose g = b - Ax is split at random into delta phi; it follows form 2.
    """
    root, discount = rng.standard_normal((n, n)), 0.9
    a, b, x = root @ root.T + np.eye(n), rng.standard_normal(n), np.zeros(n)
    before: dict[str, Any] = {}
    said = []
    for _ in range(n):
        g, delta = b - a @ x, rng.uniform(0.5, 2)
        phi = trace = g / delta
        if before:
            step = {"delta": delta, "phi": phi, "discount": discount, **before}
            said.append([rule(**step) for rule in rules])
            trace = discount * fletcher_reeves(**step) * before["trace_prev"] + phi
        p = delta * trace
        x = x + (g @ p) / (p @ a @ p) * p
        before = {"delta_prev": delta, "phi_prev": phi, "trace_prev": trace}
    return np.array(said), float(np.linalg.norm(b - a @ x))
