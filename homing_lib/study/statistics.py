"""What may be said about few runs: means, interquartile means and comparisons, each with a bootstrap interval.

The run is the unit: its episodes depend on each other, its seed on nothing. Intervals are 95 % percentile intervals
of `scipy.stats.bootstrap`, which resamples runs. With five runs they are rough, and rather too narrow than too wide.
"""

from collections.abc import Callable
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from homing_lib.features import Array

RESAMPLES = 9999

MARGIN = 1.25  # steps that differ by no more than this factor, in either direction, are called comparable


class Interval(NamedTuple):
    """An estimate and the ends of its 95 % interval. f"{interval:.2f}" writes all three: 0.50 [0.40, 0.61]."""

    value: float
    low: float
    high: float

    def __format__(self, each: str) -> str:
        return f"{self.value:{each}} [{self.low:{each}}, {self.high:{each}}]"


def iqm(values: ArrayLike, axis: int | None = None) -> Any:
    """Interquartile mean: the mean of the middle half."""
    return stats.trim_mean(values, 0.25, axis=axis)


def interval(values: ArrayLike, rng: np.random.Generator, statistic: Callable[..., Any] = np.mean) -> Interval:
    """A statistic of numbers, one per run. statistic: takes `axis`, such as `np.mean` or `iqm`."""
    return _bootstrap(rng, statistic, values)


def band(table: Array, rng: np.random.Generator) -> tuple[Array, Array, Array]:
    """Mean of each column and the ends of its 95 % interval; whole rows, the runs, are resampled."""
    weights = rng.multinomial(len(table), np.full(len(table), 1 / len(table)), size=RESAMPLES) / len(table)
    low, high = np.percentile(weights @ table, (2.5, 97.5), axis=0)
    return table.mean(axis=0), low, high


def side(estimate: Interval, reference: float) -> Literal["below", "above", "open"]:
    """On which side of a reference the whole interval lies; open: it holds the reference."""
    return "below" if estimate.high < reference else "above" if estimate.low > reference else "open"


def judged(*found: Interval) -> Literal["better", "worse", "comparable", "open"]:
    """What ratios of the same steps all say: less than 1 is better; comparable if every interval lies within MARGIN.

    Open, which is not comparable: one holds 1, or they lie on both sides of it, and one reaches beyond MARGIN.
    """
    where = {side(one, 1) for one in found}
    if len(where) == 1 and "open" not in where:
        return "better" if "below" in where else "worse"
    return "comparable" if all(one.low > 1 / MARGIN and one.high < MARGIN for one in found) else "open"


def ratio(
    numerator: ArrayLike, denominator: ArrayLike, rng: np.random.Generator, statistic: Callable[..., Any] = np.mean
) -> Interval:
    """A statistic of one over that of the other. Element i of both belongs to the same seed, and is drawn with it."""
    return _bootstrap(rng, lambda a, b, axis: statistic(a, axis=axis) / statistic(b, axis=axis), numerator, denominator)


def probability_of_improvement(ours: ArrayLike, theirs: ArrayLike, rng: np.random.Generator) -> Interval:
    """How probably ours is the lesser (steps: the better) of a pair that shares a seed, ties counting half."""
    return _bootstrap(rng, lambda a, b, axis: ((a < b) + (a == b) / 2).mean(axis=axis), ours, theirs)


def _bootstrap(rng: np.random.Generator, statistic: Callable[..., Any], *samples: ArrayLike) -> Interval:
    data = [np.asarray(sample, dtype=np.float64) for sample in samples]
    value = float(statistic(*data, axis=-1))
    if data[0].size < 2:
        return Interval(value, np.nan, np.nan)  # one run says nothing of how runs differ
    found = stats.bootstrap(data, statistic, n_resamples=RESAMPLES, method="percentile", paired=True, rng=rng)
    return Interval(value, float(found.confidence_interval.low), float(found.confidence_interval.high))
