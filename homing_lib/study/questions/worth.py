"""Is learning worth it?

Against the climb, which keeps to an action while the view comes closer to the snapshot, else draws one of the two
others, and learns nothing. All episodes count, the first as well.
"""

from collections.abc import Iterator
from math import pi
from typing import Any

import numpy as np

from homing_lib.environment import HomingEnv
from homing_lib.features import Array
from homing_lib.rooms import Pose
from homing_lib.settings import Settings
from homing_lib.study.engine import run, run_episode
from homing_lib.study.findings import Comparison, Judged, bound, claim, estimate, of, question, shares, steps
from homing_lib.study.measures import TRIAL_STEPS, rows_after, starts_everywhere
from homing_lib.study.questions import rooms, varying
from homing_lib.study.questions.drives import after
from homing_lib.study.robots import Kidnapped, driver
from homing_lib.study.runs import Columns, episode_matrix
from homing_lib.study.studies import ROBOTS, ROOM_ROBOTS, ROOMS, UNLEARNT, column, labelled, of_kind, rows, study
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
        after(EVERY[-1], room=room, controller=controller, start=start)
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


def _trials(
    settings: Settings, env: HomingEnv, agent: Any, seed: int, kinds: Any
) -> Iterator[tuple[str, Any, Any, Any]]:
    """Of each kind, one trial from each place of the room, its heading drawn anew for each seed, then five from the
    room's start: kind, pose, steps (at most 2,000) and whether home was reached.
    """
    drawn = np.random.default_rng([seed, 4])
    everywhere = [pose._replace(heading=drawn.uniform(-pi, pi)) for pose in starts_everywhere(env, headings=1)]
    saved = agent.learner.weights.copy()
    now = settings.with_changes(max_steps=2000, start="room")
    with HomingEnv(now, observation="features", model=env.model) as world:
        for name in kinds:
            rng = np.random.default_rng([seed, 5, KINDS.index(name)])
            robot = driver(name, agent, settings, saved, rng)
            world.reset(seed=seed)
            order = rng.permutation(len(everywhere))  # who learns on meets the places in no order
            for pose in [*(everywhere[place] for place in order), *5 * [env.room.start]]:
                robot.begin_episode(settings.episodes + 1)
                path, home = run_episode(world, robot, {"start": pose})
                yield name, pose, len(path), home
    agent.learner.weights[:] = saved


def placed(settings: Settings, seed: int) -> Columns:
    """Trials from everywhere and from the start, summed up. One row for each kind, `kind`, its place in KINDS.

    From everywhere: mean `steps` of at most 2,000; the same cut at TRIAL_STEPS, `cut`; `median` steps; shares `soon`,
    home within TRIAL_STEPS, and `home`, within 2,000. From the start: mean steps, `start_steps`.
    """
    names = ("kind", "steps", "cut", "median", "soon", "home", "start_steps")

    def summed_up(env: HomingEnv, agent: Any) -> Iterator[tuple[float, ...]]:
        kinds = KINDS if settings.start == "room" else EXTENDED
        trials = list(_trials(settings, env, agent, seed, kinds))
        for name in kinds:
            taken, reached = np.array([(one[2], one[3]) for one in trials if one[0] == name], dtype=float).T
            everywhere, start = taken[:-5], taken[-5:]
            cut = np.minimum(everywhere, TRIAL_STEPS)
            soon = reached[:-5] * (everywhere <= TRIAL_STEPS)
            means = (everywhere.mean(), cut.mean(), np.median(everywhere), soon.mean(), reached[:-5].mean())
            yield (float(KINDS.index(name)), *map(float, means), float(start.mean()))

    return rows_after(settings, seed, names, summed_up)


MAPPED = ("restored", "frozen", "climb", "random")


def mapped(settings: Settings, seed: int) -> Columns:
    """The same trials one by one, of those who are drawn on a map: `kind`, `x`, `y` (m), `steps`, and `home`, within
    TRIAL_STEPS.
    """
    names = ("kind", "x", "y", "steps", "home")

    def one_by_one(env: HomingEnv, agent: Any) -> Iterator[tuple[float, ...]]:
        for name, pose, taken, home in _trials(settings, env, agent, seed, MAPPED):
            if pose != env.room.start:
                yield KINDS.index(name), pose.x, pose.y, taken, home and taken <= TRIAL_STEPS

    return rows_after(settings, seed, names, one_by_one)


PLACED = study(
    "worth-everywhere",
    "From everywhere and from the start, after the published training of twenty episodes and after the extension.",
    labelled(
        one
        for room in ROOMS
        for one in (
            Settings(images="atlas", room=room),
            Settings(images="atlas", room=room, **_EXTENSION),
        )
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
_LIVING = ("restored", "frozen")


def carried(settings: Settings, seed: int) -> Columns:
    """At 40 random free poses, in three lights: an episode that begins there; and, as learnt, one in which the robot is
    carried there after eight steps from the room's start. Learning on (weights restored for each trial), and frozen.

    One row each: `learning` (1 or 0), `bright` (the light), `kidnapped`, and means: `steps` from there, at most
    TRIAL_STEPS, and `home`.
    """
    names = ("learning", "bright", "kidnapped", "steps", "home")

    def trials(env: HomingEnv, agent: Any) -> Iterator[tuple[float, ...]]:
        rng = np.random.default_rng([seed, 4])
        poses = [free_pose(env.world, env.room, rng) for _ in range(40)]
        saved = agent.learner.weights.copy()
        for name in _LIVING:
            for light, kidnapped in [*((light, False) for light in LIGHTS), (1.0, True)]:
                robot = driver(name, agent, settings, saved, np.random.default_rng([seed, 5]))
                cap = TRIAL_STEPS + _KIDNAPPED_AT * kidnapped
                now = settings.with_changes(light=light, max_steps=cap)
                with HomingEnv(now, observation="features", model=env.model) as world:
                    world.reset(seed=seed)
                    ends = [_trial(world, robot, settings, pose, kidnapped) for pose in poses]
                yield (name == "restored", light, kidnapped, *np.mean(ends, axis=0))

    return rows_after(settings, seed, names, trials)


def _trial(world: HomingEnv, robot: Any, settings: Settings, pose: Pose, kidnapped: bool) -> tuple[float, bool]:
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

AT = (20, 60)

OWN_STEP_SIZE = ("hall", "cell")
"""Rooms in which another step size than the default suits form 2 better (`varying.CHOICE`)."""

COMPARISONS = len(ROOMS) * len(AT)


def tried(table: Any, name: str, kind: str, room: str, **values: Any) -> Array:
    """A column of `placed`, one number per robot, of trials of a kind; one that diverged never comes home."""
    never = {"steps": 2000.0, "start_steps": 2000.0, "median": 2000.0, "cut": float(TRIAL_STEPS)}
    its = of_kind(table, KINDS.index(kind), room=room, **values)[name]
    return np.asarray(its.fillna(never.get(name, 0.0)).to_numpy(float))


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
)
def worth(paper: Any, others: Any, everywhere: Any, unlearnt: Any, *own: Any) -> Judged:
    """Room by room."""
    found: dict[str, Comparison] = {}
    for room in ROOMS:
        table = paper if room == "paper" else others
        for start in ("room", "uniform"):
            ours, climb = (rows(table, room=room, start=start, controller=who) for who in ("sarsa", "climb"))
            for number in EVERY:
                comparisons = COMPARISONS if number in AT and start == "room" else 1
                pair = (one[f"after_{number}"].to_numpy(float) for one in (ours, climb))
                found[f"{room}.{start}.{number}"] = steps(*pair, comparisons=comparisons)
            saved = climb[f"after_{AT[0]}"].to_numpy(float) - ours[f"after_{AT[0]}"].to_numpy(float)
            found[f"{room}.{start}.saved"] = estimate(saved)
        for training, episodes, kinds in (("published", 20, KINDS), ("extension", 100, EXTENDED)):
            for kind in kinds:
                for name in ("steps", "cut", "median", "soon", "home", "start_steps"):
                    its = tried(everywhere, name, kind, room, episodes=episodes)
                    found[f"{room}.{training}.{kind}.{name}"] = estimate(its)
                    if kind != "climb" and name in ("steps", "start_steps"):
                        climb = tried(everywhere, name, "climb", room, episodes=20)
                        found[f"{room}.{training}.{kind}.of climb.{name}"] = steps(its, climb)
    for room, table in zip(OWN_STEP_SIZE, own, strict=True):
        climb = column(unlearnt, "total", room=room, controller="climb")
        learner = varying.robots_of("form2", room, "taken", table, None).total.to_numpy(float)
        found[f"{room}.own step size.{AT[0]}"] = steps(learner[: len(climb)], climb)
    counts = [sum(found[f"{room}.room.{number}"].verdict == "fewer" for room in ROOMS) for number in AT]
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
    """Learning on, and frozen."""
    found: dict[str, Comparison] = {}
    for kind in ("restored", "frozen", "climb", "random"):
        for name in ("soon", "home"):
            found[f"{kind}.{name}"] = estimate(tried(everywhere, name, kind, "paper", episodes=20))
    side = bound(found["restored.soon"].interval, 0.95)
    found["restored.soon"] = of(found["restored.soon"].interval, side, judged=True)
    return claim(side, ("above",), ("below",)), found


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
    """Learning on, and frozen."""
    found: dict[str, Comparison] = {}
    for learning, name in ((1, "restored"), (0, "frozen")):
        of_robot = table[table.learning == learning]
        home = {
            (round(float(light), 2), bool(taken)): one.sort_values("seed").home.to_numpy(float)
            for (light, taken), one in of_robot.groupby(["bright", "kidnapped"])
        }
        for (light, taken), its in home.items():
            found[f"{name}.{'carried' if taken else f'light {light:g}'}"] = estimate(its)
        found[f"{name}.carried or begun"] = shares(home[1.0, True], home[1.0, False])
        for light in (LIGHTS[0], LIGHTS[-1]):
            found[f"{name}.light {light:g} or as learnt"] = shares(home[light, False], home[1.0, False])
    as_many = found["restored.carried or begun"].verdict
    enough = bound(found["restored.carried"].interval, 0.95)
    found["restored.carried"] = of(found["restored.carried"].interval, enough, judged=True)
    found["restored.carried or begun"] = found["restored.carried or begun"]._replace(judged=True)
    if as_many in ("the same", "more") and enough == "above":
        return "supported", found
    return "contradicted" if as_many == "fewer" or enough == "below" else "inconclusive", found
