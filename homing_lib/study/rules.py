"""Lambda rules side by side on the robot: the same seeds, the same settings, and a verdict with its interval.

A lesson's tool, quick on the compact atlas. All rules share one step size; which step size suits which rule is a
question for a study (`varying`).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from homing_lib.errors import UserError, shown
from homing_lib.features import Array
from homing_lib.lambdas import LambdaRule, checked
from homing_lib.settings import Settings
from homing_lib.study import findings
from homing_lib.study.bootstrap import Statistic, iqm, mean
from homing_lib.study.engine import run, side_by_side
from homing_lib.study.findings import Comparison
from homing_lib.study.measures import WINDOW
from homing_lib.study.runs import episode_matrix, seeds_of


class ResampledLambda:
    """A lambda drawn from a pool, whatever the step. met, count: lambdas to two digits, and how often each was met."""

    def __init__(self, met: ArrayLike, count: ArrayLike, rng: np.random.Generator) -> None:
        counts = pd.Series(np.asarray(count, dtype=float)).groupby(np.asarray(met, dtype=float).round(2)).sum()
        self._rng, self._met, self._share = rng, counts.index.to_numpy(float), (counts / counts.sum()).cumsum()

    def __call__(self, **_: Any) -> float:
        return float(self.beforehand(1)[0])

    def beforehand(self, count: int) -> Array:
        """The lambdas of the next steps, shape (count,), which are drawn with this."""
        places = np.searchsorted(self._share, self._rng.random(count), side="right")
        return self._met[np.minimum(places, len(self._met) - 1)]

    def __str__(self) -> str:
        return "resampled"


@dataclass(frozen=True)
class Rules:
    """Rules compared. steps: by label, steps of each episode, shape (seeds, episodes). str() is a table in Markdown."""

    steps: Mapping[str, Array]

    @cached_property
    def verdicts(self) -> dict[str, Comparison]:
        """Total steps as a multiple of the first rule's, seed by seed; its `.verdict` is the verdict."""
        return self._against_first(lambda steps: steps.sum(axis=1), mean)

    @cached_property
    def late(self) -> dict[str, Comparison]:
        """The same of the last episodes, for the typical robot."""
        return self._against_first(lambda steps: steps[:, -WINDOW:].mean(axis=1), iqm)

    def _against_first(self, of: Callable[[Array], Array], statistic: Statistic) -> dict[str, Comparison]:
        first, *others = self.steps
        return {label: findings.steps(of(self.steps[label]), of(self.steps[first]), statistic) for label in others}

    def of_first(self, count: int) -> "Rules":
        """What the first few seeds alone would say."""
        return Rules({label: steps[:count] for label, steps in self.steps.items()})

    def __str__(self) -> str:
        first, *_ = self.steps
        rows = [
            f"| rule | total steps, mean | as a multiple of {first} | verdict | last {WINDOW} episodes, typical (IQM) "
            f"| as a multiple of {first} | verdict |",
            "|---|---|---|---|---|---|---|",
        ]
        for label, steps in self.steps.items():
            told = [
                f"{one[label]:.2f} | {one[label].verdict}" if label in one else "1 |"
                for one in (self.verdicts, self.late)
            ]
            typical = float(iqm(steps[:, -WINDOW:].mean(axis=1))[0])
            rows.append(f"| {label} | {steps.sum(axis=1).mean():,.0f} | {told[0]} | {typical:.1f} | {told[1]} |")
        return "\n".join(rows)


def compare(rules: Mapping[str, LambdaRule], seeds: Sequence[int], settings: Settings | None = None) -> Rules:
    """Run every rule with every seed. settings: by default the paper's robot on the compact atlas.

    A run that diverges counts as `max_steps` steps in each episode that it did not finish. Before any run, raises
    UserError for what are no seeds, or only one, and TypeError that names the label for what is no rule.
    """
    settings = settings or Settings(images="compact")
    seeds = seeds_of(seeds)
    if len(seeds) < 2:
        raise UserError(f"seeds = {shown(seeds)}: one robot says nothing of how robots differ; give two or more")
    for label, rule in rules.items():
        try:
            checked(rule)
        except TypeError as error:
            raise TypeError(f"{label}: {error}") from None

    def of_seed(seed: int) -> Array:
        return episode_matrix([run(settings, seed, rule) for rule in rules.values()])

    found = np.array(side_by_side(of_seed, seeds, rules.values()))
    return Rules({label: found[:, k] for k, label in enumerate(rules)})
