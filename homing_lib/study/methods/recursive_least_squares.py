"""Recursive least squares, in the form of Sarsa: Bradtke and Barto, Linear least-squares algorithms for
temporal difference learning, Machine Learning 22 (1996); Boyan, Technical update: LSTD, Machine Learning 49 (2002).

    k = P x / (1 + (x - gamma x').P x)          x = phi(s, a), x' = phi(s', a')
    w += k delta
    P -= k (P^T (x - gamma x'))^T

After every step w solves (P_0^-1 + sum x (x - gamma x')^T) w = P_0^-1 w_0 + sum x r exactly: there is no step size, and
nothing is forgotten, though the policy changes. So it is a ceiling of what the features allow, not of what can be
learnt. P_0 is the identity times the step size of the settings, which does not fall.

Cost: P, of 3 n times 3 n numbers, three times; 1.5 * 3 n times Sarsa(lambda), 1.6 ms a step here.
"""

from typing import Any

import numpy as np
from scipy.linalg.blas import ddot as dot
from scipy.linalg.blas import dger

from homing_lib.features import Array
from homing_lib.study.methods.base import Method, register


class RecursiveLeastSquares(Method):
    """LSTD(0) of action values, solved anew at every step."""

    def __init__(self, *shape: int, **settings: Any) -> None:
        super().__init__(*shape, **settings)
        self.p = np.asfortranarray(self._step_size * np.eye(self._theta.size))

    def change_of(self, delta: float, x: Array, y: Array) -> Array:
        """y is gamma x'."""
        gain, difference = self.p @ x, x - y
        gain /= 1 + dot(difference, gain)
        self.p = dger(-1.0, gain, difference @ self.p, a=self.p, overwrite_a=True)
        return gain * delta


register("least-squares", 1.5 * 774, RecursiveLeastSquares)
