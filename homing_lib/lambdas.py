"""The lambda of TD(lambda), chosen anew at every step: eq. (7) of the paper in its three forms, and other rules.

A lambda *rule* is a function such as `fletcher_reeves`, which looks at two steps and returns a ratio; `LambdaRule` says
of what, and what becomes of it. A rule with a name, for settings and the command line, is added by `@register(...)` or
`_derived(...)` where it is defined.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import isfinite
from operator import neg
from typing import Any, NamedTuple, Protocol, TypeVar

import numpy as np
import numpy.typing as npt
from scipy.linalg.blas import ddot as dot  # x^T y as a float, in a third of the time of x @ y; overflow is silent

from homing_lib.errors import misfit, nearest, shown, unit_interval

Array = npt.NDArray[np.float64]


class LambdaRule(Protocol):
    """A function of keywords, of which it may leave to **_ what it does not need:

    delta, delta_prev    TD errors of this step and of the one before
    phi, phi_prev        feature vectors of the two steps, shape (n,)
    trace_prev           eligibility trace before this step, e_{t-1}, shape (n,)
    discount             gamma

    It returns a ratio, which the learner resets to [0, 1] and counts. Where the ratio is undefined (0/0, x/0) it raises
    ZeroDivisionError or another ArithmeticError, and the learner's `on_zero` stands in (NumPy's own numbers raise
    nothing; `dot` gives plain ones). At the first step of an episode there is no previous step: lambda is 0 and the
    rule is not asked.
    """

    def __call__(
        self, *, delta: float, phi: Array, delta_prev: float, phi_prev: Array, trace_prev: Array, discount: float
    ) -> float: ...


TAKES_AND_RETURNS = (
    "a lambda rule is a function of the keywords delta, phi, delta_prev, phi_prev, trace_prev and discount (what it "
    "does not need may go to **_) that returns a finite number, such as lambdas.fletcher_reeves or Fixed(0.9)"
)

Rule = TypeVar("Rule", bound=LambdaRule)

AnyRule = LambdaRule | str  # or its name; `lambda_spec` reads both

RULES: dict[str, LambdaRule] = {}  # those that settings know by name


def register(name: str) -> Callable[[Rule], Rule]:
    """A decorator that lists a rule in RULES."""
    return lambda rule: RULES.update({name: rule}) or rule


@dataclass(frozen=True)
class Derived:
    """What `change` makes of another rule's ratio."""

    name: str
    rule: LambdaRule
    change: Callable[[float], float]

    def __call__(self, **step: Any) -> float:
        return self.change(self.rule(**step))

    def __str__(self) -> str:
        return self.name


def _derived(name: str, rule: LambdaRule, change: Callable[[float], float]) -> LambdaRule:
    """A rule whose ratio is another's, changed; listed under its name."""
    return register(name)(Derived(name, rule, change))


@register("hestenes-stiefel")
def hestenes_stiefel(
    *, delta: float, phi: Array, delta_prev: float, phi_prev: Array, trace_prev: Array, discount: float
) -> float:
    """Eq. (7), form 1: the lambda that makes TD(lambda) follow the Hestenes-Stiefel direction.

        lambda_t = - (delta_t phi_t - delta_{t-1} phi_{t-1})^T phi_t
                   / (gamma (delta_t phi_t - delta_{t-1} phi_{t-1})^T e_{t-1})

    The paper prints it without the minus. Conjugate gradient needs it: only so do the three forms coincide on a
    quadratic with exact line search.
    """
    along_phi = delta * dot(phi, phi) - delta_prev * dot(phi_prev, phi)
    along_trace = delta * dot(phi, trace_prev) - delta_prev * dot(phi_prev, trace_prev)
    return _ratio(-along_phi, discount * along_trace)


hestenes_stiefel_printed = _derived("hestenes-stiefel:printed", hestenes_stiefel, neg)  # without the minus


@register("fletcher-reeves")
def fletcher_reeves(
    *, delta: float, phi: Array, delta_prev: float, phi_prev: Array, discount: float, **_: Any
) -> float:
    """Eq. (7), form 2: the lambda that makes TD(lambda) follow the Fletcher-Reeves direction.

        lambda_t = delta_t |phi_t|^2 / (gamma delta_{t-1} |phi_{t-1}|^2)

    The paper's choice.
    """
    return _ratio(delta * dot(phi, phi), discount * delta_prev * dot(phi_prev, phi_prev))


@register("polak-ribiere")
def polak_ribiere(*, delta: float, phi: Array, delta_prev: float, phi_prev: Array, discount: float, **_: Any) -> float:
    """Eq. (7), form 3: the lambda that makes TD(lambda) follow the Polak-Ribiere direction.

        lambda_t = (delta_t phi_t - delta_{t-1} phi_{t-1})^T phi_t / (gamma delta_{t-1} |phi_{t-1}|^2)

    It differs from form 2 where successive features are not orthogonal.
    """
    along_phi = delta * dot(phi, phi) - delta_prev * dot(phi_prev, phi)
    return _ratio(along_phi, discount * delta_prev * dot(phi_prev, phi_prev))


# --- What form 2 is made of: its sign, its size, and each without the other ------------------------------------------


@register("gate")
def gate(*, delta: float, delta_prev: float, **_: Any) -> float:
    """Form 2's sign alone: 1, the whole trace, while the TD error keeps its sign, else 0. An error of 0 has none."""
    return float(min(delta, delta_prev) > 0 or max(delta, delta_prev) < 0)


_derived("gate:0.7", gate, lambda ratio: 0.7 * ratio)  # a fixed lambda that is cut where the TD error changes its sign


@register("gate:opposite")
def gate_opposite(*, delta: float, delta_prev: float, **_: Any) -> float:
    """The gate the wrong way round: 1 where the TD error changes its sign, else 0."""
    return gate(delta=-delta, delta_prev=delta_prev)


@register("inverse")
def inverse(*, delta: float, phi: Array, delta_prev: float, phi_prev: Array, discount: float, **_: Any) -> float:
    """Form 2's ratio upside down: the same sign, and a size that falls where form 2's grows."""
    return _ratio(discount * delta_prev * dot(phi_prev, phi_prev), delta * dot(phi, phi))


_derived("absolute", fletcher_reeves, abs)  # form 2's size without its sign
_derived("fletcher-reeves:negated", fletcher_reeves, neg)
_derived("polak-ribiere:negated", polak_ribiere, neg)


def _ratio(numerator: float, denominator: float) -> float:
    """The quotient as a plain float. ArithmeticError where there is none: x/0, or beyond the floating-point range."""
    ratio = float(numerator) / float(denominator)
    if not isfinite(ratio):
        raise OverflowError("the ratio is beyond the floating-point range")
    return ratio


@dataclass(frozen=True)
class Fixed:
    """The same lambda at every step: ordinary TD(lambda). Its name in settings is "fixed:0.9"."""

    value: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "value", unit_interval("lambda", self.value))

    def __call__(self, **_: Any) -> float:
        return self.value

    def __str__(self) -> str:
        return f"fixed:{_short(self.value)}"


# --- Names -----------------------------------------------------------------------------------------------------------


class LambdaSpec(NamedTuple):
    """What a learner is told of lambda. str() is its name, which `rule_named` reads."""

    name: str
    rule: LambdaRule
    on_zero: float = 0.0
    clip: bool = True

    def __str__(self) -> str:
        guard = f":on_zero={_short(self.on_zero)}" if self.on_zero else ""
        return f"{self.name}{guard}{'' if self.clip else ':unclipped'}"


def lambda_spec(rule: AnyRule) -> LambdaSpec:
    """The one door for a rule, wherever one is given: by its name, or as a function.

    ValueError, in one line, for a name or an option that does not exist; TypeError for what cannot be called as a rule.
    """
    return rule_named(rule) if isinstance(rule, str) else LambdaSpec(name_of(rule), checked(rule))


def rule_named(text: str) -> LambdaSpec:
    """The rule of this name, with its options: "fixed:0.9", "fletcher-reeves", "polak-ribiere:on_zero=1:unclipped".

    ValueError, in one line, for a name or an option that does not exist.
    """
    known = f"fixed:<lambda>, {', '.join(RULES)}"
    if not isinstance(text, str):
        others = f"`agent.run` and the learners also take a function: {TAKES_AND_RETURNS}"
        raise ValueError(f"settings name their rule: {known}; {others}")
    name, *options = text.split(":")
    while options and (name == "fixed" or f"{name}:{options[0]}" in RULES):
        name += f":{options.pop(0)}"
    if name.startswith("fixed:"):
        rule: LambdaRule = Fixed(float(name.removeprefix("fixed:")))
        name = str(rule)
    elif name in RULES:
        rule = RULES[name]
    else:
        raise ValueError(f"unknown lambda rule {shown(text)}; known: {known}{nearest(text, RULES)}")
    on_zero = 0.0
    for option in options:
        if option.startswith("on_zero="):
            on_zero = unit_interval("on_zero", float(option.removeprefix("on_zero=")))
        elif option != "unclipped":
            raise ValueError(f"unknown option {shown(option)} in {shown(text)}; known: unclipped, on_zero=<lambda>")
    return LambdaSpec(name, rule, on_zero, "unclipped" not in options)


def checked(rule: LambdaRule) -> LambdaRule:
    """The rule itself, or TypeError, in one line, for what cannot be called as a rule is."""
    if wrong := misfit(rule, delta=0, phi=0, delta_prev=0, phi_prev=0, trace_prev=0, discount=0):
        raise TypeError(f"lambda_rule = {name_of(rule)}: {wrong}; {TAKES_AND_RETURNS}")
    return rule


def name_of(rule: LambdaRule) -> str:
    """What to call a rule: a function's own name, or what an object says of itself."""
    return " ".join(str(getattr(rule, "__name__", rule))[:60].split())


def _short(value: float) -> str:
    """0.9 as "0.9", 1.0 as "1": every digit that float() needs, and no more."""
    return repr(value).removesuffix(".0")
