"""Lambda rules on the random walk of the textbooks: a prediction problem of seconds, with a literature.

Nineteen states in a row; an episode begins in the middle and steps left or right at even odds. Beyond the left end it
is paid -1, beyond the right end +1, else nothing (Sutton & Barto 2018, example 7.1). Tabular features, gamma = 1. An
error is the root mean square over the states. A rule is a function, or a name with its guard, such as
"fletcher-reeves:on_zero=1" (`lambdas.lambda_spec`). A `Method` is another learner, which races beside them.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise
from math import isnan, nan
from typing import Any

import numpy as np

from homing_lib.features import Array
from homing_lib.lambdas import AnyRule, Fixed, lambda_spec
from homing_lib.sarsa import Diverged, silent
from homing_lib.study.findings import Comparison, against_first, compare_to_first
from homing_lib.study.methods.prediction import HL, META, LambdaGreedy
from homing_lib.study.runs import seeds_of
from homing_lib.td import LinearTD, TrueOnlineTD

EPISODES = 10
RACE_SIZES = (0.02, 0.05, 0.1, 0.2, 0.3, 0.4, 0.6, 0.8, 1.0)  # the first for rules that keep the whole trace
VALUES = np.arange(-9, 10) / 10
_PHI = np.eye(20, 19)

ERROR_CAP = 1e6
"""In a race a greater error, as of weights that diverged, counts as this."""


@dataclass(frozen=True)
class Method:
    """What may race in place of a rule. make: from a step size, a learner of 19 states, used as `LinearTD` is."""

    make: Callable[[float], Any]


@cache  # drawing one costs as much as learning from it
def walks(seed: int) -> tuple[tuple[int, ...], ...]:
    """The states of ten episodes, 0 to 18; each ends beyond one of the ends, at -1 or 19."""
    rng, episodes = np.random.default_rng(seed), []
    for _ in range(EPISODES):
        states = [9]
        while 0 <= states[-1] < 19:
            states.append(states[-1] + int(rng.choice((-1, 1))))
        episodes.append(tuple(states))
    return tuple(episodes)


def follow(learner: Any, states: Sequence[int]) -> None:
    """One episode of learning. learner: `LinearTD`, or what is used as it is; states: one of `walks`."""
    learner.begin_episode()
    for state, then in pairwise(states):
        ended = not 0 <= then < 19
        learner.update(_PHI[state], float(np.sign(then - 9)) * ended, _PHI[then], terminal=ended)


@silent
def learning(rule: AnyRule | Method, seed: int, step_size: float) -> Array:
    """The error after each of ten episodes, shape (EPISODES,); infinite once the weights are not finite."""
    if isinstance(rule, Method):
        learner = rule.make(step_size)
    else:
        learner = LinearTD(19, step_size=step_size, discount=1.0, lambda_rule=rule)
    errors = np.full(EPISODES, np.inf)
    try:
        for number, states in enumerate(walks(seed)):
            follow(learner, states)
            errors[number] = np.sqrt(np.mean((learner.weights - VALUES) ** 2))
    except Diverged:
        pass
    return np.where(np.isnan(errors), np.inf, errors)


@dataclass(frozen=True)
class Race:
    """Rules raced: each chose its step size on some walks and is judged on others. str() is a table in Markdown.

    By label: `tried`, mean errors on the walks where it chose, shape (walks, step sizes); `step_size`, its choice;
    `errors`, those on the walks held out, shape (walks,).
    """

    tried: Mapping[str, Array]
    step_size: Mapping[str, float]
    errors: Mapping[str, Array]

    @property
    def verdicts(self) -> dict[str, Comparison]:
        """Errors as a multiple of the first rule's, walk by walk; `.verdict` is the verdict, in which fewer is less."""
        return compare_to_first(self.errors)

    def against(self, first: str) -> "Race":
        """The same race, told as multiples of this label's errors."""
        return replace(self, errors={first: self.errors[first]} | {**self.errors})

    def __str__(self) -> str:
        return self.table({})

    def table(self, words: Mapping[str, str]) -> str:
        """In Markdown; words: what a verdict is called, if not by its own word."""
        verdicts, (first, *_) = self.verdicts, self.errors
        walks = len(self.errors[first])
        rows = [f"| rule | its step size | error on {walks} new walks | as a multiple of {first} | |"]
        rows.append("|---|---|---|---|---|")
        for label, errors in self.errors.items():
            ratio, word = against_first(verdicts, label)
            size = "none" if isnan(self.step_size[label]) else f"{self.step_size[label]:g}"
            rows.append(f"| {label} | {size} | {errors.mean():.3f} | {ratio} | {words.get(word, word)} |")
        return "\n".join(rows)


def _errors(rule: AnyRule | Method, seeds: Sequence[int], step_sizes: Sequence[float]) -> Array:
    """Means over the ten episodes, capped, shape (walks, step sizes)."""
    return np.minimum([[learning(rule, seed, size).mean() for size in step_sizes] for seed in seeds], ERROR_CAP)


def race(
    rules: Mapping[str, AnyRule | Method],
    choose: Sequence[int] = range(6),
    judge: Sequence[int] = range(1000, 1020),
    step_sizes: Sequence[float] = RACE_SIZES,
) -> Race:
    """Race rules against the first of them: each has the step size that is best on the walks of the seeds `choose`,
    and is judged on those of `judge`, which it has not met. TypeError, before any run, names the label of what is no
    rule.
    """
    choose, judge = seeds_of(choose), seeds_of(judge)
    for label, rule in rules.items():
        try:
            isinstance(rule, Method) or lambda_spec(rule)
        except (TypeError, ValueError) as error:
            raise TypeError(f"{label}: {error}") from None

    tried = {label: _errors(rule, choose, step_sizes) for label, rule in rules.items()}
    best = {label: step_sizes[int(by_walk.mean(axis=0).argmin())] for label, by_walk in tried.items()}
    return Race(tried, best, {label: _errors(rule, judge, [best[label]])[:, 0] for label, rule in rules.items()})


def _method(learner: Callable[..., Any], **settings: Any) -> Method:
    return Method(lambda size: learner(19, step_size=size, discount=1.0, **settings))


TODAY: dict[str, tuple[AnyRule | Method, float]] = {
    "TD, λ = 0.8": (Fixed(0.8), 0.3),
    "form 1, guard 0.8": ("hestenes-stiefel:on_zero=0.8", 0.4),
    "form 2, guard 0": ("fletcher-reeves", 0.6),
    "form 2, guard 0.8": ("fletcher-reeves:on_zero=0.8", 0.4),
    "true online TD, λ = 0.8": (_method(TrueOnlineTD, lambda_rule=Fixed(0.8)), 0.4),
    "HL, λ = 1": (Method(lambda _: HL(19, lambda_=1.0, discount=1.0)), nan),
    "λ-greedy, α' = 0.01": (_method(LambdaGreedy, helper_step_size=0.01), 0.2),
    "META, κ = 0.3": (_method(META, kappa=0.3), 0.2),
}
"""The paper's rules beside what was there before and has come since, each with its step size. That was chosen on walks
0 to 19; lambda, the guard (lambda where the ratio is undefined), the helpers' step size and kappa on walks 20 to 99,
from what stands in `tests/test_prediction_methods.py`. Form 3 is form 2 here: no two states share a feature.
"""


def today(judge: Sequence[int] = range(10_000, 10_060)) -> Race:
    """Race `TODAY` on walks that chose nothing. What is judged is the mean error of ten episodes, against TD(lambda)
    at its best constant: fewer, the same or more; and (`against`) that of form 2.
    """
    errors = {label: _errors(rule, seeds_of(judge), [size])[:, 0] for label, (rule, size) in TODAY.items()}
    return Race({}, {label: size for label, (_, size) in TODAY.items()}, errors)
