"""What the robot does before it learns: it looks at its home, then drives about at random (section III.A-B)."""

from collections.abc import Callable, Sequence
from math import radians

import numpy as np

from homing_lib.features import Array, HomeModel, bins_per_channel, difference_variance
from homing_lib.robot import Robot, World
from homing_lib.rooms import Pose, Room
from homing_lib.settings import Settings


def wander(world: World, settings: Settings, home: Pose, rng: np.random.Generator) -> Array:
    """What the robot sees on `survey_steps` uniformly random actions from home, reflex included: shape (steps, 3 B)."""
    robot = Robot(world, settings, home)
    seen = np.empty((settings.survey_steps, 3 * bins_per_channel(settings.bin_size)))
    for row in seen:
        robot.act(int(rng.integers(3)), rng)
        row[:] = world.histogram(robot.pose)
    return seen


def survey(world: World, settings: Settings, home: Pose, rng: np.random.Generator) -> HomeModel:
    """Take the snapshots, wander, and estimate sigma^2 from all that was seen (section III.A-B, E9).

    The first snapshot faces home, further ones are turned by `snapshot_angle_deg` to either side.
    """
    return surveys(world, settings, [home], rng)[0]


def surveys(
    world: World,
    settings: Settings,
    homes: Sequence[Pose],
    rng: np.random.Generator,
    *,
    wander: Callable[..., Array] = wander,
) -> list[HomeModel]:
    """`survey` of several homes by one drive, from the first: what it sees gives sigma^2 about each's snapshots."""
    angle = radians(settings.snapshot_angle_deg)
    turns = (0.0, angle, -angle)[: settings.snapshots]
    seen = wander(world, settings, homes[0], rng)
    floor = (settings.variance_floor_pixels / settings.image_size**2) ** 2
    models = []
    for home in homes:
        snapshots = np.array([world.histogram(home._replace(heading=home.heading + turn)) for turn in turns])
        variance = difference_variance(seen, snapshots, variance=settings.variance, centre=settings.centre, floor=floor)
        models.append(HomeModel(snapshots, variance))
    return models


def free_pose(world: World, room: Room, rng: np.random.Generator) -> Pose:
    """A pose drawn uniformly from those at which the body touches nothing."""
    while True:
        x, y = rng.uniform(0, room.size[0]), rng.uniform(0, room.size[1])
        if world.clearance(x, y) >= 0:
            return Pose(x, y, rng.uniform(-np.pi, np.pi))
