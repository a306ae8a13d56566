"""What the robot sees and feels in PyBullet's rooms is what geometry says, and depends on the pose alone."""

import hashlib
import os
import subprocess
import sys
from math import cos, degrees, hypot, inf, pi, radians, sin

import numpy as np
import pytest

pybullet = pytest.importorskip("pybullet", reason="needs PyBullet")

from homing_lib.arena import Arena
from homing_lib.atlas import Lattice, open_compact
from homing_lib.features import histogram, similarity
from homing_lib.publish import compact
from homing_lib.robot import INFRARED_ANGLES_DEG, Robot, wrapped
from homing_lib.rooms import PAPER, ROOMS, Pose
from homing_lib.settings import Settings
from homing_lib.storage import ROOT
from homing_lib.surfaces import paint
from homing_lib.thresholds import stopping_thresholds

RADIUS = 0.035
THING = {thing.name: thing for thing in PAPER.objects}

every_room = pytest.mark.parametrize("room", ROOMS.values(), ids=ROOMS)


def drive_at_random(world, steps, seed=0):
    """The poses of a random drive from home."""
    rng, robot = np.random.default_rng(seed), Robot(world, world.settings, world.room.home)
    for _ in range(steps):
        robot.act(int(rng.integers(3)), rng)
        yield robot.pose


# What the robot sees


@every_room
def test_nothing_at_the_start_shows_the_home_and_views_are_rich_and_never_of_the_robot_itself(room):
    with Arena(room, Settings()) as world:
        home_objects = set(room.home_objects)
        assert home_objects
        assert not home_objects & world.visible(room.start)
        assert home_objects <= world.visible(room.home)
        poses = list(drive_at_random(world, 400))
        assert not any("robot" in world.visible(pose) for pose in poses[:100])
        filled = np.max([world.histogram(pose) for pose in poses], axis=0) > 0
    assert filled.mean() > 0.7  # even in a pale room


def test_the_camera_sees_22_and_a_half_degrees_to_either_side(arena):
    ball, distance = THING["ball"], 0.4
    edge = 22.5 + degrees(np.arcsin(ball.radius / distance))
    offset = Settings().camera_offset_m
    for off_centre, seen in ((edge - 1.5, True), (edge + 1.5, False)):
        for side in (-1, 1):
            heading = side * radians(off_centre)
            eye = ball.x - distance - offset * cos(heading), ball.y - offset * sin(heading)
            assert ("ball" in arena.visible(Pose(*eye, heading))) is seen


HASH = """
import hashlib
import os
from homing_lib import parallel
from homing_lib.arena import Arena
from homing_lib.rooms import PAPER
from homing_lib.settings import Settings
def of_two_images(room):
    with Arena(room, Settings()) as world:
        return hashlib.sha256(b"".join(world.image(pose).tobytes() for pose in (room.home, room.start))).hexdigest()
print(of_two_images(PAPER), *parallel.results(of_two_images, [(PAPER,), (PAPER,)], workers=2))
"""


def test_an_image_depends_on_the_pose_alone_in_any_process_wherever_temporary_files_are_and_none_is_left(
    arena, tmp_path
):
    arena.clearance(PAPER.home.x + 0.05, PAPER.home.y)  # this puts the body there
    arena.infrared(PAPER.start)
    arena.top_view()
    images = [arena.image(pose) for pose in (PAPER.home, PAPER.start)]
    assert {(image.shape, image.dtype.name) for image in images} == {((64, 64, 4), "uint8")}
    here = hashlib.sha256(b"".join(image.tobytes() for image in images)).hexdigest()
    folder = tmp_path / "Jürgen's $HOME\\temp" / ("long" * 30) / ("longer" * 30)
    folder.mkdir(parents=True)
    command, environment = [sys.executable, "-OO", "-c", HASH], os.environ | {"TMPDIR": str(folder)}
    there = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=True)
    assert there.stdout.split() == [here] * 3
    assert not list(folder.iterdir())


def test_light_scales_every_pixel_and_stays_with_its_own_arena(arena):
    bright = arena.image(PAPER.home)[:, :, :3].astype(float)
    with Arena(PAPER, Settings(light=0.5)) as dim:
        for _ in range(2):
            assert dim.image(PAPER.home)[:, :, :3] == pytest.approx(bright / 2, abs=1.01)
            np.testing.assert_array_equal(arena.image(PAPER.home)[:, :, :3], bright)


def test_from_above_x_runs_to_the_right_and_y_upwards(arena):
    top = arena.top_view(pixels=460)
    assert top.shape == (400, 460, 3)
    orange, blue = (top[round((1 - t.y) * 400), round(t.x * 400)].astype(int) for t in (THING["cone"], THING["ball"]))
    assert orange[0] > orange[2] + 50
    assert blue[2] > blue[0] + 50


def test_obliquely_from_above_two_walls_stand_behind_the_floor_and_the_near_ones_hide_nothing(arena):
    # From the south-west: north wall on the left, east wall on the right, the television before it.
    picture = arena.perspective(pixels=320)
    assert picture.shape == (240, 320, 3)
    parts = (picture[20:, 80:120], picture[60:, 180:190], picture[120:, 110:200], picture[200:, :40])
    left, right, floor, outside = (part[:20].mean(axis=(0, 1)) for part in parts)
    assert left[2] > left[0] + 40  # blue
    assert right[0] > right[2] + 10  # sand
    assert floor.max() < 150  # dark, where the south and the west wall would be before it
    assert (outside == 255).all()


def test_images_are_the_same_from_a_pybullet_that_was_built_without_numpy(arena, monkeypatch):
    def seen():
        return arena.image(PAPER.home), arena.top_view(), arena.visible(PAPER.home)

    expected, render = seen(), pybullet.getCameraImage

    def without_numpy(*args, **options):
        width, height, *images = render(*args, **options)
        return width, height, *(tuple(np.ravel(image).tolist()) for image in images)

    monkeypatch.setattr(pybullet, "getCameraImage", without_numpy)
    for image, before in zip(seen(), expected, strict=True):
        np.testing.assert_array_equal(image, before)


# Surfaces


@every_room
def test_every_surface_is_rich_it_fills_a_quarter_of_the_bins_and_no_bin_has_a_quarter_of_it(room):
    surfaces = {"floor": room.floor} | {f"{name} wall": texture for name, texture in room.walls.items()}
    surfaces |= {thing.name: thing.texture for thing in room.objects}
    surfaces |= {f"picture {number}": picture.texture for number, picture in enumerate(room.pictures, start=1)}
    for name, texture in surfaces.items():
        bins = histogram(paint(texture, room.texture_seed, name), 3)
        assert (bins > 0).mean() > 1 / 4, name
        assert bins.max() < 1 / 4, name


def test_a_texture_is_fixed_by_its_seed_and_its_surface():
    texture = PAPER.floor
    first = paint(texture, 1, "floor").copy()
    paint.cache_clear()
    np.testing.assert_array_equal(paint(texture, 1, "floor"), first)
    for other in (paint(texture, 2, "floor"), paint(texture, 1, "wall")):
        assert (other != first).mean() > 0.9


# What it feels


def to_walls(x, y, direction):
    """Metres from a point to the walls of the paper's room, in one direction."""
    width, depth = PAPER.size
    dx, dy = cos(direction), sin(direction)
    along_x = ((width if dx > 0 else 0) - x) / dx if dx else inf
    along_y = ((depth if dy > 0 else 0) - y) / dy if dy else inf
    return min(along_x, along_y)


@pytest.mark.parametrize("asked_before", [(0.5, 0.5), (0.07, 0.07), (0.05, 0.05)])
def test_infrared_sensors_measure_from_the_bodys_edge_to_the_wall_as_geometry_says(arena, asked_before):
    for heading in np.arange(-pi, pi, pi / 7):
        arena.clearance(*asked_before)  # this puts the body there, where it must not be in the way
        pose = Pose(0.06, 0.055, heading)
        expected = [to_walls(*pose[:2], heading + radians(angle)) - RADIUS for angle in INFRARED_ANGLES_DEG]
        assert arena.infrared(pose) == pytest.approx(np.clip(expected, 0, 0.05), abs=1e-4)


def test_infrared_sensors_see_objects_and_where_nothing_is_near_their_range(arena):
    ball = THING["ball"]
    towards = Pose(ball.x - 0.1, ball.y, radians(-10))  # the third sensor, at +10 degrees, looks at its middle
    half_height = 0.015  # of the body: the rays' height; the ball is narrower there than at its centre
    narrow = (ball.radius**2 - (ball.radius - half_height) ** 2) ** 0.5
    assert arena.infrared(towards)[2] == pytest.approx(0.1 - RADIUS - narrow, abs=1e-3)
    np.testing.assert_array_equal(arena.infrared(Pose(0.5, 0.5, 1)), [0.05] * 8)


@pytest.mark.parametrize(
    ("x", "y", "metres"),
    [
        (0.06, 0.5, 0.06 - RADIUS),
        (0.5, 0.95, 0.05 - RADIUS),
        (0.06, 0.04, 0.04 - RADIUS),  # in a corner the nearer wall counts
        (0.02, 0.5, 0.02 - RADIUS),  # inside the wall: negative
        (0.93, 0.42, 0.09 - 0.03 - RADIUS),  # the ball
        (0.93, 0.58, 0.09 - 0.03 - RADIUS),  # the cone
        (1.03, 0.76, hypot(0.04, 0.08) - RADIUS),  # the television's corner at 1.07, .68
        (0.5, 0.5, 0.1),  # no more than this is said
    ],
)
def test_clearance_is_what_geometry_says_to_a_millimetre(arena, x, y, metres):
    assert arena.clearance(x, y) == pytest.approx(metres, abs=1e-3)


# Where home is


def test_only_near_home_and_facing_it_a_view_is_similar_enough_to_stop(arena, home_model):
    # Every 4 cm and 20 degrees, where the compact atlas holds what the camera sees. 35 cm is about half of the way from
    # the start; within 90 degrees the camera still looks to the television's side.
    psi_upper, psi_lower = stopping_thresholds(Settings().multiplier)
    home, poses, stops = PAPER.home, 0, []
    atlas, lattice = open_compact(PAPER, Settings(images="compact")), Lattice(PAPER, compact.SETTINGS)
    for i, j in zip(*np.nonzero(atlas.clearance_m >= 0), strict=True):
        for pose in (lattice.pose(int(i), int(j), k) for k in range(lattice.headings)):
            poses += 1
            if similarity(home_model.features(atlas.histogram(pose))) >= psi_upper:
                stops.append((hypot(pose.x - home.x, pose.y - home.y), abs(wrapped(pose.heading - home.heading))))
    farthest, most_turned = np.max(stops, axis=0)
    assert farthest < 0.35
    assert degrees(most_turned) < 90
    assert 0.003 < len(stops) / poses < 0.03  # not so rare either that three fixed actions would miss it
    assert similarity(home_model.features(arena.histogram(PAPER.start))) < psi_lower - 0.05
    assert similarity(home_model.features(arena.histogram(home))) == 1
