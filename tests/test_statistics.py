"""What is said about few runs, against numbers that can be checked by hand."""

import subprocess
import sys

import numpy as np
import pandas as pd
import pytest

from homing_lib.agent import STEP_COLUMNS, Run
from homing_lib.settings import Settings
from homing_lib.study.runs import by_episode, episodes_of
from homing_lib.study.statistics import (
    Interval,
    band,
    interval,
    iqm,
    judged,
    knife_edge,
    pooled_at_best,
    ratio,
    ratio_at_best,
    side,
)


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


@pytest.mark.parametrize("statistic", [np.mean, iqm])
def test_a_ratio_with_one_choice_is_the_plain_ratio(statistic, rng):
    ours, theirs = rng.uniform(10, 30, (2, 60))
    plain, chosen = ratio(ours, theirs, rng, statistic), ratio_at_best([ours], [theirs], rng, statistic)
    assert chosen == pytest.approx(plain, abs=0.03)


def test_each_side_has_its_best_row_and_ours_are_drawn_with_theirs(rng):
    slow_and_fast = np.array([10.0, 100.0, 1000.0])
    ours, theirs = [slow_and_fast * 7, slow_and_fast], [slow_and_fast * 4, slow_and_fast * 2, slow_and_fast * 3]
    assert ratio_at_best(ours, theirs, rng) == pytest.approx((0.5, 0.5, 0.5))


def test_one_half_of_the_runs_is_judged_at_the_row_that_the_other_half_chooses(rng):
    """Runs 1 and 3 against 2 and 4: each pair's own best row is the other's worst."""
    ours = [[1.0, 9.0, 1.0, 9.0], [9.0, 1.0, 9.0, 1.0]]
    assert ratio_at_best(ours, np.ones((1, 4)), rng) == pytest.approx((9, 9, 9))


def test_who_is_best_by_one_number_may_be_compared_by_another(rng):
    late, total = np.array([[2.0] * 10, [1.0] * 10]), np.array([[3.0] * 10, [9.0] * 10])
    assert ratio_at_best(total, np.ones((1, 10)), rng) == pytest.approx((3, 3, 3))
    by_late = (late, np.ones((1, 10)))
    assert ratio_at_best(total, np.ones((1, 10)), rng, chosen_by=by_late) == pytest.approx((9, 9, 9))


def test_who_may_choose_among_many_alike_seems_no_better_for_it(rng):
    """One row against twelve of the same chance: whoever judges the least by the runs that chose it is fooled."""
    held, found, fooled = [], [], []
    for _ in range(20):
        ours, theirs = rng.exponential(100, (1, 30)), rng.exponential(100, (12, 30))
        chosen = ratio_at_best(ours, theirs, rng)
        held.append(side(chosen, 1) == "open")
        found.append(np.log(chosen.value))
        fooled.append(np.log(ours.mean() / theirs.mean(axis=1).min()))
    assert sum(held) >= 18
    assert abs(np.mean(found)) < 0.1
    assert np.mean(fooled) > 0.2


def test_rooms_are_pooled_by_the_geometric_mean_of_their_ratios(rng):
    steps = np.array([10.0, 100.0, 1000.0, 7.0])
    halved, doubled = ([steps], [steps * 2]), ([steps * 2, steps * 9], [steps])
    assert pooled_at_best([halved, doubled, doubled, doubled], rng) == pytest.approx((2**0.5,) * 3)


def test_what_is_pooled_has_a_percentile_interval_over_runs_and_rooms_that_stay_make_it_no_wider(rng):
    """Skewed, so that no interval that is symmetric, on whatever scale, would do; and four rooms halve it."""
    few = rng.exponential(100, 60) ** 2
    alone = pooled_at_best([([few], [np.ones(60)])], rng)
    assert alone == pytest.approx(ratio_at_best([few], [np.ones(60)], rng), rel=0.05)
    four = pooled_at_best([([few * scale], [np.ones(60)]) for scale in (1, 10, 100, 1000)], rng)
    assert four.value == pytest.approx(alone.value * 1000**0.5)
    assert np.log(four.high / four.low) == pytest.approx(np.log(alone.high / alone.low) / 2, rel=0.1)


def test_intervals_of_a_family_are_as_wide_as_their_number_asks(rng):
    """Of a normal mean: 1.96 standard errors to a side alone, 2.81 as one of ten (1 - .05/10)."""
    sample = rng.standard_normal(400)
    widths = [np.ptp(interval(sample, rng, family=family)[1:]) for family in (1, 10)]
    assert widths[1] / widths[0] == pytest.approx(2.81 / 1.96, rel=0.06)
    pair = [np.ptp(ratio(sample + 9, sample[::-1] + 9, rng, family=family)[1:]) for family in (1, 10)]
    best = [np.ptp(ratio_at_best([sample + 9], [sample[::-1] + 9], rng, family=family)[1:]) for family in (1, 10)]
    assert [pair[1] / pair[0], best[1] / best[0]] == pytest.approx([2.81 / 1.96] * 2, rel=0.06)


def test_an_end_within_two_per_cent_of_a_margin_is_named_a_knife_edge():
    assert knife_edge(Interval(0.8, 0.7, 0.979)) == ""
    assert knife_edge(Interval(0.8, 0.7, 0.981)) == " (a knife edge at 1)"
    assert knife_edge(Interval(0.8, 0.7, 0.9), Interval(1.1, 1.01, 1.2)) == " (a knife edge at 1)"
    assert knife_edge(Interval(0.9, 0.79, 0.99), margins=(0.8, 1)) == " (a knife edge at 0.8 and 1)"
    assert knife_edge(Interval(0.97, 0.96, 0.98), margins=(0.95,)) == " (a knife edge at 0.95)"
    assert knife_edge(Interval(1, 1, 1)) == "", "the same runs to the bit"


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
