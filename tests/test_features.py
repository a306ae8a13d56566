import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from homing_lib.features import HomeModel, bins_per_channel, difference_variance, histogram, similarity
from homing_lib.settings import Settings

# Eq. (14), (11): histograms


def test_bins_of_three_give_the_258_features_of_eq_14_and_three_snapshots_three_times_as_many():
    assert 3 * bins_per_channel(3) == 258
    assert Settings().n_features == 258
    assert Settings(snapshots=3).n_features == 774


@pytest.mark.parametrize("bin_size", range(1, 129))
def test_bins_of_every_size_cover_all_256_intensities(bin_size):
    image = np.arange(256, dtype=np.uint8).reshape(16, 16, 1).repeat(3, axis=2)
    shares = histogram(image, bin_size).reshape(3, bins_per_channel(bin_size))
    full, rest = divmod(256, bin_size)
    expected = np.zeros(bins_per_channel(bin_size))
    expected[:full] = bin_size / 256
    expected[full : full + 1] = rest / 256
    np.testing.assert_array_equal(shares, [expected] * 3)


def test_a_histogram_of_four_pixels_is_the_one_counted_by_hand():
    # red 0, 0, 127, 128; green all 255; blue 0, 64, 128, 192; bins of 128: 0..127, 128..255 and an empty third
    red_green_blue = [[(0, 255, 0), (0, 255, 64)], [(127, 255, 128), (128, 255, 192)]]
    image = np.array(red_green_blue, dtype=np.uint8)
    expected = [3 / 4, 1 / 4, 0, 0, 1, 0, 1 / 2, 1 / 2, 0]
    np.testing.assert_array_equal(histogram(image, 128), expected)


def test_the_fourth_channel_of_an_image_does_not_count():
    image = np.zeros((2, 2, 4), dtype=np.uint8)
    image[:, :, 3] = 255
    np.testing.assert_array_equal(histogram(image, 128), [1, 0, 0] * 3)


@given(
    image=arrays(np.uint8, st.tuples(st.integers(1, 6), st.integers(1, 6), st.just(3))), bin_size=st.integers(1, 128)
)
def test_the_bins_of_each_channel_sum_to_one(image, bin_size):
    channels = histogram(image, bin_size).reshape(3, -1)
    assert channels.sum(axis=1) == pytest.approx([1, 1, 1])


# Eq. (9), (10): sigma^2


SEEN = np.array([[0.0, 0.5], [0.2, 0.5], [0.4, 0.2]])
SNAPSHOT = np.array([[0.1, 0.3]])


@pytest.mark.parametrize(
    ("variance", "centre", "expected"),
    [
        # mean .2 and .4: squares .04 + 0 + .04 and .01 + .01 + .04, over 2
        ("per-bin", "mean", [0.04, 0.03]),
        ("pooled", "mean", [0.035, 0.035]),
        # from .1 and .3: squares .01 + .01 + .09 and .04 + .04 + .01, over 2
        ("per-bin", "zero", [0.055, 0.045]),
        ("pooled", "zero", [0.05, 0.05]),
    ],
)
def test_the_four_readings_of_sigma_squared_are_those_worked_by_hand(variance, centre, expected):
    sigma2 = difference_variance(SEEN, SNAPSHOT, variance=variance, centre=centre, floor=1e-9)
    assert sigma2 == pytest.approx(np.array([expected]))


def test_about_the_mean_sigma_squared_is_the_same_for_every_snapshot_and_about_zero_it_is_not():
    snapshots = np.array([[0.1, 0.3], [0.2, 0.4]])
    about_mean = difference_variance(SEEN, snapshots, variance="per-bin", centre="mean", floor=1e-9)
    about_zero = difference_variance(SEEN, snapshots, variance="per-bin", centre="zero", floor=1e-9)
    assert about_mean == pytest.approx(np.array([[0.04, 0.03], [0.04, 0.03]]))
    assert about_zero == pytest.approx(np.array([[0.055, 0.045], [0.04, 0.03]]))


@pytest.mark.parametrize("centre", ["mean", "zero"])
def test_a_bin_that_never_varied_gets_the_floor_and_the_others_keep_theirs(centre):
    seen = np.array([[0.3, 0.0], [0.3, 0.2]])
    sigma2 = difference_variance(seen, np.array([[0.3, 0.1]]), variance="per-bin", centre=centre, floor=1e-4)
    assert sigma2 == pytest.approx(np.array([[1e-4, 0.02]]))


def test_one_view_is_too_few_for_a_variance():
    with pytest.raises(ValueError, match="1 views: at least 2 are needed"):
        difference_variance(SEEN[:1], SNAPSHOT, variance="pooled", centre="mean", floor=1e-9)


# Eq. (8), (12), (13), (15): features and their mean


def test_features_are_those_of_eq_8_worked_by_hand():
    model = HomeModel(np.array([[0.5, 0.5]]), np.array([[0.02, 0.08]]))
    # differences .2 and -.4: exp(-.04 / .04) and exp(-.16 / .16)
    assert model.features(np.array([0.7, 0.1])) == pytest.approx([np.exp(-1), np.exp(-1)])
    # differences 0 and .2: exp(0) and exp(-.04 / .16)
    assert model.features(np.array([0.5, 0.7])) == pytest.approx([1, np.exp(-1 / 4)])


def test_the_features_of_several_snapshots_stand_in_a_row():
    model = HomeModel(np.array([[0.5, 0.5], [0.7, 0.3], [0.9, 0.1]]), np.full((3, 2), 0.02))
    assert model.n_features == 6
    # differences from .7, .3: .2, -.2; 0, 0; -.2, .2
    phi = model.features(np.array([0.7, 0.3]))
    assert phi == pytest.approx([np.exp(-1), np.exp(-1), 1, 1, np.exp(-1), np.exp(-1)])
    assert similarity(phi) == pytest.approx((4 * np.exp(-1) + 2) / 6)


shares = arrays(np.float64, 6, elements=st.floats(0, 1))


@given(view=shares, snapshot=shares, sigma2=st.floats(1e-9, 1))
def test_features_lie_in_the_unit_interval_and_so_does_their_mean(view, snapshot, sigma2):
    phi = HomeModel(snapshot[None], np.full((1, 6), sigma2)).features(view)
    assert phi.shape == (6,)
    assert (phi >= 0).all()
    assert (phi <= 1).all()
    assert 0 <= similarity(phi) <= 1


@given(snapshot=shares, sigma2=st.floats(1e-9, 1))
def test_the_similarity_is_exactly_one_at_the_snapshot(snapshot, sigma2):
    model = HomeModel(snapshot[None], np.full((1, 6), sigma2))
    assert similarity(model.features(snapshot)) == 1


@given(view=shares, snapshot=shares)
def test_a_wider_sigma_never_makes_a_view_less_similar(view, snapshot):
    narrow, wide = (HomeModel(snapshot[None], np.full((1, 6), sigma2)) for sigma2 in (0.01, 0.04))
    assert similarity(narrow.features(view)) <= similarity(wide.features(view))


def test_features_leave_the_histogram_and_the_model_as_they_were():
    model, view = HomeModel(SNAPSHOT.copy(), np.full((1, 2), 0.02)), np.array([0.7, 0.1])
    first = model.features(view)
    np.testing.assert_array_equal(view, [0.7, 0.1])
    np.testing.assert_array_equal(model.snapshots, SNAPSHOT)
    second = model.features(view)
    np.testing.assert_array_equal(first, second)
    assert not np.shares_memory(first, second)


def test_a_model_whose_shapes_disagree_is_refused_with_both():
    with pytest.raises(ValueError, match=r"snapshots \(1, 2\) and variance \(2,\): both must be \(m, 3 B\)"):
        HomeModel(SNAPSHOT, np.ones(2))
