"""What is kept of a run: its episodes or their summary, trials after it, views, shortest paths."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import product
from math import degrees, floor, pi
from typing import Any

import numpy as np

from homing_lib.agent import STEP_COLUMNS, Agent, Run
from homing_lib.environment import HomingEnv, free_pose
from homing_lib.features import similarity
from homing_lib.robot import drive, wrapped
from homing_lib.rooms import Pose, room_named
from homing_lib.sarsa import silent
from homing_lib.settings import Settings
from homing_lib.study.engine import run, run_episode
from homing_lib.study.robots import FrozenAgent, Kidnapped
from homing_lib.study.runs import Columns, by_episode
from homing_lib.thresholds import stopping_thresholds

WINDOW = 5  # episodes at each end of a run that are compared: the first five with the last five


def episodes(settings: Settings, seed: int) -> Columns:
    """One row per episode, those after a divergence too."""
    return episode_table(run(settings, seed))


@silent
def episode_table(result: Run) -> Columns:
    """The episodes of a run as columns; of those that it did not finish, only `episode` and `diverged` are numbers."""
    home, ended, lengths = room_named(result.settings.room).home, result.ended, result.lengths
    total = dict(zip(STEP_COLUMNS, np.add.reduceat(result.steps, ended - lengths).T, strict=True))
    last = result.steps[ended - 1]
    finished = {
        "steps": lengths,
        "reached": result.reached,  # 1: ended at home, 0: truncated
        "return": total["reward"],
        "change": total["change"],  # sum of the lengths of the weights' changes
        **{name: total[name] / lengths for name in ("lambda", "clipped", "at_wall")},
        "distance_m": np.hypot(last[:, 0] - home.x, last[:, 1] - home.y),  # of the last pose from home
        "angle_deg": [abs(degrees(wrapped(heading - home.heading))) for heading in last[:, 2]],
    }
    number, lost = np.arange(1.0, result.settings.episodes + 1), result.settings.episodes - len(lengths)
    padded = {name: np.r_[values, np.full(lost, np.nan)] for name, values in finished.items()}
    return {"episode": number, **padded, "diverged": (number > len(lengths)).astype(float)}


def typical(result: Run, numbers: Sequence[int]) -> int:
    """Of these episodes (1, 2, ...) the one of median length: no favourite."""
    return sorted(numbers, key=lambda number: result.lengths[number - 1])[len(numbers) // 2]


def resets(several: Sequence[Run]) -> dict[str, float]:
    """Shares of all steps, by what became of their lambda; and of those before the first reset of an episode."""
    lambda_, clipped = (np.concatenate([one.column(name) for one in several]) for name in ("lambda", "clipped"))
    episodes = [part for one in several for part in np.split(one.column("clipped"), one.ended[:-1])]
    return {
        "reset to 0": ((lambda_ == 0) & (clipped > 0)).mean(),
        "reset to 1": ((lambda_ == 1) & (clipped > 0)).mean(),
        "as (7) gives it": (clipped == 0).mean(),
        "before the first reset of their episode": np.concatenate([part.cumsum() == 0 for part in episodes]).mean(),
    }


def summary(settings: Settings, seed: int) -> Columns:
    """One row per run, for studies of many."""
    return summary_table(run(settings, seed))


CUT = 500  # steps of an episode, at most, where a single lost robot shall not decide


def totals(settings: Settings, seed: int) -> Columns:
    """One row per run, for studies of a thousand."""
    return totals_of(run(settings, seed))


def totals_of(result: Run) -> Columns:
    """A run in one row: `total` steps of its episodes, the same with each cut at CUT, `cut`, mean of the first and last
    WINDOW, `early` and `late`; sum of the weights' `change`; mean `lambda`; shares of the steps whose lambda was reset,
    `clipped`, and that were spent `at_wall`; and `diverged`.
    """
    taken, made = by_episode([result])[0], max(len(result.steps), 1)
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
    taken = by_episode([run(settings, seed)])[0]
    return {"episode": np.arange(1.0, len(taken) + 1), "steps": taken}


def summary_table(result: Run) -> Columns:
    """A run in one row. An episode that it did not finish, since it diverged, took `max_steps` and did not come home.

    Steps, mean of the first and last WINDOW episodes and sum of all: `early`, `late`, `total`; `lost`: share of the
    last WINDOW that did not reach home; sum of the weights' `change`; mean `lambda`; shares of the steps: `clipped`,
    `at_wall`, `band` (psi_lower <= NRB < psi_upper); `band_stay`: longest stay there, in steps; `diverged`.
    """
    steps, psi = by_episode([result])[0], stopping_thresholds(result.settings.multiplier, result.settings.band)
    home = np.pad(result.reached, (0, len(steps) - len(result.reached)))
    nrb = result.column("similarity")
    band = (nrb >= psi.lower) & (nrb < psi.upper)
    # An episode's last step is home or the cap: no stay in the band goes on from there.
    inside = np.concatenate([[0], np.insert(band, result.ended[:-1], False), [0]]).astype(int)
    edges = np.flatnonzero(np.diff(inside)).reshape(-1, 2)
    taken = max(len(result.steps), 1)
    shares = {name: result.column(name) for name in ("lambda", "clipped", "at_wall")} | {"band": band}
    row = {
        "early": steps[:WINDOW].mean(),
        "late": steps[-WINDOW:].mean(),
        "total": steps.sum(),
        "lost": 1 - home[-WINDOW:].mean(),
        "change": result.column("change").sum(),
        **{name: values.sum() / taken for name, values in shares.items()},
        "band_stay": np.diff(edges).max(initial=0),
        "diverged": result.diverged > 0,
    }
    return {name: np.array([value], dtype=float) for name, value in row.items()}


TRIAL_STEPS = 300  # a robot that has not come home by then is counted as lost

TRIAL_LIGHTS = (1.0, 0.97, 1.03)
"""Brightness of the trials: as learnt, and changed so little that home still looks like home."""

_KIDNAPPED_AT = 8


def trials(settings: Settings, seed: int) -> Columns:
    """After learning: one episode without learning from everywhere, and from where a kidnapper puts the robot.

    One row per trial: `kidnapped` (0: started there; 1: carried there after eight steps from the usual start), the pose
    `x`, `y` (m), `heading` (rad), `steps` from there, `reached`, and `light` of the trial (1: as learnt). A run that
    diverged has nothing to try: one row without numbers.
    """
    rows: list[tuple[float, ...]] = []

    def afterwards(env: HomingEnv, agent: Agent) -> None:
        rng = np.random.default_rng([seed, 2])
        frozen = FrozenAgent(agent)
        everywhere = list(starts_everywhere(env))
        somewhere = [free_pose(env.world, env.room, rng) for _ in range(40)]
        for light in TRIAL_LIGHTS:
            now = settings.with_changes(light=light, max_steps=TRIAL_STEPS)
            with HomingEnv(now, observation="features", model=env.model) as world:
                world.reset(seed=seed)
                for pose in everywhere if light == 1 else somewhere:
                    steps, reached = run_episode(world, frozen, {"start": pose})
                    rows.append((0, *pose, len(steps), reached, light))
                for pose in somewhere if light == 1 else ():
                    steps, reached = run_episode(Kidnapped(world, _KIDNAPPED_AT, pose), frozen)
                    rows.append((1, *pose, len(steps) - _KIDNAPPED_AT, reached, light))

    names = ("kidnapped", "x", "y", "heading", "steps", "reached", "light")
    run(settings, seed, afterwards=afterwards)
    return dict(zip(names, np.array(rows or [(np.nan,) * len(names)], dtype=float).T, strict=True))


def abductions(settings: Settings, seed: int) -> Columns:
    """After learning, at 40 random free poses: an episode that starts there, and one in which the robot is carried
    there after eight steps from the usual start.

    One row per pose, `x`, `y` (m), `heading` (rad): steps from there, `begun` and `carried`, at most TRIAL_STEPS, and
    whether home was reached, `begun_home` and `carried_home`. A run that diverged: one row without numbers.
    """
    rows: list[tuple[float, ...]] = []

    def afterwards(env: HomingEnv, agent: Agent) -> None:
        rng, frozen = np.random.default_rng([seed, 4]), FrozenAgent(agent)
        worlds = [
            HomingEnv(settings.with_changes(max_steps=cap), observation="features", model=env.model)
            for cap in (TRIAL_STEPS, TRIAL_STEPS + _KIDNAPPED_AT)
        ]
        with worlds[0] as usual, worlds[1] as longer:
            for world in worlds:
                world.reset(seed=seed)
            for pose in (free_pose(env.world, env.room, rng) for _ in range(40)):
                begun, begun_home = run_episode(usual, frozen, {"start": pose})
                carried, carried_home = run_episode(Kidnapped(longer, _KIDNAPPED_AT, pose), frozen)
                rows.append((*pose, len(begun), begun_home, len(carried) - _KIDNAPPED_AT, carried_home))

    names = ("x", "y", "heading", "begun", "begun_home", "carried", "carried_home")
    run(settings, seed, afterwards=afterwards)
    return dict(zip(names, np.array(rows or [(np.nan,) * len(names)], dtype=float).T, strict=True))


def starts_everywhere(env: HomingEnv, spacing_m: float = 0.1, headings: int = 8) -> Iterator[Pose]:
    """Free poses on a grid over the whole room."""
    width, depth = env.room.size
    for x, y in product(np.arange(spacing_m / 2, width, spacing_m), np.arange(spacing_m / 2, depth, spacing_m)):
        if env.world.clearance(x, y) >= 0:
            yield from (Pose(float(x), float(y), wrapped(2 * pi * k / headings)) for k in range(headings))


def rows_after(
    settings: Settings,
    seed: int,
    names: Sequence[str],
    rows_of: Callable[[HomingEnv, Any], Iterable[tuple[float, ...]]],
) -> Columns:
    """A table of what is seen when a robot has learnt. rows_of: takes its world and the robot, and yields rows.

    A run that diverged has nothing to show: one row without numbers.
    """
    rows: list[tuple[float, ...]] = []
    run(settings, seed, afterwards=lambda env, agent: rows.extend(rows_of(env, agent)))
    return dict(zip(names, np.array(rows or [(np.nan,) * len(names)], dtype=float).T, strict=True))


def views(settings: Settings, seed: int) -> Columns:
    """The similarity of 400 random free views to home by the camera, `camera`, and by the settings' atlas, `atlas`."""
    from homing_lib.arena import Arena  # which needs PyBullet, as nothing else here does

    rows: list[tuple[float, ...]] = []

    def afterwards(env: HomingEnv, agent: Agent) -> None:
        assert env.model is not None
        rng = np.random.default_rng([seed, 3])
        with Arena(env.room, settings) as camera:
            for pose in (free_pose(camera, env.room, rng) for _ in range(400)):
                nrb = [similarity(env.model.features(world.histogram(pose))) for world in (camera, env.world)]
                rows.append((*pose, *nrb))

    run(settings.with_changes(episodes=1, max_steps=1), seed, afterwards=afterwards)
    return dict(zip(("x", "y", "heading", "camera", "atlas"), np.array(rows).T, strict=True))


def shortest(settings: Settings, seed: int) -> Columns:
    """`fewest_steps` from the room's start, under the same actions."""
    found: list[float] = []
    now = settings.with_changes(episodes=1, controller="random")
    run(now, seed, afterwards=lambda env, agent: found.append(fewest_steps(env)))
    return {"steps": np.array(found)}


def fewest_steps(env: HomingEnv, start: Pose | None = None) -> float:
    """The least number of steps from a pose, by default the room's start, to a view that ends an episode.

    Breadth-first search over poses, those in one cell of 2 cm and 10 degrees taken for the same: the least, up to what
    the cells hide. Moves that a wall stops are left out.
    """
    s, model = env.settings, env.model
    assert model is not None
    upper = stopping_thresholds(s.multiplier).upper
    frontier, seen = [start or env.room.start], set()
    for steps in range(1, s.max_steps + 1):
        reached = []
        for pose, (left, right) in product(frontier, s.wheel_commands_m):
            there, stopped = drive(pose, left, right, s.wheel_base_m, env.world.clearance)
            cell = (floor(there.x / 0.02), floor(there.y / 0.02), round(there.heading / (pi / 18)) % 36)
            if stopped or cell in seen:
                continue
            if similarity(model.features(env.world.histogram(there))) >= upper:
                return float(steps)
            seen.add(cell)
            reached.append(there)
        frontier = reached
    return float("nan")
