"""What may be said about few runs: means, interquartile means and comparisons, each with a bootstrap interval.

The run is the unit: its episodes depend on each other, its seed on nothing. Intervals are 95 % percentile intervals
of `scipy.stats.bootstrap`, which resamples runs. With five runs they are rough, and rather too narrow than too wide.
Where one question makes several comparisons, `family` says how many, and each interval is that of 1 - .05/family
(Bonferroni): with 95 % certainty all of them hold at once, whatever they have in common.
"""

from collections.abc import Callable, Sequence
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from homing_lib.features import Array

RESAMPLES = 9999

FEWER_RESAMPLES = 2000  # where each of them is dear

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


def interval(
    values: ArrayLike, rng: np.random.Generator, statistic: Callable[..., Any] = np.mean, family: int = 1
) -> Interval:
    """A statistic of numbers, one per run. statistic: takes `axis`, such as `np.mean` or `iqm`."""
    return _bootstrap(rng, statistic, values, family=family)


def over_runs(estimate: Callable[[Any], float], runs: int, rng: np.random.Generator, family: int = 1) -> Interval:
    """Of what must be estimated from several runs at once; they are resampled. estimate: takes the places of the runs
    that are drawn, some more than once, shape (runs,).
    """
    again = [estimate(rng.integers(runs, size=runs)) for _ in range(FEWER_RESAMPLES)]
    return Interval(estimate(np.arange(runs)), *np.percentile(again, (2.5 / family, 100 - 2.5 / family)))


def band(table: Array, rng: np.random.Generator) -> tuple[Array, Array, Array]:
    """Mean of each column and the ends of its 95 % interval; whole rows, the runs, are resampled."""
    weights = rng.multinomial(len(table), np.full(len(table), 1 / len(table)), size=RESAMPLES) / len(table)
    low, high = np.percentile(weights @ table, (2.5, 97.5), axis=0)
    return table.mean(axis=0), low, high


def side(estimate: Interval, reference: float) -> Literal["below", "above", "open"]:
    """On which side of a reference the whole interval lies; open: it holds the reference."""
    return "below" if estimate.high < reference else "above" if estimate.low > reference else "open"


KNIFE_EDGE = 0.02


def knife_edge(*found: Interval, margins: Sequence[float] = (1.0,)) -> str:
    """Where an interval ends within 2 % of a margin that its verdict hangs on: a remark that says so, else nothing.

    A few more runs could move such an end to the other side. margins: none of them 0.
    """
    ends = [end for one in found if one.low < one.high for end in (one.low, one.high)]  # without chance, no edge
    near = [margin for margin in margins if any(abs(end / margin - 1) < KNIFE_EDGE for end in ends)]
    return f" (a knife edge at {' and '.join(f'{m:g}' for m in near)})" if near else ""


def judged(*found: Interval) -> Literal["better", "worse", "comparable", "open"]:
    """What ratios of the same steps all say: less than 1 is better; comparable if every interval lies within MARGIN.

    Open, which is not comparable: one holds 1, or they lie on both sides of it, and one reaches beyond MARGIN.
    """
    where = {side(one, 1) for one in found}
    if len(where) == 1 and "open" not in where:
        return "better" if "below" in where else "worse"
    return "comparable" if all(one.low > 1 / MARGIN and one.high < MARGIN for one in found) else "open"


def ratio(
    numerator: ArrayLike,
    denominator: ArrayLike,
    rng: np.random.Generator,
    statistic: Callable[..., Any] = np.mean,
    family: int = 1,
) -> Interval:
    """A statistic of one over that of the other. Element i of both belongs to the same seed, and is drawn with it."""

    def quotient(a: Array, b: Array, axis: int) -> Any:
        return statistic(a, axis=axis) / statistic(b, axis=axis)

    return _bootstrap(rng, quotient, numerator, denominator, family=family)


def ratio_at_best(
    ours: ArrayLike,
    theirs: ArrayLike,
    rng: np.random.Generator,
    statistic: Callable[..., Any] = np.mean,
    family: int = 1,
    chosen_by: Sequence[ArrayLike] = (),
) -> Interval:
    """The same where each side may choose, a step size for instance: its least row over that of the other.

    ours, theirs: shapes (k, runs) and (l, runs), a row per choice, column i of both of the same seed. chosen_by: two
    further arrays of these shapes, whose least rows are chosen instead: who is best by one number is compared by
    another.

    Whoever chooses and judges by the same runs counts luck as merit, and the more so the more rows there are. Here
    every other run is judged at the row that the rest would choose, and the other way round; each replicate resamples
    both halves and chooses anew. Where all of 3 and of 21 rows are alike, the interval holds 1 in more than 95 of 100
    studies of 50 runs; if the chosen rows were resampled by the runs that chose them, in 75.
    """
    found = _at_best(ours, theirs, rng, statistic, RESAMPLES, chosen_by)
    return Interval(float(found[0]), *np.percentile(found[1:], (2.5 / family, 100 - 2.5 / family)))


def pooled_at_best(
    pairs: Sequence[tuple[ArrayLike, ArrayLike]], rng: np.random.Generator, statistic: Callable[..., Any] = np.mean
) -> Interval:
    """Geometric mean of such ratios of several pairs, a room each for instance; runs are resampled, rooms are not: the
    interval tells of other runs in the same rooms, not of other rooms.
    """
    logs = np.mean([np.log(_at_best(*pair, rng, statistic, FEWER_RESAMPLES)) for pair in pairs], axis=0)
    return Interval(*np.exp([logs[0], *np.percentile(logs[1:], (2.5, 97.5))]))


def _at_best(
    ours: ArrayLike,
    theirs: ArrayLike,
    rng: np.random.Generator,
    statistic: Callable[..., Any],
    resamples: int,
    chosen_by: Sequence[ArrayLike] = (),
) -> Array:
    """The ratio that is found, and then that of each replicate."""
    both, by = (
        [np.asarray(rows, dtype=np.float64) for rows in of] for of in ((ours, theirs), chosen_by or (ours, theirs))
    )
    runs = np.arange(both[0].shape[1])

    def quotient(halves: Sequence[Any]) -> Array:
        our, their = (
            statistic(_chosen_by_others(*pair, halves, statistic), axis=1) for pair in zip(both, by, strict=True)
        )
        return np.asarray(our / their)

    again = [half[rng.integers(len(half), size=(resamples, len(half)))] for half in (runs[::2], runs[1::2])]
    return np.r_[quotient([runs[None, ::2], runs[None, 1::2]]), quotient(again)]


def _chosen_by_others(rows: Array, by: Array, halves: Sequence[Any], statistic: Callable[..., Any]) -> Array:
    """Shape (replicates, runs): each half of the runs, from the row that is least in the other half, of `by`."""
    least = [np.argmin([statistic(row[half], axis=1) for row in by], axis=0)[:, None] for half in halves]
    return np.hstack([rows[least[1], halves[0]], rows[least[0], halves[1]]])


def _bootstrap(
    rng: np.random.Generator, statistic: Callable[..., Any], *samples: ArrayLike, family: int = 1
) -> Interval:
    data = [np.asarray(sample, dtype=np.float64) for sample in samples]
    value = float(statistic(*data, axis=-1))
    if data[0].size < 2:
        return Interval(value, np.nan, np.nan)  # one run says nothing of how runs differ
    found = stats.bootstrap(
        data,
        statistic,
        n_resamples=RESAMPLES,
        confidence_level=1 - 0.05 / family,
        method="percentile",
        paired=True,
        rng=rng,
    )
    return Interval(value, float(found.confidence_interval.low), float(found.confidence_interval.high))
