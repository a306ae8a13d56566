"""Arcs, what stops them, the reflex that follows, and slip: in a room that is a formula, and in those of the arena."""

from math import cos, hypot, inf, pi, radians, sin, sqrt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from homing_lib.robot import (
    FRONT_SENSORS,
    GO_FORWARD,
    INFRARED_ANGLES_DEG,
    LEFT_FORWARD,
    RIGHT_FORWARD,
    Robot,
    arc,
    drive,
    wrapped,
)
from homing_lib.rooms import ROOMS, Ball, Box, Cone, Pose
from homing_lib.settings import Settings

BASE = 0.053
RADIUS = 0.035
HEIGHT = 0.03

ways = st.floats(-0.2, 0.2)
poses = st.builds(Pose, st.floats(-1, 1), st.floats(-1, 1), st.floats(-pi, pi))


def same(a, b):
    """Equal poses, headings modulo a full turn, to a nanometre."""
    return (*a[:2], cos(a.heading), sin(a.heading)) == pytest.approx((*b[:2], cos(b.heading), sin(b.heading)), abs=1e-9)


def wall(x, y):
    """Clearance to a wall along x = 1."""
    return 1 - RADIUS - x


class Hall:
    """A world of one wall, along x = 1: what the robot feels there is geometry."""

    clearance = staticmethod(wall)

    @staticmethod
    def infrared(pose):
        ahead = [cos(pose.heading + radians(angle)) for angle in INFRARED_ANGLES_DEG]
        return np.array([min(0.05, (1 - pose.x) / c - RADIUS) if c > 0 else 0.05 for c in ahead])


OPEN, FACING_WALL = Pose(0.2, 0.5, 0), Pose(0.94, 0.5, 0)


# Arcs


@pytest.mark.parametrize(
    ("start", "left", "right", "end"),
    [
        # straight ahead along y; backwards; no way at all
        (Pose(0.1, 0.2, pi / 2), 0.06, 0.06, Pose(0.1, 0.26, pi / 2)),
        (Pose(0, 0, 0), -0.06, -0.06, Pose(-0.06, 0, 0)),
        (Pose(0.3, 0.4, 1), 0, 0, Pose(0.3, 0.4, 1)),
        # in place, a quarter turn to the left and half a turn to the right
        (Pose(0.1, 0.2, 0), -BASE * pi / 4, BASE * pi / 4, Pose(0.1, 0.2, pi / 2)),
        (Pose(0.1, 0.2, 0), BASE * pi / 2, -BASE * pi / 2, Pose(0.1, 0.2, pi)),
        # a quarter circle of radius 10 cm, to the left and to the right
        (Pose(0, 0, 0), (0.1 - BASE / 2) * pi / 2, (0.1 + BASE / 2) * pi / 2, Pose(0.1, 0.1, pi / 2)),
        (Pose(0, 0, 0), (0.1 + BASE / 2) * pi / 2, (0.1 - BASE / 2) * pi / 2, Pose(0.1, -0.1, -pi / 2)),
        # around the standing left wheel, which is half a wheel base to the left; a full circle
        (Pose(0, 0, 0), 0, BASE * pi / 2, Pose(BASE / 2, BASE / 2, pi / 2)),
        (Pose(0.3, 0.4, 1), (0.1 - BASE / 2) * 2 * pi, (0.1 + BASE / 2) * 2 * pi, Pose(0.3, 0.4, 1)),
    ],
)
def test_arcs_end_where_geometry_says(start, left, right, end):
    assert same(arc(start, left, right, BASE), end)


@given(pose=poses, left=ways, right=ways, share=st.floats(0, 1))
def test_two_parts_of_an_arc_are_the_arc_and_rolling_back_leads_back(pose, left, right, share):
    middle, end = arc(pose, share * left, share * right, BASE), arc(pose, left, right, BASE)
    assert same(arc(middle, (1 - share) * left, (1 - share) * right, BASE), end)
    assert same(arc(end, -left, -right, BASE), pose)


@given(angle=st.floats(-1e4, 1e4))
def test_a_wrapped_angle_is_the_same_angle_within_half_a_turn(angle):
    assert abs(wrapped(angle)) <= pi
    assert (cos(wrapped(angle)), sin(wrapped(angle))) == pytest.approx((cos(angle), sin(angle)), abs=1e-9)


# Obstacles


def test_a_drive_into_a_wall_stops_where_the_body_touches_it():
    pose, stopped = drive(Pose(0.93, 0.5, 0), 0.06, 0.06, BASE, wall)
    assert stopped
    assert pose.x <= 1 - RADIUS
    assert pose == pytest.approx((1 - RADIUS, 0.5, 0), abs=1e-4)


@pytest.mark.parametrize(
    ("heading", "left", "right", "stopped"),
    [(pi, 0.06, 0.06, False), (0, -0.06, 0.06, False), (0, -0.06, -0.06, False), (0, 0.06, 0.06, True)],
)
def test_a_body_that_touches_the_wall_may_drive_away_or_along_it_or_turn_but_not_on(heading, left, right, stopped):
    assert drive(Pose(1 - RADIUS, 0.5, heading), left, right, BASE, wall)[1] is stopped


@given(gap=st.floats(0, 0.1), heading=st.floats(-pi, pi), left=ways, right=ways)
def test_no_drive_ends_inside_a_wall_and_one_that_is_not_stopped_is_the_arc(gap, heading, left, right):
    start = Pose(1 - RADIUS - gap, 0, heading)
    pose, stopped = drive(start, left, right, BASE, wall)
    assert wall(*pose[:2]) >= min(0, wall(*start[:2]))
    if not stopped:
        assert pose == arc(start, left, right, BASE)


def gap(room, x, y):
    """Metres between the body and what stands nearest, by plane geometry: the body is as high as what it touches."""
    gaps = [x, room.size[0] - x, y, room.size[1] - y]
    for thing in room.objects:
        match thing:
            case Box():
                beside = max(abs(x - thing.x) - thing.size[0] / 2, 0), max(abs(y - thing.y) - thing.size[1] / 2, 0)
                gaps.append(hypot(*beside))
            case Cone():
                gaps.append(hypot(x - thing.x, y - thing.y) - thing.radius)
            case Ball():
                above = max(thing.radius - HEIGHT, 0)  # of the body's top: there the ball is at its widest for it
                gaps.append(hypot(x - thing.x, y - thing.y) - sqrt(thing.radius**2 - above**2))
            case _:
                raise TypeError(thing)
    return min(gaps) - RADIUS


@pytest.mark.parametrize("room", ROOMS.values(), ids=ROOMS)
def test_ten_thousand_random_steps_never_enter_an_obstacle_by_a_millimetre_nor_leave_the_room(room):
    from homing_lib.arena import Arena

    rng = np.random.default_rng(0)
    with Arena(room, Settings()) as world:
        robot = Robot(world, Settings(), room.home)
        nearest, stops = inf, 0
        for _ in range(10_000):
            _, at_wall = robot.act(int(rng.integers(3)), rng)
            nearest, stops = min(nearest, gap(room, *robot.pose[:2])), stops + at_wall
    assert -0.001 < nearest < 0.001  # it has touched something
    assert stops > 100


# The reflex


@pytest.mark.parametrize("action", [LEFT_FORWARD, RIGHT_FORWARD, GO_FORWARD])
def test_a_free_robot_drives_what_is_commanded_and_draws_no_random_number(action):
    s, rng = Settings(), np.random.default_rng(0)
    robot = Robot(Hall, s, OPEN)
    assert robot.act(action, rng) == (action, False)
    assert robot.pose == arc(OPEN, *s.wheel_commands_m[action], s.wheel_base_m)
    assert robot.reflex is None
    assert rng.random() == np.random.default_rng(0).random()


def test_a_robot_stopped_by_a_wall_turns_in_place_to_one_random_side_until_the_way_is_clear():
    s, sides = Settings(), set()
    front = [index for index, angle in enumerate(INFRARED_ANGLES_DEG) if abs(angle) < 60]
    assert list(range(8))[FRONT_SENSORS] == front
    for seed in range(10):
        rng = np.random.default_rng(seed)
        robot = Robot(Hall, s, FACING_WALL)
        assert robot.act(GO_FORWARD, rng) == (GO_FORWARD, True)
        side, stopped_at = robot.reflex, robot.pose
        assert stopped_at[:2] == pytest.approx((1 - RADIUS, 0.5), abs=1e-3)
        turn = radians(s.turn_deg) * (1 if side == LEFT_FORWARD else -1)
        turns = 0
        while robot.reflex is not None:
            assert robot.reflex == side
            assert Hall.infrared(robot.pose)[front].min() < s.clear_way_m
            # Whatever is commanded, the side's action is driven, and to be credited.
            assert robot.act(GO_FORWARD, rng) == (side, True)
            turns += 1
            assert same(robot.pose, stopped_at._replace(heading=stopped_at.heading + turns * turn))
        assert Hall.infrared(robot.pose)[front].min() >= s.clear_way_m
        assert robot.act(GO_FORWARD, rng) == (GO_FORWARD, False)
        sides.add(side)
    assert sides == {LEFT_FORWARD, RIGHT_FORWARD}


def test_slip_spreads_the_way_of_each_wheel_by_its_share():
    s, rng = Settings(wheel_slip=0.1, forward_m=0.06), np.random.default_rng(0)
    rolled = []
    for _ in range(1000):
        robot = Robot(Hall, s, OPEN)
        robot.act(GO_FORWARD, rng)
        rolled.append((robot.pose.x - OPEN.x, robot.pose.heading * s.wheel_base_m))
    # The mean of two wheels, and their difference, of 60 mm +- 6 mm each; five standard errors.
    assert np.mean(rolled, axis=0) == pytest.approx([0.06, 0], abs=0.0015)
    assert np.std(rolled, axis=0) == pytest.approx([0.006 / 2**0.5, 0.006 * 2**0.5], rel=0.15)
