"""Swift-Sarsa: Javed and Sutton, Swift-Sarsa: fast and robust linear control, arXiv 2507.19539 (2025), after Javed,
Sharifnassab and Sutton, SwiftTD, RLJ 2024. The code is its author's: the package `swiftsarsa`, of 32-bit numbers.

    true online Sarsa(lambda) with a step size exp(b_i) for each weight
    b += theta / exp(b) (delta - w_change.x) p          learnt by the gradient of the error, p its trace
    all step sizes times eta / tau where tau = sum exp(b) x^2 > eta, and they decay

No step takes away more than the share eta of its error: the bound of Dabney and Barto, for each step anew. theta, the
decay and the least step size are its author's; the step size of the settings is where all begin, and does not fall by
eq. (23); the name in settings says eta.

The package starts from weights of 0. Those of theta_0 are put in front: theta_0 (1.phi) is added to its values and
taken out of its rewards, which is the same. Its step is learnt when the next one is known, as here; at home, and where
an episode is cut, its traces are cleared by a step of discount 0 into nowhere.

Cost: ten vectors of length 3 n, where Sarsa(lambda) has two; 5 times.
"""

from math import isfinite
from typing import Any

from homing_lib.errors import UserError
from homing_lib.features import Array
from homing_lib.lambdas import Fixed
from homing_lib.sarsa import Diverged, LinearSarsa
from homing_lib.study.methods.base import register

META, DECAY, TRACE_LEFT, LEAST = 1e-3, 0.999, 1e-4, 1e-8
"""Of the step sizes: theta, what the decay leaves, and the least; of a trace: what share of it is dropped."""


class SwiftSarsa(LinearSarsa):
    """eta: the largest share of an error that one step may take away. Raises UserError without the package, or for a
    lambda that is not fixed.
    """

    _value: float | None = None  # of the step that is yet to be learnt, by the package's weights

    def __init__(self, n: int, actions: int, *, eta: float, **settings: Any) -> None:
        super().__init__(n, actions, **settings)
        needs = "controller = 'swift-sarsa' needs"
        try:
            from swiftsarsa import SwiftSarsa as Package
        except ImportError:
            raise UserError(f"{needs} a package: `pip install swiftsarsa`") from None
        if not isinstance(self.lambda_rule, Fixed):
            raise UserError(f"{needs} a fixed lambda: lambda_rule = fixed:0.9")
        self.package = Package(n, actions, self.lambda_rule.value, self._step_size, META, eta, DECAY, TRACE_LEFT, LEAST)
        self.initial = settings.get("initial_weight", 0.0)

    def begin_episode(self) -> None:
        """What is left of an episode that was cut is cleared."""
        super().begin_episode()
        if self._value is not None:
            self.package.learn([], self._value, 0.0, 0)
        self._value = None

    def value_list(self, phi: Any = None, name: str = "phi") -> list[float]:
        """Q(s, a) of every action."""
        offset = self.initial * float(phi.sum())
        return [offset + value for value in self.package.get_action_values(_pairs(phi))]

    def learn(self, phi_tm1: Array, a_tm1: int, r_t: float, phi_t: Array, a_t: int, terminal: bool) -> float:
        """One step, as `LinearSarsa.learn`."""
        if self._value is None:
            self._value = self.package.learn(_pairs(phi_tm1), 0.0, self.discount, a_tm1)
        before, reward = self._value, r_t - self.initial * float(phi_tm1.sum())
        if terminal:
            ahead = self.value_list(phi_t)[a_t] if self.bootstrap_terminal else 0.0
            delta = reward + self.discount * ahead - before
            self.package.learn([], reward + self.discount * ahead, 0.0, a_t)
            self._value = None
        else:
            reward += self.discount * self.initial * float(phi_t.sum())
            self._value = self.package.learn(_pairs(phi_t), reward, self.discount, a_t)
            delta = reward + self.discount * self._value - before
        self.steps += 1
        if not isfinite(delta):
            raise Diverged(self.steps, "of Swift-Sarsa", self._step_size)
        return delta


def _pairs(phi: Array) -> list[tuple[int, float]]:
    """Features as the package takes them: their numbers and values."""
    return list(enumerate(phi.tolist()))


for eta in (0.1, 0.5):
    register(f"swift-sarsa:{eta:g}", 5, SwiftSarsa, eta=eta)
