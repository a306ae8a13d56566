"""The paper's claims, C2 to C17, judged by the stored studies: a predicate for each, an effect with its 95 % interval.

A judge takes the tables of its studies and returns a verdict and the effect that it rests on; its docstring is the
predicate. Steps are compared over the last WINDOW episodes, seed by seed, and an episode that a diverged run did not
reach counts as the step cap (`runs.episodes_of`). A few robots get lost, and one of them moves a mean more than
all others: every comparison of steps is therefore made twice (`Comparison`), and open unless both say the same.
"""

from collections.abc import Callable, Iterable
from functools import cache
from typing import Any, Literal, NamedTuple

import numpy as np

from homing_lib.features import Array
from homing_lib.settings import Settings
from homing_lib.study import measures, studies
from homing_lib.study.measures import WINDOW
from homing_lib.study.runs import Study, episodes_of, load_table
from homing_lib.study.statistics import Interval, interval, iqm, judged, ratio, side

Verdict = Literal["reproduced", "partly reproduced", "not reproduced", "not shown", "not testable here"]

_Judged = tuple[Verdict, str]
_Judge = Callable[..., _Judged]


class Claim(NamedTuple):
    """What the paper says, in short; what judges it; the studies whose tables that takes."""

    text: str
    judge: _Judge
    studies: tuple[Study, ...]


CLAIMS: dict[int, Claim] = {}
"""By their numbers, filled by `claim`; Altahhan (2014) spreads them over the abstract and sections IV and V."""


def claim(number: int, text: str, *needed: Study) -> Callable[[_Judge], _Judge]:
    """Stands above a judge: the claim, and the studies whose tables it takes."""

    def judged_by(judge: _Judge) -> _Judge:
        CLAIMS[number] = Claim(text, judge, needed)
        return judge

    return judged_by


class Finding(NamedTuple):
    """What was found about a claim. str() is a paragraph in Markdown."""

    number: int
    verdict: Verdict
    effect: str

    @property
    def claim(self) -> str:
        """What the paper says, in short."""
        return CLAIMS[self.number].text

    def __str__(self) -> str:
        return f"**Claim C{self.number}**, {self.claim}: **{self.verdict}**. {self.effect}"


@cache
def judge(number: int) -> Finding:
    """The verdict on claim C2, C3, ... from the stored tables. Raises UserError, in one line, if they are not sound."""
    _, judge_of, needed = CLAIMS[number]
    return Finding(number, *judge_of(*map(load_table, needed)))


def table(numbers: Iterable[int] = CLAIMS) -> str:
    """Verdicts as a table in Markdown."""
    rows = [f"| C{one.number} | {one.claim} | **{one.verdict}** | {one.effect} |" for one in map(judge, numbers)]
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


def compare(ours: Array, theirs: Array) -> Comparison:
    """One number per run, the same seeds in order."""
    rng = np.random.default_rng(0)
    return Comparison(*(ratio(ours, theirs, rng, statistic) for statistic in (iqm, np.mean)))


def of_steps(of: Any, ours: str, theirs: str) -> Comparison:
    """Late steps of one condition as a multiple of another's."""
    return compare(late(of, ours), late(of, theirs))


def of_change(of: Any, ours: str, theirs: str) -> Interval:
    """The same of a run's parameter change, as a geometric mean: zero where theirs is unbounded."""
    our, their = (episodes_of(of, condition, "change").sum(axis=1) for condition in (ours, theirs))
    if not np.isfinite(their).all():
        return Interval(0.0, 0.0, 0.0)
    return Interval(*np.exp(_interval(np.log(our / their))))


def at_best_step_size(mapped: Any) -> dict[str, Array]:
    """Late steps of each rule at that of its step sizes at which they are least. mapped: of `LAMBDA_MAP`."""
    tried = {rule: [late(mapped, f"{rule} @ {alpha:g}") for alpha in studies.STEP_SIZES] for rule in studies.RULES}
    return {rule: min(several, key=np.mean) for rule, several in tried.items()}


def first_good(of: Any, condition: str = "form 2") -> Interval:
    """The first episode whose mean steps are at most one and a half times those of the last; runs are resampled."""
    steps, rng = episodes_of(of, condition), np.random.default_rng(0)

    def first(runs: Array) -> int:
        mean = runs.mean(axis=0)
        return 1 + int(np.argmax(mean <= 1.5 * mean[-WINDOW:].mean()))

    again = [first(steps[rng.integers(len(steps), size=len(steps))]) for _ in range(2000)]
    return Interval(first(steps), *np.percentile(again, (2.5, 97.5)))


def success(trials: Any) -> Interval:
    """Share of the trials that reach home, over robots. trials: rows of `AFTER`."""
    return _interval(trials.groupby("seed").reached.mean().to_numpy(float))


def at_walls(of: Any, condition: str) -> Array:
    """Per cent of the steps spent at walls, one number per run."""
    steps, share = episodes_of(of, condition), np.nan_to_num(episodes_of(of, condition, "at_wall"))
    return 100 * (share * steps).sum(axis=1) / steps.sum(axis=1)


def change_by_episode(of: Any, settings: Settings) -> dict[str, Array]:
    """Form 2's parameter change, shape (runs, episodes): of an episode, per step, and per step by the step size."""
    change, steps = episodes_of(of, "form 2", "change"), episodes_of(of, "form 2")
    return {
        "a whole episode": change,
        "a step": change / steps,
        "a step, by the step size": change / steps / (settings.alpha0 * settings.step_size_rates),
    }


# --- Judges ----------------------------------------------------------------------------------------------------------


@claim(2, "a conjugate λ is better than fixed ones, or comparable", studies.LAMBDA, studies.LAMBDA_MAP)
def conjugate_lambda(of: Any, mapped: Any) -> _Judged:
    """Better than every fixed λ or comparable: in steps, in parameter change, and with each at its best step size.

    Partly: than more than half of them, in each.
    """
    fixed = [rule for rule in studies.RULES if rule.startswith("fixed")]
    best_of = at_best_step_size(mapped)
    found: dict[str, list[str]] = {
        "steps": [of_steps(of, "form 2", rule).word for rule in fixed],
        "parameter change": [judged(of_change(of, "form 2", rule)) for rule in fixed],
        "steps, each at its best step size": [compare(best_of["form 2"], best_of[rule]).word for rule in fixed],
    }
    counts = {name: sum(word in ("better", "comparable") for word in words) for name, words in found.items()}
    best = min(fixed, key=lambda rule: late(of, rule).mean())
    told = "; ".join(f"{name}: {count}" for name, count in counts.items())
    change = of_change(of, "form 2", best)
    least = min(counts.values())
    return (
        "reproduced" if least == len(fixed) else "partly reproduced" if least > len(fixed) / 2 else "not reproduced",
        f"Better or comparable, of {len(fixed)} fixed values: {told}. Against the fixed one of the least mean, {best}, "
        f"at the default step size: {of_steps(of, 'form 2', best):.2f} of its steps, {change:.2f} of its change.",
    )


@claim(3, "learning converges within 20 episodes", studies.REFERENCES, studies.LONG)
def within_twenty_episodes(references: Any, long: Any) -> _Judged:
    """The last episodes of 20 take fewer steps than the first, and 180 more save less than a fifth of them."""
    of_first = compare(late(references, "learnt"), early(references, "learnt"))
    of_twenty = compare(episodes_of(long, "form 2")[:, -20:].mean(axis=1), late(references, "learnt"))
    done = min(found.low for found in of_twenty) > 0.8
    return (
        "not reproduced" if of_first.side != "below" else "reproduced" if done else "partly reproduced",
        f"On the atlas, the last {WINDOW} of 20 episodes take {of_first:.2f} of the steps of the first {WINDOW}, and "
        f"the last 20 of 200 take {of_twenty:.2f} of those.",
    )


@claim(8, "after learning, home is reached from almost anywhere", studies.AFTER, studies.REFERENCES)
def from_almost_anywhere(trials: Any, references: Any) -> _Judged:
    """At least 95 % of the trials reach home, with all of the interval; partly: more than half of them."""
    placed = trials[(trials.kidnapped == 0) & (trials.light == 1) & (trials.condition == "20 episodes")]
    found = success(placed)
    worst = placed.groupby(["x", "y"]).reached.mean().min()
    by_chance = _interval((episodes_of(references, "random") <= measures.TRIAL_STEPS).mean(axis=1))
    return (
        "reproduced" if found.low >= 0.95 else "partly reproduced" if found.low > 0.5 else "not reproduced",
        f"After 20 episodes {_percent(found)} % of the trials reach home within {measures.TRIAL_STEPS} steps, from the "
        f"worst place {worst:.0%}; random actions, from the usual start alone, which is a hard one, "
        f"{_percent(by_chance)} %.",
    )


@claim(9, "a kidnapped robot recovers at once", studies.AFTER)
def kidnapped(trials: Any) -> _Judged:
    """Carried away, at most five points fewer reach home than of those that start at such places."""
    trained = trials[(trials.light == 1) & (trials.condition == "20 episodes")]
    carried, begun = (trained[trained.kidnapped == so].groupby("seed").reached.mean() for so in (1, 0))
    found = _interval((carried - begun).to_numpy(float))
    return (
        "reproduced" if found.low > -0.05 else "not reproduced" if found.high < -0.05 else "not shown",
        f"The share that reaches home differs by {_percent(found, '+')} percentage points from that of robots which "
        "start at such places. It follows from the model: there is no memory that a kidnapper could confuse.",
    )


@claim(10, "a policy that explores less and less converges", studies.PARTS)
def less_and_less_exploration(parts: Any) -> _Judged:
    """The last episodes take fewer steps than the first."""
    falls = compare(late(parts, "default"), early(parts, "default"))
    constant = of_steps(parts, "constant exploration and step size", "default")
    return (
        "reproduced" if falls.side == "below" else "not reproduced",
        f"The last {WINDOW} episodes take {falls:.2f} of the steps of the first. Whether the decrease helps is "
        f"another matter: with exploration and step size held constant they take {constant:.2f} of the default's "
        f"({constant.word}).",
    )


@claim(11, "the parameter change falls exponentially", studies.LAMBDA)
def exponential_change(of: Any) -> _Judged:
    """It falls, also by step and step size, and its logarithm is straighter in the episode than in log(ep_0 + ep)."""
    settings = Settings()
    changes = list(change_by_episode(of, settings).values())
    rng = np.random.default_rng(0)
    falls = [ratio(one[:, -WINDOW:].mean(1), one[:, :WINDOW].mean(1), rng) for one in changes]
    fell = [side(fall, 1) == "below" for fall in falls]
    number, logarithm = np.arange(1, settings.episodes + 1), np.log(changes[0].mean(axis=0))
    exponential = np.corrcoef(logarithm, number)[0, 1] ** 2
    hyperbolic = np.corrcoef(logarithm, np.log(settings.first_episode + number))[0, 1] ** 2
    return (
        "reproduced" if exponential > hyperbolic and fell[2] else "partly reproduced" if fell[0] else "not reproduced",
        f"From the first {WINDOW} episodes to the last it falls to {falls[0]:.2f}; per step, to {falls[1]:.2f}; per "
        f"step and divided by the step size, so that neither shorter episodes nor the decay count, to {falls[2]:.2f}. "
        f"A straight line accounts for {exponential:.0%} of the variance of its logarithm against the episode "
        f"(exponential) and {hyperbolic:.0%} against the logarithm of ep_0 + episode (hyperbolic, as the step size).",
    )


@claim(12, "a wall penalty, with learning at walls, reduces wall following", studies.PARTS)
def wall_penalty(parts: Any) -> _Judged:
    """Without the penalty, and without learning at walls, more of the steps are spent there; partly: without one."""
    labels = ("no wall penalty", "no learning at walls", "wall penalty 5")
    more = {label: _interval(at_walls(parts, label) - at_walls(parts, "default")) for label in labels}
    steps = {label: of_steps(parts, label, "default") for label in labels}
    helps = [side(more[label], 0) == "above" for label in labels[:2]]
    return (
        "reproduced" if all(helps) else "partly reproduced" if any(helps) else "not shown",
        f"The share of the steps at walls changes by {more[labels[0]]:+.1f} percentage points without the penalty, and "
        f"by {more[labels[1]]:+.1f} without learning there (and so without the penalty, which is not learnt from). "
        f"A penalty of 5 in place of {Settings().wall_penalty:g} changes it by {more[labels[2]]:+.1f}, and an episode "
        f"takes {steps[labels[2]]:.2f} of the steps.",
    )


@claim(13, "good episodes begin around the ninth", studies.LAMBDA)
def around_the_ninth(of: Any) -> _Judged:
    """The interval of the first good episode (`first_good`) holds 9."""
    steps, good = episodes_of(of, "form 2"), first_good(of)
    typical = np.median(steps[:, -WINDOW:])
    relapses = (steps[:, int(good.value) :] > 3 * typical).mean()
    return (
        "reproduced" if good.low <= 9 <= good.high else "not reproduced",
        f"The first good one is episode {good:.0f}; of those after it {relapses:.0%} take more than three times the "
        f"median of the last, {typical:.0f} steps.",
    )


@claim(14, "one snapshot does better than three", studies.PARTS)
def one_snapshot(parts: Any) -> _Judged:
    """With three, an episode takes more steps."""
    also = " (Similarity is then the mean of three comparisons: what passes for home changes too.)"
    return _worse_with(parts, "three snapshots", f"With three, {Settings().snapshot_angle_deg:g} degrees apart,", also)


@claim(16, "a cost of 1/t helps against a constant one", studies.PARTS)
def falling_cost(parts: Any) -> _Judged:
    """With a constant cost, an episode takes more steps."""
    return _worse_with(parts, "constant cost", "With a constant cost (the mean of 1/t over 100 steps)")


@claim(17, "tens of episodes suffice where the earlier model took hundreds", studies.LAMBDA, studies.PARTS)
def tens_of_episodes(of: Any, parts: Any) -> _Judged:
    """Not to be judged without the earlier model; not reproduced if nothing is learnt in 20 episodes."""
    learnt = compare(late(parts, "default"), early(parts, "default")).side == "below"
    return (
        "not testable here" if learnt else "not reproduced",
        "The earlier model is not rebuilt, so the comparison cannot be made here. What can be seen is how soon this "
        f"one comes within one and a half times its last episodes: by episode {first_good(of):.0f}.",
    )


def _interval(values: Array) -> Interval:
    return interval(values, np.random.default_rng(0))


def _percent(share: Interval, sign: str = "") -> str:
    return format(Interval(*(100 * end for end in share)), f"{sign}.1f")


def _worse_with(parts: Any, condition: str, how: str, also: str = "") -> _Judged:
    """Reproduced if an episode takes more steps with a part changed or taken away."""
    found = of_steps(parts, condition, "default")
    verdicts: dict[str, Verdict] = {"above": "reproduced", "below": "not reproduced", "open": "not shown"}
    return verdicts[found.side], f"{how} an episode takes {found:.2f} of the steps.{also}"
