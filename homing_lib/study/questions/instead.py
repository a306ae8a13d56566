"""What would a user install instead? Environment steps are counted: they are what a robot pays, whoever learns."""

from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from homing_lib.features import Array
from homing_lib.settings import Settings
from homing_lib.study.bootstrap import estimated, iqm, ratio_unpaired, word_of
from homing_lib.study.findings import Comparison, Judged, estimate, question
from homing_lib.study.measures import driven
from homing_lib.study.methods import deep
from homing_lib.study.questions import learns, varying
from homing_lib.study.runs import Columns
from homing_lib.study.studies import CAMERA_ROBOTS, ROOM_ROBOTS, UNLEARNT, column, study

STEPS = 50_000
"""Environment steps of a run."""

AT = (2_000, 5_000, 20_000, 40_000)
"""After how many of them learners are compared, by their next ten episodes."""


def learning(settings: Settings, seed: int) -> Columns:
    """One row per episode of a run of 50,000 environment steps: its number, `episode`, and its `steps`. One that does
    not come home takes `max_steps`; the last is cut where the run ends, so that the steps add up.
    """
    if settings.controller in deep.LEARNERS:
        steps = deep.episode_lengths(settings, seed, STEPS)
    else:
        steps, _ = driven(settings, seed, lambda lengths, *_: sum(lengths) < STEPS)
    return until(STEPS, steps, settings.max_steps)


def until(budget: int, steps: Sequence[float], max_steps: int) -> Columns:
    """The columns of `learning`, of these episodes up to so many steps. Where they are fewer, those that follow do not
    come home: of a robot that diverged, or one that is under way.
    """
    ends = np.cumsum([*steps, *[max_steps] * (1 + budget // max_steps)], dtype=float)
    ends = np.minimum(ends[: np.searchsorted(ends, budget) + 1], budget)
    return {"episode": np.arange(1.0, len(ends) + 1), "steps": np.diff(ends, prepend=0.0)}


def next_ten(steps: Array, at: ArrayLike) -> Array:
    """Mean steps of the ten episodes that begin next, after each of these numbers of environment steps.

    steps: of all episodes of a run. Where the run ends before the tenth, of those that begin, the last as long as it
    lasts; NaN where none begins any more.
    """
    ends = np.r_[0.0, np.cumsum(steps)]
    first = np.searchsorted(ends[:-1], at)
    last = np.minimum(first + 10, len(steps))
    with np.errstate(invalid="ignore"):
        return np.asarray((ends[last] - ends[first]) / (last - first))


def curves(table: Any, condition: str, at: ArrayLike = AT) -> Array:
    """`next_ten` of the robots of a condition of a study, shape (robots, len(at)), seeds in order."""
    robots = table[table.condition == condition].groupby("seed", sort=True)
    return np.array([next_ten(one.steps.to_numpy(float), at) for _, one in robots])


# --- Studies ----------------------------------------------------------------------------------------------------------

REWARDS: dict[str, dict[str, Any]] = {"paper": {}, "constant": {"step_cost": "constant", "approach_reward": False}}
"""The paper's, and a constant cost of a step, with nothing for coming closer."""

DEEP = study(
    "instead",
    "PPO and DQN of Stable-Baselines3 on features, with the paper's reward and with a constant cost.",
    {
        f"{who}.{reward}": Settings(images="atlas", controller=who, **changes)
        for who in deep.LEARNERS
        for reward, changes in REWARDS.items()
    },
    ROOM_ROBOTS[:10],
    learning,
    deep=True,
)

IMAGES = study(
    "instead-images",
    "PPO on the camera's images, as a user would begin.",
    {"ppo.images": Settings(controller="ppo")},
    CAMERA_ROBOTS[:3],
    learning,
    deep=True,
)


PUBLISHED = study(
    "instead-published",
    "Form 2, and standard Sarsa at the fixed lambda and step size that suit it best, for as many steps.",
    lambda: {"form2": Settings(images="atlas"), "standard": varying.standard("paper")},
    ROOM_ROBOTS,
    learning,
    needs=[varying.CHOICE.second],
)


# --- What is judged ---------------------------------------------------------------------------------------------------

COMPARISONS = len(DEEP.conditions) * len(AT)


def compare_unpaired(ours: Array, theirs: Array, comparisons: int = 0) -> Comparison:
    """Mean steps as a multiple of those of other robots, which share no seeds."""
    interval = ratio_unpaired(ours, theirs, max(comparisons, 1))
    return Comparison(*interval, word_of(interval), comparisons)


def of_all(words: list[str]) -> str:
    """What the words against several say of the best of them: more, if one does; fewer, if all do."""
    if "more" in words:
        return "more"
    return "undecided" if "undecided" in words else "the same" if "the same" in words else "fewer"


def over_time(words: Mapping[int, str]) -> str:
    """A word for each number of steps as one verdict: up to when the first holds, from when on the last."""
    spans = [(word, [at for at, _ in some]) for word, some in groupby(words.items(), lambda one: one[1])]
    (first, early), (last, late) = spans[0], spans[-1]
    if len(spans) == 1:
        return f"{first} throughout"
    return f"{first} up to {early[-1]:,} steps, {last} from {late[0]:,} on"


@question(
    "instead",
    "Does form 2 take fewer steps than the deep learners that one would install instead?",
    """Form 2, and PPO and DQN of Stable-Baselines3 with its defaults, each on features with the paper's reward and with
    a constant cost. After 2,000, 5,000, 20,000 and 40,000 environment steps: the mean steps of the next ten episodes,
    those that begin then or later; the end of the run, after 50,000, cuts the last. Ratio of means, of robots that
    share no seeds (k = 16: four learners, four times). Form 2 takes fewer, if it takes fewer than all four; more, if
    more than one of them; the same, if the same as some and fewer than the others; else it is undecided. The verdict
    says the first of these words and up to how many steps it holds, and the last and from how many on: "fewer up to
    5,000 steps, more from 20,000 on"; or "fewer throughout" (more, the same, undecided). Standard Sarsa, PPO on images,
    the typical robot (interquartile mean), and lost ones, whose ten episodes take more than random actions do, stand
    beside it.""",
    DEEP,
    IMAGES,
    PUBLISHED,
    UNLEARNT,
    learns.SHORTEST,
    order=9.5,
)
def instead(on_features: Any, images: Any, ours: Any, unlearnt: Any, shortest: Any) -> Judged:
    robots = {who: curves(ours, who) for who in ("form2", "standard")}
    others = {who: curves(on_features, who) for who in DEEP.conditions}
    others |= {who: curves(images, who) for who in IMAGES.conditions}
    at_random = column(unlearnt, "late", room="paper", controller="random").mean()
    found: dict[str, Comparison] = {}
    words: dict[int, str] = {}
    for place, at in enumerate(AT):
        taken = {who: steps[:, place] for who, steps in (robots | others).items()}
        for who in others:
            found[f"{at}.{who}"] = compare_unpaired(taken["form2"], taken[who], COMPARISONS * (who in DEEP.conditions))
        words[at] = of_all([found[f"{at}.{who}"].verdict for who in DEEP.conditions])
        for who, steps in taken.items():
            found |= {f"{at}.{who}.steps": estimate(steps), f"{at}.{who}.lost": estimate(steps > at_random)}
            found[f"{at}.{who}.typical"] = Comparison(*estimated(steps, iqm))
    found["shortest"] = estimate(column(shortest, "steps", room="paper"))
    return over_time(words), found
