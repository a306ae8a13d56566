"""Lambda rules side by side on the robot: the same seeds, the same settings, and a verdict with its interval.

A lesson's tool, quick on the compact atlas. All rules share one step size; which step size suits which rule is a
question for a study (`lambda-map`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from tqdm import tqdm

from homing_lib.agent import run
from homing_lib.features import Array
from homing_lib.lambdas import LambdaRule, checked
from homing_lib.settings import Settings
from homing_lib.study import claims
from homing_lib.study.measures import WINDOW
from homing_lib.study.runs import by_episode, seeds_of


@dataclass(frozen=True)
class Rules:
    """Rules compared. steps: by label, steps of each episode, shape (seeds, episodes). str() is a table in Markdown."""

    steps: Mapping[str, Array]

    @property
    def verdicts(self) -> dict[str, claims.Comparison]:
        """Steps of the last episodes as a multiple of the first rule's, seed by seed; its `.word` is the verdict."""
        late = {label: steps[:, -WINDOW:].mean(axis=1) for label, steps in self.steps.items()}
        first, *others = late
        return {label: claims.compare(late[label], late[first]) for label in others}

    def __str__(self) -> str:
        verdicts, first = self.verdicts, next(iter(self.steps))
        rows = [f"| rule | steps, last {WINDOW} episodes | as a multiple of {first} | |", "|---|---|---|---|"]
        for label, steps in self.steps.items():
            told = f"{verdicts[label]:.2f} | {verdicts[label].word}" if label in verdicts else "1 |"
            rows.append(f"| {label} | {steps[:, -WINDOW:].mean():.1f} | {told} |")
        return "\n".join(rows)


def compare(rules: Mapping[str, LambdaRule], seeds: Sequence[int], settings: Settings | None = None) -> Rules:
    """Run every rule with every seed. settings: by default the paper's robot on the compact atlas.

    A run that diverges counts as `max_steps` steps in each episode that it did not finish. Before any run, raises
    UserError for what are no seeds, and TypeError that names the label for what is no rule.
    """
    settings = settings or Settings(images="compact")
    seeds = seeds_of(seeds)
    for label, rule in rules.items():
        try:
            checked(rule)
        except TypeError as error:
            raise TypeError(f"{label}: {error}") from None
    jobs = [(label, seed) for label in rules for seed in seeds]
    runs = [run(settings, seed, lambda_rule=rules[label]) for label, seed in tqdm(jobs, "runs", unit="run")]
    steps = by_episode(runs).reshape(len(rules), len(seeds), -1)
    return Rules(dict(zip(rules, steps, strict=True)))
