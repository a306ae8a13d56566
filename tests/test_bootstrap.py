"""What is said about few robots, against SciPy given the same draws, and against numbers that can be worked out."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from homing_lib.study import bootstrap
from homing_lib.study.bootstrap import Interval, band, draws, estimated, iqm, mean, pooled, ratio, word_of

SAMPLES = st.lists(st.floats(0.1, 1e4), min_size=1, max_size=40).map(np.array)


@given(SAMPLES, st.integers(0, 2**32))
def test_mean_and_interquartile_mean_with_counts_are_those_of_the_values_that_were_drawn(values, seed):
    robots = len(values)
    counts = np.random.default_rng(seed).multinomial(robots, np.full(robots, 1 / robots), size=5).astype(float)
    drawn = [np.repeat(values, times.astype(int)) for times in counts]
    np.testing.assert_allclose(mean(values, counts), [one.mean() for one in drawn], rtol=1e-12)
    np.testing.assert_allclose(iqm(values, counts), [stats.trim_mean(one, 0.25) for one in drawn], rtol=1e-12)
    assert iqm(values) == pytest.approx([stats.trim_mean(values, 0.25)], rel=1e-12)


def test_the_interquartile_mean_leaves_out_a_quarter_at_each_end():
    assert iqm(np.array([1000.0, 0, 3, 1])) == [2]
    assert iqm(np.array([1.0, 2, 6])) == [3]  # a quarter of three, rounded down, is none
    assert iqm(np.array([0.0, 1, 3, 1000]), np.array([[0, 0, 2, 2.0], [4, 0, 0, 0]])).tolist() == [501.5, 0]


@pytest.mark.parametrize("robots", [2, 30])
def test_an_interval_holds_the_middle_95_per_cent_of_what_the_resamples_give(robots):
    values = np.random.default_rng(robots).exponential(100, robots)
    for statistic, by_scipy in ((mean, np.mean), (iqm, lambda drawn: stats.trim_mean(drawn, 0.25))):
        found = [by_scipy(np.repeat(values, times.astype(int))) for times in draws(len(values))]
        expected = [by_scipy(values), *np.quantile(found, (0.025, 0.975))]
        assert estimated(values, statistic) == pytest.approx(expected, rel=1e-9)


def test_intervals_are_those_of_scipys_bootstrap_but_for_the_draws():
    ours, theirs = np.random.default_rng(1).exponential(100, (2, 60))

    def of_means(a, b, axis):
        return a.mean(axis=axis) / b.mean(axis=axis)

    options = {"method": "percentile", "paired": True, "n_resamples": 9999, "random_state": 3}
    expected = stats.bootstrap((ours, theirs), of_means, **options).confidence_interval
    found = ratio(ours, theirs)
    assert found.value == pytest.approx(ours.mean() / theirs.mean())
    assert found[1:] == pytest.approx((expected.low, expected.high), abs=0.05 * (expected.high - expected.low))


def test_the_draws_are_as_many_as_the_robots_the_same_each_time_and_cannot_be_changed():
    assert draws(7).shape == (bootstrap.RESAMPLES, 7)
    assert (draws(7).sum(axis=1) == 7).all()
    assert draws(7) is draws(7)
    assert draws(7).mean(axis=0) == pytest.approx(np.ones(7), abs=0.05)
    with pytest.raises(ValueError, match="read-only"):
        draws(7)[0, 0] = 1


def test_a_robot_is_drawn_with_all_that_its_seed_has_done():
    slow_and_fast = np.array([10.0, 100.0, 1000.0])
    assert ratio(slow_and_fast / 2, slow_and_fast) == pytest.approx((0.5, 0.5, 0.5))
    assert ratio(slow_and_fast / 2, slow_and_fast[::-1]).low < 0.4


def test_intervals_of_comparisons_that_are_judged_together_are_as_wide_as_their_number_asks():
    """Of a normal mean: 1.96 standard errors to a side alone, 2.81 as one of ten (1 - .05/10)."""
    sample = np.random.default_rng(1).standard_normal(400) + 9
    for of in (
        lambda comparisons: estimated(sample, comparisons=comparisons),
        lambda comparisons: ratio(sample, sample[::-1], comparisons=comparisons),
    ):
        alone, one_of_ten = (np.ptp(of(comparisons)[1:]) for comparisons in (1, 10))
        assert one_of_ten / alone == pytest.approx(2.81 / 1.96, rel=0.06)


def test_one_robot_has_an_estimate_and_no_interval_and_nothing_is_said_of_it():
    seven = np.array([7.0])
    for found in (estimated(seven), estimated(seven, iqm), ratio(seven, seven / 2), pooled([(seven, seven / 2)])):
        assert found.value in (7, 2)
        assert np.isnan(found[1:]).all()
        assert word_of(found) == "undecided"


def test_rooms_are_pooled_by_the_geometric_mean_and_four_rooms_of_other_robots_halve_the_spread():
    steps = np.array([10.0, 100.0, 1000.0, 7.0])
    assert pooled([(steps, steps * 2), *[(steps * 2, steps)] * 3]) == pytest.approx((2**0.5,) * 3)
    assert pooled([(steps, steps[::-1])]) == pytest.approx(ratio(steps, steps[::-1]))
    rng = np.random.default_rng(2)
    rooms = [(rng.exponential(100, 300) * scale, np.full(300, 100.0)) for scale in (1, 10, 100, 1000)]
    alone = [np.log(one.high / one.low) for one in (pooled([room]) for room in rooms)]
    together = pooled(rooms)
    assert np.log(together.high / together.low) == pytest.approx(np.mean(alone) / 2, rel=0.15)


SHARES = (-0.02, 0.02), 0.0


@pytest.mark.parametrize(
    ("low", "high", "word", "bounds"),
    [
        (0.92, 0.99, "the same", ()),  # though it leaves out 1
        (1 / 1.1, 1.1, "the same", ()),
        (0.9, 1.1, "undecided", ()),
        (0.9, 0.999, "fewer", ()),
        (0.9, 1.0, "undecided", ()),
        (1.0, 1.2, "undecided", ()),
        (1.001, 1.2, "more", ()),
        (np.nan, np.nan, "undecided", ()),
        (-0.02, 0.02, "the same", SHARES),
        (-0.05, -0.001, "fewer", SHARES),
        (-0.05, 0.0, "undecided", SHARES),
        (0.001, 0.05, "more", SHARES),
    ],
)
def test_a_word_is_allowed_by_the_whole_interval_alone(low, high, word, bounds):
    assert word_of(Interval(1.0, low, high), *bounds) == word


def test_a_band_has_the_mean_of_each_episode_and_the_interval_that_it_would_have_alone():
    table = np.random.default_rng(1).standard_normal((50, 3)) + np.array([0, 5, 9])
    found = band(table)
    for column in range(3):
        assert [one[column] for one in found] == pytest.approx(estimated(table[:, column]))


@pytest.mark.parametrize("comparisons", [1, 8])
def test_the_smallest_ratio_is_detected_in_four_of_five_studies(comparisons):
    """Robots whose steps spread as in some rooms, ours that many times theirs; each interval as a normal one."""
    rng, robots = np.random.default_rng(5), 200
    earlier = rng.lognormal(7, 0.6, (2, 2000))
    least = bootstrap.smallest_ratio(*earlier, robots, comparisons)
    assert 1.1 < least < 1.4
    ours, theirs = rng.lognormal(7, 0.6, (2, 2000, robots))
    ours = ours * least
    found = ours.mean(axis=1) / theirs.mean(axis=1)
    a, b = ours / ours.mean(axis=1, keepdims=True), theirs / theirs.mean(axis=1, keepdims=True)
    error = np.std(a - b, axis=1, ddof=1) / np.sqrt(robots)
    detected = np.log(found) - stats.norm.ppf(1 - 0.025 / comparisons) * error > 0
    assert detected.mean() == pytest.approx(0.8, abs=0.05)
