"""What robots allow one to say: an estimate, its 95 % interval, and the word that the interval allows.

The robot is the unit: its episodes depend on each other, its seed on nothing. Intervals are percentile intervals of the
bootstrap, which draws robots; a robot brings all that its seed has done. Where k comparisons are judged together, each
interval is that of 1 - .05/k (Bonferroni), so that with 95 % certainty all of them hold at once.
"""

from collections.abc import Callable
from functools import cache
from statistics import NormalDist
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from homing_lib.features import Array

RESAMPLES = 9999

SAME = 1.1
"""Steps that differ by no more than this factor, whichever way, are called the same."""

SAME_SHARE = 0.02  # and shares that differ by no more than this

Statistic = Callable[[Array, Array], Array]


class Interval(NamedTuple):
    """An estimate and the ends of its interval. f"{interval:.2f}" writes all three: 0.50 [0.40, 0.61]."""

    value: float
    low: float
    high: float

    def __format__(self, each: str) -> str:
        return f"{self.value:{each}} [{self.low:{each}}, {self.high:{each}}]"


@cache
def draws(robots: int) -> Array:
    """How often each robot is drawn in each resample, shape (RESAMPLES, robots): the same for all that is estimated."""
    rng = np.random.default_rng(0)
    counts: Array = rng.multinomial(robots, np.full(robots, 1 / robots), size=RESAMPLES).astype(np.float64)
    counts.flags.writeable = False
    return counts


def bootstrap(estimate: Callable[[Array], Array], robots: int, comparisons: int = 1) -> Interval:
    """Percentile interval of anything that is estimated from robots.

    estimate: from how often each robot is drawn, shape (k, robots), to k numbers. comparisons: how many are judged
    together. One robot says nothing of how robots differ, and has no ends (NaN); of no robot all is NaN.
    """
    if robots == 0:
        return Interval(np.nan, np.nan, np.nan)
    value = float(estimate(np.ones((1, robots)))[0])
    if robots < 2:
        return Interval(value, np.nan, np.nan)
    low, high = np.percentile(estimate(draws(robots)), (2.5 / comparisons, 100 - 2.5 / comparisons))
    return Interval(value, float(low), float(high))


def mean(values: Array, counts: Array) -> Array:
    """Mean of numbers, one per robot, in each resample; of rows of numbers, shape (robots, n), shape (k, n)."""
    return np.asarray(counts @ values / counts.shape[1])


def iqm(values: Array, counts: Array | None = None) -> Array:
    """Interquartile mean, which tells of the typical robot: n/4 robots, rounded down, are left out at each end."""
    counts = np.ones((1, len(values)), np.int16) if counts is None else counts
    order, robots = np.argsort(values, kind="stable"), len(values)
    cut, ordered = robots // 4, values[order]
    means = []
    for some in np.array_split(counts, max(1, len(counts) // 250)):  # as many as fit into a processor's cache
        up_to = some[:, order].cumsum(axis=1).clip(cut, robots - cut)
        means.append(np.diff(up_to, axis=1, prepend=cut) @ ordered)
    return np.concatenate(means) / (robots - 2 * cut)


def estimated(values: ArrayLike, statistic: Statistic = mean, comparisons: int = 1) -> Interval:
    """A statistic of numbers, one per robot."""
    numbers = np.asarray(values, dtype=float)
    return bootstrap(lambda counts: statistic(numbers, counts), len(numbers), comparisons)


def band(table: Array) -> tuple[Array, Array, Array]:
    """Mean of each column and the ends of its 95 % interval; whole rows, the robots, are drawn. Shape (robots, n)."""
    low, high = np.percentile(mean(table, draws(len(table))), (2.5, 97.5), axis=0)
    return table.mean(axis=0), low, high


def ratio(ours: ArrayLike, theirs: ArrayLike, statistic: Statistic = mean, comparisons: int = 1) -> Interval:
    """A statistic of our robots over that of theirs; element i of both has the same seed, and is drawn with it."""
    a, b = np.asarray(ours, dtype=float), np.asarray(theirs, dtype=float)
    return bootstrap(lambda counts: statistic(a, counts) / statistic(b, counts), len(a), comparisons)


def ratio_unpaired(ours: ArrayLike, theirs: ArrayLike, comparisons: int = 1) -> Interval:
    """Mean of our robots over that of others, which share no seeds: each side is drawn by itself.

    For so few robots percentile intervals are too short. They are taken as far out as Student's t asks of the smaller
    side (Hesterberg, What teachers should know about the bootstrap, The American Statistician 69, 2015, section 4.1).
    """
    from scipy.special import stdtrit  # slow to load

    a, b = np.asarray(ours, dtype=float), np.asarray(theirs, dtype=float)
    n = min(len(a), len(b))
    out = np.sqrt(n / (n - 1)) * stdtrit(n - 1, 1 - 0.025 / comparisons)
    below = 100 * NormalDist().cdf(-out)
    drawn = mean(a, draws(len(a))) / mean(b, draws(len(b))[::-1])  # reversed, since both begin with the same numbers
    low, high = np.percentile(drawn, (below, 100 - below))
    return Interval(float(a.mean() / b.mean()), float(low), float(high))


def pooled(pairs: list[tuple[Array, Array]]) -> Interval:
    """Geometric mean of the rooms' ratios of means. Its interval is for other robots in these rooms, not other rooms.

    pairs: of each room ours and theirs, one number per robot, the same seeds in order.
    """

    def estimate(counts: Array) -> Array:
        return np.exp(np.mean([np.log(mean(ours, counts) / mean(theirs, counts)) for ours, theirs in pairs], axis=0))

    return bootstrap(estimate, len(pairs[0][0]))


def word_of(interval: Interval, same: tuple[float, float] = (1 / SAME, SAME), equal: float = 1.0) -> str:
    """What an interval says: the same, if it lies within these bounds; fewer or more, if it leaves out `equal`; else
    undecided: these robots do not settle it.
    """
    if same[0] <= interval.low and interval.high <= same[1]:
        return "the same"
    return "fewer" if interval.high < equal else "more" if interval.low > equal else "undecided"


def smallest_ratio(ours: Array, theirs: Array, robots: int, comparisons: int = 1) -> float:
    """The smallest ratio of means that so many robots would tell from 1 in 80 of 100 studies, by the spread of others.

    ours, theirs: steps of those others, one per robot, seeds in order. comparisons: as in `bootstrap`.
    """
    error = np.std(ours / ours.mean() - theirs / theirs.mean(), ddof=1) / np.sqrt(robots)  # of the ratio's logarithm
    quantile = NormalDist().inv_cdf  # what scipy.stats.norm.ppf is, without a second's loading
    return float(np.exp((quantile(1 - 0.025 / comparisons) + quantile(0.8)) * error))
