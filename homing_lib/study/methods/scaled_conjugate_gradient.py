"""TD with scaled conjugate gradient: Falas and Stafylopatis, Implementing temporal-difference learning with the scaled
conjugate gradient algorithm, Neural Processing Letters 22 (2005), and their papers of 2001 and 2002, the paper's [8] to
[11]; after Moller, A scaled conjugate gradient algorithm for fast supervised learning, Neural Networks 6 (1993).

    E(w) = sum (r + gamma w_0.x' - w.x)^2 / 2          over a batch of steps, its targets held fixed

Moller goes along conjugate directions, by Polak and Ribiere; how far follows from the curvature along each, raised by a
scale. There is no step size. With linear values E is a quadratic: its curvature is exact, the scale only shrinks, and
what Moller does where E is not convex, or falls less than promised, is never needed and left out.

The sources learn from whole sequences, again and again. Ours, since they do not say how a robot would: a batch is the
last so many steps, learnt when they are over and at the episode's end, with so many directions; both are in the name,
"scaled-conjugate-gradient:16:2".

Cost: x and x' of every step, and two products with the batch for each direction; for two, 3 times Sarsa(lambda).
"""

from typing import Any

import numpy as np
from scipy.linalg.blas import ddot as dot

from homing_lib.features import Array
from homing_lib.study.methods.base import Method, register


def minimised(w: Array, inputs: Array, targets: Array, directions: int, scale: float = 1e-6) -> Array:
    """Weights, shape (n,), from which the squared errors of inputs.w, shape (steps, n), are less by so many directions
    of Moller's algorithm; by fewer where no error is left.
    """
    r = p = (targets - inputs @ w) @ inputs  # the gradient, downwards
    for _ in range(directions):
        along, squares = dot(p, r), dot(p, p)
        if not along > 0:
            break
        forward = inputs @ p
        step = along / (dot(forward, forward) + scale * squares)
        w, before = w + step * p, r
        r = r - step * (forward @ inputs)
        p = r + (dot(r, r) - dot(r, before)) / along * p
        scale /= 4
    return w


class ScaledConjugateGradient(Method):
    """Sarsa by batches. batch: steps of one; directions: of the search in each."""

    def __init__(self, *shape: int, batch: int, directions: int, **settings: Any) -> None:
        super().__init__(*shape, **settings)
        self.batch, self.directions = batch, directions

    def begin_episode(self) -> None:
        """Nothing is left to learn from."""
        super().begin_episode()
        self._steps: list[tuple[Array, float]] = []

    def change_of(self, delta: float, x: Array, y: Array) -> Array:
        """Nothing until the batch is complete, or the episode at its end."""
        w = self._theta.reshape(-1)
        self._steps.append((x, delta + dot(w, x)))
        if len(self._steps) < self.batch and not self._last:
            return np.zeros_like(w)
        inputs, targets = (np.array(column) for column in zip(*self._steps, strict=True))
        self._steps.clear()
        return minimised(w, inputs, targets, self.directions) - w


for batch, directions in ((16, 2), (64, 2), (64, 8)):
    name = f"scaled-conjugate-gradient:{batch}:{directions}"
    register(name, 1 + directions, ScaledConjugateGradient, batch=batch, directions=directions)
