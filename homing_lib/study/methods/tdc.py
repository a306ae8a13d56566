"""TDC, TD with gradient correction, in the form of Sarsa: Sutton, Maei, Precup, Bhatnagar, Silver, Szepesvari and
Wiewiora, Fast gradient-descent methods for temporal-difference learning with linear function approximation, ICML 2009.

    w += alpha (delta x - gamma x' (x.h))          x = phi(s, a), x' = phi(s', a')
    h += beta (delta - x.h) x

A gradient descent on the projected Bellman error, so that it is stable where plain TD is not; h estimates by least
squares what TD error is to be expected in x. The source predicts; here a' is the action that is taken next, as in
Sarsa. beta is a multiple of alpha, which the name in settings says: "tdc:1".

Cost: w twice and h twice; 2 times Sarsa(lambda).
"""

from typing import Any

import numpy as np
from scipy.linalg.blas import ddot as dot

from homing_lib.features import Array
from homing_lib.study.methods.base import Method, register


class TDC(Method):
    """ratio: beta / alpha."""

    def __init__(self, *shape: int, ratio: float, **settings: Any) -> None:
        super().__init__(*shape, **settings)
        self.ratio, self.h = ratio, np.zeros(self._theta.size)

    def change_of(self, delta: float, x: Array, y: Array) -> Array:
        """y is gamma x'."""
        alpha, expected = self._step_size, dot(x, self.h)
        self.h += self.ratio * alpha * (delta - expected) * x
        return alpha * (delta * x - expected * y)


for ratio in (0.1, 1):
    register(f"tdc:{ratio}", 2, TDC, ratio=ratio)
