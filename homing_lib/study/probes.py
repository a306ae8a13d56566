"""What is kept of a robot put down somewhere, of the views about home, and of where a run's updates point."""

from collections.abc import Iterator, Sequence
from itertools import islice
from math import cos, pi, sin
from typing import Any

import numpy as np

from homing_lib.agent import STEP_COLUMNS, Agent, SarsaAgent
from homing_lib.environment import HomingEnv, free_pose, survey
from homing_lib.features import Array, HomeModel, histogram, similarity
from homing_lib.lambdas import parse
from homing_lib.robot import Robot, wrapped
from homing_lib.rooms import Pose, room_named
from homing_lib.settings import Settings
from homing_lib.study.engine import run, run_episode
from homing_lib.study.measures import TRIAL_STEPS, fewest_steps, starts_everywhere
from homing_lib.study.robots import ClimbGuidedAgent, FrozenAgent
from homing_lib.study.runs import Columns
from homing_lib.study.theorem import beta

# --- Put down somewhere ----------------------------------------------------------------------------------------------

SHARES = (0.0, 0.3, 0.5, 0.7)
"""Shares of a trial's steps at which a trained robot climbs, which `searched` tries; 0: it drives as it learnt."""

USUAL = 10  # trials from the room's own start


CLIMBING = 0.7
"""The share at which a robot climbs that is to come home from anywhere: `opponents.chosen`, on seeds of the search."""


def placed(settings: Settings, seed: int) -> Columns:
    """Trials from each place of the room, and `USUAL` from its start, of a robot that learns nothing more.

    One that has learnt makes them twice: it drives as it learnt to, and it climbs in a share `CLIMBING` of its steps.
    """
    return _placed(settings, seed, (0.0, CLIMBING))


def searched(settings: Settings, seed: int) -> Columns:
    """The same for each of `SHARES`, and with half of the steps at random instead: share -.5."""
    return _placed(settings, seed, (*SHARES, -0.5))


def _placed(settings: Settings, seed: int, shares: Sequence[float]) -> Columns:
    """One row per trial: `share`, `usual` (1: from the room's start), the pose `x`, `y` (m), `heading` (rad) where it
    began, `steps` (cut at TRIAL_STEPS) and `reached`. A run that diverged has one row without numbers.

    Each place has a heading of its own, drawn anew for each seed; all agents and shares of a seed have the same.
    """
    rows: list[tuple[float, ...]] = []

    def afterwards(env: HomingEnv, agent: Agent) -> None:
        poses = _poses_everywhere(env, seed)
        now = settings.with_changes(max_steps=TRIAL_STEPS)
        with HomingEnv(now, observation="features", model=env.model) as world:
            for share in shares if isinstance(agent, SarsaAgent) else shares[:1]:
                world.reset(seed=seed)
                driver = _driver(agent, share, np.random.default_rng([seed, 5]))
                for usual, pose in [(0, pose) for pose in poses] + USUAL * [(1, env.room.start)]:
                    driver.begin_episode(1)
                    steps, reached = run_episode(world, driver, {"start": pose})
                    rows.append((share, usual, *pose, len(steps), reached))

    run(settings, seed, afterwards=afterwards)
    return _columns(("share", "usual", "x", "y", "heading", "steps", "reached"), rows)


def _driver(agent: Agent, share: float, rng: np.random.Generator) -> Agent:
    """Who drives the trials: an agent that learns nothing more."""
    if not isinstance(agent, SarsaAgent):
        return agent
    return ClimbGuidedAgent(agent, share, rng) if share else FrozenAgent(agent)


def where_lost(settings: Settings, seed: int) -> Columns:
    """Of the trials of `placed` that a robot drives as it learnt to, those from which it does not come home.

    One row each: `x`, `y` where it began (m), and of its last hundred steps the mean place, `end_x`, `end_y`, their
    root mean square distance from it, `spread_m`, and the share that is spent at walls, `at_wall`.
    """
    rows: list[tuple[float, ...]] = []

    def afterwards(env: HomingEnv, agent: Agent) -> None:
        now = settings.with_changes(max_steps=TRIAL_STEPS)
        with HomingEnv(now, observation="features", model=env.model) as world:
            world.reset(seed=seed)
            for pose in _poses_everywhere(env, seed):
                steps, reached = run_episode(world, FrozenAgent(agent), {"start": pose})
                if not reached:
                    last = steps[-100:]
                    end = last[:, :2].mean(axis=0)
                    spread = np.sqrt(((last[:, :2] - end) ** 2).sum(axis=1).mean())
                    rows.append((pose.x, pose.y, *end, spread, last[:, STEP_COLUMNS.index("at_wall")].mean()))

    run(settings, seed, afterwards=afterwards)
    return _columns(("x", "y", "end_x", "end_y", "spread_m", "at_wall"), rows)


def _poses_everywhere(env: HomingEnv, seed: int) -> list[Pose]:
    """One at each place of the room."""
    rng = np.random.default_rng([seed, 4])
    return [pose._replace(heading=rng.uniform(-pi, pi)) for pose in starts_everywhere(env, headings=1)]


def nearest_way(settings: Settings, seed: int) -> Columns:
    """The least number of steps from the start, and from ten random free poses: `usual`, the pose, `steps`."""
    rows: list[tuple[float, ...]] = []

    def afterwards(env: HomingEnv, agent: Agent) -> None:
        rng = np.random.default_rng([seed, 6])
        somewhere = [(0, free_pose(env.world, env.room, rng)) for _ in range(10)]
        for usual, pose in [(1, env.room.start), *somewhere]:
            rows.append((usual, *pose, fewest_steps(env, pose)))

    run(settings.with_changes(episodes=1, controller="random"), seed, afterwards=afterwards)
    return _columns(("usual", "x", "y", "heading", "steps"), rows)


def _columns(names: Sequence[str], rows: Sequence[tuple[float, ...]]) -> Columns:
    return dict(zip(names, np.array(rows or [(np.nan,) * len(names)], dtype=float).T, strict=True))


# --- The views about home --------------------------------------------------------------------------------------------

ANYWHERE, ABOUT_HOME, AT_HOME, DRIVEN = range(4)
"""Kinds of poses of `rules_of_stopping`: all over the room; on a lattice about home; at home, turned; on a drive."""


def rules_of_stopping(settings: Settings, seed: int) -> Columns:
    """What three rules of stopping make of the same views, by the camera.

    One row per view: `kind` of the pose, `away_m` and `turned_deg` from home, and what each rule compares: `one`, the
    similarity to one snapshot (eq. 15, 19); `three`, to three of them (m = 3); `raw`, the mean squared difference of
    the image from the snapshot's, intensities in [0, 1], negated, so that more is nearer.

    Kinds: 3,000 free poses all over the room; places 3 cm apart within 15 cm of home along both axes, every 10 degrees
    up to 60; home's place, every 2 degrees; and a drive of 2,000 random actions from the start.
    """
    from homing_lib.arena import Arena  # which needs PyBullet

    room = room_named(settings.room)
    home, rng = room.home, np.random.default_rng([seed, 7])
    rows: list[tuple[float, ...]] = []
    with Arena(room, settings) as world:
        three = survey(world, settings.with_changes(snapshots=3), home, rng)
        one = HomeModel(three.snapshots[:1], three.variance[:1])
        remembered = world.image(home)[:, :, :3].astype(np.float64) / 255
        for kind, pose in _poses(world, settings, room.start, home, rng):
            image = world.image(pose)
            view = histogram(image, settings.bin_size)
            raw = -float(((image[:, :, :3] / 255 - remembered) ** 2).mean())
            away = np.hypot(pose.x - home.x, pose.y - home.y)
            turned = np.degrees(wrapped(pose.heading - home.heading))
            rows.append((kind, away, turned, similarity(one.features(view)), similarity(three.features(view)), raw))
    return _columns(("kind", "away_m", "turned_deg", "one", "three", "raw"), rows)


def _poses(
    world: Any, settings: Settings, start: Pose, home: Pose, rng: np.random.Generator
) -> Iterator[tuple[int, Pose]]:
    room = room_named(settings.room)
    yield from ((ANYWHERE, free_pose(world, room, rng)) for _ in range(3000))
    for ahead in range(-5, 6):
        for aside in range(-5, 6):
            x = home.x + 0.03 * (ahead * cos(home.heading) - aside * sin(home.heading))
            y = home.y + 0.03 * (ahead * sin(home.heading) + aside * cos(home.heading))
            if world.clearance(x, y) >= 0:
                yield from ((ABOUT_HOME, Pose(x, y, wrapped(home.heading + pi * k / 18))) for k in range(-6, 7))
    yield from ((AT_HOME, home._replace(heading=wrapped(home.heading + pi * k / 90))) for k in range(-45, 46))
    robot = Robot(world, settings, start)
    for _ in range(2000):
        robot.act(int(rng.integers(3)), rng)
        yield DRIVEN, robot.pose


# --- Where the updates point -----------------------------------------------------------------------------------------

AGREES = 1e-9
"""How far two directions that are the same may differ, relative to their length: rounding, over some hundred steps."""


class Watched:
    """A lambda rule that computes beside its own what conjugate gradient would do at the same steps.

    asked: for every step but an episode's first, whether the update of all actions' weights, and of those of the action
    taken alone, points where conjugate gradient does since the episode's first step, and since its last restart,
    which is where lambda was reset to 0. A step's delta phi is the descent direction g; p = g + beta p_prev.
    """

    def __init__(self, name: str) -> None:
        self._form, self._rule = parse(name).name, parse(name).rule
        self._phi: Array = np.empty(0)
        self.asked: list[tuple[bool, bool, bool, bool]] = []

    def __call__(
        self, *, delta: float, phi: Array, delta_prev: float, phi_prev: Array, trace_prev: Array, discount: float
    ) -> float:
        if phi_prev is not self._phi:  # the second step of an episode: the first went along its own gradient
            self._strict = self._restarted = delta_prev * phi_prev
        self._phi = phi
        g, g_prev = delta * phi, delta_prev * phi_prev
        ratio = self._rule(
            delta=delta, phi=phi, delta_prev=delta_prev, phi_prev=phi_prev, trace_prev=trace_prev, discount=discount
        )
        lambda_t = min(max(0.0, ratio), 1.0)
        every = delta * (discount * lambda_t * trace_prev + phi)
        taken = every.reshape(3, -1) * (phi.reshape(3, -1) != 0).any(axis=1, keepdims=True)
        form: Any = self._form
        self._strict = g + beta(form, g, g_prev, self._strict) * self._strict
        self._restarted = g if ratio < 0 else g + beta(form, g, g_prev, self._restarted) * self._restarted
        self.asked.append(
            tuple(_agree(done.ravel(), wanted) for wanted in (self._strict, self._restarted) for done in (every, taken))  # type: ignore[arg-type]
        )
        return ratio


def _agree(done: Array, wanted: Array) -> bool:
    return bool(np.linalg.norm(done - wanted) <= AGREES * np.linalg.norm(wanted))


def directions(settings: Settings, seed: int) -> Columns:
    """Where a run's updates point: those of the settings, of the action taken or of all.

    One row per episode: its `steps`; of them, those before the first whose lambda was reset (`unclipped`), those before
    the direction first leaves that of conjugate gradient (`until`), those that follow it in all (`follows`), and those
    that follow it since the last restart (`restarted`).
    """
    watched = Watched(settings.lambda_rule)
    result = run(settings, seed, lambda_rule=watched)
    which = 0 if settings.update == "all" else 1
    asked, rows = iter(watched.asked), []
    # A rule that is undefined somewhere would be out of step with the episodes.
    assert result.diverged or len(watched.asked) == (result.lengths - 1).sum()
    for length, end in zip(result.lengths, result.ended, strict=True):
        clipped = np.logical_or.accumulate(result.column("clipped")[end - length : end] > 0)
        later = ((one[which], one[2 + which]) for one in islice(asked, int(length) - 1))
        strict, restarted = np.array([(True, True), *later]).T
        until = np.logical_and.accumulate(strict).sum()
        rows.append((length, (~clipped).sum(), until, strict.sum(), restarted.sum()))
    return _columns(("steps", "unclipped", "until", "follows", "restarted"), rows)
