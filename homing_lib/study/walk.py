"""Lambda rules on the random walk of the textbooks: a prediction problem of seconds, with a literature.

Nineteen states in a row; an episode begins in the middle and steps left or right at even odds. Beyond the left end it
is paid -1, beyond the right end +1, else nothing (Sutton & Barto 2018, example 7.1). Tabular features, gamma = 1. An
error is the root mean square over the states. A rule is a function, or a name with its guard, such as
"fletcher-reeves:on_zero=1" (`lambdas.lambda_spec`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from homing_lib.features import Array
from homing_lib.lambdas import AnyRule, lambda_spec
from homing_lib.sarsa import Diverged, silent
from homing_lib.study.findings import Comparison, compare_to_first
from homing_lib.study.runs import seeds_of
from homing_lib.td import LinearTD

EPISODES = 10
STEP_SIZES = (0.05, 0.1, 0.2, 0.3, 0.4, 0.6, 0.8, 1.0)
RACE_SIZES = (0.02, *STEP_SIZES)  # for a race, in which a rule that keeps the whole trace asks for smaller ones
VALUES = np.arange(-9, 10) / 10
_PHI = np.eye(20, 19)

LOST = 1e6
"""In a race, an error that is greater counts as this one: the weights are lost."""


def walks(seed: int) -> list[list[int]]:
    """The states of ten episodes, 0 to 18; each ends beyond one of the ends, at -1 or 19."""
    rng, episodes = np.random.default_rng(seed), []
    for _ in range(EPISODES):
        states = [9]
        while 0 <= states[-1] < 19:
            states.append(states[-1] + int(rng.choice((-1, 1))))
        episodes.append(states)
    return episodes


def follow(learner: LinearTD, states: Sequence[int]) -> None:
    """One episode of learning. states: one of `walks`."""
    learner.begin_episode()
    for state, then in pairwise(states):
        ended = not 0 <= then < 19
        learner.update(_PHI[state], float(np.sign(then - 9)) * ended, _PHI[then], terminal=ended)


@silent
def learning(rule: AnyRule, seed: int, step_size: float) -> Array:
    """The error after each of ten episodes, shape (EPISODES,); infinite once the weights are not finite."""
    learner = LinearTD(19, step_size=step_size, discount=1.0, lambda_rule=rule)
    errors = np.full(EPISODES, np.inf)
    try:
        for number, states in enumerate(walks(seed)):
            follow(learner, states)
            errors[number] = np.sqrt(np.mean((learner.weights - VALUES) ** 2))
    except Diverged:
        pass
    return errors


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

    def __str__(self) -> str:
        return self.table({})

    def table(self, words: Mapping[str, str]) -> str:
        """In Markdown; words: what a verdict is called, if not by its own word."""
        verdicts, (first, *_) = self.verdicts, self.errors
        walks = len(self.errors[first])
        rows = [f"| rule | its step size | error on {walks} new walks | as a multiple of {first} | |"]
        rows.append("|---|---|---|---|---|")
        for label, errors in self.errors.items():
            against = "1 |"
            if label in verdicts:
                word = verdicts[label].verdict
                against = f"{verdicts[label]:.2f} | {words.get(word, word)}"
            rows.append(f"| {label} | {self.step_size[label]:g} | {errors.mean():.3f} | {against} |")
        return "\n".join(rows)


def race(
    rules: Mapping[str, AnyRule],
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
            lambda_spec(rule)
        except (TypeError, ValueError) as error:
            raise TypeError(f"{label}: {error}") from None

    def errors(label: str, seeds: Sequence[int], sizes: Sequence[float]) -> Array:
        by_walk = [[learning(rules[label], seed, size).mean() for size in sizes] for seed in seeds]
        return np.minimum(by_walk, LOST)

    tried = {label: errors(label, choose, step_sizes) for label in rules}
    best = {label: step_sizes[int(by_walk.mean(axis=0).argmin())] for label, by_walk in tried.items()}
    return Race(tried, best, {label: errors(label, judge, [best[label]])[:, 0] for label in rules})
