"""What the reward does, what the paper's letter gives, and what the earlier model gave.

The frame for the reward is potential-based shaping (Ng, Harada and Russell, ICML 1999) and its twin, the initial value
(Wiewiora, JAIR 19, 2003): a value that begins at Phi(s) learns as one that begins at 0 and is paid, on top of the
reward, gamma Phi(s') - Phi(s). With theta_0 = 1 Phi is n NRB, some 200: the robot is told the way up the similarity
before its first step, in units beside which eq. (16) is small. Only at home is there a difference: masked, the last
such payment is -Phi, and takes back what was paid; bootstrapped, it is not taken back.
"""

from typing import Any

import numpy as np

from homing_lib.features import Array
from homing_lib.settings import Settings
from homing_lib.study.claims import Comparison, Judged, claim, compare, first_good
from homing_lib.study.claims import late as late_by_episode
from homing_lib.study.measures import episodes, summary
from homing_lib.study.runs import episodes_of
from homing_lib.study.statistics import MARGIN, Interval, knife_edge
from homing_lib.study.studies import FRESH, study
from homing_lib.thresholds import stopping_thresholds

_ATLAS = Settings(images="atlas")

# --- Reward and initial value ----------------------------------------------------------------------------------------

REWARDS: dict[str, dict[str, Any]] = {
    "as is": {},
    "zero": {"reward_scale": 0.0},
    "negated": {"reward_scale": -1.0},
    "constant": {"step_cost": "constant", "approach_reward": False},
}

WORTH = round(_ATLAS.n_features * stopping_thresholds(_ATLAS.multiplier).upper, 1)
"""n psi_upper: what the view that ends an episode is worth at theta_0 = 1, and so the bonus in place of a bootstrap."""

HOMES: dict[str, dict[str, Any]] = {
    "bootstrapped": {},
    "masked": {"bootstrap_terminal": False},
    "bonus": {"bootstrap_terminal": False, "terminal_bonus": WORTH},
}


def _of(reward: str, home: str, theta0: float = 1.0) -> Settings:
    return _ATLAS.with_changes(theta0=theta0, **REWARDS[reward], **HOMES[home])


REWARD = study(
    "reward",
    "Does the reward matter while theta_0 = 1 makes the similarity the first value? As it is, none, turned round, and "
    "a constant cost without a part for approach; home bootstrapped, or masked with a bonus of what it was worth.",
    {f"{reward}, {home}": _of(reward, home) for reward in REWARDS for home in ("bootstrapped", "bonus")}
    | {"as is, masked": _of("as is", "masked")},
    FRESH,
    summary,
)

INITIAL = study(
    "initial",
    "The same with theta_0 = 0 and .1, and with home masked: what learns without the similarity as its first value? "
    "Ten robots, since those that do not learn drive far and differ much.",
    {
        f"{reward}, {home}, theta_0 {theta0:g}": _of(reward, home, theta0)
        for theta0 in (0.0, 0.1, 1.0)
        for reward in REWARDS
        for home in HOMES
        if theta0 < 1 or (home == "masked" and reward != "as is")
    },
    FRESH[:10],
    summary,
)

REWARD_LONG = study(
    "reward-long",
    "Are 200 episodes enough for the reward to matter, or for theta_0 = 0 to catch up? (Only with a bonus: where home "
    "is bootstrapped it drives so far that ten robots would take minutes.)",
    {
        label: settings.with_changes(episodes=200)
        for label, settings in {
            **{f"{reward}, bootstrapped": _of(reward, "bootstrapped") for reward in REWARDS},
            "as is, bonus": _of("as is", "bonus"),
            "as is, masked": _of("as is", "masked"),
            "as is, bonus, theta_0 0": _of("as is", "bonus", 0.0),
        }.items()
    },
    FRESH[:10],
    summary,
)

BANDS = (1.0, 6.0, 9.0)  # psi_lower .904 as printed, .870, .816; psi_upper stays, and with it home

LENGTHS = (20, 200)

BAND = study(
    "band",
    "Does the robot loiter between psi_lower and psi_upper, where eq. (16) pays some .9 a step and gamma = 1 forgets "
    "nothing (E21)? With the printed band and wider ones, each with and without the payment.",
    {
        f"{length} episodes, band {band:g}, {'paid' if paid else 'unpaid'}": _ATLAS.with_changes(
            episodes=length, band=band, approach_reward=paid
        )
        for length in LENGTHS
        for band in BANDS
        for paid in (True, False)
    },
    FRESH[:20],
    summary,
)


def column(of: Any, condition: str, name: str = "late", runs: int | None = None) -> Array:
    """A column of a table of summaries, one number per run: of all, or of the first few seeds."""
    return of[of.condition == condition].sort_values("seed")[name].to_numpy(np.float64)[:runs]


def against(of: Any, ours: str, theirs: str, family: int, name: str = "late") -> Comparison:
    """One condition's summaries as a multiple of another's."""
    return compare(column(of, ours, name), column(of, theirs, name), family)


def _told(label: str, found: Comparison) -> str:
    decided = found.word in ("better", "worse")
    edge = knife_edge(*found, margins=(1,) if decided else (1 / MARGIN, 1, MARGIN))
    return f"{label}, {found:.2f}, {found.word}{edge}"


@claim("Q10", "does the reward matter?", REWARD, REWARD_LONG)
def reward_matters(of: Any, long: Any) -> Judged:
    """None, turned round and constant against the reward as it is, home bootstrapped, theta_0 = 1: late steps (k = 3).

    Yes: all three are better or worse; partly: some are; no: all three are comparable; else not shown. Beside them
    stand total steps, and the late steps of 200 episodes, with the same k.
    """
    others = [reward for reward in REWARDS if reward != "as is"]
    found = {one: against(of, f"{one}, bootstrapped", "as is, bootstrapped", len(others)) for one in others}
    later = {one: against(long, f"{one}, bootstrapped", "as is, bootstrapped", len(others)) for one in others}
    total = {one: against(of, f"{one}, bootstrapped", "as is, bootstrapped", len(others), "total") for one in others}
    decided = [comparison.word in ("better", "worse") for comparison in found.values()]
    alike = all(comparison.word == "comparable" for comparison in found.values())
    return (
        "yes" if all(decided) else "partly" if any(decided) else "no" if alike else "not shown",
        "Late steps as a multiple of those under the reward as it is: "
        + "; ".join(_told(one, comparison) for one, comparison in found.items())
        + ". Total steps: "
        + "; ".join(f"{one}, {comparison:.2f}" for one, comparison in total.items())
        + ". After 200 episodes: "
        + "; ".join(f"{one}, {comparison:.2f}" for one, comparison in later.items())
        + ".",
    )


@claim("Q11", "does the initial value carry the learning?", REWARD, INITIAL, REWARD_LONG)
def initial_value_carries(of: Any, initial: Any, long: Any) -> Judged:
    """Two parts. Without any reward, theta_0 = 1: the last episodes take fewer steps than the first. With the reward as
    it is, theta_0 = 0: the last episodes take more steps than with theta_0 = 1, in the seeds of table initial. Home is
    bootstrapped in both; k = 2.

    Yes: both hold; partly: one; no: neither, and theta_0 = 0 is better or comparable; else not shown.
    """
    learns = compare(column(of, "zero, bootstrapped"), column(of, "zero, bootstrapped", "early"), 2)
    empty, bonus = (column(initial, f"as is, {home}, theta_0 0") for home in ("bootstrapped", "bonus"))
    without = compare(empty, column(of, "as is, bootstrapped", runs=len(empty)), 2)
    parts = learns.side == "below", without.side == "above"
    harmless = without.word in ("better", "comparable")
    return (
        "yes" if all(parts) else "partly" if any(parts) else "no" if harmless else "not shown",
        f"With theta_0 = 1 and no reward at all, the last episodes take {learns:.2f} of the steps of the first"
        f"{knife_edge(*learns)}. With the reward as it is and theta_0 = 0 they take {without:.2f} of those with "
        f"theta_0 = 1{knife_edge(*without)}. With home masked and the bonus, theta_0 = 0 takes "
        f"{compare(bonus, column(of, 'as is, bonus', runs=len(bonus))):.2f} of the late steps of theta_0 = 1 after 20 "
        f"episodes, and {against(long, 'as is, bonus, theta_0 0', 'as is, bonus', 1):.2f} after 200.",
    )


@claim("Q12", "does the robot loiter in the band that pays?", BAND)
def band_is_exploited(of: Any) -> Judged:
    """Steps of a run spent in the band, paid as a multiple of unpaid, in 20 and 200 episodes, with three bands (k = 6).
    Yes: more where paid, with the printed band, in either length; partly: with a wider band only; no: everywhere fewer
    or comparable; else not shown.
    """
    cases = [(band, length) for band in BANDS for length in LENGTHS]
    found = {
        (band, length): compare(
            steps_in_band(of, length, band, "paid"), steps_in_band(of, length, band, "unpaid"), len(cases)
        )
        for band, length in cases
    }
    more = {case for case, comparison in found.items() if comparison.side == "above"}
    words = {comparison.word for comparison in found.values()}
    printed = any(band == BANDS[0] for band, _ in more)
    share, stay = (column(of, f"20 episodes, band {BANDS[0]:g}, paid", name) for name in ("band", "band_stay"))
    return (
        "yes" if printed else "partly" if more else "no" if words <= {"better", "comparable"} else "not shown",
        f"With the printed band {share.mean():.2%} of the steps of 20 episodes lie in it, the longest stay "
        f"{stay.max():.0f}. Steps there, paid as a multiple of unpaid: "
        + "; ".join(_told(f"band {band:g}, {length} episodes", found[band, length]) for band, length in cases)
        + ".",
    )


def steps_in_band(of: Any, length: int, band: float, how: str) -> Array:
    """Of a whole run, one number per run."""
    label = f"{length} episodes, band {band:g}, {how}"
    return column(of, label, "band") * column(of, label, "total")


@claim("Q13", "is a bootstrapped home a reward that the robot pays itself?", REWARD)
def home_pays_itself(of: Any) -> Judged:
    """Late steps with home masked, against bootstrapped, are more; with a bonus of n psi_upper, comparable (k = 2).

    No: masked is better or comparable, and so it is none. Else yes: both; partly: one; not shown: neither.
    """
    masked, bonus = (against(of, f"as is, {home}", "as is, bootstrapped", 2) for home in ("masked", "bonus"))
    parts = masked.side == "above", bonus.word == "comparable"
    refuted = masked.word in ("better", "comparable")
    return (
        "no" if refuted else "yes" if all(parts) else "partly" if any(parts) else "not shown",
        f"As multiples of bootstrapped: {_told('masked', masked)}; {_told(f'masked, a bonus of {WORTH:g}', bonus)}.",
    )


# --- To the letter ----------------------------------------------------------------------------------------------------

LETTER = {
    f"alpha_0 {alpha:g}, tau {tau:g}": {"alpha0": alpha, "tau0": tau}
    for alpha in (1.25e-2, 1.25e-3, 1.25e-4)
    for tau in (1.0, 0.03)
}

_TO_THE_LETTER = _ATLAS.with_changes(mixture="literal", centre="zero", overwrite_features=True, max_steps=1000)

TO_THE_LETTER = study(
    "letter",
    "What does a reader get who follows the paper to the letter, all at once: the mixture as printed, sigma^2 about "
    "zero, features overwritten, each printed alpha_0, and the temperature that it leaves open? epsilon_0 is .3, as 6 "
    "is no probability; an episode ends after 1000 steps.",
    {label: _TO_THE_LETTER.with_changes(**changes) for label, changes in LETTER.items()}
    | {"random": _TO_THE_LETTER.with_changes(controller="random")},
    FRESH[:20],
    summary,
)


@claim("Q14", "does a robot learn that follows the paper to the letter?", TO_THE_LETTER)
def learns_to_the_letter(of: Any) -> Judged:
    """It learns if its last episodes take fewer steps than its first, and than random actions in the same world. Yes:
    at each printed alpha_0 and both temperatures (k = 12); partly: at some; no: at none, and everywhere one of the two
    comparisons says worse or comparable; else not shown.
    """
    family = 2 * len(LETTER)
    chance = column(of, "random", "total") / _TO_THE_LETTER.episodes
    found = {
        label: (
            compare(column(of, label), column(of, label, "early"), family),
            compare(column(of, label), chance, family),
        )
        for label in LETTER
    }
    learns = [all(one.side == "below" for one in both) for both in found.values()]
    fails = all(any(one.word in ("worse", "comparable") for one in both) for both in found.values())
    return (
        "yes" if all(learns) else "partly" if any(learns) else "no" if fails else "not shown",
        f"It learns at {sum(learns)} of {len(learns)}. Last episodes as a multiple of the first, and of random ones: "
        + "; ".join(f"{label}, {first:.2f} and {random:.2f}" for label, (first, random) in found.items())
        + f". About zero, home is so large that random actions take {chance.mean():.0f} steps.",
    )


# --- The earlier model ------------------------------------------------------------------------------------------------

_EARLIER = _ATLAS.with_changes(snapshots=3, step_cost="constant", approach_reward=False, learn_at_walls=False)
"""Three snapshots, a constant cost, no learning at walls; lambda is fixed."""

EARLIER_ALPHAS = {"alpha": 1.25e-3, "alpha / 3": round(1.25e-3 / 3, 7)}
"""Three snapshots triple |phi|^2, and with it the step that is really taken; a third of alpha makes up for it."""

FIXED = (0.0, 0.5, 0.9)

EARLIER_CHOICE = study(
    "earlier-choice",
    "Which fixed lambda suits the earlier model? The one of the least total steps, with either step size; sixty "
    "episodes, since robots that do not learn drive far.",
    {
        f"fixed {value:g}, {name}": _EARLIER.with_changes(episodes=60, alpha0=alpha, lambda_rule=f"fixed:{value:g}")
        for name, alpha in EARLIER_ALPHAS.items()
        for value in FIXED
    },
    range(5),
    summary,
)

EARLIER_FIXED = {"alpha": 0.0, "alpha / 3": 0.0}  # what that study chose

EARLIER = study(
    "earlier",
    "Does the paper's model need tens of episodes where the earlier one took hundreds (claim C17)? Both with 300 "
    "episodes and with 20, over which step size and exploration fall; the earlier with the fixed lambda that suits it.",
    {
        f"{name}, {length} episodes": settings.with_changes(episodes=length)
        for length in (300, 20)
        for name, settings in {
            "this model": _ATLAS,
            **{
                f"earlier, {name}": _EARLIER.with_changes(alpha0=alpha, lambda_rule=f"fixed:{EARLIER_FIXED[name]:g}")
                for name, alpha in EARLIER_ALPHAS.items()
            },
        }.items()
    },
    FRESH[:20],
    episodes,
)

SNAPSHOTS = study(
    "snapshots",
    "Does one snapshot do better than three (claim C14), where the step size makes up for three times the features, "
    "and where it does not?",
    {"one": _ATLAS}
    | {f"three, {name}": _ATLAS.with_changes(snapshots=3, alpha0=a) for name, a in EARLIER_ALPHAS.items()},
    FRESH,
    summary,
)


@claim("C17", "tens of episodes suffice where the earlier model took hundreds", EARLIER)
def tens_of_episodes(of: Any) -> Judged:
    """Of 300 episodes, the first good one (within one and a half times the steps of the last ones) of this model comes
    before the hundredth, and of the earlier, at both step sizes, not before it: reproduced.

    Partly: else, with 20 episodes for its schedule this model takes fewer late steps than the earlier at both step
    sizes (k = 2). Not reproduced: neither, and the earlier's first good episode comes before the hundredth at both step
    sizes. Else not shown.
    """
    models = ["this model", *(f"earlier, {name}" for name in EARLIER_ALPHAS)]
    good = {model: first_good(of, f"{model}, 300 episodes") for model in models}
    ours, *theirs = (good[model] for model in models)
    at_twenty = [
        compare(
            late_by_episode(of, "this model, 20 episodes"), late_by_episode(of, f"{model}, 20 episodes"), len(theirs)
        )
        for model in models[1:]
    ]
    total = {model: episodes_of(of, f"{model}, 300 episodes").sum(axis=1) for model in models}
    saved = [compare(total["this model"], total[model], len(theirs)) for model in models[1:]]
    hundreds, tens = all(one.low >= 100 for one in theirs), all(one.high < 100 for one in theirs)
    fewer = all(one.side == "below" for one in at_twenty)
    return (
        "reproduced"
        if ours.high < 100 and hundreds
        else "partly reproduced"
        if fewer
        else "not reproduced"
        if tens
        else "not shown",
        f"With 300 episodes the first good one is {_first(ours)} of this model; "
        + "; ".join(
            f"{_first(one)} of the {model}, of whose total steps this model takes {less:.2f}, and with 20 episodes "
            f"{late:.2f} of its last ones{knife_edge(*late)}"
            for model, one, less, late in zip(models[1:], theirs, saved, at_twenty, strict=True)
        )
        + ".",
    )


def _first(good: Interval) -> str:
    return f"episode {good:.0f}"


@claim("C14", "one snapshot does better than three", SNAPSHOTS)
def one_snapshot(of: Any) -> Judged:
    """With three, there are more late steps: at the same step size, which three times the features make three times
    as large in effect (weak), and at a third of it (strong).

    Reproduced: both (k = 2); partly: one; not reproduced: neither, and at a third three are better or comparable; else
    not shown.
    """
    weak, strong = (against(of, f"three, {name}", "one", len(EARLIER_ALPHAS)) for name in EARLIER_ALPHAS)
    parts = weak.side == "above", strong.side == "above"
    refuted = strong.word in ("better", "comparable")
    return (
        "reproduced"
        if all(parts)
        else "partly reproduced"
        if any(parts)
        else "not reproduced"
        if refuted
        else "not shown",
        f"With three snapshots an episode takes, as a multiple of one: {_told('at the same step size', weak)}; "
        f"{_told('at a third of it', strong)}. Similarity is then the mean of three comparisons: what passes for home "
        "changes too.",
    )
