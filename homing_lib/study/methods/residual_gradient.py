"""The residual gradient: Baird, Residual algorithms: reinforcement learning with function approximation, ICML 1995.

    w += alpha delta (x - gamma x')          x = phi(s, a), x' = phi(s', a')

The gradient of the squared TD error itself, so that it always converges; but to weights that change little from step to
step, rather than to those that predict. The paper's reference [3]. Each step is seen once: where chance decides what
follows, it is the mean squared TD error that becomes least, not the Bellman error.

Cost: w at x and at x'; that of Sarsa(lambda).
"""

from homing_lib.features import Array
from homing_lib.study.methods.base import Method, register


class ResidualGradient(Method):
    """Sarsa by the residual gradient."""

    def change_of(self, delta: float, x: Array, y: Array) -> Array:
        """y is gamma x'."""
        return self._step_size * delta * (x - y)


register("residual-gradient", 1, ResidualGradient)
