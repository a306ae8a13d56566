"""Learners that predict, and set their lambda or their step size themselves: HL(lambda), lambda-greedy, META.

They are used as `td.LinearTD` is, and raced on the random walk (`study.walk.today`). What a step costs is counted in
operations on vectors, as a multiple of those of TD(lambda).
"""

from math import sqrt
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from homing_lib.lambdas import Array, Fixed
from homing_lib.sarsa import silent
from homing_lib.study.methods.lambda_greedy import greedy_lambda
from homing_lib.td import TrueOnlineTD

UNKNOWN = sqrt(np.finfo(float).eps)  # a variance up to this is none yet, as in the code of META's authors


class HL:
    """HL(lambda), which has no step size: Hutter and Legg, Temporal difference updating without a learning rate, NIPS
    2007. Tabular: phi has a single 1. Costs 2x.

        E(s_t) += 1,  N(s_t) += 1
        beta(s) = N(s_{t+1}) / (N(s_{t+1}) - gamma E(s_{t+1})) / N(s)
        V(s) += beta(s) E(s) delta_t,  then E(s) *= gamma lambda,  N(s) *= lambda        for every state s

    N is 1 at first, as if each state had been met once. V(s) is the mean of all returns from s, an older one of less
    weight if lambda < 1; those still under way are completed by V(s_{t+1}). The authors' chains never end. Here an end
    is a state that is known to be worth 0, as if met infinitely often: beta(s) = 1 / N(s). So, when an episode ends,
    HL(1) is the mean of the returns of all visits, Monte Carlo, with a return of 0 for the visit that was none.
    """

    def __init__(self, n_states: int, *, lambda_: float, discount: float) -> None:
        self.lambda_, self.discount = lambda_, discount
        self.weights, self.visits = np.zeros(n_states), np.ones(n_states)  # V, N
        self.begin_episode()

    def begin_episode(self) -> None:
        """Clear the trace."""
        self.trace = np.zeros_like(self.weights)  # E

    @silent
    def update(self, phi: ArrayLike, reward: float, phi_next: ArrayLike, *, terminal: bool = False) -> float:
        """Learn from one step; return its TD error. phi, phi_next: shape (states,). At a terminal step V(s') is 0."""
        here, ahead = _arrays(phi, phi_next, terminal)
        delta = reward + self.discount * (self.weights @ ahead) - self.weights @ here
        self.trace += here
        self.visits += here
        under_way = 0.0 if terminal else self.discount * (self.trace @ ahead) / (self.visits @ ahead)
        self.weights += delta * self.trace / (self.visits * (1 - under_way))
        self.trace *= self.discount * self.lambda_
        self.visits *= self.lambda_
        return float(delta)


class _Helped:
    """True online TD with a lambda for each state, and two helpers that learn what the return from a state is: its mean
    by true online TD(1), its variance by TD(0) on squared TD errors (Sherstan et al., UAI 2018).
    """

    def __init__(
        self, n_features: int, *, step_size: float, helper_step_size: float, discount: float, initial_return: float = 0
    ) -> None:
        self._settings: dict[str, Any] = {"discount": discount, "step_size": helper_step_size}
        self.lambda_ = 1.0  # of the state that a step leaves
        self.value = TrueOnlineTD(n_features, lambda_rule=self._rule, **self._settings | {"step_size": step_size})
        self.mean = TrueOnlineTD(n_features, lambda_rule=Fixed(1), initial_weight=initial_return, **self._settings)
        self.learners = [self.value, self.mean]
        self.variance = np.zeros(n_features)

    def _rule(self, **_: Any) -> float:
        return self.lambda_

    @property
    def weights(self) -> Array:
        """Those of the value, shape (n,)."""
        return self.value.weights

    def begin_episode(self) -> None:
        """Clear the traces."""
        for learner in self.learners:
            learner.begin_episode()

    def _learn(self, here: Array, reward: float, ahead: Array, terminal: bool, lambda_ahead: float) -> float:
        """Whatever is learnt from one step; returns the TD error of the value. Of the return with this lambda,

        Var(s_t) += alpha' (delta_t^2 + (gamma lambda)^2 Var(s_{t+1}) - Var(s_t)),  alpha' the helpers' step size
        """
        delta, *_ = [learner.learn(here, 0, reward, ahead, 0, terminal) for learner in self.learners]
        discount = (self.mean.discount * lambda_ahead) ** 2
        error = delta**2 + discount * (self.variance @ ahead) - self.variance @ here
        self.variance += self.mean.step_size * error * here
        return delta


class LambdaGreedy(_Helped):
    """Lambda-greedy, the lambda of each state that makes the target of the next update as good as it can be: White and
    White, A greedy approach to adapting the trace parameter for temporal difference learning, AAMAS 2016. Costs 3x.

        lambda(s_{t+1}) = D^2 / (D^2 + Var(s_{t+1})),  D = M(s_{t+1}) - V(s_{t+1})

    M and Var are mean and variance of the return as the helpers have learnt them, with a step size of their own.
    initial_return: M at first. The authors take the greatest return that there is, so that lambda is near 1 where
    nothing is known yet. They learn by GTD(lambda), and the variance by the mean square; this is the direct form.
    """

    @silent
    def update(self, phi: ArrayLike, reward: float, phi_next: ArrayLike, *, terminal: bool = False) -> float:
        """Learn from one step; return its TD error. phi, phi_next: shape (n,). At a terminal step V(s') is 0."""
        here, ahead = _arrays(phi, phi_next, terminal)
        value_ahead = self.weights @ ahead
        delta = self._learn(here, reward, ahead, terminal, 1.0)
        bias = float(self.mean.weights @ ahead - value_ahead)
        self.lambda_ = greedy_lambda(bias, float(self.variance @ ahead), UNKNOWN)
        return delta


class META(_Helped):
    """META, a lambda for each state that is learnt by gradient descent: Zhao et al., META-learning state-based
    eligibility traces, AAMAS 2020; their code is PwnerHarry/META, `mta.py`. Costs 5x.

        lambda(s_{t+1}) -= kappa gamma^2 (lambda (D^2 + Var) - D (V - M))        D = V - L, all of s_{t+1}

    half the gradient of the target's squared bias and variance. M is the mean of the return, L and Var are mean and
    variance of the return with lambda(s), as three helpers learn them, with twice the step size, as in the code. Lambda
    is 1 at first; a step that leads beyond [0, 1], or from where no variance was seen yet, is not taken. The code has
    the last term with a plus, which is up the bias, and takes every step: lambda then falls to 0, whatever is learnt.
    """

    def __init__(self, n_features: int, *, step_size: float, kappa: float, discount: float) -> None:
        super().__init__(n_features, step_size=step_size, helper_step_size=min(1, 2 * step_size), discount=discount)
        self.lambda_mean = TrueOnlineTD(n_features, lambda_rule=self._rule, **self._settings)
        self.learners.append(self.lambda_mean)
        self.lambda_weights, self.kappa = np.ones(n_features), kappa

    @silent
    def update(self, phi: ArrayLike, reward: float, phi_next: ArrayLike, *, terminal: bool = False) -> float:
        """Learn from one step; return its TD error. phi, phi_next: shape (n,). At a terminal step V(s') is 0."""
        here, ahead = _arrays(phi, phi_next, terminal)
        self.lambda_, lambda_ahead = float(self.lambda_weights @ here), float(self.lambda_weights @ ahead)
        value_ahead, variance = self.weights @ ahead, self.variance @ ahead
        d = value_ahead - self.lambda_mean.weights @ ahead
        slope = lambda_ahead * (d**2 + variance) - d * (value_ahead - self.mean.weights @ ahead)
        step = self.kappa * self.mean.discount**2 * slope

        delta = self._learn(here, reward, ahead, terminal, lambda_ahead)
        if variance > UNKNOWN and 0 <= lambda_ahead - step <= 1:
            self.lambda_weights -= step * ahead
        return delta


def _arrays(phi: ArrayLike, phi_next: ArrayLike, terminal: bool) -> tuple[Array, Array]:
    """phi_t and phi_{t+1}; the latter 0 after the last step, so that whatever is learnt is worth 0 there."""
    here = np.asarray(phi, np.float64)
    return here, np.zeros_like(here) if terminal else np.asarray(phi_next, np.float64)
