"""Rooms are described in a file, and a slip in it is one line that says where."""

import os
import shutil
import subprocess
import sys
from math import pi
from pathlib import Path

import pytest

from homing_lib import rooms
from homing_lib.errors import UserError
from homing_lib.rooms import Ball, Box, Cone, Pose, Texture, read_rooms

CLOSET = """
[closet]
size = [1, 2]
home = [0.5, 1.5, 90]
start = [0.5, 0.5, -180]
floor = { rgb = [0.1, 0.2, 0.3] }
walls.east = { rgb = [0.4, 0.5, 0.6], patches = 2 }
walls.north = { rgb = [0.4, 0.5, 0.6] }
walls.west = { rgb = [0.4, 0.5, 0.6] }
walls.south = { rgb = [0.4, 0.5, 0.6] }
home_objects = ["apple"]
objects = [
  { name = "stool", x = 0.2, y = 0.3, radius = 0.1, height = 0.4, texture = { rgb = [1, 0, 0] } },
  { name = "apple", x = 0.7, y = 0.8, radius = 0.1, texture = { rgb = [0, 1, 0] } },
]

[larder]
like = "closet"
texture_seed = 5
objects = [{ name = "shelf", x = 0.5, y = 0.1, size = [0.3, 0.1, 0.2], texture = { rgb = [0, 0, 1] } }]

[pantry]
like = "larder"
size = [2, 2]
walls.north = { rgb = [0.9, 0.9, 0.9] }
"""


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "rooms.toml"
    path.write_text(CLOSET, encoding="utf-8")
    return path


def test_a_room_is_what_its_entry_says_with_headings_in_degrees_and_what_it_does_not_say_is_the_default(file):
    closet = read_rooms(file)["closet"]
    assert (closet.name, closet.size, closet.texture_seed) == ("closet", (1, 2), 2014)
    assert (closet.home, closet.start) == (Pose(0.5, 1.5, pi / 2), Pose(0.5, 0.5, -pi))
    assert closet.walls["east"] == Texture((0.4, 0.5, 0.6), patches=2)
    stool = Cone("stool", 0.2, 0.3, radius=0.1, height=0.4, texture=Texture((1, 0, 0)))
    assert closet.objects == (stool, Ball("apple", 0.7, 0.8, radius=0.1, texture=Texture((0, 1, 0))))


def test_a_room_like_another_is_that_one_with_further_objects_and_other_values_and_so_on(file):
    closet, larder, pantry = read_rooms(file).values()
    shelf = Box("shelf", 0.5, 0.1, size=(0.3, 0.1, 0.2), texture=Texture((0, 0, 1)))
    assert larder.objects == (*closet.objects, shelf)
    assert (larder.size, larder.texture_seed, larder.home) == ((1, 2), 5, closet.home)
    assert (pantry.objects, pantry.texture_seed, pantry.size) == (larder.objects, 5, (2, 2))
    assert pantry.walls == closet.walls | {"north": Texture((0.9, 0.9, 0.9))}


HEADING, TABLE = "[x, y, heading in degrees]", "must be a table"


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        ("radius = 0.1, height", "radios = 0.1, height", "room closet: objects.0.Cone.radios: Unexpected"),
        ("height = 0.4", "heigth = 0.4", "room closet: objects.0.Ball.heigth: Unexpected"),
        ('name = "stool", x = 0.2', 'name = "stool", x = "left"', "room closet: objects.0.Cone.x: number"),
        ("[0.5, 0.5, -180]", "[0.5, 0.5]", f"room closet: start: {HEADING}"),
        ("[0.5, 0.5, -180]", '[0.5, 0.5, "north"]', f"room closet: start: {HEADING}"),
        ("[0.5, 0.5, -180]", "7", f"room closet: start: {HEADING}"),
        ("patches = 2", "patches = 0", "room closet: walls.east.patches: 1"),
        ("walls.north", "walls.nord", "room closet: walls: east, north, west, south"),
        ('= ["apple"]', '= ["appel"]', "room closet: home_objects: appel"),
        ("size = [1, 2]", "size = [1, nan]", "room closet: size.1: finite"),
        ("size = [1, 2]", "size = [1, -2]", "room closet: size.1: greater than 0"),
        ("rgb = [1, 0, 0]", "rgb = [8, 0, 0]", "room closet: objects.0.Cone.texture.rgb.0: less than"),
        ('like = "closet"', 'like = "larder"', "room larder: like = 'larder': no room above"),
        ('like = "closet"', 'like = ["closet"]', f"room larder: {TABLE}"),
        ("objects = [{", "objects = 3\nothers = [{", f"room larder: {TABLE}"),
        ("[closet]", "closet = 3\n[other]", f"room closet: {TABLE}"),
        ("[pantry]", "[pantry", "Expected ']'"),
    ],
)
def test_a_slip_in_the_description_is_one_line_that_names_file_room_and_entry(before, after, words, file):
    file.write_text(CLOSET.replace(before, after, 1), encoding="utf-8")
    with pytest.raises(UserError) as refused:
        read_rooms(file)
    line, (*where, what) = str(refused.value), words.split(": ")
    assert line.startswith(": ".join([str(file), *where]))
    assert what in line and line.endswith("restore it with git") and "\n" not in line


def test_the_command_answers_a_slip_in_the_description_of_a_room_in_one_line_without_a_traceback(tmp_path):
    house = Path(rooms.__file__).parent
    shutil.copytree(house, tmp_path / "homing_lib", ignore=shutil.ignore_patterns("__pycache__"))
    (tmp_path / "homing_lib" / "rooms.toml").write_text("[paper]\n", encoding="utf-8")
    environment = {**os.environ, "PYTHONPATH": str(tmp_path), "PYTHONSAFEPATH": "1"}
    command = [sys.executable, "-m", "homing_lib", "settings"]
    ended = subprocess.run(command, env=environment, cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert ended.returncode == 1
    (line,) = ended.stderr.splitlines()
    assert line.startswith(f"homing: {tmp_path / 'homing_lib' / 'rooms.toml'}: room paper: ")
