"""What is said about few runs, against numbers that can be checked by hand."""

import subprocess
import sys

import numpy as np
import pandas as pd
import pytest

from homing_lib.agent import STEP_COLUMNS, Run
from homing_lib.settings import Settings
from homing_lib.study.runs import by_episode, episodes_of
from homing_lib.study.statistics import Interval, band, interval, iqm, judged, probability_of_improvement, ratio, side


def run(lengths, episodes=3, diverged=0):
    steps = np.zeros((sum(lengths), len(STEP_COLUMNS)))
    steps[:, STEP_COLUMNS.index("reward")] = np.arange(sum(lengths))
    settings = Settings(episodes=episodes, max_steps=100)
    return Run(settings, 0, steps, np.array(lengths, dtype=int), np.ones(len(lengths), dtype=bool), diverged)


@pytest.fixture
def rng():
    return np.random.default_rng(1)


def test_steps_and_sums_of_each_episode_are_those_of_its_steps():
    runs = [run([1, 2, 3]), run([2, 2, 2])]
    assert by_episode(runs).tolist() == [[1, 2, 3], [2, 2, 2]]
    assert by_episode(runs, "reward").tolist() == [[0, 1 + 2, 3 + 4 + 5], [1, 5, 9]]


def test_episodes_lost_to_divergence_count_as_never_home_and_have_no_sums():
    runs = [run([4], diverged=2), run([], diverged=1)]
    assert by_episode(runs).tolist() == [[4, 100, 100], [100, 100, 100]]
    assert np.isnan(by_episode(runs, "reward")).tolist() == [[False, True, True], [True] * 3]


def test_a_table_gives_a_row_a_run_whatever_its_order_and_counts_lost_episodes_as_the_cap():
    rows = [("a", 7, 2, np.nan, np.nan), ("a", 7, 1, 30.0, 3.0), ("a", 5, 1, 10.0, 1.0), ("a", 5, 2, 20.0, 2.0)]
    table = pd.DataFrame([*rows, ("b", 5, 1, 99.0, 9.0)], columns=["condition", "seed", "episode", "steps", "change"])
    assert episodes_of(table, "a").tolist() == [[10, 20], [30, Settings().max_steps]]
    assert np.isnan(episodes_of(table, "a", "change")).tolist() == [[False, False], [False, True]]


def test_a_band_has_the_mean_of_each_episode_and_the_interval_that_it_would_have_alone(rng):
    table = rng.standard_normal((50, 3)) + np.array([0, 5, 9])
    mean, low, high = band(table, rng)
    for column in range(3):
        alone = interval(table[:, column], rng)
        assert (mean[column], low[column], high[column]) == pytest.approx(alone, abs=0.02)


def test_an_interval_lies_on_a_side_only_with_all_of_it():
    assert [side(Interval(2, 1, 3), reference) for reference in (0.9, 1, 2, 3, 3.1)] == [
        "above",
        "open",
        "open",
        "open",
        "below",
    ]


def test_a_ratio_is_comparable_only_if_no_large_difference_is_left_possible():
    found = [Interval(0.9, 0.85, 0.99), Interval(1.1, 0.95, 1.2), Interval(1.1, 0.7, 1.2), Interval(1.1, 1.01, 1.2)]
    assert [judged(ratio) for ratio in found] == ["better", "comparable", "open", "worse"]


def test_an_interval_is_written_with_its_ends():
    assert f"{Interval(0.5, 0.4, 0.6111):.2f}" == "0.50 [0.40, 0.61]"


def test_the_interquartile_mean_ignores_the_outer_quarters():
    assert iqm([0, 1, 3, 1000]) == 2
    assert iqm([[0, 1, 3, 1000], [5, 5, 5, 5]], axis=1).tolist() == [2, 5]


@pytest.mark.parametrize("statistic", [np.mean, iqm])
def test_the_interval_of_a_normal_sample_is_about_two_standard_errors_to_either_side(statistic, rng):
    sample = rng.standard_normal(400)
    found = interval(sample, rng, statistic)
    assert found.value == pytest.approx(statistic(sample))
    assert found.low < found.value < found.high
    assert found.high - found.low == pytest.approx(4 / np.sqrt(400), rel=0.2)


def test_a_paired_ratio_keeps_runs_together(rng):
    slow_and_fast = np.array([10.0, 100.0, 1000.0])
    paired = ratio(slow_and_fast / 2, slow_and_fast, rng)
    assert paired == pytest.approx((0.5, 0.5, 0.5))


def test_probability_of_improvement_counts_pairs_and_ties_half(rng):
    ours, theirs = [1, 2, 3, 4], [2, 2, 2, 2]
    assert probability_of_improvement(ours, theirs, rng).value == (1 + 0.5) / 4
    assert probability_of_improvement([1, 1, 1], [2, 2, 2], rng) == (1, 1, 1)


def test_one_run_has_a_mean_but_no_interval(rng):
    found = interval([7.0], rng)
    assert found.value == 7
    assert np.isnan(found.low)
    assert np.isnan(found.high)


def test_the_same_generator_gives_the_same_interval():
    sample = [3.0, 1.0, 4.0, 1.0, 5.0]
    assert interval(sample, np.random.default_rng(2)) == interval(sample, np.random.default_rng(2))


def test_statistics_and_learners_load_no_simulator():
    code = (
        "import sys, homing_lib.study.statistics, homing_lib.td, homing_lib.sarsa; sys.exit('pybullet' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
