"""What is kept of a run: its episodes or their summary, trials after it, views, shortest paths."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import wraps
from itertools import product
from math import floor, pi
from typing import Any

import numpy as np

from homing_lib import agent
from homing_lib.agent import STEP_COLUMNS, Episodes, Run
from homing_lib.environment import HomingEnv
from homing_lib.features import similarity
from homing_lib.robot import LEFT_FORWARD, RIGHT_FORWARD, Robot
from homing_lib.rooms import Pose
from homing_lib.sarsa import Diverged
from homing_lib.settings import Settings
from homing_lib.study.engine import run, run_episode
from homing_lib.study.runs import Columns, Measure, episode_matrix
from homing_lib.survey import free_pose
from homing_lib.thresholds import stopping_thresholds

WINDOW = 5  # episodes at each end of a run that are compared: the first five with the last five


def typical(result: Run, numbers: Sequence[int]) -> int:
    """Of these episodes (1, 2, ...) the one of median length: no favourite."""
    return sorted(numbers, key=lambda number: result.lengths[number - 1])[len(numbers) // 2]


CUT = 500  # steps of an episode, at most, where one robot that never comes home shall not decide


def totals(settings: Settings, seed: int) -> Columns:
    """One row per run, for studies of a thousand: that of `totals_of`, which says what it holds."""
    return totals_of(run(settings, seed))


def totals_of(result: Run) -> Columns:
    """A run in one row: `total` steps of its episodes, the same with each cut at CUT, `cut`, mean of the first and last
    WINDOW, `early` and `late`; sum of the weights' `change`; mean `lambda`; shares of the steps whose lambda was reset,
    `clipped`, and that were spent `at_wall`; and `diverged`.
    """
    taken, made = episode_matrix([result])[0], max(len(result.steps), 1)
    row = {
        "total": taken.sum(),
        "cut": np.minimum(taken, CUT).sum(),
        "early": taken[:WINDOW].mean(),
        "late": taken[-WINDOW:].mean(),
        "change": result.column("change").sum(),
        **{name: result.column(name).sum() / made for name in ("lambda", "clipped", "at_wall")},
        "diverged": result.diverged > 0,
    }
    return {name: np.array([value], dtype=float) for name, value in row.items()}


def curve(settings: Settings, seed: int) -> Columns:
    """One row per episode, for learning curves: its number, `episode`, and `steps`."""
    taken = episode_matrix([run(settings, seed)])[0]
    return {"episode": np.arange(1.0, len(taken) + 1), "steps": taken}


def driven(settings: Settings, seed: int, goes_on: Callable[..., bool]) -> tuple[list[int], bool]:
    """Steps of the episodes of a run that has as many as it takes, the rates of the settings' schedule continued, and
    whether it diverged. goes_on: asked before each, with the steps of those so far, the world and the robot.
    """
    lengths: list[int] = []

    def drive(env: HomingEnv, robot: Any, *_: Any) -> Episodes:
        while goes_on(lengths, env, robot):
            robot.begin_episode(len(lengths) + 1)
            lengths.append(len(run_episode(env, robot)[0]))
        return np.empty((0, len(STEP_COLUMNS))), np.array(lengths), np.ones(len(lengths), dtype=bool), 0

    try:
        agent.run(settings, seed, episodes=drive)
    except Diverged:
        return lengths, True
    return lengths, False


TRIAL_STEPS = 300  # of a trial: a robot that comes home within these comes home soon


def starts_everywhere(env: HomingEnv) -> Iterator[Pose]:
    """Free places all over the room, 10 cm apart; all headings are 0."""
    width, depth = env.room.size
    for x, y in product(np.arange(0.05, width, 0.1), np.arange(0.05, depth, 0.1)):
        if env.world.clearance(x, y) >= 0:
            yield Pose(float(x), float(y), 0.0)


def after_learning(*names: str, **changes: Any) -> Callable[[Callable[..., Iterable[tuple[float, ...]]]], Measure]:
    """Stands above a function of settings, with these changes, seed, world and robot that yields rows of what is seen
    when the robot has learnt, and makes a measure of it, with columns of these names.

    A run that diverged has nothing to show: one row without numbers.
    """

    def measure_of(rows_of: Callable[..., Iterable[tuple[float, ...]]]) -> Measure:
        @wraps(rows_of)
        def measure(settings: Settings, seed: int) -> Columns:
            now, seen = settings.with_changes(**changes), list[tuple[float, ...]]()
            run(now, seed, afterwards=lambda env, agent: seen.extend(rows_of(now, seed, env, agent)))
            return dict(zip(names, np.array(seen or [(np.nan,) * len(names)], dtype=float).T, strict=True))

        return measure

    return measure_of


@after_learning("x", "y", "heading", "camera", "atlas", episodes=1, max_steps=1)
def views(settings: Settings, seed: int, env: HomingEnv, agent: Any) -> Iterator[tuple[float, ...]]:
    """The similarity of 400 random free views (`x`, `y`, `heading`) to home by the camera and by the settings' atlas,
    as `camera` and `atlas`.
    """
    from homing_lib.arena import Arena  # which needs PyBullet, as nothing else here does

    assert env.model is not None
    rng = np.random.default_rng([seed, 3])
    with Arena(env.room, settings) as camera:
        for _ in range(400):
            pose = free_pose(camera, env.room, rng)
            nrb = [similarity(env.model.features(world.histogram(pose))) for world in (camera, env.world)]
            yield (*pose, *nrb)


@after_learning("steps", episodes=1, controller="random")
def shortest(settings: Settings, seed: int, env: HomingEnv, agent: Any) -> Iterator[tuple[float]]:
    """`fewest_steps` from the room's start, under the same actions: `steps`."""
    yield (fewest_steps(env),)


def fewest_steps(env: HomingEnv, start: Pose | None = None, *, walls: bool = False) -> float:
    """How many actions `shortest_way` has; NaN if there is no way."""
    return float(len(shortest_way(env, start, walls=walls))) or float("nan")


def shortest_way(
    env: HomingEnv, start: Pose | None = None, *, walls: bool = False, counts: Callable[[Pose], bool] = lambda _: True
) -> list[int]:
    """The fewest actions from a pose, by default the room's start, to a view that ends an episode; none if there is no
    way. counts: of the poses where an episode ends, which are asked for; the others end it all the same.

    Breadth-first search over poses, of which two in the same cell of 2 cm and 10 degrees count as one, so that the
    least is approximate. Moves that a wall stops are left out; with `walls` they count, and the turns that the reflex
    then makes, to whichever side is better.
    """
    s, model = env.settings, env.model
    assert model is not None
    upper, robot, rng = stopping_thresholds(s.multiplier).upper, Robot(env.world, s, env.home), np.random.default_rng(0)
    frontier: list[tuple[Pose, int | None, list[int]]] = [(start or env.room.start, None, [])]
    seen: set[tuple[int | None, ...]] = set()
    for _ in range(s.max_steps):
        reached = []
        for (pose, reflex, way), action in product(frontier, range(3)):
            robot.pose, robot.reflex = pose, reflex
            driven, _ = robot.act(action, rng)
            there, then = robot.pose, [robot.reflex]
            if robot.reflex is not None and reflex is None:  # stopped
                then = [LEFT_FORWARD, RIGHT_FORWARD] if walls else []
            for side in then:
                cell = (floor(there.x / 0.02), floor(there.y / 0.02), round(there.heading / (pi / 18)) % 36, side)
                if cell in seen:
                    continue
                ends = similarity(model.features(env.world.histogram(there))) >= upper
                if ends and counts(there):
                    return [*way, driven]
                if not ends:
                    seen.add(cell)
                    reached.append((there, side, [*way, driven]))
        frontier = reached
    return []
