"""The robot's body: exact arcs of a differential drive, the obstacle that stops them, and the reflex that follows.

Where the robot is, the world and the records know; the learner never does.
"""

from collections.abc import Callable
from math import atan2, cos, pi, radians, sin
from typing import Protocol

import numpy as np

from homing_lib.features import Array
from homing_lib.rooms import Pose
from homing_lib.settings import Settings

LEFT_FORWARD, RIGHT_FORWARD, GO_FORWARD = range(3)  # section III.D

INFRARED_ANGLES_DEG = (85.0, 45.0, 10.0, -10.0, -45.0, -85.0, 160.0, -160.0)  # anticlockwise from ahead (Khepera II)
FRONT_SENSORS = slice(1, 5)  # 45, 10, -10 and -45 degrees: they decide whether the way is clear


class World(Protocol):
    """What can be asked about a pose, of the arena itself or of an atlas of it."""

    def histogram(self, pose: Pose) -> Array:
        """Scaled histograms of the view (eq. 11), shape (3 B,)."""

    def clearance(self, x: float, y: float) -> float:
        """Metres between the body centred there and the nearest obstacle; negative inside one."""

    def infrared(self, pose: Pose) -> Array:
        """Metres that each of the eight sensors sees, shape (8,)."""


def wrapped(angle: float) -> float:
    """The same angle in [-pi, pi]."""
    return atan2(sin(angle), cos(angle)) if abs(angle) > pi else angle


def arc(pose: Pose, left: float, right: float, wheel_base: float) -> Pose:
    """The pose after the wheels rolled `left` and `right` metres without slip, at a constant ratio of speeds."""
    x, y, heading = pose
    turn = (right - left) / wheel_base
    half = turn / 2
    chord = (left + right) / 2 * (sin(half) / half if half else 1.0)
    direction = heading + half
    return Pose(x + chord * cos(direction), y + chord * sin(direction), wrapped(heading + turn))


def drive(
    pose: Pose, left: float, right: float, wheel_base: float, clearance: Callable[[float, float], float]
) -> tuple[Pose, bool]:
    """Follow the arc to its end, or until the body touches something. Returns the pose and whether it was stopped.

    A clearance changes by no more than the centre moves: an arc shorter than that at its start needs no further look.
    """
    end, advance = arc(pose, left, right, wheel_base), abs(left + right) / 2
    if not advance or clearance(pose.x, pose.y) > advance:
        return end, False

    def touches(share: float) -> bool:
        x, y, _ = arc(pose, share * left, share * right, wheel_base)
        return clearance(x, y) < 0

    for blocked in (0.25, 0.5, 0.75, 1.0):
        if touches(blocked):
            break
    else:
        return end, False
    free = blocked - 0.25
    for _ in range(10):
        middle = (free + blocked) / 2
        free, blocked = (free, middle) if touches(middle) else (middle, blocked)
    return arc(pose, free * left, free * right, wheel_base), True


class Robot:
    """A body in a world, with the reactive behaviour of section V.A.

    A move that an obstacle stops sets off the reflex: whatever is commanded next, the robot turns **in place**, by the
    angle of a turning action, to one random side, until the four front sensors see a clear way. Each such turn is
    driven, and to be credited, as that side's action. `reflex` says which action the next step will drive, if any.
    """

    def __init__(self, world: World, settings: Settings, pose: Pose) -> None:
        self._world = world
        self.wheel_base_m, self.slip = settings.wheel_base_m, settings.wheel_slip
        self.clear_way_m, self.commands_m = settings.clear_way_m, settings.wheel_commands_m
        turn = radians(settings.turn_deg) * settings.wheel_base_m / 2
        self.turns_m = (-turn, turn), (turn, -turn)
        self.place(pose)

    def place(self, pose: Pose) -> None:
        """Put the robot down somewhere; any reflex ends."""
        self.pose = pose
        self.reflex: int | None = None

    def act(self, action: int, rng: np.random.Generator) -> tuple[int, bool]:
        """One step. Returns the action driven, and whether the robot was at a wall: stopped, or in the reflex."""
        reflex = self.reflex
        if reflex is None:
            left, right = self.commands_m[action]
        else:
            action, (left, right) = reflex, self.turns_m[reflex]
        if self.slip:
            left, right = (way * (1 + self.slip * rng.standard_normal()) for way in (left, right))
        self.pose, stopped = drive(self.pose, left, right, self.wheel_base_m, self._world.clearance)
        if stopped:
            self.reflex = LEFT_FORWARD if rng.random() < 0.5 else RIGHT_FORWARD
        elif reflex is not None and min(self._world.infrared(self.pose)[FRONT_SENSORS]) >= self.clear_way_m:
            self.reflex = None
        return action, stopped or reflex is not None
