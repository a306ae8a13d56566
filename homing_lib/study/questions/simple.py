"""Does a linear learner of one page pass the bar that was set for it, learning on and frozen?

The learner is `methods.simple`: greedy Q-learning on centred features that replays its last episodes. The bar was set
before it was written: home almost as fast as can be after 2,000 steps of the environment, and, frozen after 5,000, a
policy that stands by itself, which the published robot's does not.

What the choice draws from was found by informal trials on seeds 0-99, in three rooms: some 600 random draws of step
size, lambda, exploration (also by climbing), start values, length of the constant feature, replay (how many episodes,
the last or the best, how often), penalties, and what is looked ahead to, of 6 to 20 robots each; and some 60 of these
again with one part changed, of 40 to 100 robots. Most got near; the simplest of the best was kept.
"""

from collections.abc import Callable, Sequence
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from homing_lib.environment import HomingEnv
from homing_lib.features import Array
from homing_lib.robot import GO_FORWARD
from homing_lib.settings import Settings
from homing_lib.study.choosing import Choice
from homing_lib.study.engine import run_episode
from homing_lib.study.findings import Comparison, Judged, compare_steps, compare_to_limit, estimate, exact, question
from homing_lib.study.measures import CUT, driven, shortest_way
from homing_lib.study.questions import drives, learns, varying
from homing_lib.study.questions.home import is_right
from homing_lib.study.robots import FrozenAgent
from homing_lib.study.runs import Columns
from homing_lib.study.studies import ROBOTS, ROOM_ROBOTS, UNLEARNT, column, labelled, rows, study

IN_ROOMS = ("paper", "attic", "hall")

LEARNT, FROZEN = 2000, 5000  # steps of the environment after which it is looked at: learning on, and frozen
LATE = 10_000  # and after which it is looked at once more, to see whether it lacked time
NEXT = 10  # episodes that are looked at then
LED = 5  # episodes in which a robot is led, to see whether it lacked a way
OF_SHORTEST, OF_SHORTEST_FROZEN, LOST = 1.15, 1.3, 0.01  # the bar: multiples of the shortest way; a share

TIMES = range(0, FROZEN, 250)
"""Steps of the environment at which the learning curve is drawn."""

_CAP = Settings().max_steps


def bar(settings: Settings, seed: int) -> Columns:
    """One row per run. `steps`: mean of the ten episodes that begin once 2,000 steps of the environment have been
    driven; `cut`, the same with each cut at CUT. `frozen`: steps from the room's start of the robot as it was at the
    end of the episode in which it drove its 5,000th step, without learning and exploration; `home`, whether it came
    home within 2,000. `at_0`, `at_250`, ...: steps of the episode that it drove after so many. `diverged`: then an
    episode takes the step cap.
    """
    frozen: list[tuple[int, bool]] = []

    def look(lengths: list[int], env: HomingEnv, robot: Any) -> bool:
        """Try it frozen once it has driven so far. Returns whether it is to drive on."""
        if sum(lengths) >= FROZEN and not frozen:
            with HomingEnv(settings, observation="features", model=env.model) as world:
                world.reset(seed=seed)
                path, home = run_episode(world, FrozenAgent(robot, greedy=True))
                frozen.append((len(path), home))
        return sum(lengths) < FROZEN or len(next_ten(lengths)) < NEXT

    lengths, diverged = looked_at(settings, seed, look)
    way, home = frozen[0] if frozen else (_CAP, False)
    begun = np.cumsum(lengths) - lengths
    row: dict[str, Any] = reached(lengths) | {"frozen": way, "home": home, "diverged": diverged}
    row |= {f"at_{time}": lengths[np.searchsorted(begun, time, side="right") - 1] for time in TIMES}
    return {name: np.array([value], dtype=float) for name, value in row.items()}


def bar_on(settings: Settings, seed: int) -> Columns:
    """`steps` and `cut` of `bar` alone, in half the time."""
    lengths, _ = looked_at(settings, seed, lambda lengths, *_: len(next_ten(lengths)) < NEXT)
    row = reached(lengths)
    return {name: np.array([value], dtype=float) for name, value in row.items()}


def looked_at(settings: Settings, seed: int, goes_on: Callable[..., bool]) -> tuple[NDArray[np.int64], bool]:
    """`measures.driven`; of a run that diverged, as many episodes more as are looked at take the step cap."""
    lengths, diverged = driven(settings, seed, goes_on)
    if diverged:
        lengths += (NEXT + LATE // _CAP) * [_CAP]
    return np.array(lengths), diverged


def next_ten(lengths: ArrayLike, after: int = LEARNT) -> NDArray[np.int64]:
    """Those of the first ten episodes that begin once so many steps have been driven."""
    each = np.asarray(lengths)
    return each[np.cumsum(each) - each >= after][:NEXT]


def reached(lengths: ArrayLike) -> dict[str, float]:
    """Of the first ten episodes that begin once LEARNT steps have been driven: mean steps, and each cut at CUT."""
    ten = next_ten(lengths)
    return {"steps": float(ten.mean()), "cut": float(np.minimum(ten, CUT).mean())}


# --- What it lacks ----------------------------------------------------------------------------------------------------


class Led:
    """A learner that is led: it learns as ever, from actions that are given; after the last it goes forward."""

    def __init__(self, robot: Any, way: Sequence[int]) -> None:
        self.begin_episode, self.learn = robot.begin_episode, robot.learn
        self._way = iter(way)

    def choose(self, phi: Array) -> int:
        """The next of the actions."""
        return next(self._way, GO_FORWARD)


def lacks(settings: Settings, seed: int) -> Columns:
    """One row per run. `led`: mean of the ten episodes after 2,000 steps of a robot that was first led, in LED episodes
    that do not count, along the shortest way; `late`: of those after 10,000 steps of one that was not. `way`: steps of
    that way; `way_home`: of the shortest that ends where a stop is right (`home.is_right`), or is as short.
    """
    row: dict[str, Any] = {}

    def lead(lengths: list[int], env: HomingEnv, robot: Any) -> bool:
        """Lead it before its first episode. Returns whether it is to drive on."""
        if not lengths:
            way, home = shortest_way(env), shortest_way(env, counts=lambda pose: is_right(pose, env.home))
            row["way"], row["way_home"] = len(way) or np.nan, len(home) or np.nan
            for number in range(1, LED + 1):
                robot.begin_episode(number)
                run_episode(env, Led(robot, way))
        return len(next_ten(lengths)) < NEXT

    row["led"] = next_ten(looked_at(settings, seed, lead)[0]).mean()
    late, _ = looked_at(settings, seed, lambda lengths, *_: len(next_ten(lengths, LATE)) < NEXT)
    row["late"] = next_ten(late, LATE).mean()
    return {name: np.array([value], dtype=float) for name, value in row.items()}


# --- The choice -------------------------------------------------------------------------------------------------------

_DRAWN: dict[str, tuple[float, ...]] = {
    "alpha0": (0.3, 0.5, 0.7, 0.9),
    "theta0": (0.01, 0.02, 0.04),
    "epsilon0": (0.0, 0.1, 0.3),
}
"""Step size; start value (a step costs .05, so that at .02 no similarity would be 90 steps from home); exploration,
which falls with the number of the episode."""


def _candidates(draws: int = 6) -> list[dict[str, Any]]:
    every = [dict(zip(_DRAWN, values, strict=True)) for values in product(*_DRAWN.values())]
    return [every[place] for place in np.random.default_rng(0).choice(len(every), draws, replace=False)]


def settings(room: str, **changes: Any) -> Settings:
    """The learner's task: every step costs the same, walls nothing more, home is worth 0."""
    task: dict[str, Any] = {
        "step_cost": "constant",
        "approach_reward": False,
        "wall_penalty": 0.0,
        "bootstrap_terminal": False,
        "first_episode_share": 0.0,
        "controller": "simple",
    }
    return Settings(**({"images": "atlas", "room": room} | task | changes))


CHOICE = Choice(
    "simple-choice",
    "Which step size, start value and exploration suit the learner of a page? Six draws, by the steps of ten episodes "
    "after 2,000 steps of the environment.",
    {room: [settings(room, **drawn) for drawn in _candidates()] for room in IN_ROOMS},
    measure=bar_on,
    seeds=range(10),
    then=range(10, 40),
)

PARTS = {"no replay": {"controller": "simple, no replay"}, "not centred": {"controller": "simple, not centred"}}
"""What it is without one of its parts."""

# --- What is judged ---------------------------------------------------------------------------------------------------


IN_PAPER = study(
    "simple",
    "The learner of a page in the paper's room.",
    lambda: labelled([CHOICE.best("paper")]),
    ROBOTS[:1000],
    bar,
    needs=[CHOICE.second],
)

IN_OTHERS = study(
    "simple-rooms",
    "The learner of a page in two other rooms.",
    lambda: labelled(CHOICE.best(room) for room in IN_ROOMS[1:]),
    ROOM_ROBOTS,
    bar,
    needs=[CHOICE.second],
)


def opponents(room: str) -> dict[str, Settings]:
    """Form 2 at the defaults, and standard Sarsa at its best fixed lambda; its schedule continued."""
    return {"form 2": drives.after(100, room=room), "standard": drives.after(100, varying.standard(room))}


OTHERS = study(
    "simple-others",
    "Form 2 and standard Sarsa, looked at in the same way.",
    lambda: labelled(one for room in IN_ROOMS for one in opponents(room).values()),
    ROBOTS[:200],
    bar,
    needs=[varying.CHOICE.second],
)

WITHOUT_PARTS = study(
    "simple-parts",
    "The learner of a page without one of its parts.",
    lambda: labelled(CHOICE.best(room).with_changes(**part) for room in IN_ROOMS for part in PARTS.values()),
    ROBOTS[:20],
    bar,
    needs=[CHOICE.second],
)

LACKS = study(
    "simple-lacks",
    "Where the learner of a page is above the bar, what does it lack? Led along the shortest way at first; after five "
    "times the steps; and how long the way is that ends at home itself.",
    lambda: labelled(CHOICE.best(room) for room in IN_ROOMS[1:]),
    ROOM_ROBOTS[:100],
    lacks,
    needs=[CHOICE.second],
)

COMPARISONS = 3 * len(IN_ROOMS)


def against_the_bar(robots: Any, shortest: float, chance: float, comparisons: int = 0) -> dict[str, Comparison]:
    """Rows of `bar`, one per robot, held against the bar. chance: steps of random actions in the room."""
    lost = (robots.diverged > 0) | (robots.steps > chance)
    soon = (robots.home > 0) & (robots.frozen <= OF_SHORTEST_FROZEN * shortest)

    def held(values: Any, limit: float) -> Comparison:
        return compare_to_limit(values, limit, comparisons=comparisons) if comparisons else estimate(values)

    return {
        "on": held(robots.steps / shortest, OF_SHORTEST),
        "on.lost": exact(float(lost.sum())),
        "frozen.soon": held(soon, 0.5),  # in the median: so does half of them
        "frozen.lost": held(robots.home == 0, LOST),
        "frozen.median": exact(float(robots.frozen.median()) / shortest),
    }


def beats(found: dict[str, Comparison], room: str) -> tuple[bool, bool]:
    """Whether the learner is within the bar, learning on and frozen, with whole intervals."""
    on, soon, lost = (found[f"{room}.simple.{name}"].verdict for name in ("on", "frozen.soon", "frozen.lost"))
    none_lost = found[f"{room}.simple.on.lost"].value == 0
    return on == "below" and none_lost, soon == "above" and lost == "below"


@question(
    "simple",
    "Does a linear learner of one page pass the bar that was set for it, learning on and frozen?",
    f"""The learner at the settings chosen for its room, from the room's start; the shortest way is the mean of those
    that search finds (five surveys a room). A room counts as beaten *learning on*, if the mean of the ten episodes that
    begin once 2,000 steps of the environment have been driven is below {OF_SHORTEST:g} times the shortest way, with the
    whole interval, and none of its robots (1,000 in the paper's room, 500 in another) diverged or took, in those ten,
    more than random actions do. It counts as beaten *frozen*, if of the robots, frozen at the end of the episode in
    which they drove their 5,000th step, and without exploration, more than half come home within
    {OF_SHORTEST_FROZEN:g} times the shortest way, and fewer than {LOST:.0%} not within 2,000 steps, both with the whole
    interval (k = {COMPARISONS}: three rooms, three comparisons). The verdict counts rooms: "both in n of 3 rooms,
    learning on in m, frozen in l". Form 2 at the defaults and standard Sarsa (all weights updated, its best fixed
    lambda), looked at in the same way, stand beside it, and the learner without its parts.""",
    IN_PAPER,
    IN_OTHERS,
    OTHERS,
    WITHOUT_PARTS,
    LACKS,
    UNLEARNT,
    learns.SHORTEST,
    order=9.7,
)
def simple(paper: Any, rooms: Any, others: Any, parts: Any, lacking: Any, unlearnt: Any, ways: Any) -> Judged:
    found: dict[str, Comparison] = {}
    for room in IN_ROOMS:
        shortest = column(ways, "steps", room=room).mean()
        chance = column(unlearnt, "late", room=room, controller="random").mean()
        ours = rows(paper if room == "paper" else rooms, room=room)
        chosen = CHOICE.best(room)
        every = {"simple": ours}
        every |= {who: rows(others, like=one) for who, one in opponents(room).items()}
        every |= {part: rows(parts, like=chosen.with_changes(**changes)) for part, changes in PARTS.items()}
        for who, robots in every.items():
            held = against_the_bar(robots, shortest, chance, COMPARISONS if who == "simple" else 0)
            found |= {f"{room}.{who}.{name}": one for name, one in held.items()}
            if who != "simple":
                found[f"{room}.of {who}"] = compare_steps(ours.steps.iloc[: len(robots)], robots.steps)
        if room != "paper":
            lacked = rows(lacking, room=room)
            same = ours.iloc[: len(lacked)]
            for name in ("led", "late"):
                found[f"{room}.{name}"] = compare_to_limit(lacked[name] / shortest, OF_SHORTEST, comparisons=0)
            found[f"{room}.led.of not led"] = compare_steps(lacked.led, same.steps)
            found[f"{room}.way home"] = estimate(lacked.way_home)
            found[f"{room}.way is home"] = estimate(lacked.way == lacked.way_home)
            found[f"{room}.frozen.of way home"] = compare_steps(same.frozen, lacked.way_home)
    on, frozen = np.array([beats(found, room) for room in IN_ROOMS]).T
    both = (on & frozen).sum()
    return f"both in {both} of {len(IN_ROOMS)} rooms, learning on in {on.sum()}, frozen in {frozen.sum()}", found
