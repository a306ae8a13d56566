"""Temporal-difference prediction with a linear value function: eqs. (1)-(6) of the paper.

    LinearTD        TD(lambda), accumulating traces, any lambda rule
    TrueOnlineTD    true online TD(lambda), which equals the online forward view at every step
    ConjugateTD     TD-conj as what it was derived from: conjugate gradient, without trace or lambda

That the first and the last are the same algorithm under the lambda of eq. (7) is the paper's central theorem.
A step is `update(phi, reward, phi_next)`: phi_t, r_{t+1}, phi_{t+1}.
"""

from math import hypot, inf, isfinite, sqrt

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg.blas import ddot as dot

from homing_lib.lambdas import Array, Conjugate, Form, LambdaRule, unit_interval

# A decorator: numpy's overflow warnings add nothing to `Diverged`, which says where the run ended.
silent = np.errstate(all="ignore")


class Diverged(ArithmeticError):
    """The weights left the finite numbers: an outcome of a run, to be recorded as such.

    step       number of the update that did it, from 1 over the life of the learner
    rule       name of the lambda rule
    step_size  alpha at that update
    """

    def __init__(self, step: int, rule: str, step_size: float) -> None:
        super().__init__(step, rule, step_size)
        self.step, self.rule, self.step_size = step, rule, step_size

    def __str__(self) -> str:
        return f"weights not finite after step {self.step}, lambda rule {self.rule}, step size {self.step_size}"


def td_error(reward: float, discount: float, value_next: float, value: float) -> float:
    """Eq. (1): delta_t = r_{t+1} + gamma V(s_{t+1}) - V(s_t), where the value of a terminal state is 0."""
    return reward + discount * value_next - value


def beta(form: Form, g: Array, g_prev: Array, p_prev: Array) -> float:
    """How much conjugate gradient keeps of its previous direction: p_t = g_t + beta_t p_{t-1}.

    g, g_prev: minus the gradients, shape (n,). p_prev: the previous direction, shape (n,). These are the textbook
    formulas, which know nothing of TD; they are undefined where the previous step was none.
    """
    if form == "hestenes-stiefel":
        return float(-((g - g_prev) @ g) / ((g - g_prev) @ p_prev))
    if form == "fletcher-reeves":
        return float((g @ g) / (g_prev @ g_prev))
    return float(((g - g_prev) @ g) / (g_prev @ g_prev))


class Learner:
    """What every linear learner here shares: its settings, and the bookkeeping that is no equation.

    weights    theta, shape (n,) or (actions, n)
    trace      e, the same shape
    step_size  alpha, may be set between steps
    lambda_    the last lambda used
    clipped    whether it had to be clipped; False if the rule does not say
    change     Euclidean norm of the last change of the weights
    steps      updates so far
    """

    def __init__(
        self,
        shape: tuple[int, ...],
        *,
        step_size: float,
        discount: float,
        lambda_rule: LambdaRule,
        initial_weight: float = 0.0,
    ) -> None:
        if min(shape) < 1:
            raise ValueError(f"the numbers of features and of actions must be at least 1, got {shape}")
        if not callable(lambda_rule):
            raise TypeError(f"lambda_rule must be callable, such as Fixed(0.9), got {lambda_rule!r}")
        self.step_size = step_size
        self.discount = unit_interval("discount", discount)
        self.lambda_rule = lambda_rule
        self.weights: Array = np.full(shape, finite("initial_weight", initial_weight))
        self.steps = 0
        self.change = 0.0
        self.begin_episode()

    @property
    def step_size(self) -> float:
        return self._step_size

    @step_size.setter
    def step_size(self, alpha: float) -> None:
        if not 0 < alpha < inf:
            raise ValueError(f"step_size must be finite and greater than 0, got {alpha!r}")
        self._step_size = float(alpha)

    def begin_episode(self) -> None:
        """Clear the trace and forget the step before; the weights stay."""
        self.lambda_, self.clipped = 0.0, False
        self._restart()

    def _restart(self) -> None:
        self.trace: Array = np.zeros_like(self.weights)
        self._step_before: tuple[float, Array] | None = None  # delta_{t-1}, phi_{t-1}

    def _lambda_t(self, delta: float, phi: Array, trace_prev: Array) -> float:
        """Eq. (7) by the lambda rule, 0 at the first step. This step then becomes the step before."""
        self.lambda_, self.clipped = 0.0, False
        if self._step_before is not None:
            delta_prev, phi_prev = self._step_before
            self.lambda_ = float(
                self.lambda_rule(
                    delta=delta,
                    phi=phi,
                    delta_prev=delta_prev,
                    phi_prev=phi_prev,
                    trace_prev=trace_prev,
                    discount=self.discount,
                )
            )
            self.clipped = bool(getattr(self.lambda_rule, "clipped", False))
            # If delta is not finite either, the weights are about to diverge, and that is not the rule's fault.
            if not isfinite(self.lambda_) and isfinite(delta):
                raise ValueError(f"lambda rule {self._rule_name} returned {self.lambda_}")
        self._step_before = delta, phi
        return self.lambda_

    def _changed_by(self, change: Array) -> None:
        """Note a change just made to the weights, and see that they are finite still."""
        self.steps += 1
        squares = dot(change.ravel(), change.ravel())
        self.change = sqrt(squares)
        # A finite sum of squares bounds each change by 1e155, by which no finite weight can overflow.
        if not isfinite(squares):
            if not np.isfinite(self.weights).all():
                raise Diverged(self.steps, self._rule_name, self.step_size)
            self.change = hypot(*change.flat)

    @property
    def _rule_name(self) -> str:
        return str(getattr(self.lambda_rule, "__name__", self.lambda_rule))


class LinearTD(Learner):
    """TD(lambda) with accumulating traces and any lambda rule: eqs. (1)-(6).

    `begin_episode` before each episode, `update` at each step; `weights` and `trace` have shape (n,).
    """

    def __init__(
        self,
        n_features: int,
        *,
        step_size: float,
        discount: float,
        lambda_rule: LambdaRule,
        initial_weight: float = 0.0,
    ) -> None:
        super().__init__(
            (n_features,),
            step_size=step_size,
            discount=discount,
            lambda_rule=lambda_rule,
            initial_weight=initial_weight,
        )

    def value(self, phi: ArrayLike) -> float:
        """Eq. (2): V(s) = theta^T phi(s). phi: shape (n,)."""
        return linear("phi", self.weights, features("phi", phi, self.weights.size))

    @silent
    def update(self, phi: ArrayLike, reward: float, phi_next: ArrayLike | None, *, terminal: bool = False) -> float:
        """Learn from one step; return its TD error. phi, phi_next: shape (n,). At a terminal step V(s') is 0."""
        phi, value, value_next = self._values(phi, phi_next, terminal)  # (2)
        delta = td_error(finite("reward", reward), self.discount, value_next, value)  # (1)
        lambda_ = self._lambda_t(delta, phi, self.trace)  # (7)
        self.trace = self.discount * lambda_ * self.trace + phi  # (4), (6)
        change = self.step_size * delta * self.trace  # (3), (5)
        self.weights += change
        self._changed_by(change)
        return delta

    def _values(self, phi: ArrayLike, phi_next: ArrayLike | None, terminal: bool) -> tuple[Array, float, float]:
        """phi_t (a copy, since the caller may use its buffer again), V(s_t), V(s_{t+1})."""
        phi = features("phi", phi, self.weights.size).copy()
        value = linear("phi", self.weights, phi)
        if terminal:
            return phi, value, 0.0
        return phi, value, linear("phi_next", self.weights, features("phi_next", phi_next, self.weights.size))


class TrueOnlineTD(LinearTD):
    """True online TD(lambda): van Seijen et al., True online temporal-difference learning, JMLR 17 (2016), with a
    lambda that may vary.

        e_t = gamma lambda_t e_{t-1} + (1 - alpha gamma lambda_t e_{t-1}^T phi_t) phi_t        the dutch trace
        theta_{t+1} = theta_t + alpha delta_t e_t + alpha (theta_t - theta_{t-1})^T phi_t (e_t - phi_t)
    """

    def begin_episode(self) -> None:
        super().begin_episode()
        self._value_next = 0.0

    @silent
    def update(self, phi: ArrayLike, reward: float, phi_next: ArrayLike | None, *, terminal: bool = False) -> float:
        """Learn from one step; return its TD error. phi, phi_next: shape (n,). At a terminal step V(s') is 0."""
        phi, value, value_next = self._values(phi, phi_next, terminal)
        delta = td_error(finite("reward", reward), self.discount, value_next, value)
        decayed = self.discount * self._lambda_t(delta, phi, self.trace) * self.trace
        self.trace = decayed + (1 - self.step_size * dot(decayed, phi)) * phi
        drift = value - self._value_next  # of this state's value, since the step before looked ahead to it
        change = self.step_size * (delta * self.trace + drift * (self.trace - phi))
        self.weights += change
        self._value_next = value_next
        self._changed_by(change)
        return delta


class ConjugateTD(LinearTD):
    """TD-conj as conjugate gradient: g_t = delta_t phi_t is the descent direction of the squared TD error, and

        p_t = g_t + beta_t p_{t-1}
        theta_{t+1} = theta_t + alpha p_t

    with p_t = g_t at the first step of an episode and wherever beta_t is undefined. `lambda_rule` is a `Conjugate`
    and names the form of beta. `direction` is p_t, shape (n,): by eq. (7) it equals delta_t e_t of a `LinearTD`
    with that rule, until the rule clips. `trace` stays zero, for none is needed.
    """

    lambda_rule: Conjugate

    def begin_episode(self) -> None:
        if not isinstance(self.lambda_rule, Conjugate) or self.lambda_rule.sign != "conjugate":
            raise ValueError(f"ConjugateTD needs a Conjugate rule of conjugate sign, got {self._rule_name}")
        super().begin_episode()
        self.direction: Array = np.zeros_like(self.weights)
        self._g_prev = self.direction

    @silent
    def update(self, phi: ArrayLike, reward: float, phi_next: ArrayLike | None, *, terminal: bool = False) -> float:
        """Learn from one step; return its TD error. phi, phi_next: shape (n,). At a terminal step V(s') is 0."""
        phi, value, value_next = self._values(phi, phi_next, terminal)
        delta = td_error(finite("reward", reward), self.discount, value_next, value)
        g = delta * phi
        beta_t = beta(self.lambda_rule.form, g, self._g_prev, self.direction)  # 0/0 or x/0 at a first step
        self.direction = g + beta_t * self.direction if isfinite(beta_t) else g
        change = self.step_size * self.direction
        self.weights += change
        self._g_prev = g
        self._changed_by(change)
        return delta


def finite(name: str, value: float) -> float:
    """The value as a float, or ValueError unless it is finite."""
    if not isfinite(value):
        raise ValueError(f"{name} must be finite, got {value!r}")
    return float(value)


def features(name: str, phi: ArrayLike | None, n: int) -> Array:
    """The feature vector as an array of floats, or ValueError unless its shape is (n,)."""
    x = np.asarray(phi, np.float64)
    if x.shape != (n,):
        raise ValueError(f"{name} must have shape ({n},), got {x.shape}")
    return x


def linear(name: str, weights: Array, phi: Array) -> float:
    """Eq. (2), theta^T phi. ValueError if phi is not finite: an infinite value of finite features is divergence."""
    value: float = dot(weights, phi)
    if not isfinite(value) and not np.isfinite(phi).all():
        raise ValueError(f"{name} must be finite, got {phi}")
    return value
