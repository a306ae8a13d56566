"""The lambda of TD(lambda), chosen anew at every step: eq. (7) of the paper, and the rules that wrap it.

A lambda *rule* is any callable

    rule(*, delta, phi, delta_prev, phi_prev, trace_prev, discount) -> float

    delta, delta_prev    TD errors of this step and of the one before
    phi, phi_prev        feature vectors of the two steps, shape (n,)
    trace_prev           eligibility trace before this step, e_{t-1}, shape (n,)
    discount             gamma

so a plain function is a rule too. At the first step of an episode there is no previous step: lambda is 0 by
definition and the rule is not asked. `Fixed` and `Conjugate` are the rules of the paper, `parse` makes them from
their short names. The three functions below are eq. (7) itself, its products multiplied out, unclipped and unguarded:
a denominator of zero raises ZeroDivisionError.
"""

from dataclasses import KW_ONLY, dataclass, field, replace
from math import isfinite, nan
from typing import ClassVar, Literal, Protocol, cast, get_args

import numpy as np
import numpy.typing as npt

# x^T y as a plain float: some hundred components in a third of the time of x @ y, and overflow is silent.
from scipy.linalg.blas import ddot as dot

Array = npt.NDArray[np.float64]
Form = Literal["hestenes-stiefel", "fletcher-reeves", "polak-ribiere"]
Sign = Literal["conjugate", "printed"]


class LambdaRule(Protocol):
    """What a learner asks of a lambda rule."""

    def __call__(
        self, *, delta: float, phi: Array, delta_prev: float, phi_prev: Array, trace_prev: Array, discount: float
    ) -> float: ...


def hestenes_stiefel(
    delta: float, phi: Array, delta_prev: float, phi_prev: Array, trace_prev: Array, discount: float
) -> float:
    """Eq. (7), form 1: the lambda that makes TD(lambda) follow the Hestenes-Stiefel direction.

        lambda_t = - (delta_t phi_t - delta_{t-1} phi_{t-1})^T phi_t
                   / (gamma (delta_t phi_t - delta_{t-1} phi_{t-1})^T e_{t-1})

    The paper prints it without the minus. Conjugate gradient needs it: only so do the three forms coincide on a
    quadratic with exact line search. phi, phi_prev, trace_prev: shape (n,).
    """
    numerator = delta * dot(phi, phi) - delta_prev * dot(phi_prev, phi)
    return -numerator / (discount * (delta * dot(phi, trace_prev) - delta_prev * dot(phi_prev, trace_prev)))


def fletcher_reeves(delta: float, phi: Array, delta_prev: float, phi_prev: Array, discount: float) -> float:
    """Eq. (7), form 2: the lambda that makes TD(lambda) follow the Fletcher-Reeves direction. The paper's choice.

        lambda_t = delta_t |phi_t|^2 / (gamma delta_{t-1} |phi_{t-1}|^2)

    phi, phi_prev: shape (n,).
    """
    return delta * dot(phi, phi) / (discount * delta_prev * dot(phi_prev, phi_prev))


def polak_ribiere(delta: float, phi: Array, delta_prev: float, phi_prev: Array, discount: float) -> float:
    """Eq. (7), form 3: the lambda that makes TD(lambda) follow the Polak-Ribiere direction.

        lambda_t = (delta_t phi_t - delta_{t-1} phi_{t-1})^T phi_t / (gamma delta_{t-1} |phi_{t-1}|^2)

    phi, phi_prev: shape (n,).
    """
    numerator = delta * dot(phi, phi) - delta_prev * dot(phi_prev, phi)
    return numerator / (discount * delta_prev * dot(phi_prev, phi_prev))


@dataclass(frozen=True)
class Fixed:
    """The same lambda at every step: ordinary TD(lambda). Its short name is "fixed:0.9"."""

    value: float
    clipped: ClassVar[bool] = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "value", unit_interval("lambda", self.value))

    def __call__(
        self, *, delta: float, phi: Array, delta_prev: float, phi_prev: Array, trace_prev: Array, discount: float
    ) -> float:
        return self.value

    def __str__(self) -> str:
        return f"fixed:{_short(self.value)}"


@dataclass
class Conjugate:
    """Eq. (7) made fit for use: one of its three forms, guarded where it is undefined and clipped to [0, 1].

    form     "hestenes-stiefel" (form 1), "fletcher-reeves" (form 2), "polak-ribiere" (form 3)
    sign     "conjugate": form 1 with the minus that conjugate gradient needs; "printed": without, as in the
             paper. Forms 2 and 3 have the same sign either way.
    on_zero  the lambda where the ratio is undefined: 0/0, x/0, or a product beyond the floating-point range.
             The paper is silent, and the choice matters. 0 starts the direction afresh, as conjugate gradient
             does.
    clip     reset a lambda outside [0, 1] to the nearer bound, as the paper asks (II.B). A clipped step no
             longer follows the conjugate direction, so `clipped` says whether the last call did it.

    Short names: "fletcher-reeves", "hestenes-stiefel:printed", "polak-ribiere:on_zero=1:unclipped".
    """

    form: Form
    _: KW_ONLY
    sign: Sign = "conjugate"
    on_zero: float = 0.0
    clip: bool = True
    clipped: bool = field(default=False, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        one_of("form of lambda", self.form, get_args(Form))
        one_of("sign", self.sign, get_args(Sign))
        self.on_zero = unit_interval("on_zero", self.on_zero)

    def __call__(
        self, *, delta: float, phi: Array, delta_prev: float, phi_prev: Array, trace_prev: Array, discount: float
    ) -> float:
        # Plain floats, for numpy's would warn of what is caught below.
        delta, delta_prev, discount = float(delta), float(delta_prev), float(discount)
        try:
            if self.form == "hestenes-stiefel":
                ratio = hestenes_stiefel(delta, phi, delta_prev, phi_prev, trace_prev, discount)
                ratio = -ratio if self.sign == "printed" else ratio
            elif self.form == "fletcher-reeves":
                ratio = fletcher_reeves(delta, phi, delta_prev, phi_prev, discount)
            else:
                ratio = polak_ribiere(delta, phi, delta_prev, phi_prev, discount)
        except ZeroDivisionError:
            ratio = nan
        lambda_ = ratio if isfinite(ratio) else self.on_zero
        self.clipped = self.clip and not 0 <= lambda_ <= 1
        return min(max(0.0, lambda_), 1.0) if self.clipped else lambda_

    def __str__(self) -> str:
        options = [
            ":printed" if self.sign == "printed" else "",
            f":on_zero={_short(self.on_zero)}" if self.on_zero else "",
            "" if self.clip else ":unclipped",
        ]
        return self.form + "".join(options)


def parse(text: str) -> Fixed | Conjugate:
    """The rule with this short name, so that parse(str(rule)) == rule: for settings and the command line."""
    name, *options = text.split(":")
    if name == "fixed" and len(options) == 1:
        return Fixed(float(options[0]))
    if name not in get_args(Form):
        raise ValueError(f"unknown lambda rule {text!r}; known: fixed:<lambda>, {', '.join(get_args(Form))}")
    rule = Conjugate(cast(Form, name))
    for option in options:
        if option == "printed":
            rule = replace(rule, sign="printed")
        elif option == "unclipped":
            rule = replace(rule, clip=False)
        elif option.startswith("on_zero="):
            rule = replace(rule, on_zero=float(option.removeprefix("on_zero=")))
        else:
            raise ValueError(f"unknown option {option!r} in {text!r}; known: printed, unclipped, on_zero=<lambda>")
    return rule


def unit_interval(name: str, value: float) -> float:
    """The value as a float, or ValueError unless it lies in [0, 1]."""
    if not 0 <= value <= 1:
        raise ValueError(f"{name} must lie in [0, 1], got {value!r}")
    return float(value)


def one_of(name: str, value: str, known: tuple[str, ...]) -> None:
    """ValueError, with the list of what is known, unless the value is in it."""
    if value not in known:
        raise ValueError(f"unknown {name} {value!r}; known: {', '.join(known)}")


def _short(value: float) -> str:
    """0.9 as "0.9", 1.0 as "1": every digit that float() needs, and no more."""
    return repr(value).removesuffix(".0")
