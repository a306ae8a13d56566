"""Lambda rules, or whole agents, side by side on the robot: the same seeds and settings, a verdict with its interval.

A lesson's tool, quick on the compact atlas. All rules share one step size; which step size suits which rule is a
question for a study (`varying`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from inspect import signature
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from homing_lib.agent import AgentFactory
from homing_lib.errors import UserError, shown
from homing_lib.features import Array
from homing_lib.lambdas import LambdaRule, checked
from homing_lib.settings import Settings
from homing_lib.study.bootstrap import iqm
from homing_lib.study.engine import run, side_by_side
from homing_lib.study.findings import Comparison, compare_to_first
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
    """Rules, or agents, compared. steps: by label, steps of each episode, shape (seeds, episodes), two seeds or more.
    str() is a table in Markdown.
    """

    steps: Mapping[str, Array]

    def __post_init__(self) -> None:
        for label, steps in self.steps.items():
            if len(steps) < 2:
                raise UserError(f"{label}: {len(steps)} seed; {_TOO_FEW}")

    @cached_property
    def verdicts(self) -> dict[str, Comparison]:
        """Total steps as a multiple of the first's, seed by seed, with what that says."""
        return compare_to_first({label: _total(steps) for label, steps in self.steps.items()})

    @cached_property
    def late(self) -> dict[str, Comparison]:
        """The same of the last episodes, for the typical robot."""
        return compare_to_first({label: _late(steps) for label, steps in self.steps.items()}, iqm)

    def of_first(self, count: int) -> "Rules":
        """What the first few seeds alone would say."""
        return Rules({label: steps[:count] for label, steps in self.steps.items()})

    def __str__(self) -> str:
        first, *_ = self.steps
        rows = [
            f"| rule | total steps, mean | ratio of means to {first} | verdict | last {WINDOW} episodes, typical (IQM) "
            f"| ratio of IQMs to {first} | verdict |",
            "|---|---|---|---|---|---|---|",
        ]
        for label, steps in self.steps.items():
            total, late = (
                f"{against[label]:.2f} | {against[label].verdict}" if label in against else "1 |"
                for against in (self.verdicts, self.late)
            )
            typical = float(iqm(_late(steps))[0])
            rows.append(f"| {label} | {_total(steps).mean():,.0f} | {total} | {typical:.1f} | {late} |")
        return "\n".join(rows)


def _total(steps: Array) -> Array:
    return np.asarray(steps.sum(axis=1))


def _late(steps: Array) -> Array:
    return np.asarray(steps[:, -WINDOW:].mean(axis=1))


_TOO_FEW = "one robot says nothing of how robots differ; give two or more"


def compare(
    rules: Mapping[str, LambdaRule],
    seeds: Sequence[int],
    settings: Settings | None = None,
    *,
    agents: Mapping[str, AgentFactory] | None = None,
) -> Rules:
    """Run every rule with every seed, and other agents. agents: by label what makes one of settings and rng, such as a
    class (`agent.Agent`).

    settings: by default the paper's robot on the compact atlas. A run that diverges counts as `max_steps` steps in each
    episode that it did not finish. Before any run, raises UserError for what are no seeds, or only one, and for a label
    that stands twice; TypeError, which names the label, for what is no rule, or makes no agent.
    """
    settings, agents = settings or Settings(images="compact"), agents or {}
    seeds = seeds_of(seeds)
    if len(seeds) < 2:
        raise UserError(f"seeds = {shown(seeds)}: {_TOO_FEW}")
    for label in agents:
        if label in rules:
            raise UserError(f"{label}: both a rule and an agent; give each a label of its own")
    for label in (*rules, *agents):
        try:
            checked(rules[label]) if label in rules else _makes_agent(agents[label])
        except TypeError as error:
            raise TypeError(f"{label}: {error}") from None

    def of_seed(seed: int) -> Array:
        learnt = [run(settings, seed, rule) for rule in rules.values()]
        return episode_matrix(learnt + [run(settings, seed, agent=makes) for makes in agents.values()])

    driven: list[Any] = [*rules.values(), *agents.values()]
    steps = np.array(side_by_side(of_seed, seeds, driven))
    return Rules({label: steps[:, k] for k, label in enumerate((*rules, *agents))})


def _makes_agent(makes: Any) -> None:
    """TypeError for what cannot be called with settings and a random generator."""
    try:
        signature(makes).bind(Settings(), np.random.default_rng())
    except TypeError as error:
        raise TypeError(f"an agent is made by a function of settings and a random generator: {error}") from None
