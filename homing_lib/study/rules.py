"""Lambda rules and other learners side by side on the robot: the same seeds, each with its start and its survey.

A lesson's tool, quick on the compact atlas. Which step size suits a learner depends on the learner: give `compare`
several, and each drives with its own best, chosen on seeds on which it is not judged.
"""

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property, partial
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from tqdm import tqdm

from homing_lib.agent import AgentFactory
from homing_lib.errors import UserError, misfit, shown
from homing_lib.features import Array
from homing_lib.lambdas import AnyRule, lambda_spec
from homing_lib.settings import Settings
from homing_lib.study.bootstrap import iqm
from homing_lib.study.engine import compiles, run, side_by_side
from homing_lib.study.findings import Comparison, against_first, compare_to_first
from homing_lib.study.measures import CUT, WINDOW
from homing_lib.study.runs import episode_matrix, seeds_of

CHOOSING_SEEDS = range(100)
"""The seeds on which step sizes are chosen: all of them on the first fifth, the best two on the others."""

THOUSAND, HUNDRED = range(10_000, 11_000), range(10_000, 10_100)
"""The seeds on which robots are compared: a thousand where all of them can be compiled, else a hundred."""


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


@dataclass(frozen=True)
class Rules:
    """Rules and other learners, compared. str() is a table in Markdown.

    steps: by label, steps of each episode, shape (seeds, episodes), two seeds or more. step_size: by label, what was
    chosen of `tried`, or None where it makes no difference. chance: steps of an episode of random actions; where
    they are not known, the table has no lost robots.
    """

    steps: Mapping[str, Array]
    step_size: Mapping[str, float | None] = field(default_factory=dict)
    tried: Sequence[float] = ()
    chance: float | None = None

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
        """Late steps of the typical robot as a multiple of the first's, seed by seed, with what that says."""
        return compare_to_first({label: _late(steps) for label, steps in self.steps.items()}, iqm)

    def of_first(self, count: int) -> "Rules":
        """What the first few seeds alone would say."""
        return replace(self, steps={label: steps[:count] for label, steps in self.steps.items()})

    def __str__(self) -> str:
        first, *_ = self.steps
        head = ["learner", "step size", "total steps, mean", f"ratio of means to {first} [95 %]", "verdict"]
        head += [f"last {WINDOW} episodes, interquartile mean", f"ratio of interquartile means to {first} [95 %]"]
        rows = [[*head, "verdict", f"lost, of {len(self.steps[first]):,}"]]
        for label, steps in self.steps.items():
            late = _late(steps)
            total = f"{_total(steps).mean():,.0f}", *against_first(self.verdicts, label)
            typical = f"{float(iqm(late)[0]):.1f}", *against_first(self.late, label)
            lost = "" if self.chance is None else str((late > self.chance).sum())
            rows.append([label, self._chosen(label), *total, *typical, lost])
        known = [(title, "---", *cells) for title, *cells in zip(*rows, strict=True) if any(cells)]
        return "\n".join(f"| {' | '.join(row)} |" for row in zip(*known, strict=True))

    def _chosen(self, label: str) -> str:
        """A step size, and whether one beyond those that were tried might be better."""
        if not self.step_size:
            return ""
        size = self.step_size[label]
        ends = {min(self.tried): "smallest", max(self.tried): "largest"} if len(self.tried) > 1 else {}
        return "any" if size is None else f"{size:g}, the {ends[size]} tried" if size in ends else f"{size:g}"


def _total(steps: Array) -> Array:
    return np.asarray(steps.sum(axis=1))


def _late(steps: Array) -> Array:
    return np.asarray(steps[:, -WINDOW:].mean(axis=1))


_TOO_FEW = "one robot says nothing of how robots differ; give two or more"


@cache
def steps_at_random(settings: Settings) -> float:
    """Steps of an episode of random actions, the mean of ten robots: who ends with more, or diverged, is lost."""
    drawn = settings.with_changes(controller="random")
    return float(np.mean([episode_matrix([run(drawn, seed)]) for seed in range(10)]))


def compare(
    rules: Mapping[str, AnyRule],
    seeds: Sequence[int] | None = None,
    settings: Settings | None = None,
    *,
    agents: Mapping[str, AgentFactory] | None = None,
    step_sizes: Sequence[float] = (),
    choose: Sequence[int] = CHOOSING_SEEDS,
) -> Rules:
    """Run every rule with every seed, and other learners.

    rules: by label, a function or a name such as "fixed:0.9" (`lambdas.lambda_spec`). agents: by label, what makes a
    learner of settings and rng, such as a class (`agent.Agent`); it is to begin with the step size `settings.alpha0`.
    step_sizes: each drives with the one of them that takes the fewest steps on the seeds `choose`, an episode cut at
    `CUT`; without, all have that of the settings. seeds: by default 10000 to 10999 if all can be compiled, else to
    10099. settings: by default the paper's robot on the compact atlas. A run that diverges counts as `max_steps` steps
    in each episode that it did not finish.

    Before any run, raises UserError for seeds that are none, only one, or among those that choose, and for a label that
    stands twice; TypeError or ValueError, which names the label, for what is no rule, or makes no agent.
    """
    settings, agents = settings or Settings(images="compact"), agents or {}
    driven = _learners(rules, agents)
    if seeds is None:
        slow = [label for label, one in driven.items() if not compiles(one)]
        seeds = HUNDRED if slow else THOUSAND
        if slow:
            tqdm.write(f"homing: a hundred robots, not a thousand: not compiled: {', '.join(slow)}", file=sys.stderr)
    seeds, choose, sizes = seeds_of(seeds), seeds_of(choose), _sizes(step_sizes)
    if len(seeds) < 2:
        raise UserError(f"seeds = {shown(seeds)}: {_TOO_FEW}")
    if sizes and not {*seeds}.isdisjoint(choose):
        remedy = "judge on others, such as range(10000, 10100)"
        raise UserError(f"seeds = {shown(seeds)}: step sizes are chosen on some of them; {remedy}")
    candidates = {label: [settings.with_changes(alpha0=size) for size in sizes] or [settings] for label in driven}

    how: dict[str, dict[str, Any]] = {label: {"lambda_rule": rule} for label, rule in rules.items()}
    how |= {label: {"agent": makes} for label, makes in agents.items()}

    def steps_of(those: Sequence[Candidate], seeds: Sequence[int]) -> Array:
        def of_seed(seed: int) -> Array:
            return episode_matrix([run(its_own, seed, **how[label]) for label, its_own in those])

        return np.array(side_by_side(of_seed, seeds, driven.values())).swapaxes(0, 1)

    if len(sizes) > 1:
        few = max(1, len(choose) // 5)
        for keep, on in ((2, choose[:few]), (1, choose[few:] or choose)):
            candidates = _best(candidates, keep, partial(steps_of, seeds=on))
    steps = steps_of([(label, best) for label, (best, *_) in candidates.items()], seeds)
    chosen = {label: best.alpha0 if not others else None for label, (best, *others) in candidates.items()}
    return Rules(dict(zip(driven, steps, strict=True)), chosen if sizes else {}, sizes, steps_at_random(settings))


Candidate = tuple[str, Settings]


def _best(
    candidates: Mapping[str, Sequence[Settings]], keep: int, steps_of: Callable[[Sequence[Candidate]], Array]
) -> dict[str, list[Settings]]:
    """Of each label's settings those that take the fewest steps, episodes cut: so many, and more where they tie."""
    those = [(label, one) for label, several in candidates.items() for one in several]
    score = dict(zip(those, np.minimum(steps_of(those), CUT).sum(axis=2).mean(axis=1), strict=True))
    left = {}
    for label, several in candidates.items():
        last = sorted(score[label, one] for one in several)[:keep][-1]
        left[label] = [one for one in several if score[label, one] <= last]
    return left


def _learners(rules: Mapping[str, AnyRule], agents: Mapping[str, AgentFactory]) -> dict[str, Any]:
    """By label, the functions of the rules, and what makes the agents. Raises as `compare` does."""
    for label in agents:
        if label in rules:
            raise UserError(f"{label}: both a rule and an agent; give each a label of its own")
    found: dict[str, Any] = {**rules, **agents}
    for label, one in found.items():
        try:
            found[label] = lambda_spec(one).rule if label in rules else _makes_agent(one)
        except (TypeError, ValueError) as error:
            raise type(error)(f"{label}: {error}") from None
    return found


def _sizes(step_sizes: Any) -> tuple[float, ...]:
    """Step sizes, each once. Raises UserError; which values they may have, the settings say."""
    try:
        return tuple({float(size): None for size in step_sizes})
    except (TypeError, ValueError):
        raise UserError(f"step_sizes = {shown(step_sizes)}: must be a list of numbers, as (0.0004, 0.00125)") from None


def _makes_agent(makes: Any) -> AgentFactory:
    """What makes an agent, or TypeError if it cannot be called with settings and a random generator."""
    if wrong := misfit(makes, "settings", "rng"):
        raise TypeError(f"an agent is made by a function of settings and a random generator: {wrong}")
    return makes
