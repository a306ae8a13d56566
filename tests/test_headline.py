"""The headline follows from the runs, and a run that diverged counts against the agent."""

import numpy as np
import pytest

from homing_lib.agent import STEP_COLUMNS, Run
from homing_lib.publish import report
from homing_lib.settings import Settings
from homing_lib.study.headline import Headline


def runs(lengths_of_runs, **changes):
    """Runs of these episode lengths whose weights change by 1 a step."""
    made = []
    for seed, lengths in enumerate(lengths_of_runs):
        steps = np.zeros((sum(lengths), len(STEP_COLUMNS)))
        steps[:, STEP_COLUMNS.index("change")] = 1
        settings = Settings(episodes=20, **changes)
        made.append(Run(settings, seed, steps, np.array(lengths), np.ones(len(lengths), dtype=bool), 0))
    return made


RANDOM = runs([[200] * 20, [220] * 20, [180] * 20], controller="random")


def learner(early, late):
    return runs([[early + seed] * 10 + [late + seed] * 10 for seed in range(3)])


@pytest.mark.parametrize(
    ("early", "late", "learns"),
    [
        (150, 50, True),
        (100, 90, True),
        (100, 100, False),
        (300, 250, False),  # better than at first, but no better than chance
    ],
)
def test_whether_it_learns_follows_from_both_comparisons(early, late, learns):
    assert Headline(learner(early, late), RANDOM).learns == learns


def test_the_headline_is_what_the_runs_say():
    h = Headline(learner(150, 50), RANDOM)
    assert (h.first.value, h.last.value, h.random.value) == (151, 51, 200)
    assert h.of_first.value == pytest.approx(51 / 151)
    assert h.of_random.value == pytest.approx(51 / 200)
    assert (h.reached, h.total, h.diverged) == (60, 60, 0)
    assert h.change_fall == pytest.approx(51 / 151)


def test_a_run_that_diverged_counts_against_the_agent():
    lost, *good = learner(150, 50)
    lost = Run(lost.settings, lost.seed, lost.steps[:150], lost.lengths[:1], lost.reached[:1], diverged=2)
    h = Headline([lost, *good], RANDOM)
    assert (h.diverged, h.reached, h.total, h.learns) == (1, 41, 60, False)
    assert all("nan" not in text for text in report.given(h).values())
