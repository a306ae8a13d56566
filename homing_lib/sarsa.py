"""Control with a linear action-value function, Q(s, a) = phi(s)^T theta(a): eqs. (17), (18) and Fig. 2 of the paper.

    LinearSarsa    Sarsa(lambda_t), on-policy
    LinearQ        Watkins's Q(lambda_t), off-policy

Either is TD prediction on state-action features: phi(s, a) is phi(s) in the row of a and zero elsewhere, shape
(actions, n).
"""

from operator import index
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg.blas import ddot as dot

from homing_lib.lambdas import Array, LambdaRule, one_of
from homing_lib.td import Learner, features, finite, linear, silent, td_error

Traces = Literal["accumulating", "replacing", "dutch"]
Update = Literal["taken", "all"]


class LinearSarsa(Learner):
    """Sarsa(lambda) with any lambda rule: the learning of Fig. 2. Choosing actions and features is the caller's.

    traces              "accumulating": eq. (17). "replacing": a feature that is not zero sets its trace instead of
                        adding to it. "dutch": true online Sarsa(lambda), see `td.TrueOnlineTD`.
    update              "taken": eq. (18) as printed, only the weights of the action taken change. "all": the
                        standard, every action's weights change by its trace. By default "taken", but "all" with
                        dutch traces, which are exact only so.
    bootstrap_terminal  False: the value after the last step is 0, the standard. True: Fig. 2 as printed, which
                        knows no terminal state.

    `weights` and `trace` have shape (actions, n). The lambda rule sees phi(s, a) and the trace as vectors of
    actions * n components, so that TD-conj stays equivalent to conjugate gradient. Form 2 is the same
    either way: |phi(s, a)| = |phi(s)|.
    """

    _default_update: Update = "taken"

    def __init__(
        self,
        n_features: int,
        n_actions: int,
        *,
        step_size: float,
        discount: float,
        lambda_rule: LambdaRule,
        initial_weight: float = 0.0,
        traces: Traces = "accumulating",
        update: Update | None = None,
        bootstrap_terminal: bool = False,
    ) -> None:
        one_of("traces", traces, get_args(Traces))
        self.traces = traces
        self.updates: Update = update if update is not None else "all" if traces == "dutch" else self._default_update
        one_of("update", self.updates, get_args(Update))
        self.bootstrap_terminal = bootstrap_terminal
        super().__init__(
            (n_actions, n_features),
            step_size=step_size,
            discount=discount,
            lambda_rule=lambda_rule,
            initial_weight=initial_weight,
        )

    def values(self, phi: ArrayLike) -> Array:
        """Q(s, a) of every action, shape (actions,). phi: shape (n,)."""
        return self._values("phi", phi)

    def _values(self, name: str, phi: ArrayLike | None) -> Array:
        x = features(name, phi, self.weights.shape[1])
        return np.array([linear(name, theta_a, x) for theta_a in self.weights])

    def begin_episode(self) -> None:
        super().begin_episode()
        self._q_ahead = 0.0  # q_next of the step before, for true online learning

    @silent
    def update(
        self,
        phi: ArrayLike,
        action: int,
        reward: float,
        phi_next: ArrayLike | None,
        next_action: int | None,
        *,
        terminal: bool = False,
    ) -> float:
        """Learn from s_t, a_t, r_{t+1}, s_{t+1}, a_{t+1}; return the TD error. phi, phi_next: shape (n,).

        After a terminal step, unless it bootstraps, nothing follows: phi_next and next_action are ignored.
        """
        theta, alpha, gamma = self.weights, self.step_size, self.discount
        phi, a = features("phi", phi, theta.shape[1]), self._action("action", action)
        phi_sa = np.zeros(theta.shape)  # phi(s_t, a_t), a new array at each step: E12
        phi_sa[a] = phi

        q = linear("phi", theta[a], phi)
        q_next = 0.0 if terminal and not self.bootstrap_terminal else self._q_next(phi_next, next_action)
        delta = td_error(finite("reward", reward), gamma, q_next, q)

        # Eq. (7). The call also keeps delta_t and phi_t, to be delta_{t-1} and phi_{t-1} at the next step.
        lambda_t = self._lambda_t(delta, phi_sa.ravel(), self.trace.ravel())

        e = gamma * lambda_t * self.trace  # eq. (17), for every action
        if self.traces == "accumulating":
            e += phi_sa  # eq. (17), for the action taken
        elif self.traces == "replacing":
            np.copyto(e, phi_sa, where=phi_sa != 0)
        else:
            e += (1 - alpha * dot(e[a], phi)) * phi_sa
        self.trace = e

        if self.updates == "taken":
            theta, e, phi_sa = theta[a], e[a], phi
        change = alpha * delta * e
        if self.traces == "dutch":
            change += alpha * (q - self._q_ahead) * (e - phi_sa)
        theta += change  # eq. (18)

        self._q_ahead = q_next
        self._changed_by(change)
        return delta

    def _q_next(self, phi_next: ArrayLike | None, next_action: int | None) -> float:
        """The value that the TD error looks ahead to: Q(s_{t+1}, a_{t+1})."""
        a = self._action("next_action", next_action)
        return linear("phi_next", self.weights[a], features("phi_next", phi_next, self.weights.shape[1]))

    def _action(self, name: str, action: int | None) -> int:
        n_actions = len(self.weights)
        if action is None or not 0 <= action < n_actions:
            raise ValueError(f"{name} must lie in 0..{n_actions - 1}, got {action!r}")
        return index(action)


class LinearQ(LinearSarsa):
    """Watkins's Q(lambda) with any lambda rule: off-policy, since the TD error looks ahead to the best next action.

    Where the next action is not a best one (before the update; ties count as best) the trace is cut: it is zero, and
    the next step is like the first of an episode, with lambda 0. Settings as in `LinearSarsa`, but `update` is "all"
    by default.
    """

    _default_update = "all"

    def update(
        self,
        phi: ArrayLike,
        action: int,
        reward: float,
        phi_next: ArrayLike | None,
        next_action: int | None,
        *,
        terminal: bool = False,
    ) -> float:
        """Learn from s_t, a_t, r_{t+1}, s_{t+1}, a_{t+1}; return the TD error. Arguments as in `LinearSarsa`."""
        self._cut = False
        delta = super().update(phi, action, reward, phi_next, next_action, terminal=terminal)
        if self._cut:
            self._restart()
        return delta

    def _q_next(self, phi_next: ArrayLike | None, next_action: int | None) -> float:
        """max over a of Q(s_{t+1}, a); notes whether the next action is one that attains it."""
        values = self._values("phi_next", phi_next)
        self._cut = bool(values[self._action("next_action", next_action)] < values.max())
        return float(values.max())
