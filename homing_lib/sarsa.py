"""The learner of Fig. 2: a linear action-value function, Q(s, a) = phi(s)^T theta(a), and eqs. (1), (17), (18).

It is TD prediction on state-action features: phi(s, a) is phi(s) in the row of a and zero elsewhere, shape (actions,
n). TD prediction itself (`td`) is the same update with one action. Each equation is a function to be called by itself.

A name that ends in `_tm1` belongs to the state that a step leaves, one in `_t` to what the step leads to (the paper's
t and t + 1).
"""

from math import inf, isfinite, sqrt
from numbers import Real
from operator import index
from typing import Any, Literal, SupportsFloat, SupportsIndex, get_args

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg.blas import ddot as dot

from homing_lib.errors import finite, one_of, shown, unit_interval
from homing_lib.lambdas import TAKES_AND_RETURNS, AnyRule, Array, lambda_spec, name_of

Traces = Literal["accumulating", "dutch"]
Update = Literal["taken", "all"]

silent = np.errstate(all="ignore")  # a decorator: NumPy's warnings of overflow add nothing to what `Diverged` says


class Diverged(ArithmeticError):
    """The weights left the finite numbers at update `step` (1, 2, ...): an outcome of a run, to be recorded as such."""

    def __init__(self, step: int, rule: str, step_size: float) -> None:
        super().__init__(step, rule, step_size)

    def __str__(self) -> str:
        step, rule, step_size = self.args
        return f"weights not finite after step {step}, lambda rule {rule}, step size {step_size}"


def value_of(weights: Array, phi: Array, name: str = "phi") -> float:
    """Eq. (2), theta^T phi. ValueError if phi, called `name`, is not finite; if only the value is not, it diverges."""
    value: float = dot(weights, phi)
    if not isfinite(value) and not np.isfinite(phi).all():
        raise ValueError(f"{name} must be finite, got {phi[~np.isfinite(phi)][0]} among its components")
    return value


def td_error(q_tm1: float, r_t: float, discount: float, q_t: float) -> float:
    """Eq. (1): what the step brought, and what is now expected, less what was expected.

        delta = r_t + gamma Q(s_t, a_t) - Q(s_tm1, a_tm1)

    q_t: 0 after the last step of an episode.
    """
    return r_t + discount * q_t - q_tm1


def decayed(trace: Array, discount: float, lambda_t: float) -> Array:
    """Eq. (17) before the features of this step are added: gamma lambda_t e, a new array of the same shape."""
    return discount * lambda_t * trace


def dutch(phi_tm1: Array, trace: Array, step_size: float) -> Array:
    """What true online learning adds to the decayed trace in place of phi: (1 - alpha e^T phi) phi, shape (n,).

    van Seijen et al., True online temporal-difference learning, JMLR 17 (2016).
    """
    return (1 - step_size * dot(trace, phi_tm1)) * phi_tm1


class LinearSarsa:
    """Sarsa(lambda_t): the learning of Fig. 2. Choosing actions and features is the caller's. Settings:

    step_size           alpha, may be set between steps
    discount            gamma
    lambda_rule         see `lambdas.LambdaRule`; or the name of one, such as "fixed:0.9", with its options
    initial_weight      theta_0
    clip                reset a lambda outside [0, 1] to the nearer bound, as the paper asks (II.B). Such a step no
                        longer follows the conjugate direction; `clipped` says so
    on_zero             the lambda where the rule's ratio is undefined (E13: the paper is silent, and the choice
                        matters). 0 starts the direction afresh, as conjugate gradient does
    traces              "accumulating": eq. (17). "dutch": true online learning, see `td.TrueOnlineTD`
    update              "taken": eq. (18) as printed, only the weights of the action taken change. "all": the
                        standard, every action's weights change by its trace. By default "taken", but "all" with
                        dutch traces, which are exact only so
    bootstrap_terminal  False: the value after the last step is 0, the standard. True: Fig. 2 as printed, which
                        knows no terminal state

    and what it shows: `weights` and `trace`; of the last step `lambda_`, whether it was `clipped`, and `change`, the
    Euclidean norm of the change of the weights; `steps`, the updates so far.

    The lambda rule sees phi(s, a) and the trace as vectors of actions * n components, so that TD-conj stays
    equivalent to conjugate gradient if `update` is "all". Form 2 is the same either way: |phi(s, a)| = |phi(s)|.
    """

    def __init__(
        self,
        n_features: int,
        n_actions: int,
        *,
        step_size: float,
        discount: float,
        lambda_rule: AnyRule,
        initial_weight: float = 0.0,
        clip: bool = True,
        on_zero: float = 0.0,
        traces: Traces = "accumulating",
        update: Update | None = None,
        bootstrap_terminal: bool = False,
    ) -> None:
        if min(n_features, n_actions) < 1:
            raise ValueError(f"there must be at least 1 feature and 1 action, got {n_features} and {n_actions}")
        self.traces, self.update_mode = traces, update or ("all" if traces == "dutch" else "taken")
        one_of("traces", self.traces, get_args(Traces))
        one_of("update", self.update_mode, get_args(Update))
        self.step_size = step_size
        self.discount = unit_interval("discount", discount)
        spec = lambda_spec(lambda_rule)
        self.lambda_rule, self.clip = spec.rule, spec.clip and clip
        self.on_zero = unit_interval("on_zero", on_zero) or spec.on_zero
        self.bootstrap_terminal = bootstrap_terminal
        self._theta: Array = np.full((n_actions, n_features), finite("initial_weight", initial_weight))
        self._shape = (n_features,)
        self._theta_of = list(self._theta)  # views of its rows: theta(a) without making one at each step
        self.steps, self.change = 0, 0.0
        self.begin_episode()

    @property
    def weights(self) -> Array:
        """theta, shape (actions, n)."""
        return self._theta

    @property
    def trace(self) -> Array:
        """e, the same shape."""
        return self._e

    @property
    def step_size(self) -> float:
        return self._step_size

    @step_size.setter
    def step_size(self, alpha: float) -> None:
        if not isinstance(alpha, SupportsFloat) or not 0 < alpha < inf:
            raise ValueError(f"step_size must be finite and greater than 0, got {shown(alpha)}")
        self._step_size = float(alpha)

    def begin_episode(self) -> None:
        """Clear the trace and forget the step before; the weights stay."""
        self.lambda_, self.clipped, self._q_ahead = 0.0, False, 0.0  # the last: q_t of the step before
        self._restart()

    def _restart(self) -> None:
        self._e: Array = np.zeros_like(self._theta)
        self._step_before: tuple[float, Array] | None = None  # delta_{t-1}, phi_{t-1}

    def values(self, phi: ArrayLike) -> Array:
        """Q(s, a) of every action, shape (actions,). phi: shape (n,)."""
        return np.array(self.value_list(phi))

    def value_list(self, phi: ArrayLike | None, name: str = "phi") -> list[float]:
        """As `values`, but Python's own floats in a list, which is faster for a few actions."""
        x = self._features(name, phi)
        return [value_of(theta_a, x, name) for theta_a in self._theta_of]

    @silent
    def update(
        self, phi: ArrayLike, action: int, reward: float, phi_next: Any, next_action: Any, *, terminal: bool = False
    ) -> float:
        """Learn from s_t, a_t, r_{t+1}, s_{t+1}, a_{t+1}; return the TD error. phi, phi_next: shape (n,).

        After a terminal step, unless it bootstraps, nothing follows: phi_next and next_action are ignored, or None.
        """
        x, a = self._features("phi", phi), self._action("action", action)
        follows = not terminal or self.bootstrap_terminal
        x_next = self._features("phi_next", phi_next) if follows else x
        a_next = self._action("next_action", next_action) if follows else a
        return self.learn(x, a, finite("reward", reward), x_next, a_next, terminal)

    def learn(self, phi_tm1: Array, a_tm1: int, r_t: float, phi_t: Array, a_t: int, terminal: bool) -> float:
        """`update` without its checks, for whoever has made sure of shapes and actions."""
        alpha, discount = self._step_size, self.discount
        q_tm1 = value_of(self._theta_of[a_tm1], phi_tm1)
        follows = not terminal or self.bootstrap_terminal
        q_t = self._value_ahead(phi_t, a_t) if follows else 0.0
        delta = td_error(q_tm1, r_t, discount, q_t)  # (1)

        phi_sa = np.zeros(self._theta.shape)  # phi(s_tm1, a_tm1), a new array at each step: E12
        phi_sa[a_tm1] = phi_tm1
        lambda_t = self._lambda(delta, phi_sa.ravel())  # (7)

        self._e = e = decayed(self._e, discount, lambda_t)  # (17), of every action
        e_a = e[a_tm1]
        e_a += phi_tm1 if self.traces == "accumulating" else dutch(phi_tm1, e_a, alpha)

        moves = a_tm1 if self.update_mode == "taken" else slice(None)  # whose weights
        alpha = self._step_along(e, phi_sa, moves, (phi_t, a_t) if follows else None)
        change = alpha * delta * e[moves]  # (18)
        if self.traces == "dutch":  # the value grew by q_tm1 - q_ahead since the step before looked ahead to it
            change += alpha * (q_tm1 - self._q_ahead) * (e - phi_sa)[moves]
        theta = self._theta[moves]
        theta += change

        self._q_ahead = q_t
        self._changed_by(change.ravel())
        return delta

    def _lambda(self, delta: float, phi: Array) -> float:
        """lambda_t by the rule, guarded and clipped; 0 at the first step. This step then becomes the step before."""
        self.lambda_, self.clipped = 0.0, False
        if self._step_before is not None:
            (delta_prev, phi_prev), e, discount = self._step_before, self._e.ravel(), self.discount
            try:
                ratio = self.lambda_rule(
                    delta=delta, phi=phi, delta_prev=delta_prev, phi_prev=phi_prev, trace_prev=e, discount=discount
                )
            except ArithmeticError:
                ratio = self.on_zero
            self.lambda_ = ratio if type(ratio) is float and isfinite(ratio) else self._plain(ratio, delta)
            if self.clip and not 0 <= self.lambda_ <= 1:
                self.lambda_, self.clipped = min(max(0.0, self.lambda_), 1.0), True
        self._step_before = delta, phi
        return self.lambda_

    def _plain(self, ratio: Any, delta: float) -> float:
        """The ratio as a float, or `on_zero` if the TD error is not finite either. ValueError for any other ratio."""
        if isinstance(ratio, Real | np.ndarray) and not getattr(ratio, "shape", ()) and isfinite(ratio):
            return float(ratio)
        if not isfinite(delta):  # the weights are about to diverge, and that is not the rule's fault
            return self.on_zero
        returned = f"lambda rule {name_of(self.lambda_rule)} returned {' '.join(repr(ratio)[:60].split())}"
        why = " (NumPy's numbers divide by 0)" if isinstance(ratio, np.floating) else ""
        raise ValueError(f"{returned}{why}; {TAKES_AND_RETURNS}")

    def _step_along(self, e: Array, phi_sa: Array, moves: Any, ahead: Any) -> float:
        """The step size of this step, for learners that bound it. moves: the rows of the trace e that it moves along;
        ahead: the features and the action that follow, or None.
        """
        return self._step_size

    def _value_ahead(self, phi_t: Array, a_t: int) -> float:
        """The value that the TD error looks ahead to: Q(s_t, a_t)."""
        return value_of(self._theta_of[a_t], phi_t, "phi_next")

    def _changed_by(self, change: Array) -> None:
        """Note a change just made to the weights, and see that they are still finite."""
        self.steps += 1
        squares = dot(change, change)
        # A finite sum of squares bounds each change by 1e155, by which no finite weight can overflow.
        if not isfinite(squares) and not np.isfinite(self._theta).all():
            raise Diverged(self.steps, name_of(self.lambda_rule), self._step_size)
        largest = 1.0 if isfinite(squares) else float(np.abs(change).max())
        self.change = largest * sqrt(squares if largest == 1 else dot(change / largest, change / largest))

    def _features(self, name: str, phi: ArrayLike | None) -> Array:
        """The feature vector as an array of floats, or ValueError unless its shape is (n,)."""
        try:
            x = np.asarray(phi, np.float64)
        except (TypeError, ValueError, OverflowError):
            raise ValueError(f"{name} must be numbers of shape {self._shape}, got {shown(phi)}") from None
        if x.shape != self._shape:
            raise ValueError(f"{name} must have shape {self._shape}, got {x.shape}")
        return x

    def _action(self, name: str, action: Any) -> int:
        if not isinstance(action, SupportsIndex) or not 0 <= index(action) < len(self._theta):
            raise ValueError(f"{name} must be an integer in 0..{len(self._theta) - 1}, got {shown(action)}")
        return index(action)


class LinearQ(LinearSarsa):
    """Watkins's Q(lambda) with any lambda rule: off-policy, since the TD error looks ahead to the best next action.

    Where the next action is not a best one (before the update; ties count as best) the trace is cut: it is zero, and
    the next step is like the first of an episode, with lambda 0. Settings as in `LinearSarsa`, but `update` is "all"
    by default.
    """

    def __init__(self, n_features: int, n_actions: int, *, update: Update = "all", **settings: Any) -> None:
        super().__init__(n_features, n_actions, update=update, **settings)

    def learn(self, *step: Any) -> float:
        """As `LinearSarsa.learn`."""
        self._cut = False
        delta = super().learn(*step)
        if self._cut:
            self._restart()
        return delta

    def _value_ahead(self, phi_t: Array, a_t: int) -> float:
        """max over a of Q(s_t, a); notes whether the next action is one that attains it."""
        values = np.array(self.value_list(phi_t, "phi_next"))
        self._cut = bool(values[a_t] < values.max())
        return float(values.max())
