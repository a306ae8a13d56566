"""Claims of the paper, and questions beyond it, judged by the stored studies: how a verdict is made, told and found.

A judge takes the tables of its studies and returns a verdict and the effect that it rests on, with its 95 % interval;
its docstring is the predicate, in which {NAME} stands for a constant of its module. Judges stand beside their studies,
those of the paper's claims in `judges.py`. What all of them have in common is told by `HOW`. A few robots get lost, and
one of them moves a mean more than all others: every comparison of steps is therefore made twice (`Comparison`).
"""

import pkgutil
from collections.abc import Callable, Iterable
from functools import cache
from importlib import import_module
from typing import Any, Literal, NamedTuple

import numpy as np

import homing_lib.study
from homing_lib.features import Array
from homing_lib.settings import Settings
from homing_lib.study.measures import WINDOW
from homing_lib.study.runs import Study, episodes_of, load_table
from homing_lib.study.statistics import (
    FEWER_RESAMPLES,
    MARGIN,
    RESAMPLES,
    Interval,
    interval,
    iqm,
    judged,
    over_runs,
    ratio,
    ratio_at_best,
    side,
)

Verdict = Literal[
    "reproduced",
    "partly reproduced",
    "not reproduced",
    "not shown",
    "not testable here",
    "yes",
    "partly",
    "no",
]
"""Of a claim, the first five; of a question "yes", "partly", "no" or "not shown"."""

HOW = f"""**How it is judged.** Late steps, or those of the last episodes, are a run's mean of its last {WINDOW}, those
of the first episodes of its first {WINDOW}; an episode that a diverged run did not reach counts as the step cap, and a
trial of such a run as one that does not come home. A share is each robot's own, averaged over robots. What is compared
is compared twice, as the ratio of interquartile means (IQM: of n runs, n / 4, rounded down, are left out at each end)
and as that of means. Better or worse: the intervals of both lie on that side of 1; else comparable: both lie between
1/{MARGIN:g} and {MARGIN:g}; else open. Intervals are 95 % percentile intervals of {RESAMPLES} bootstrap samples
({FEWER_RESAMPLES} for episodes, degrees, straight lines and pooled ratios), in which a seed brings all of its runs.
Where a predicate names a k, as many comparisons are made together and each interval is that of 1 - .05/k; else it is
not widened. What must exceed a bound, or fall short of it, must do so with its whole interval. Who may choose a step
size or a fixed λ chooses by halves: the runs at the even and at the odd places of the list of seeds. The choice with
the fewest steps in one half (by the IQM or by the mean, as it is judged) is judged in the other, both ways, and the
runs of both are put together; each bootstrap sample draws anew within the halves, and chooses anew. A claim is
reproduced if its weak and its strong sense hold, partly if the weak one does and the strong one does not or is open,
not reproduced if the weak one does not hold, and not shown if that is open. Whether form 2 is better than several
others: yes, than each; partly, than some; no, than none, and comparable or worse each time; not shown, if none of
these. Where a predicate has a rule of its own, that one counts."""

Judged = tuple[Verdict, str]
"""What a judge returns: the verdict, and the effect in words."""

_Judge = Callable[..., Judged]


class Claim(NamedTuple):
    """What the paper says, or what is asked, in short; what judges it; the studies whose tables that takes."""

    text: str
    judge: _Judge
    studies: tuple[Study, ...]

    @property
    def predicate(self) -> str:
        """The docstring of the judge, and where its numbers come from."""
        tables = ", ".join(f"{one.name} (seeds {min(one.seeds)}-{max(one.seeds)})" for one in self.studies)
        return " ".join(f"{self.judge.__doc__}{f' Tables: {tables}.' * bool(tables)}".split())


CLAIMS: dict[str, Claim] = {}
"""By name, filled by `claim`: "C1" to "C17" of the paper, which spreads them over its abstract and sections IV and V,
and "Q1", "Q2", ... for what is asked beyond it."""


def claim(name: str, text: str, *needed: Study) -> Callable[[_Judge], _Judge]:
    """Stands above a judge: the claim or question, and the studies whose tables it takes."""

    def judged_by(judge: _Judge) -> _Judge:
        if CLAIMS.get(name):
            raise ValueError(f"{name} is judged already, by {CLAIMS[name].judge.__name__}")
        judge.__doc__ = (judge.__doc__ or "").format_map(judge.__globals__)
        CLAIMS[name] = Claim(text, judge, needed)
        return judge

    return judged_by


def names(kind: str = "CQ") -> list[str]:
    """Names of all claims, "C", and all questions, "Q", by their numbers, in whichever module their judges stand."""
    for module in pkgutil.iter_modules(homing_lib.study.__path__):
        import_module(f"homing_lib.study.{module.name}")
    return sorted((name for name in CLAIMS if name[0] in kind), key=lambda name: (name[0], int(name[1:])))


def counted(words: Iterable[str], wanted: str, *otherwise: str) -> Verdict:
    """Of what was found in several comparisons: yes if all are as wanted, partly if some are, no if none is and all are
    otherwise; else not shown.
    """
    found = set(words)
    if wanted in found:
        return "yes" if found == {wanted} else "partly"
    return "no" if found <= {*otherwise} else "not shown"


class Finding(NamedTuple):
    """What was found about a claim or a question. str() is a paragraph in Markdown, and one of the predicate."""

    name: str
    verdict: Verdict
    effect: str

    @property
    def claim(self) -> str:
        """What the paper says, or what is asked, in short."""
        return CLAIMS[self.name].text

    def __str__(self) -> str:
        kind = "Claim" if self.name.startswith("C") else "Question"
        told = f"**{kind} {self.name}**, {self.claim}: **{self.verdict}**. {self.effect}"
        return f"{told}\n\n> *Predicate*: {CLAIMS[self.name].predicate}"


@cache
def judge(name: str) -> Finding:
    """The verdict on "C1", "Q1", ... from the stored tables. Raises UserError, in one line, if they are not sound."""
    if name not in CLAIMS:
        names()
    _, judge_of, needed = CLAIMS[name]
    return Finding(name, *judge_of(*map(load_table, needed)))


def table(which: Iterable[str]) -> str:
    """Verdicts as a table in Markdown. which: their names."""
    rows = [f"| {one.name} | {one.claim} | **{one.verdict}** | {one.effect} |" for one in map(judge, which)]
    return "\n".join(["| | claim | verdict | effect |", "|---|---|---|---|", *rows])


# --- What is compared ------------------------------------------------------------------------------------------------


def early(of: Any, condition: str) -> Array:
    """Mean steps of the first WINDOW episodes, one number per run. of: the table of a study."""
    return episodes_of(of, condition)[:, :WINDOW].mean(axis=1)


def late(of: Any, condition: str) -> Array:
    """Mean steps of the last WINDOW episodes, one number per run. of: the table of a study."""
    return episodes_of(of, condition)[:, -WINDOW:].mean(axis=1)


def lost(of: Any, condition: str) -> int:
    """How many runs diverged."""
    return int((episodes_of(of, condition, "diverged") > 0).any(axis=1).sum())


class Comparison(NamedTuple):
    """Steps as a multiple of others': of the interquartile means, which tell of the typical robot, and of the means.

    f"{comparison:.2f}" writes both.
    """

    typical: Interval
    mean: Interval

    @property
    def word(self) -> str:
        """What `statistics.judged` says of both together."""
        return judged(*self)

    @property
    def side(self) -> Literal["below", "above", "open"]:
        """On which side of 1 both lie with all of their intervals."""
        where = side(self.typical, 1)
        return where if where == side(self.mean, 1) else "open"

    def __format__(self, each: str) -> str:
        return f"{self.typical:{each}} (mean {self.mean:{each}})"


def compare(ours: Array, theirs: Array, family: int = 1) -> Comparison:
    """One number per run, the same seeds in order; family: how many comparisons its question makes."""
    rng = np.random.default_rng(0)
    return Comparison(*(ratio(ours, theirs, rng, statistic, family) for statistic in (iqm, np.mean)))


def compare_at_best(
    ours: Array, theirs: Array, family: int = 1, chosen_by: tuple[Array, Array] | None = None
) -> Comparison:
    """The same, each side at its best choice: shapes (k, runs) and (l, runs), a row per choice (`ratio_at_best`)."""
    rng = np.random.default_rng(0)
    return Comparison(*(ratio_at_best(ours, theirs, rng, one, family, chosen_by or ()) for one in (iqm, np.mean)))


def whether(*found: Comparison) -> Verdict:
    """Is it better than the others? Yes: than each; partly: than some; no: than none, and comparable or worse."""
    return counted([one.word for one in found], "better", "comparable", "worse")


def of_steps(of: Any, ours: str, theirs: str, family: int = 1) -> Comparison:
    """Late steps of one condition as a multiple of another's."""
    return compare(late(of, ours), late(of, theirs), family)


def first_good(of: Any, condition: str = "form 2") -> Interval:
    """The first episode whose mean steps are at most one and a half times those of the last; runs are resampled."""
    steps = episodes_of(of, condition)

    def first(runs: Array) -> int:
        mean = steps[runs].mean(axis=0)
        return 1 + int(np.argmax(mean <= 1.5 * mean[-WINDOW:].mean()))

    return over_runs(first, len(steps), np.random.default_rng(0))


def success(trials: Any) -> Interval:
    """Share of the trials that reach home, over robots. trials: rows of `AFTER`."""
    return interval_of(trials.groupby("seed").reached.mean().to_numpy(float))


def at_walls(of: Any, condition: str) -> Array:
    """Per cent of the steps spent at walls, one number per run: of the episodes that it made."""
    steps, share = episodes_of(of, condition), episodes_of(of, condition, "at_wall")
    return 100 * np.nansum(share * steps, axis=1) / (steps * ~np.isnan(share)).sum(axis=1)


def change_by_episode(of: Any, settings: Settings) -> dict[str, Array]:
    """Form 2's parameter change, shape (runs, episodes): of an episode, per step, and per step by the step size."""
    change, steps = episodes_of(of, "form 2", "change"), episodes_of(of, "form 2")
    return {
        "a whole episode": change,
        "a step": change / steps,
        "a step, by the step size": change / steps / (settings.alpha0 * settings.step_size_rates),
    }


def interval_of(values: Array, family: int = 1) -> Interval:
    """The mean of numbers, one per run; family: how many comparisons their question makes."""
    return interval(values, np.random.default_rng(0), family=family)


def percent(share: Interval, sign: str = "") -> str:
    """A share and its ends, written in per cent."""
    return format(Interval(*(100 * end for end in share)), f"{sign}.1f")
