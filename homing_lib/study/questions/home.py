"""What is home for the robot, and where does it stop?"""

from collections.abc import Iterator
from math import cos, pi, radians, sin
from typing import Any

import numpy as np
import pandas as pd

from homing_lib.features import Array, HomeModel, bins_per_channel, histogram, similarity
from homing_lib.robot import Robot, wrapped
from homing_lib.rooms import Pose, Room, room_named
from homing_lib.settings import Settings
from homing_lib.study.bootstrap import Interval, bootstrap
from homing_lib.study.engine import run
from homing_lib.study.findings import (
    Comparison,
    Judged,
    by_construction,
    compare_to_limit,
    estimate,
    exact,
    question,
    side_of,
)
from homing_lib.study.runs import Columns
from homing_lib.study.studies import CAMERA_ROBOTS, ROOM_ROBOTS, ROOMS, labelled, rows, study
from homing_lib.survey import free_pose, survey
from homing_lib.thresholds import linear, stopping_thresholds

FAR_M, TURNED_DEG = 0.25, 45.0
"""A stop is right within this of home, and turned from its heading by no more.

At .25 m the nearer of home's objects, some .2 m ahead of home, have been passed, or look half as large. At 45 degrees,
the camera's field of view, a robot at home's place sees nothing of what the snapshot shows.
"""


def is_right(pose: Pose | Array, home: Pose) -> bool:
    """Whether a stop at this pose is right."""
    x, y, heading = np.subtract(pose, home)
    return bool(np.hypot(x, y) <= FAR_M and abs(wrapped(heading)) <= radians(TURNED_DEG))


def stops(settings: Settings, seed: int) -> Columns:
    """One row per episode that ends at home: the pose where it ends, `x`, `y` (m), and how far, `away_m`, and how much
    turned, `turned_deg`, that is from home. A run without any has one row without numbers.
    """
    result, home = run(settings, seed), room_named(settings.room).home
    last = result.steps[result.ended[result.reached] - 1]
    if not len(last):
        last = np.full((1, 3), np.nan)
    turned = [np.degrees(wrapped(heading - home.heading)) for heading in last[:, 2]]
    away = np.hypot(last[:, 0] - home.x, last[:, 1] - home.y)
    return {"x": last[:, 0], "y": last[:, 1], "away_m": away, "turned_deg": np.array(turned)}


STOPS = study(
    "home",
    "Where do robots that learn stop, in each room?",
    labelled(Settings(images="atlas", room=room) for room in ROOMS),
    ROOM_ROBOTS[:200],
    stops,
)

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
    seen: list[tuple[float, ...]] = []
    with Arena(room, settings) as world:
        three = survey(world, settings.with_changes(snapshots=3), home, rng)
        one = HomeModel(three.snapshots[:1], three.variance[:1])
        remembered = world.image(home)[:, :, :3].astype(np.float64) / 255
        for kind, pose in _poses(world, settings, room, rng):
            image = world.image(pose)
            view = histogram(image, settings.bin_size)
            raw = -float(((image[:, :, :3] / 255 - remembered) ** 2).mean())
            away = np.hypot(pose.x - home.x, pose.y - home.y)
            turned = np.degrees(wrapped(pose.heading - home.heading))
            seen.append((kind, away, turned, similarity(one.features(view)), similarity(three.features(view)), raw))
    return dict(zip(("kind", "away_m", "turned_deg", *STOPPING_RULES), np.array(seen, dtype=float).T, strict=True))


def _poses(world: Any, settings: Settings, room: Room, rng: np.random.Generator) -> Iterator[tuple[int, Pose]]:
    home = room.home
    yield from ((ANYWHERE, free_pose(world, room, rng)) for _ in range(3000))
    for ahead in range(-5, 6):
        for aside in range(-5, 6):
            x = home.x + 0.03 * (ahead * cos(home.heading) - aside * sin(home.heading))
            y = home.y + 0.03 * (ahead * sin(home.heading) + aside * cos(home.heading))
            if world.clearance(x, y) >= 0:
                yield from ((ABOUT_HOME, Pose(x, y, wrapped(home.heading + pi * k / 18))) for k in range(-6, 7))
    yield from ((AT_HOME, home._replace(heading=wrapped(home.heading + pi * k / 90))) for k in range(-45, 46))
    robot = Robot(world, settings, room.start)
    for _ in range(2000):
        robot.act(int(rng.integers(3)), rng)
        yield DRIVEN, robot.pose


STOPPING_RULES = ("one", "three", "raw")

VIEWED = ("paper", "attic")

VIEWS = study(
    "home-views",
    "At which places and headings does a rule stop the robot: that of eq. (19), one on three snapshots, and one on raw "
    "images? With the camera.",
    labelled(Settings(room=room) for room in VIEWED),
    CAMERA_ROBOTS[:5],
    rules_of_stopping,
)


def thresholds(views: Any) -> dict[str, float]:
    """What each rule of stopping must exceed, for as many false alarms all over the room as eq. (19) gives. views: rows
    of `VIEWS`, of one room.
    """
    false = views[(views.kind == ANYWHERE) & ((views.away_m > FAR_M) | (views.turned_deg.abs() > TURNED_DEG))]
    alarms = int((false.one >= stopping_thresholds(Settings().multiplier).upper).sum())
    return {rule: float(np.sort(false[rule])[-1 - alarms]) for rule in STOPPING_RULES}


def width(views: Any, rule: str, threshold: float) -> float:
    """Over how many degrees of heading a rule fires at home's place, mean over seeds."""
    return 2.0 * float((views[views.kind == AT_HOME][rule] > threshold).sum()) / views.seed.nunique()


def wider(views: Any, rule: str) -> Interval:
    """By how many degrees eq. (19) tolerates more at home than another rule; seeds are resampled, thresholds anew."""
    needed = views[views.kind.isin((ANYWHERE, AT_HOME))]
    by_seed = [one for _, one in needed.groupby("seed", observed=True)]

    def degrees(counts: Array) -> float:
        drawn = np.repeat(np.arange(len(by_seed)), counts.astype(int))
        resample = pd.concat([by_seed[seed].assign(seed=number) for number, seed in enumerate(drawn)])
        least = thresholds(resample)
        return width(resample, "one", least["one"]) - width(resample, rule, least[rule])

    def each(counts: Array) -> Array:
        unlike, place = np.unique(counts, axis=0, return_inverse=True)  # of a few seeds there are few
        return np.array([degrees(one) for one in unlike])[place.ravel()]

    return bootstrap(each, len(by_seed))


@question(
    "home",
    "Does the robot stop where home is?",
    f"""Learning on, all stops of twenty episodes. A stop is right within {FAR_M:g} m of home and {TURNED_DEG:g} degrees
    of its heading. The verdict counts the rooms in which at least 95 % of a robot's stops are right, with the whole
    interval (k = 6): "in n of 6 rooms".""",
    STOPS,
    order=3,
)
def home(table: Any) -> Judged:
    found: dict[str, Comparison] = {}
    for room in ROOMS:
        here = rows(table, room=room).dropna()
        right = (here.away_m <= FAR_M) & (here.turned_deg.abs() <= TURNED_DEG)
        shares = right.groupby(here.seed).mean().to_numpy(float)
        found[f"{room}.right"] = compare_to_limit(shares, 0.95, comparisons=len(ROOMS))
        found[f"{room}.away_m"] = estimate(here.groupby("seed").away_m.median().to_numpy(float))
        found[f"{room}.turned_deg"] = estimate(here.turned_deg.abs().groupby(here.seed).median().to_numpy(float))
    count = sum(found[f"{room}.right"].verdict == "above" for room in ROOMS)
    return f"in {count} of {len(ROOMS)} rooms", found


@question(
    "C5",
    "The stopping rule is less sensitive to orientation.",
    f"""By the camera, no robot drives. At the same share of false alarms (stops more than {FAR_M:g} m from home, or
    turned by more than {TURNED_DEG:g} degrees; as many as eq. (19) gives), eq. (19) fires at home's place over a wider
    range of headings than a rule on raw images, and than one on three snapshots. Supported, if it does so in both rooms
    against both; contradicted, if in both rooms it fires over a narrower one than either of them; else
    inconclusive.""",
    VIEWS,
)
def orientation(table: Any) -> Judged:
    found: dict[str, Comparison] = {}
    for room in VIEWED:
        views = rows(table, room=room)
        least = thresholds(views)
        found |= {f"{room}.{rule}.degrees": exact(width(views, rule, least[rule])) for rule in STOPPING_RULES}
        for rule in STOPPING_RULES[1:]:
            more = wider(views, rule)
            found[f"{room}.{rule}"] = Comparison(*more, side_of(more, 0.0, "wider", "narrower"), 1)
    words = [{found[f"{room}.{rule}"].verdict for room in VIEWED} for rule in STOPPING_RULES[1:]]
    if all(word == {"wider"} for word in words):
        return "supported", found
    return "contradicted" if {"narrower"} in words else "inconclusive", found


@question(
    "C6",
    "Multipliers 11 and 12 give the thresholds .904 and .908.",
    """By construction, if eq. (19) gives them, to three digits; else contradicted. Whether they tell home is asked by
    "home".""",
)
def thresholds_of_home() -> Judged:
    upper, lower = stopping_thresholds(12)
    return by_construction((round(lower, 3), round(upper, 3)) == (0.904, 0.908)), {}


@question(
    "C7",
    "Bins of 3 give 258 features.",
    "By construction, if eq. (14) gives them; else contradicted.",
)
def number_of_features() -> Judged:
    return by_construction(Settings().n_features == 3 * bins_per_channel(3) == 258), {}


@question(
    "C15",
    "The second form of the threshold changes more finely than the first.",
    """Multiplier by multiplier: by construction, if from 11 to 12 the second form moves less than the first; else
    contradicted. From the same threshold on it does not move less: that stands beside it.""",
)
def finer_threshold() -> Judged:
    upper, lower = stopping_thresholds(12)
    there = 1 / (pi * (1 - lower) ** 2)  # the first form's multiplier for the same threshold
    moves = {
        "second": upper - lower,
        "first": linear(12) - linear(11),
        "first, from the same threshold": linear(there + 1) - linear(there),
    }
    return by_construction(moves["second"] < moves["first"]), {name: exact(move) for name, move in moves.items()}
