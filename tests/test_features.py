"""Eqs. (8)-(15): histograms, sigma^2, features and their mean."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from homing_lib.features import CountedViews, HomeModel, bins_per_channel, difference_variance, histogram, similarity
from homing_lib.settings import Settings


def test_bins_of_three_give_the_258_features_of_eq_14_and_three_snapshots_three_times_as_many():
    assert 3 * bins_per_channel(3) == Settings().n_features == 258
    assert Settings(snapshots=3).n_features == 774


@pytest.mark.parametrize("bin_size", [1, 2, 3, 5, 49, 85, 127, 128])
def test_bins_of_every_size_cover_all_256_intensities(bin_size):
    image = np.arange(256, dtype=np.uint8).reshape(16, 16, 1).repeat(3, axis=2)
    shares = histogram(image, bin_size).reshape(3, bins_per_channel(bin_size))
    full, rest = divmod(256, bin_size)
    expected = np.zeros(bins_per_channel(bin_size))
    expected[:full] = bin_size / 256
    expected[full : full + 1] = rest / 256
    np.testing.assert_array_equal(shares, [expected] * 3)


def test_a_histogram_of_four_pixels_is_the_one_counted_by_hand_and_a_fourth_channel_does_not_count():
    # red 0, 0, 127, 128; green all 255; blue 0, 64, 128, 192; bins of 128: 0..127, 128..255 and an empty third
    pixels = [[(0, 255, 0, 255), (0, 255, 64, 0)], [(127, 255, 128, 9), (128, 255, 192, 0)]]
    expected = [3 / 4, 1 / 4, 0, 0, 1, 0, 1 / 2, 1 / 2, 0]
    np.testing.assert_array_equal(histogram(np.array(pixels, dtype=np.uint8), 128), expected)


@given(
    image=arrays(np.uint8, st.tuples(st.integers(1, 6), st.integers(1, 6), st.just(3))), bin_size=st.integers(1, 128)
)
def test_the_bins_of_each_channel_sum_to_one(image, bin_size):
    channels = histogram(image, bin_size).reshape(3, -1)
    assert channels.sum(axis=1) == pytest.approx([1, 1, 1])


SEEN = np.array([[0.0, 0.5], [0.2, 0.5], [0.4, 0.2]])
SNAPSHOTS = np.array([[0.1, 0.3], [0.2, 0.4]])


@pytest.mark.parametrize(
    ("variance", "centre", "expected"),
    [
        # mean .2 and .4, whatever the snapshot: squares .04 + 0 + .04 and .01 + .01 + .04, over 2
        ("per-bin", "mean", [[0.04, 0.03], [0.04, 0.03]]),
        ("pooled", "mean", [[0.035, 0.035], [0.035, 0.035]]),
        # from .1 and .3: squares .01 + .01 + .09 and .04 + .04 + .01, over 2; the second snapshot is the mean
        ("per-bin", "zero", [[0.055, 0.045], [0.04, 0.03]]),
        ("pooled", "zero", [[0.0425, 0.0425], [0.0425, 0.0425]]),
    ],
)
def test_the_four_readings_of_sigma_squared_are_those_worked_by_hand(variance, centre, expected):
    sigma2 = difference_variance(SEEN, SNAPSHOTS, variance=variance, centre=centre, floor=1e-9)
    assert sigma2 == pytest.approx(np.array(expected))


@pytest.mark.parametrize("centre", ["mean", "zero"])
def test_a_bin_that_never_varied_gets_the_floor_and_the_others_keep_theirs(centre):
    seen = np.array([[0.3, 0.0], [0.3, 0.2]])
    sigma2 = difference_variance(seen, np.array([[0.3, 0.1]]), variance="per-bin", centre=centre, floor=1e-4)
    assert sigma2 == pytest.approx(np.array([[1e-4, 0.02]]))


def test_the_features_of_several_snapshots_stand_in_a_row_as_worked_by_hand():
    model = HomeModel(np.array([[0.5, 0.5], [0.7, 0.3]]), np.array([[0.02, 0.08], [0.02, 0.02]]))
    assert model.n_features == 4
    view = np.array([0.7, 0.1])
    # from the first .2 and -.4: exp(-.04 / .04), exp(-.16 / .16); from the second 0 and -.2: 1, exp(-.04 / .04)
    phi = model.features(view)
    assert phi == pytest.approx([np.exp(-1), np.exp(-1), 1, np.exp(-1)])
    assert similarity(phi) == pytest.approx((3 * np.exp(-1) + 1) / 4)
    np.testing.assert_array_equal(view, [0.7, 0.1])
    assert not np.shares_memory(phi, model.features(view))


shares = arrays(np.float64, 6, elements=st.floats(0, 1))


@given(view=shares, snapshot=shares, sigma2=st.floats(1e-9, 0.5))
def test_features_lie_in_the_unit_interval_are_one_at_home_and_no_less_where_sigma_is_wider(view, snapshot, sigma2):
    narrow, wide = (HomeModel(snapshot[None], np.full((1, 6), variance)) for variance in (sigma2, 2 * sigma2))
    phi = narrow.features(view)
    assert phi.shape == (6,)
    assert ((phi >= 0) & (phi <= 1)).all()
    assert 0 <= similarity(phi) <= similarity(wide.features(view)) <= 1
    assert similarity(narrow.features(snapshot)) == 1


@given(
    counts=arrays(np.int64, 6, elements=st.integers(0, 16)),
    homes=arrays(np.int64, st.tuples(st.integers(1, 2), st.just(6)), elements=st.integers(0, 16)),
    variance=st.sampled_from([0.01, np.arange(1, 7) / 100]),
    pixels=st.sampled_from([16, 17]),
)
def test_features_of_counted_views_are_those_of_their_shares_to_the_bit(counts, homes, variance, pixels):
    model = HomeModel(homes / pixels, np.broadcast_to(variance, homes.shape).copy())
    views = CountedViews(model, np.full(6, 16), pixels)
    np.testing.assert_array_equal(views.features(counts), model.features(counts / pixels))


@pytest.mark.parametrize(
    ("attempt", "line"),
    [
        (lambda: difference_variance(SEEN[:1], SNAPSHOTS, variance="pooled", centre="mean", floor=1), "1 views: .* 2"),
        (lambda: HomeModel(SNAPSHOTS, np.ones(2)), r"snapshots \(2, 2\) and variance \(2,\): both must be \(m, 3 B\)"),
    ],
)
def test_what_gives_no_features_is_refused(attempt, line):
    with pytest.raises(ValueError, match=line):
        attempt()
