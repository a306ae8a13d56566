"""Rooms as data: what stands where, and how it looks. `arena.py` builds them."""

from dataclasses import dataclass, replace
from math import pi
from typing import NamedTuple

from homing_lib.errors import UserError


class Pose(NamedTuple):
    """Position in metres, heading in radians anticlockwise from the x axis."""

    x: float
    y: float
    heading: float


@dataclass(frozen=True)
class Texture:
    """A procedural surface: noise of several scales around a base colour (0 to 1 per channel), and grain.

    contrast: strength of the patches, and grain: of the noise from texel to texel, both as standard deviations on a
    logit scale. patches: coarse cells along a side. picture: paint a sun over a horizon on top.
    """

    rgb: tuple[float, float, float]
    contrast: float = 0.32
    grain: float = 0.15
    patches: int = 4
    picture: bool = False


@dataclass(frozen=True)
class _Thing:
    """What stands on the floor: its centre, and further measures, in metres."""

    name: str
    x: float
    y: float


@dataclass(frozen=True)
class Box(_Thing):
    """Upright, seen and touched from all sides. front: the face towards -x, where it differs (a television's)."""

    size: tuple[float, float, float]
    texture: Texture
    front: Texture | None = None


@dataclass(frozen=True)
class Cone(_Thing):
    """Upright."""

    radius: float
    height: float
    texture: Texture


@dataclass(frozen=True)
class Ball(_Thing):
    """As high as it is wide."""

    radius: float
    texture: Texture


@dataclass(frozen=True)
class Picture:
    """On a wall, flat: centre along the wall and above the floor, width and height, in metres."""

    wall: str
    along: float
    height: float
    size: tuple[float, float]
    texture: Texture


@dataclass(frozen=True)
class Room:
    """A rectangle from (0, 0) to `size` with walls east (+x), north (+y), west and south, and what stands in it.

    home: where the snapshot is taken; start: where training episodes begin, and no home_objects are in sight.
    """

    name: str
    size: tuple[float, float]
    home: Pose
    start: Pose
    floor: Texture
    walls: dict[str, Texture]
    objects: tuple[Box | Cone | Ball, ...] = ()
    pictures: tuple[Picture, ...] = ()
    home_objects: tuple[str, ...] = ()
    wall_height: float = 0.75
    texture_seed: int = 2014


PAPER = Room(
    name="paper",
    size=(1.15, 1.00),
    home=Pose(0.85, 0.50, 0.0),
    start=Pose(0.25, 0.50, pi),
    floor=Texture((0.45, 0.40, 0.35), contrast=0.25, grain=0.20, patches=6),
    walls={
        "east": Texture((0.80, 0.75, 0.60), contrast=0.28),
        "north": Texture((0.25, 0.45, 0.75), contrast=0.35),
        "west": Texture((0.75, 0.25, 0.30), contrast=0.35),
        "south": Texture((0.30, 0.65, 0.25), contrast=0.35),
    },
    objects=(
        Box(
            "television",
            x=1.11,
            y=0.50,
            size=(0.08, 0.36, 0.28),
            texture=Texture((0.16, 0.15, 0.18), contrast=0.20),
            front=Texture((0.75, 0.65, 0.75), patches=3, picture=True),
        ),
        Cone("cone", x=1.02, y=0.58, radius=0.03, height=0.09, texture=Texture((0.88, 0.42, 0.10), contrast=0.25)),
        Ball("ball", x=1.02, y=0.42, radius=0.03, texture=Texture((0.18, 0.25, 0.85), contrast=0.25)),
    ),
    pictures=(
        Picture("north", 0.30, 0.20, (0.26, 0.20), Texture((0.75, 0.70, 0.25), contrast=0.50, patches=3)),
        Picture("north", 0.85, 0.22, (0.20, 0.26), Texture((0.60, 0.25, 0.65), contrast=0.50, patches=3)),
        Picture("west", 0.30, 0.22, (0.24, 0.20), Texture((0.25, 0.70, 0.70), contrast=0.50, patches=3)),
        Picture("west", 0.70, 0.20, (0.18, 0.24), Texture((0.80, 0.78, 0.72), contrast=0.50, patches=3)),
        Picture("south", 0.25, 0.20, (0.20, 0.22), Texture((0.85, 0.35, 0.40), contrast=0.50, patches=3)),
        Picture("south", 0.80, 0.22, (0.28, 0.18), Texture((0.20, 0.22, 0.45), contrast=0.50, patches=3)),
    ),
    home_objects=("television", "cone", "ball"),
)

_PARTITION = Box("partition", x=0.55, y=0.31, size=(0.04, 0.62, 0.30), texture=Texture((0.50, 0.35, 0.60)))

DIVIDED = replace(PAPER, name="divided", objects=(*PAPER.objects, _PARTITION))
"""The paper's room with a wall across it, open for 38 cm in the north: the u-turn must go round."""

ATTIC = Room(
    name="attic",
    size=(0.90, 1.40),
    home=Pose(0.45, 1.08, pi / 2),
    start=Pose(0.45, 0.48, -pi / 2),
    floor=Texture((0.30, 0.38, 0.42), contrast=0.25, grain=0.20, patches=8),
    walls={
        "east": Texture((0.55, 0.35, 0.65), contrast=0.35),
        "north": Texture((0.70, 0.72, 0.78), contrast=0.28),
        "west": Texture((0.72, 0.60, 0.28), contrast=0.35),
        "south": Texture((0.22, 0.50, 0.48), contrast=0.35),
    },
    objects=(
        Box("crate", x=0.45, y=1.36, size=(0.34, 0.08, 0.22), texture=Texture((0.72, 0.50, 0.30), contrast=0.40)),
        Cone("lamp", x=0.36, y=1.27, radius=0.035, height=0.12, texture=Texture((0.90, 0.85, 0.45))),
        Ball("globe", x=0.54, y=1.27, radius=0.035, texture=Texture((0.20, 0.60, 0.55))),
    ),
    pictures=(
        Picture("east", 0.35, 0.20, (0.22, 0.22), Texture((0.85, 0.40, 0.25), contrast=0.50, patches=3)),
        Picture("east", 1.00, 0.22, (0.30, 0.20), Texture((0.30, 0.60, 0.85), contrast=0.50, patches=3)),
        Picture("west", 0.50, 0.20, (0.26, 0.22), Texture((0.25, 0.30, 0.55), contrast=0.50, patches=3)),
        Picture("south", 0.45, 0.22, (0.24, 0.20), Texture((0.80, 0.75, 0.40), contrast=0.50, patches=3)),
    ),
    home_objects=("crate", "lamp", "globe"),
    texture_seed=7,
)
"""A longer and narrower room with other surfaces and another home."""

HALL = Room(
    name="hall",
    size=(1.60, 1.20),
    home=Pose(0.81, 0.33, -pi / 2),
    start=Pose(0.81, 0.93, pi / 2),
    floor=Texture((0.55, 0.52, 0.48), contrast=0.12, grain=0.20, patches=8),
    walls={
        "east": Texture((0.60, 0.58, 0.50), contrast=0.15),
        "north": Texture((0.45, 0.52, 0.60), contrast=0.15),
        "west": Texture((0.58, 0.45, 0.46), contrast=0.15),
        "south": Texture((0.48, 0.58, 0.45), contrast=0.15),
    },
    objects=(
        Box("cupboard", x=0.80, y=0.04, size=(0.40, 0.08, 0.30), texture=Texture((0.40, 0.30, 0.25), contrast=0.20)),
        Cone("hat", x=0.88, y=0.14, radius=0.035, height=0.10, texture=Texture((0.25, 0.30, 0.35))),
        Ball("melon", x=0.72, y=0.14, radius=0.040, texture=Texture((0.35, 0.60, 0.25))),
    ),
    pictures=(
        Picture("east", 0.60, 0.25, (0.40, 0.30), Texture((0.70, 0.55, 0.35), contrast=0.30)),
        Picture("north", 0.50, 0.22, (0.30, 0.24), Texture((0.35, 0.40, 0.65), contrast=0.30)),
    ),
    home_objects=("cupboard", "hat", "melon"),
    texture_seed=11,
)
"""Larger, paler and emptier: little tells one view from another."""

CELL = Room(
    name="cell",
    size=(0.80, 0.70),
    home=Pose(0.30, 0.35, pi),
    start=Pose(0.55, 0.35, 0.0),
    floor=Texture((0.30, 0.30, 0.35), contrast=0.45, grain=0.25, patches=5),
    walls={
        "east": Texture((0.85, 0.55, 0.25), contrast=0.50),
        "north": Texture((0.35, 0.25, 0.60), contrast=0.50),
        "west": Texture((0.65, 0.75, 0.70), contrast=0.50),
        "south": Texture((0.70, 0.25, 0.45), contrast=0.50),
    },
    objects=(
        Box("stove", x=0.04, y=0.35, size=(0.08, 0.26, 0.24), texture=Texture((0.20, 0.20, 0.22), contrast=0.30)),
        Cone("kettle", x=0.13, y=0.43, radius=0.030, height=0.10, texture=Texture((0.75, 0.70, 0.30))),
        Ball("pot", x=0.13, y=0.27, radius=0.030, texture=Texture((0.85, 0.30, 0.20))),
    ),
    home_objects=("stove", "kettle", "pot"),
    texture_seed=23,
)
"""Small, bare and boldly patterned."""

WORKSHOP = Room(
    name="workshop",
    size=(1.30, 1.30),
    home=Pose(0.97, 0.97, pi / 4),
    start=Pose(0.45, 0.45, -0.75 * pi),
    floor=Texture((0.42, 0.44, 0.40), contrast=0.30, grain=0.15, patches=7),
    walls={
        "east": Texture((0.35, 0.55, 0.60), contrast=0.30),
        "north": Texture((0.75, 0.65, 0.35), contrast=0.40),
        "west": Texture((0.40, 0.35, 0.55), contrast=0.30),
        "south": Texture((0.65, 0.40, 0.35), contrast=0.40),
    },
    objects=(
        Box("lathe", x=1.20, y=1.20, size=(0.16, 0.16, 0.30), texture=Texture((0.25, 0.45, 0.30), contrast=0.40)),
        Cone("bucket", x=1.08, y=1.20, radius=0.035, height=0.12, texture=Texture((0.80, 0.30, 0.25))),
        Ball("drum", x=1.20, y=1.08, radius=0.035, texture=Texture((0.85, 0.80, 0.30))),
        Box("pillar", x=0.35, y=0.95, size=(0.12, 0.12, 0.50), texture=Texture((0.60, 0.60, 0.65), contrast=0.20)),
        Cone("heap", x=0.95, y=0.35, radius=0.080, height=0.20, texture=Texture((0.55, 0.40, 0.25))),
        Ball("buoy", x=0.72, y=0.62, radius=0.050, texture=Texture((0.80, 0.35, 0.60))),
    ),
    pictures=(Picture("west", 0.40, 0.22, (0.30, 0.24), Texture((0.80, 0.75, 0.45), contrast=0.50)),),
    home_objects=("lathe", "bucket", "drum"),
    texture_seed=31,
)
"""Square and cluttered, with home in a corner."""

ROOMS = {room.name: room for room in (PAPER, DIVIDED, ATTIC, HALL, CELL, WORKSHOP)}


def room_named(name: str) -> Room:
    """The room of this name. Raises UserError for one that does not exist."""
    if name not in ROOMS:
        raise UserError(f"room {name!r}: there is none of this name; known are {', '.join(ROOMS)}")
    return ROOMS[name]
