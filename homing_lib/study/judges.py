"""The paper's claims, C1 to C17: a predicate for each, which its judge has for docstring.

Where a claim has a trivial reading and a strong one, both are judged. Each could come out either way.
"""

from typing import Any

import numpy as np

from homing_lib.settings import Settings
from homing_lib.study import measures, studies
from homing_lib.study.claims import (
    Judged,
    Verdict,
    at_best_step_size,
    at_walls,
    change_by_episode,
    claim,
    compare,
    early,
    first_good,
    interval_of,
    late,
    of_change,
    of_steps,
    percent,
    success,
)
from homing_lib.study.measures import WINDOW
from homing_lib.study.runs import episodes_of
from homing_lib.study.statistics import judged, ratio, side


@claim("C2", "a conjugate λ is better than fixed ones, or comparable", studies.LAMBDA, studies.LAMBDA_MAP)
def conjugate_lambda(of: Any, mapped: Any) -> Judged:
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


@claim("C3", "learning converges within 20 episodes", studies.REFERENCES, studies.LONG)
def within_twenty_episodes(references: Any, long: Any) -> Judged:
    """The last episodes of 20 take fewer steps than the first, and 180 more save less than a fifth of them."""
    of_first = compare(late(references, "learnt"), early(references, "learnt"))
    of_twenty = compare(episodes_of(long, "form 2")[:, -20:].mean(axis=1), late(references, "learnt"))
    done = min(found.low for found in of_twenty) > 0.8
    return (
        "not reproduced" if of_first.side != "below" else "reproduced" if done else "partly reproduced",
        f"On the atlas, the last {WINDOW} of 20 episodes take {of_first:.2f} of the steps of the first {WINDOW}, and "
        f"the last 20 of 200 take {of_twenty:.2f} of those.",
    )


@claim("C8", "after learning, home is reached from almost anywhere", studies.AFTER, studies.REFERENCES)
def from_almost_anywhere(trials: Any, references: Any) -> Judged:
    """At least 95 % of the trials reach home, with all of the interval; partly: more than half of them."""
    placed = trials[(trials.kidnapped == 0) & (trials.light == 1) & (trials.condition == "20 episodes")]
    found = success(placed)
    worst = placed.groupby(["x", "y"]).reached.mean().min()
    by_chance = interval_of((episodes_of(references, "random") <= measures.TRIAL_STEPS).mean(axis=1))
    return (
        "reproduced" if found.low >= 0.95 else "partly reproduced" if found.low > 0.5 else "not reproduced",
        f"After 20 episodes {percent(found)} % of the trials reach home within {measures.TRIAL_STEPS} steps, from the "
        f"worst place {worst:.0%}; random actions, from the usual start alone, which is a hard one, "
        f"{percent(by_chance)} %.",
    )


@claim("C9", "a kidnapped robot recovers at once", studies.AFTER)
def kidnapped(trials: Any) -> Judged:
    """Carried away, at most five points fewer reach home than of those that start at such places."""
    trained = trials[(trials.light == 1) & (trials.condition == "20 episodes")]
    carried, begun = (trained[trained.kidnapped == so].groupby("seed").reached.mean() for so in (1, 0))
    found = interval_of((carried - begun).to_numpy(float))
    return (
        "reproduced" if found.low > -0.05 else "not reproduced" if found.high < -0.05 else "not shown",
        f"The share that reaches home differs by {percent(found, '+')} percentage points from that of robots which "
        "start at such places. It follows from the model: there is no memory that a kidnapper could confuse.",
    )


@claim("C10", "a policy that explores less and less converges", studies.PARTS)
def less_and_less_exploration(parts: Any) -> Judged:
    """The last episodes take fewer steps than the first."""
    falls = compare(late(parts, "default"), early(parts, "default"))
    constant = of_steps(parts, "constant exploration and step size", "default")
    return (
        "reproduced" if falls.side == "below" else "not reproduced",
        f"The last {WINDOW} episodes take {falls:.2f} of the steps of the first. Whether the decrease helps is "
        f"another matter: with exploration and step size held constant they take {constant:.2f} of the default's "
        f"({constant.word}).",
    )


@claim("C11", "the parameter change falls exponentially", studies.LAMBDA)
def exponential_change(of: Any) -> Judged:
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


@claim("C12", "a wall penalty, with learning at walls, reduces wall following", studies.PARTS)
def wall_penalty(parts: Any) -> Judged:
    """Without the penalty, and without learning at walls, more of the steps are spent there; partly: without one."""
    labels = ("no wall penalty", "no learning at walls", "wall penalty 5")
    more = {label: interval_of(at_walls(parts, label) - at_walls(parts, "default")) for label in labels}
    steps = {label: of_steps(parts, label, "default") for label in labels}
    helps = [side(more[label], 0) == "above" for label in labels[:2]]
    return (
        "reproduced" if all(helps) else "partly reproduced" if any(helps) else "not shown",
        f"The share of the steps at walls changes by {more[labels[0]]:+.1f} percentage points without the penalty, and "
        f"by {more[labels[1]]:+.1f} without learning there (and so without the penalty, which is not learnt from). "
        f"A penalty of 5 in place of {Settings().wall_penalty:g} changes it by {more[labels[2]]:+.1f}, and an episode "
        f"takes {steps[labels[2]]:.2f} of the steps.",
    )


@claim("C13", "good episodes begin around the ninth", studies.LAMBDA)
def around_the_ninth(of: Any) -> Judged:
    """The interval of the first good episode (`first_good`) holds 9."""
    steps, good = episodes_of(of, "form 2"), first_good(of)
    typical = np.median(steps[:, -WINDOW:])
    relapses = (steps[:, int(good.value) :] > 3 * typical).mean()
    return (
        "reproduced" if good.low <= 9 <= good.high else "not reproduced",
        f"The first good one is episode {good:.0f}; of those after it {relapses:.0%} take more than three times the "
        f"median of the last, {typical:.0f} steps.",
    )


@claim("C14", "one snapshot does better than three", studies.PARTS)
def one_snapshot(parts: Any) -> Judged:
    """With three, an episode takes more steps."""
    also = " (Similarity is then the mean of three comparisons: what passes for home changes too.)"
    return _worse_with(parts, "three snapshots", f"With three, {Settings().snapshot_angle_deg:g} degrees apart,", also)


@claim("C16", "a cost of 1/t helps against a constant one", studies.PARTS)
def falling_cost(parts: Any) -> Judged:
    """With a constant cost, an episode takes more steps."""
    return _worse_with(parts, "constant cost", "With a constant cost (the mean of 1/t over 100 steps)")


@claim("C17", "tens of episodes suffice where the earlier model took hundreds", studies.LAMBDA, studies.PARTS)
def tens_of_episodes(of: Any, parts: Any) -> Judged:
    """Not to be judged without the earlier model; not reproduced if nothing is learnt in 20 episodes."""
    learnt = compare(late(parts, "default"), early(parts, "default")).side == "below"
    return (
        "not testable here" if learnt else "not reproduced",
        "The earlier model is not rebuilt, so the comparison cannot be made here. What can be seen is how soon this "
        f"one comes within one and a half times its last episodes: by episode {first_good(of):.0f}.",
    )


def _worse_with(parts: Any, condition: str, how: str, also: str = "") -> Judged:
    """Reproduced if an episode takes more steps with a part changed or taken away."""
    found = of_steps(parts, condition, "default")
    verdicts: dict[str, Verdict] = {"above": "reproduced", "below": "not reproduced", "open": "not shown"}
    return verdicts[found.side], f"{how} an episode takes {found:.2f} of the steps.{also}"
