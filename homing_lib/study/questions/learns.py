"""With declared choices, does the robot learn the u-turn?"""

from math import asin, atan2, hypot
from typing import Any

import numpy as np

from homing_lib.features import Array
from homing_lib.robot import wrapped
from homing_lib.rooms import Box, Room, room_named
from homing_lib.settings import Settings
from homing_lib.study.bootstrap import Interval, bootstrap, iqm, mean
from homing_lib.study.findings import (
    OF_A_QUESTION,
    Comparison,
    Judged,
    compare_steps,
    compare_to_limit,
    estimate,
    question,
    verdict_of,
)
from homing_lib.study.measures import TRIAL_STEPS, WINDOW, curve, shortest
from homing_lib.study.runs import episodes_of
from homing_lib.study.studies import CAMERA_ROBOTS, HEADLINE_SEEDS, ROBOTS, ROOMS, UNLEARNT, column, labelled, study

EPISODES = 20

ATLAS = study(
    "learns",
    "A hundred episodes on the lattice, with the rates of the schedule of twenty continued: the first twenty are its.",
    {"form 2": Settings(images="atlas", episodes=100, first_episode_share=Settings().first_episode / 100)},
    ROBOTS,
    curve,
)

CAMERA = study(
    "learns-camera",
    "Form 2 and fixed 0 with the camera.",
    {"form 2": Settings(), "fixed 0": Settings(lambda_rule="fixed:0")},
    CAMERA_ROBOTS,
    curve,
)

SHORTEST = study(
    "shortest",
    "The least number of steps that the robot's actions allow.",
    labelled(Settings(images="atlas", room=room) for room in ROOMS),
    HEADLINE_SEEDS,
    shortest,
)


def first_and_last(table: Any) -> tuple[Array, Array]:
    """Form 2's mean steps of the first and the last five of twenty episodes, one number per robot."""
    taken = episodes_of(table, "form 2")[:, :EPISODES]
    return taken[:, :WINDOW].mean(axis=1), taken[:, -WINDOW:].mean(axis=1)


@question(
    "learns",
    "With declared choices, does the robot learn?",
    """The last five of twenty episodes, learning on, take fewer steps than the first five, and than random actions in
    the same room: yes, if both hold with the camera and on the atlas; no, if with either the last five take the same as
    the first, or more, or as random actions; else undecided (k = 4). The climb stands beside it.""",
    ATLAS,
    CAMERA,
    UNLEARNT,
    SHORTEST,
    order=2,
)
def learns(atlas: Any, camera: Any, unlearnt: Any, shortest: Any) -> Judged:
    random, climb = (column(unlearnt, "late", room="paper", controller=who) for who in ("random", "climb"))
    found: dict[str, Comparison] = {}
    for name, table in (("atlas", atlas), ("camera", camera)):
        first, last = first_and_last(table)
        chance = np.full_like(last, random.mean())  # its robots are others: their mean is taken as it is
        found[f"{name}.of first"] = compare_steps(last, first, comparisons=4)
        found[f"{name}.of random"] = compare_steps(last, chance, comparisons=4)
        found[f"{name}.of climb"] = compare_steps(last, np.full_like(last, climb.mean()))
        found |= {f"{name}.first": estimate(first), f"{name}.last": estimate(last)}
    words = [one.verdict for one in found.values() if one.judged]
    found["random"], found["climb"] = estimate(random), estimate(climb)
    found |= {f"shortest.{room}": estimate(column(shortest, "steps", room=room)) for room in ROOMS}
    ours, theirs = (episodes_of(camera, who) for who in ("form 2", "fixed 0"))
    found["camera.fixed0.total"] = compare_steps(ours.sum(axis=1), theirs.sum(axis=1))
    found["camera.fixed0.late"] = compare_steps(ours[:, -WINDOW:].mean(axis=1), theirs[:, -WINDOW:].mean(axis=1), iqm)
    on_lattice, by_camera = (first_and_last(table)[1][: len(CAMERA_ROBOTS)] for table in (atlas, camera))
    found["lattice.late"] = compare_steps(on_lattice, by_camera, iqm)
    return verdict_of(words, ["fewer"], ["the same", "more"], OF_A_QUESTION), found


@question(
    "C3",
    "Learning converges within 20 episodes.",
    """Learning on, on the atlas; the rates of the schedule of twenty episodes are continued to a hundred. Supported, if
    the last five of twenty episodes take the same steps as the last five of a hundred (interquartile means), or fewer;
    contradicted, if more; else inconclusive.""",
    ATLAS,
)
def converges(atlas: Any) -> Judged:
    taken = episodes_of(atlas, "form 2")
    late, much_later = (taken[:, end - WINDOW : end].mean(axis=1) for end in (EPISODES, 100))
    compared = compare_steps(late, much_later, iqm, comparisons=1)
    return verdict_of([compared.verdict], ["the same", "fewer"], ["more"]), {"late": compared}


@question(
    "C4",
    "A hidden goal: from one snapshot, without landmarks, the robot solves the u-turn.",
    f"""Learning on. Supported, if from the start no part of a home object is in view, and of a robot's last five of
    twenty episodes at least 95 % end at home within {TRIAL_STEPS} steps, with the whole interval; contradicted, if an
    object is in view or fewer do; else inconclusive. With the camera and on the atlas, the atlas decides.""",
    ATLAS,
    CAMERA,
)
def hidden_goal(atlas: Any, camera: Any) -> Judged:
    settings = Settings()
    soon, soon_by_camera = (
        (episodes_of(table, "form 2")[:, EPISODES - WINDOW : EPISODES] <= TRIAL_STEPS).mean(axis=1)
        for table in (atlas, camera)
    )
    found = {"atlas.home": compare_to_limit(soon, 0.95), "camera.home": estimate(soon_by_camera)}
    if in_view(room_named(settings.room), settings.field_of_view_deg):
        return "contradicted", found
    return verdict_of([found["atlas.home"].verdict], ["above"], ["below"]), found


def in_view(room: Room, field_of_view_deg: float) -> list[str]:
    """Home objects that stand, at least in part, within the camera's angle at the start; walls hide nothing here."""
    seen = []
    for thing in (one for one in room.objects if one.name in room.home_objects):
        radius = hypot(*thing.size[:2]) / 2 if isinstance(thing, Box) else thing.radius
        dx, dy = thing.x - room.start.x, thing.y - room.start.y
        bearing = abs(wrapped(atan2(dy, dx) - room.start.heading))
        if bearing - asin(min(radius / hypot(dx, dy), 1.0)) < np.radians(field_of_view_deg) / 2:
            seen.append(thing.name)
    return seen


@question(
    "C13",
    "Good episodes begin around the ninth.",
    """Learning on, on the atlas. The first good episode is the first whose steps, a mean over the robots, are at most
    one and a half times those of the last five of twenty. Supported, if its interval lies within 7 to 11; contradicted,
    if it leaves all of 7 to 11 out; else inconclusive.""",
    ATLAS,
)
def around_the_ninth(atlas: Any) -> Judged:
    first = first_good(episodes_of(atlas, "form 2")[:, :EPISODES])
    inside, outside = first.low >= 7 and first.high <= 11, first.high < 7 or first.low > 11
    verdict = "supported" if inside else "contradicted" if outside else "inconclusive"
    return verdict, {"first good": Comparison(*first, judged=1)}


def first_good(taken: Array) -> Interval:
    """The first episode whose mean steps are at most one and a half times those of the last five. Shape (robots,
    episodes).
    """

    def first(counts: Array) -> Array:
        means = mean(taken, counts)
        good = means <= 1.5 * means[:, -WINDOW:].mean(axis=1, keepdims=True)
        return 1.0 + np.argmax(good, axis=1)

    return bootstrap(first, len(taken))
