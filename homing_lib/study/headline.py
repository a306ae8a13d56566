"""The headline: five runs with the camera beside as many of random actions, in numbers and in a sentence."""

from collections.abc import Sequence
from functools import cache

import numpy as np

from homing_lib.agent import Run
from homing_lib.study import runs, studies
from homing_lib.study.bootstrap import estimated, ratio
from homing_lib.study.measures import WINDOW
from homing_lib.study.runs import episode_matrix

WELL_BELOW = 0.75
"""A ratio of mean steps counts as "well below" if it is no larger than this and its interval excludes 1."""


class Headline:
    """What runs of the agent say, and runs of random actions of the same seeds.

    Steps are means per episode, with 95 % intervals, of the first and the last WINDOW episodes and of random actions;
    `of_first` and `of_random` are the last as a share of these. The falls, of the parameter change and of the step
    size, are the last as a share of the first.
    """

    def __init__(self, learnt: Sequence[Run], random: Sequence[Run]) -> None:
        self.runs, self.settings = len(learnt), learnt[0].settings
        window = min(WINDOW, self.settings.episodes // 2)
        begin, end = np.s_[..., :window], np.s_[..., -window:]
        steps, by_chance = episode_matrix(learnt), episode_matrix(random).mean(axis=1)
        first, last = steps[begin].mean(axis=1), steps[end].mean(axis=1)
        self.first, self.last, self.random = estimated(first), estimated(last), estimated(by_chance)
        self.of_first, self.of_random = ratio(last, first), ratio(last, by_chance)
        self.reached, self.random_reached = (sum(int(run.reached.sum()) for run in group) for group in (learnt, random))
        self.total, self.random_total = (sum(run.settings.episodes for run in group) for group in (learnt, random))
        self.diverged = sum(run.diverged > 0 for run in learnt)
        changes, rates = episode_matrix(learnt, "change"), self.settings.step_size_rates
        self.change_fall = float(np.nanmean(changes[end]) / np.nanmean(changes[begin]))
        self.rate_fall = float(rates[end].mean() / rates[begin].mean())

    @property
    def verdict(self) -> str:
        """ "well below", "below" or "not below": how the last episodes stand to the first and to random actions."""
        ratios = self.of_first, self.of_random
        if not all(ratio.high < 1 for ratio in ratios):
            return "not below"
        return "well below" if all(ratio.value <= WELL_BELOW for ratio in ratios) else "below"


@cache
def stored() -> Headline:
    """The headline of the runs stored under data/. Raises UserError if they are not sound."""
    return Headline(*runs.load_study(studies.HEADLINE).values())


def conclusion(h: Headline) -> str:
    """The result in one sentence."""
    lead = {
        "well below": "The episodes get shorter:",
        "below": "The episodes get shorter, though by less than the paper suggests:",
        "not below": "These runs do not show that the episodes get shorter:",
    }[h.verdict]
    return (
        f"{lead} over {h.runs} runs of {h.settings.episodes} episodes, an episode takes {h.first:.0f} steps "
        f"at first (mean of the first {WINDOW} with its 95 % interval) and {h.last:.0f} at the end (last {WINDOW}); "
        f"random actions in the same room take {h.random:.0f}."
    )


def in_numbers(h: Headline) -> list[str]:
    """The end against the beginning and against chance, and how often home was reached: two sentences."""
    return [
        f"Last five against first five: {h.of_first:.2f} of the steps; against random actions: "
        f"{h.of_random:.2f}. The end is {h.verdict} both.",
        f"Home was reached in {h.reached} of {h.total} episodes, by random actions in {h.random_reached} of "
        f"{h.random_total}; {h.diverged} of {h.runs} runs diverged.",
    ]
