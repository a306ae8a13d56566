"""Is learning worth it? All episodes count, against the climb, which learns nothing."""

from collections.abc import Iterator, Sequence
from itertools import groupby, product
from math import pi
from typing import Any

import numpy as np

from homing_lib.agent import SarsaAgent
from homing_lib.environment import HomingEnv
from homing_lib.features import Array
from homing_lib.rooms import Pose
from homing_lib.settings import Settings
from homing_lib.study.engine import run, run_episode
from homing_lib.study.findings import (
    Comparison,
    Judged,
    compare_shares,
    compare_steps,
    compare_to_limit,
    estimate,
    question,
    verdict_of,
)
from homing_lib.study.measures import TRIAL_STEPS, after_learning, starts_everywhere
from homing_lib.study.questions import drives, rooms, varying
from homing_lib.study.robots import Kidnapped, driver
from homing_lib.study.runs import Columns, episode_matrix
from homing_lib.study.studies import ROBOTS, ROOM_ROBOTS, ROOMS, UNLEARNT, column, labelled, study
from homing_lib.survey import free_pose

# --- All episodes counted ---------------------------------------------------------------------------------------------

EVERY = (5, 10, 15, 20, 30, 40, 50, 60)
"""After how many episodes the steps are added up."""


def added_up(settings: Settings, seed: int) -> Columns:
    """One row per run: the steps of its first 5, 10, ... episodes, `after_5`, `after_10`, ..."""
    sums = episode_matrix([run(settings, seed)])[0].cumsum()
    return {f"after_{number}": sums[number - 1 : number] for number in EVERY}


def _added_up(*rooms: str) -> dict[str, Settings]:
    return labelled(
        drives.after(EVERY[-1], room=room, controller=controller, start=start)
        for room in rooms
        for controller in ("sarsa", "climb")
        for start in ("room", "uniform")
    )


PAPER = study(
    "worth",
    "When does learning pay for itself? The steps of all episodes, with the rates of the schedule of twenty continued, "
    "from the room's start and from anywhere; the learner and the climb.",
    _added_up("paper"),
    ROBOTS,
    added_up,
)

OTHERS = study("worth-rooms", "The same in five other rooms.", _added_up(*ROOMS[1:]), ROOM_ROBOTS, added_up)

# --- From everywhere --------------------------------------------------------------------------------------------------

KINDS = ("learning on", "restored", "frozen", "climbing", "climb", "random")
"""Climbing: frozen, and guided by the climb."""

EXTENDED = ("restored", "climbing")
"""Those that are tried after the extension."""

_EXTENSION: dict[str, Any] = {
    "episodes": 100,
    "first_episode_share": Settings().first_episode_share,
    "start": "uniform",
    "step_cost": "constant",
    "update": "all",
}
"""The declared extension learns from everywhere, at a constant cost, in a hundred episodes; tried, it climbs as
well."""

FROM_START = 5  # trials of each kind from the room's start


def trials(
    settings: Settings, env: HomingEnv, agent: SarsaAgent, seed: int, kinds: Sequence[str]
) -> Iterator[tuple[str, Pose, int, bool]]:
    """Of each kind, one from each place of the room, its heading drawn anew for each seed, then five from the room's
    start: the kind, whence, steps (at most 2,000), and whether it came home.
    """
    drawn = np.random.default_rng([seed, 4])
    everywhere = [pose._replace(heading=drawn.uniform(-pi, pi)) for pose in starts_everywhere(env)]
    saved = agent.learner.weights.copy()
    now = settings.with_changes(max_steps=drives.CAPS[-1], start="room")
    with HomingEnv(now, observation="features", model=env.model) as world:
        for kind in kinds:
            rng = np.random.default_rng([seed, 5, KINDS.index(kind)])
            robot = driver(kind, agent, settings, saved, rng)
            world.reset(seed=seed)
            order = rng.permutation(len(everywhere))  # who learns on meets the places in no order
            for start in [*(everywhere[place] for place in order), *FROM_START * [env.room.start]]:
                robot.begin_episode(settings.episodes + 1)
                path, home = run_episode(world, robot, {"start": start})
                yield kind, start, len(path), home


@after_learning("kind", "steps", "cut", "median", "soon", "home", "start_steps")
def placed(settings: Settings, seed: int, env: HomingEnv, agent: Any) -> Iterator[tuple[float, ...]]:
    """Trials from everywhere and from the start, summed up. One row for each kind, `kind`, its place in KINDS.

    From everywhere: mean `steps` of at most 2,000; the same cut at TRIAL_STEPS, `cut`; `median` steps; shares `soon`,
    home within TRIAL_STEPS, and `home`, within 2,000. From the start: mean steps, `start_steps`.
    """
    kinds = KINDS if settings.start == "room" else EXTENDED
    for kind, some in groupby(trials(settings, env, agent, seed, kinds), lambda one: one[0]):
        taken, reached = np.array([(steps, home) for _, _, steps, home in some], dtype=float).T
        steps, home = taken[:-FROM_START], reached[:-FROM_START]
        cut = np.minimum(steps, TRIAL_STEPS)
        soon = home * (steps <= TRIAL_STEPS)
        means = (steps.mean(), cut.mean(), np.median(steps), soon.mean(), home.mean(), taken[-FROM_START:].mean())
        yield (KINDS.index(kind), *map(float, means))


MAPPED = ("restored", "frozen", "climb", "random")


@after_learning("kind", "x", "y", "steps", "home")
def mapped(settings: Settings, seed: int, env: HomingEnv, agent: Any) -> Iterator[tuple[float, ...]]:
    """The trials of `placed` one by one, of those who are drawn on a map: `kind`, `x`, `y` (m), `steps`, and `home`,
    within TRIAL_STEPS.
    """
    for kind, start, steps, home in trials(settings, env, agent, seed, MAPPED):
        if start != env.room.start:
            yield KINDS.index(kind), start.x, start.y, steps, home and steps <= TRIAL_STEPS


PLACED = study(
    "worth-everywhere",
    "From everywhere and from the start, after the published training of twenty episodes and after the extension.",
    labelled(
        one
        for room in ROOMS
        for one in (Settings(images="atlas", room=room), Settings(images="atlas", room=room, **_EXTENSION))
    ),
    ROBOTS[:80],
    placed,
)

MAP = study(
    "worth-map",
    "From where does it come home?",
    {"20 episodes": Settings(images="atlas")},
    ROBOTS[:60],
    mapped,
)

# --- Kidnapped, and in another light ----------------------------------------------------------------------------------

LIGHTS = (0.97, 1.0, 1.03)
"""Brightness of the trials: as learnt, and changed so little that home still looks like home."""

_KIDNAPPED_AT = 8


@after_learning("learning", "bright", "kidnapped", "steps", "home")
def carried(settings: Settings, seed: int, env: HomingEnv, agent: Any) -> Iterator[tuple[float, ...]]:
    """At 40 random free poses, in three lights: an episode that begins there; and, as learnt, one in which the robot is
    carried there after eight steps from the room's start. Learning on (weights restored for each trial), and frozen.

    One row each: `learning` (1 or 0), `bright` (the light), `kidnapped`, and means: `steps` from there, at most
    TRIAL_STEPS, and `home`.
    """
    rng = np.random.default_rng([seed, 4])
    poses = [free_pose(env.world, env.room, rng) for _ in range(40)]
    saved = agent.learner.weights.copy()
    for kind in ("restored", "frozen"):
        for light, kidnapped in [*((light, False) for light in LIGHTS), (1.0, True)]:
            robot = driver(kind, agent, settings, saved, np.random.default_rng([seed, 5]))
            now = settings.with_changes(light=light, max_steps=TRIAL_STEPS + _KIDNAPPED_AT * kidnapped)
            with HomingEnv(now, observation="features", model=env.model) as world:
                world.reset(seed=seed)
                ends = [way_home(world, robot, settings, pose, kidnapped) for pose in poses]
            yield (kind == "restored", light, kidnapped, *np.mean(ends, axis=0))


def way_home(world: HomingEnv, robot: Any, settings: Settings, pose: Pose, kidnapped: bool) -> tuple[float, bool]:
    """Of an episode that begins at a pose, or in which the robot is carried there: steps from there, and success."""
    robot.begin_episode(settings.episodes + 1)
    if not kidnapped:
        path, home = run_episode(world, robot, {"start": pose})
        return len(path), home
    path, home = run_episode(Kidnapped(world, _KIDNAPPED_AT, pose), robot)
    return len(path) - _KIDNAPPED_AT, home


CARRIED = study(
    "worth-carried",
    "Carried away, and in another light: does the robot get home as from a start at the same place? (3 cm lattice, of "
    "which there are three, one for each light.)",
    {"20 episodes": Settings(images="atlas", atlas_spacing_m=0.03)},
    ROBOTS[:200],
    carried,
    [Settings(images="atlas", atlas_spacing_m=0.03, light=light) for light in LIGHTS],
)


# --- Judges -----------------------------------------------------------------------------------------------------------

JUDGED_AT = (20, 60)

OWN_STEP_SIZE = ("hall", "cell")
"""Rooms in which another step size than the default suits form 2 better (`varying.CHOICE`)."""

COMPARISONS = len(ROOMS) * len(JUDGED_AT)


def outcomes(table: Any, name: str, kind: str, room: str, episodes: int = 20) -> Array:
    """A column of `placed` after so many episodes of training, one number per robot, of trials of a kind."""
    return drives.outcomes(table, name, kind, KINDS, room=room, episodes=episodes)


@question(
    "worth",
    "Is learning worth it?",
    """Form 2 at the default step size, learning on, from the room's start, all episodes counted. In a room learning
    pays within n episodes if their steps, added up, are fewer than the climb's (k = 12: six rooms, n = 20 and 60). The
    verdict counts the rooms: "within 20 episodes in n of 6 rooms, within 60 in m". Beside it: from anywhere; trials
    after learning, from everywhere and from the start, learning on, restored and frozen, the extension and the
    published training with climbing.""",
    PAPER,
    OTHERS,
    PLACED,
    UNLEARNT,
    *(rooms.STUDIES[room][0] for room in OWN_STEP_SIZE),
    order=8,
)
def worth(paper: Any, others: Any, everywhere: Any, unlearnt: Any, *own: Any) -> Judged:
    found: dict[str, Comparison] = {}
    for room in ROOMS:
        table = paper if room == "paper" else others
        for start, number in product(("room", "uniform"), EVERY):
            ours, climb = (
                column(table, f"after_{number}", room=room, start=start, controller=who) for who in ("sarsa", "climb")
            )
            together = COMPARISONS if number in JUDGED_AT and start == "room" else 0
            found[f"{room}.{start}.{number}"] = compare_steps(ours, climb, comparisons=together)
        for training, episodes, kinds in (("published", 20, KINDS), ("extension", 100, EXTENDED)):
            for kind, name in product(kinds, ("steps", "median", "soon", "home", "start_steps")):
                robots = outcomes(everywhere, name, kind, room, episodes)
                found[f"{room}.{training}.{kind}.{name}"] = estimate(robots)
                if kind != "climb" and name in ("steps", "start_steps"):
                    climb = outcomes(everywhere, name, "climb", room)
                    found[f"{room}.{training}.{kind}.of climb.{name}"] = compare_steps(robots, climb)
    for room, table in zip(OWN_STEP_SIZE, own, strict=True):
        climb = column(unlearnt, "total", room=room, controller="climb")
        learner = varying.robots_of("form2", room, "taken", table, None).total.iloc[: len(climb)]
        found[f"{room}.own step size.{JUDGED_AT[0]}"] = compare_steps(learner, climb)
    counts = [sum(found[f"{room}.room.{number}"].verdict == "fewer" for room in ROOMS) for number in JUDGED_AT]
    return f"within 20 episodes in {counts[0]} of {len(ROOMS)} rooms, within 60 in {counts[1]}", found


@question(
    "C8",
    "After learning, home is reached from almost anywhere.",
    f"""After twenty episodes, in the paper's room, from everywhere, learning on (weights restored for each trial).
    Supported, if at least 95 % of a robot's trials come home within {TRIAL_STEPS} steps, with the whole interval;
    contradicted, if fewer do; else inconclusive. The frozen robot stands beside it.""",
    PLACED,
)
def from_almost_anywhere(everywhere: Any) -> Judged:
    soon = {kind: outcomes(everywhere, "soon", kind, "paper") for kind in ("restored", "frozen", "climb", "random")}
    found = {f"{kind}.soon": estimate(shares) for kind, shares in soon.items()}
    found["restored.soon"] = compare_to_limit(soon["restored"], 0.95)
    return verdict_of([found["restored.soon"].verdict], ["above"], ["below"]), found


@question(
    "C9",
    "A kidnapped robot recovers at once.",
    f"""After twenty episodes, learning on (weights restored for each trial). Supported, if of the robots that are
    carried away as many come home within {TRIAL_STEPS} steps as of those that start at the same places, within two
    points, and at least 95 %; contradicted, if it is fewer by more, or fewer than 95 %; else inconclusive. The frozen
    robot stands beside it, and other lights.""",
    CARRIED,
)
def kidnapped(table: Any) -> Judged:
    found: dict[str, Comparison] = {}
    for learning, name in ((1, "restored"), (0, "frozen")):
        home = {
            "carried" if taken else f"light {light:g}": column(
                table, "home", learning=learning, bright=light, kidnapped=taken
            )
            for light, taken in sorted([*product(LIGHTS, [False]), (1.0, True)])
        }
        found |= {f"{name}.{trials}": estimate(shares) for trials, shares in home.items()}
        carried, begun = home.pop("carried"), home.pop("light 1")
        judged = int(name == "restored")
        if judged:
            found["restored.carried"] = compare_to_limit(carried, 0.95)
        found[f"{name}.carried or begun"] = compare_shares(carried, begun, comparisons=judged)
        found |= {f"{name}.{light} or as learnt": compare_shares(shares, begun) for light, shares in home.items()}
    words = found["restored.carried or begun"].verdict, found["restored.carried"].verdict
    return verdict_of(words, ["the same", "more", "above"], ["fewer", "below"]), found
