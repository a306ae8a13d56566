"""Section III.A-C, eq. (8)-(15): what the robot makes of an image.

An image becomes three histograms; their bins, compared with those of the snapshots of home, become radial basis
features in [0, 1]; the mean of the features is the similarity NRB.
"""

from dataclasses import dataclass, field
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Variance = Literal["per-bin", "pooled"]
Centre = Literal["mean", "zero"]


def bins_per_channel(bin_size: int) -> int:
    """Eq. (14): B = round(256 / b) + 1 bins of `bin_size` intensities each; 86 for b = 3."""
    return round(256 / bin_size) + 1


def histogram(image: NDArray[np.uint8], bin_size: int) -> Array:
    """The scaled histogram h/H of eq. (11): the share of a channel's pixels in each bin, red, green, blue in turn.

    image: shape (height, width, 3 or more), the first three channels RGB. Returns shape (3 B,); every channel's bins
    sum to 1. (The paper sums to H over n features; H is the number of pixels of one channel.)
    """
    bins = bins_per_channel(bin_size)
    # Bounds lie between intensities: on one, such as 49 where b = 49, rounding would decide its bin.
    bounds = [-0.5, bins * bin_size - 0.5]
    counts = [cv2.calcHist([image], [channel], None, [bins], bounds).ravel() for channel in range(3)]
    return np.concatenate(counts).astype(np.float64) / (image.shape[0] * image.shape[1])


def difference_variance(
    histograms: Array, snapshots: Array, *, variance: Variance, centre: Centre, floor: float
) -> Array:
    """Eq. (9)-(10): sigma^2 of the difference between a view's bins and a snapshot's, over T views.

    histograms: shape (T, 3 B), T >= 2; snapshots: shape (m, 3 B). Returns shape (m, 3 B). centre: "mean" takes the
    variance about the mean; "zero" the mean square, as eq. (9) prints it. (The factor is 1/(T - 1) in both; printed is
    1/T - 1, which is negative.) variance: "per-bin" keeps one value per bin (eq. 8), "pooled" one average for all
    (eq. 12). floor: least variance of a bin, in squared shares of pixels: one that never varied has features too.
    """
    if len(histograms) < 2:
        raise ValueError(f"{len(histograms)} views: at least 2 are needed for a variance (eq. 9)")
    if centre == "mean":
        per_bin = np.broadcast_to(histograms.var(axis=0, ddof=1), snapshots.shape)
    else:
        squares = [((histograms - snapshot) ** 2).sum(axis=0) for snapshot in snapshots]
        per_bin = np.array(squares) / (len(histograms) - 1)
    if variance == "pooled":
        per_bin = np.full(snapshots.shape, per_bin.mean())
    return np.maximum(per_bin, floor)


@dataclass(frozen=True)
class HomeModel:
    """All that the robot knows of home: its snapshots, and how much each bin varies on the way.

    snapshots: scaled histograms of the m views of home, shape (m, 3 B); variance: sigma^2, shape (m, 3 B).
    """

    snapshots: Array
    variance: Array
    _snapshots: Array = field(init=False, repr=False, compare=False)
    _exponent: Array = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if self.snapshots.ndim != 2 or self.snapshots.shape != self.variance.shape:
            shapes = f"snapshots {self.snapshots.shape} and variance {self.variance.shape}"
            raise ValueError(f"{shapes}: both must be (m, 3 B)")
        # For one snapshot, vectors: no broadcasting at every step.
        object.__setattr__(self, "_snapshots", self.snapshots.squeeze())
        object.__setattr__(self, "_exponent", -0.5 / self.variance.squeeze())

    @property
    def n_features(self) -> int:
        """Eq. (14): n = 3 B m."""
        return self.snapshots.size

    def features(self, scaled_histogram: Array) -> Array:
        """Eq. (8), (12), (13): phi_i = exp(-(h_i(view) - h_i(snapshot))^2 / (2 sigma_i^2)), shape (n,), each in [0, 1].

        Histograms and sigma^2 are both scaled, so that H^2 of eq. (12) does not appear: with it they would be
        normalised twice and every feature would be about 1.
        """
        difference = scaled_histogram - self._snapshots
        difference *= difference
        difference *= self._exponent
        return np.exp(difference, out=difference).ravel()


class CountedViews:
    """`HomeModel.features` of views that come as counts of pixels, with every exponential computed beforehand.

        phi_i = values[start_i + |count_i - centre_i|]

    Where one variance serves all bins, and shares of the pixels are exact (their number is a power of two), a feature
    depends on the difference of the counts alone: centre is the snapshot's count, and all features share one table.
    Otherwise each has a table of its own, by its count, and centre is 0.

    most: largest count of each bin that can come, shape (3 B,); pixels: of a channel of the image.
    """

    def __init__(self, model: HomeModel, most: NDArray[np.integer], pixels: int) -> None:
        snapshots, variance = model.snapshots * pixels, model.variance
        shared = pixels & (pixels - 1) == 0 and (snapshots == np.rint(snapshots)).all() and np.ptp(variance) == 0
        sizes = np.full(1, pixels + 1) if shared else np.tile(most.astype(np.intp) + 1, len(snapshots))
        start = np.cumsum(sizes) - sizes
        share = (np.arange(sizes.sum()) - np.repeat(start, sizes)) / pixels
        share -= 0 if shared else np.repeat(model.snapshots.ravel(), sizes)
        share *= share
        share *= np.repeat(-0.5 / variance.ravel()[: len(sizes)], sizes)
        self.values: Array = np.exp(share, out=share)
        self.start = np.resize(start, model.n_features)
        self.centre = np.rint(snapshots).astype(np.intp).ravel() if shared else np.zeros_like(self.start)
        self._m = len(snapshots)

    def features(self, counts: NDArray[np.integer]) -> Array:
        """phi, shape (n,), a new array. counts: pixels in each bin, shape (3 B,)."""
        place = (counts if self._m == 1 else np.tile(counts, self._m)) - self.centre
        np.abs(place, out=place)
        place += self.start
        return self.values.take(place)


def similarity(features: Array) -> float:
    """Eq. (15), NRB: the mean of the features. 1 exactly where the view has the snapshot's histograms."""
    return float(np.add.reduce(features)) / features.size
