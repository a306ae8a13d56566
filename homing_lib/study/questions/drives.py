"""What drives the learning: reward, start value, what home is worth? And is it the policy learnt, or learning itself?

A robot that has learnt is tried in several ways, from the room's start and with its own exploration. *Restored*: it
goes on learning, but each trial begins with the saved weights. *Frozen*: the same weights, no learning. *Forgetful*: it
learns, but each trial begins with the initial weights. *Untrained*: the initial weights, no learning. So the weights
that were learnt and the learning under way are each there or not, in all four ways.
"""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from homing_lib.agent import STEP_COLUMNS
from homing_lib.environment import HomingEnv
from homing_lib.features import Array
from homing_lib.settings import Settings
from homing_lib.study.engine import run_episode
from homing_lib.study.findings import Comparison, Judged, compare_steps, estimate, question
from homing_lib.study.measures import TRIAL_STEPS, after_learning
from homing_lib.study.questions import varying
from homing_lib.study.robots import driver
from homing_lib.study.studies import CAMERA_ROBOTS, ROBOTS, ROOM_ROBOTS, ROOMS, labelled, rows, study
from homing_lib.thresholds import stopping_thresholds

AFTER = (5, 10, 20)
JUDGED_AFTER = 10

CAPS = (TRIAL_STEPS, 2000)

KINDS = ("learning on", "restored", "frozen", "greedy", "forgetful", "untrained", "climb", "random")


_ATLAS = Settings(images="atlas")


def after(episodes: int, like: Settings = _ATLAS, **changes: Any) -> Settings:
    """The first episodes of the schedule of twenty, its rates continued where there are more. like: all else."""
    share = Settings().first_episode / episodes
    return like.with_changes(**{"episodes": episodes, "first_episode_share": share, **changes})


HABITS = ("stay_up", "stay_down", "at_wall", "one_action", "spread_m", "stuck_at_wall")
"""How robots drive, and where those that do not come home are stuck."""


@after_learning("kind", "steps", "cut", "home", *HABITS)
def tried(settings: Settings, seed: int, env: HomingEnv, agent: Any) -> Iterator[tuple[float, ...]]:
    """What a robot that has learnt does from the start, tried in all ways. One row for each, `kind`, its place in
    KINDS.

    Means over three trials (with the camera one, and none of the greedy robot) of at most 2,000 steps: `steps`, the
    same cut at TRIAL_STEPS, `cut`, and `home`, whether it came home; then `stay_up` and `stay_down`, the shares of the
    steps after which the same action was taken again, where the view had come closer to the snapshot and where it had
    not; and `at_wall`. Of the last thousand steps of those trials that did not come home: `one_action`, the share of
    the action taken most; `spread_m`, the root mean square distance from their mean place; `stuck_at_wall`.
    """
    trials = 1 if settings.images == "camera" else 3
    saved, initial = agent.learner.weights.copy(), np.full_like(agent.learner.weights, settings.theta0)
    with HomingEnv(settings.with_changes(max_steps=CAPS[-1]), observation="features", model=env.model) as world:
        for kind, name in enumerate(KINDS):
            if name == "greedy" and settings.images == "camera":
                continue  # it would drive for most of the time, and is not asked about
            rng = np.random.default_rng([seed, 6, kind])
            weights = initial if name in ("forgetful", "untrained") else saved
            robot = driver(name, agent, settings, weights, rng)
            world.reset(seed=seed)
            each = []
            for _ in range(trials):
                robot.begin_episode(settings.episodes + 1)
                each.append(run_episode(world, robot))
            yield (kind, *summed_up(each))


def summed_up(trials: Sequence[tuple[Array, bool]]) -> tuple[float, ...]:
    """Of trials, each its steps and whether it came home: `steps`, `cut`, `home` and HABITS, as `tried` says."""
    action, similarity, at_wall = (STEP_COLUMNS.index(name) for name in ("action", "similarity", "at_wall"))
    lengths = np.array([len(path) for path, _ in trials])
    home = np.mean([reached for _, reached in trials])
    again, rose = [], []
    for path, _ in trials:
        chosen = (path[1:-1, at_wall] == 0) & (path[2:, at_wall] == 0)  # the reflex keeps to its side
        again.append((path[2:, action] == path[1:-1, action])[chosen])
        rose.append((np.diff(path[:-1, similarity]) > 0)[chosen])
    same, up = np.concatenate(again), np.concatenate(rose)
    stay = [same[some].mean() if some.any() else np.nan for some in (up, ~up)]
    walls = np.concatenate([path[:, at_wall] for path, _ in trials]).mean()
    stuck = [
        (
            np.unique(path[:, action], return_counts=True)[1].max() / len(path),
            np.sqrt(path[:, :2].var(axis=0).sum()),
            path[:, at_wall].mean(),
        )
        for path in (path[-1000:] for path, reached in trials if not reached)
    ]
    held = np.mean(stuck or [(np.nan,) * 3], axis=0)
    return (lengths.mean(), np.minimum(lengths, CAPS[0]).mean(), home, *stay, walls, *held)


PAPER = study(
    "drives",
    "After 5, 10 and 20 episodes: is it the weights learnt that bring the robot home, or the learning under way?",
    labelled(after(number) for number in AFTER),
    ROBOTS,
    tried,
)

IN_ROOMS = study(
    "drives-rooms",
    "The same after ten episodes in five other rooms.",
    labelled(after(JUDGED_AFTER, room=room) for room in ROOMS[1:]),
    ROOM_ROBOTS,
    tried,
)

SLIP = study(
    "drives-slip",
    "The same with wheels that slip by 2 %: is it that a lattice sends the robot round the very same poses?",
    labelled([after(JUDGED_AFTER, wheel_slip=0.02)]),
    ROOM_ROBOTS,
    tried,
)

CAMERA = study(
    "drives-camera",
    "The same with the camera.",
    labelled([after(JUDGED_AFTER, images="camera")]),
    CAMERA_ROBOTS,
    tried,
)


RULES = (varying.FORM_2, "fixed:0", "fixed:0.5", "fixed:0.9")


def with_rule(update: str, rule: str) -> Settings:
    chosen = varying.chosen("paper", update, rule)
    return after(JUDGED_AFTER, update=chosen.update, lambda_rule=rule, alpha0=chosen.alpha0)


OTHER_RULES = study(
    "drives-rules",
    "The same with other rules of lambda, each at its own best step size: is it form 2's doing?",
    lambda: labelled(with_rule(update, rule) for update in varying.UPDATES for rule in RULES),
    ROOM_ROBOTS,
    tried,
    needs=[varying.CHOICE.second],
)


HOME_VALUE = round(Settings().n_features * stopping_thresholds(Settings().multiplier).upper, 1)
"""n psi_upper: what the view that ends an episode is worth at theta_0 = 1, and so the bonus in place of a bootstrap."""

START: dict[str, dict[str, Any]] = {
    "as is": {},
    "no reward": {"reward_scale": 0.0},
    "reward negated": {"reward_scale": -1.0},
    "constant cost": {"step_cost": "constant", "approach_reward": False},
    "home masked": {"bootstrap_terminal": False},
    "home masked but a bonus": {"bootstrap_terminal": False, "terminal_bonus": HOME_VALUE},
    "start value a tenth": {"theta0": 0.1},
    "start value 0": {"theta0": 0.0},
    "start value 0 but a bonus": {"theta0": 0.0, "bootstrap_terminal": False, "terminal_bonus": HOME_VALUE},
}
"""Reward, start value and what home is worth. With theta_0 = 1 the value of an action is at first n times the
similarity of the view: potential-based shaping (Ng, Harada and Russell, ICML 1999; as a start value, Wiewiora, JAIR 19,
2003)."""

BY_START = study(
    "drives-start",
    "Reward, start value and what home is worth, after twenty episodes: what does the robot learn by?",
    labelled(after(20, **changes) for changes in START.values()),
    ROOM_ROBOTS,
    tried,
)


NEVER_HOME = {"steps": CAPS[-1], "median": CAPS[-1], "start_steps": CAPS[-1], "cut": CAPS[0]}
"""What counts for a robot that diverged, in its trials; in any other column 0."""


def outcomes(table: Any, name: str, kind: str, kinds: Sequence[str] = KINDS, **values: Any) -> Array:
    """A column of a table of trials: of a kind, in the rows with these values, one number per robot, seeds in order.
    One that diverged never comes home.
    """
    here = rows(table, **values)
    column = here[here.kind == kinds.index(kind)].set_index("seed").reindex(np.sort(here.seed.unique()))[name]
    return np.asarray(column.fillna(NEVER_HOME.get(name, 0)).to_numpy(float))


PAIRS = ("restored.frozen", "restored.forgetful")
"""Is the learning under way needed, and are the weights that were learnt?"""


def compared(table: Any, name: str, comparisons: int = 0, **values: Any) -> dict[str, Comparison]:
    """Trials of each kind, their pairs at both caps, and the frozen robot beside random actions."""
    here = rows(table, **values)
    kinds = [KINDS[int(kind)] for kind in sorted(here.kind.dropna().unique())]
    found: dict[str, Comparison] = {}
    for cap, column in zip(CAPS, ("cut", "steps"), strict=True):
        taken = {kind: outcomes(here, column, kind) for kind in kinds}
        for pair in PAIRS:
            ours, theirs = pair.split(".")
            found[f"{name}.{pair}.{cap}"] = compare_steps(taken[ours], taken[theirs], comparisons=comparisons)
    found[f"{name}.frozen.random.{CAPS[-1]}"] = compare_steps(taken["frozen"], taken["random"])
    for kind, steps in taken.items():
        found[f"{name}.{kind}.steps"] = estimate(steps)
        found[f"{name}.{kind}.home"] = estimate(outcomes(here, "home", kind))
    return found


COMPARISONS = len(ROOMS) * len(PAIRS) * len(CAPS)

VERDICTS = {
    (True, True): "both together",
    (True, False): "the learning under way",
    (False, True): "the policy learnt",
    (False, False): "neither",
}


@question(
    "drives",
    "What brings the robot home: the policy that it has learnt, or the learning under way?",
    """Form 2 at the default step size, after ten of the twenty episodes, from the room's start. The learning under way
    is needed where the restored robot takes fewer steps than the frozen one; the weights learnt are needed where it
    takes fewer than the forgetful one; at caps of 300 and of 2,000 steps a trial (k = 24: six rooms, two pairs, two
    caps). The verdict: "both together", if in each room and at each cap both are; "the learning under way", if only it
    is, everywhere; "the policy learnt", likewise; "neither", if neither is anywhere; else "it depends on the room".
    Beside it: the camera, slipping wheels, other rules of lambda, other numbers of episodes, other rewards and start
    values.""",
    PAPER,
    IN_ROOMS,
    SLIP,
    CAMERA,
    OTHER_RULES,
    BY_START,
    order=4,
)
def drives(paper: Any, others: Any, slip: Any, camera: Any, by_rule: Any, by_start: Any) -> Judged:
    found = compared(paper, "paper", COMPARISONS, episodes=JUDGED_AFTER)
    for room in ROOMS[1:]:
        found |= compared(others, room, COMPARISONS, room=room)
    needed = [{found[f"{room}.{pair}.{cap}"].verdict == "fewer" for room in ROOMS for cap in CAPS} for pair in PAIRS]
    for number in AFTER:
        found |= compared(paper, f"after {number}", episodes=number)
    found |= compared(slip, "slip") | compared(camera, "camera")
    for update in varying.UPDATES:
        for rule in RULES:
            name = f"{update}.{rule.replace(varying.FORM_2, 'form2').replace(':', '')}"
            found |= compared(by_rule, name, like=with_rule(update, rule))
    as_is = outcomes(by_start, "steps", "restored", like=after(20))
    for name, changes in START.items():
        wanted = after(20, **changes)
        found |= compared(by_start, name, like=wanted)
        found[f"{name}.of as is"] = compare_steps(outcomes(by_start, "steps", "restored", like=wanted), as_is)
    for kind in ("restored", "frozen", "greedy", "climb"):
        its = rows(paper, kind=KINDS.index(kind), episodes=JUDGED_AFTER)
        found |= {f"why.{kind}.{habit}": estimate(its[habit].dropna()) for habit in HABITS}
    if any(len(everywhere) > 1 for everywhere in needed):
        return "it depends on the room", found
    return VERDICTS[needed[0] == {True}, needed[1] == {True}], found
