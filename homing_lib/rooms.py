"""What a room is made of: what stands where, and how it looks. `rooms.toml` describes each, `arena.py` builds it."""

import tomllib
from collections import Counter
from math import cos, radians, sin
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, get_args

from pydantic import BeforeValidator, ConfigDict, Field, ValidationError
from pydantic.dataclasses import dataclass

from homing_lib.errors import UserError, nearest, shown

Wall = Literal["east", "north", "west", "south"]
_STRICT = ConfigDict(extra="forbid", allow_inf_nan=False)
_Positive = Annotated[float, Field(gt=0)]
_Share = Annotated[float, Field(ge=0, le=1)]


class Pose(NamedTuple):
    """Position in metres, heading in radians anticlockwise from the x axis."""

    x: float
    y: float
    heading: float

    def ahead(self, metres: float, turn: float = 0.0) -> tuple[float, float]:
        """The position so many metres ahead, or in the direction turned by `turn` radians from there."""
        return self.x + metres * cos(self.heading + turn), self.y + metres * sin(self.heading + turn)


def _in_radians(pose: Any) -> Any:
    """A pose as it is, or from [x, y, heading in degrees], as a file has it."""
    try:
        return pose if isinstance(pose, Pose) else Pose(pose[0], pose[1], radians(*pose[2:]))
    except (TypeError, LookupError):
        raise ValueError("must be [x, y, heading in degrees]") from None


@dataclass(frozen=True, config=_STRICT)
class Texture:
    """A procedural surface: noise of several scales around a base colour (0 to 1 per channel), and grain.

    contrast: strength of the patches, and grain: of the noise from texel to texel, both as standard deviations on a
    logit scale. patches: coarse cells along a side. picture: paint a sun over a horizon on top.
    """

    rgb: tuple[_Share, _Share, _Share]
    contrast: float = 0.32
    grain: float = 0.15
    patches: Annotated[int, Field(ge=1)] = 4
    picture: bool = False


@dataclass(frozen=True, config=_STRICT)
class _Thing:
    """What stands on the floor: its centre, and further measures, in metres."""

    name: str
    x: float
    y: float


@dataclass(frozen=True, config=_STRICT)
class Box(_Thing):
    """Upright. size: along x, along y, upwards. front: the face towards -x, where it differs (a television's)."""

    size: tuple[_Positive, _Positive, _Positive]
    texture: Texture
    front: Texture | None = None


@dataclass(frozen=True, config=_STRICT)
class Cone(_Thing):
    """Stands on the floor, point upwards."""

    radius: _Positive
    height: _Positive
    texture: Texture


@dataclass(frozen=True, config=_STRICT)
class Ball(_Thing):
    """Lies on the floor."""

    radius: _Positive
    texture: Texture


@dataclass(frozen=True, config=_STRICT)
class Picture:
    """On a wall, flat: its centre's x (north, south) or y (east, west) and height above the floor; width and height."""

    wall: Wall
    along: float
    height: float
    size: tuple[_Positive, _Positive]
    texture: Texture


@dataclass(frozen=True, config=_STRICT)
class Room:
    """A rectangle from (0, 0) to `size` with walls east (+x), north (+y), west and south, and what stands in it.

    home: where the snapshot is taken; start: where episodes begin, with none of the home_objects (their names) in
    sight. texture_seed: of all that is painted.
    """

    name: str
    size: tuple[_Positive, _Positive]
    home: Annotated[Pose, BeforeValidator(_in_radians)]
    start: Annotated[Pose, BeforeValidator(_in_radians)]
    floor: Texture
    walls: dict[str, Texture]
    objects: tuple[Box | Cone | Ball, ...] = ()
    pictures: tuple[Picture, ...] = ()
    home_objects: tuple[str, ...] = ()
    wall_height: _Positive = 0.75
    texture_seed: int = 2014

    def __post_init__(self) -> None:
        if {*self.walls} != {*get_args(Wall)}:
            raise ValueError(f"walls: must be {', '.join(get_args(Wall))}")
        if unknown := {*self.home_objects} - {thing.name for thing in self.objects}:
            raise ValueError(f"home_objects: no object has the name {unknown.pop()}")

    def __hash__(self) -> int:
        return hash(self.name)  # walls is a dict


def read_rooms(file: Path) -> dict[str, Room]:
    """The rooms of such a file, by name. Raises UserError, in one line, if it is not there or not right."""
    rooms, where, entries = {}, "", dict[str, Any]()
    try:
        for name, entry in tomllib.loads(file.read_text(encoding="utf-8")).items():
            where = f"room {name}: "
            like = entries[entry.pop("like")] if "like" in entry else {}
            walls = like.get("walls", {}) | entry.get("walls", {})
            objects = [*like.get("objects", ()), *entry.get("objects", ())]
            entries[name] = {**like, **entry, "walls": walls, "objects": objects}
            rooms[name] = Room(name=name, **entries[name])
    except (OSError, ValueError, TypeError, KeyError, AttributeError) as error:
        problem = " ".join(_problem(error).split())[:300]
        raise UserError(f"{file}: {where}{problem}; mend it, or restore it with git") from None
    return rooms


def _problem(error: Exception) -> str:
    """What went wrong. A thing is a box, cone or ball: as what it has the fewest mistakes, an unknown name first."""
    if isinstance(error, TypeError | AttributeError):
        return f"must be a table, with walls a table, objects a list and like the name of a room above: {error}"
    if not isinstance(error, ValidationError):
        return f"like = {error}: no room above has this name" if isinstance(error, KeyError) else str(error)
    mistakes = error.errors()
    per_shape = Counter(mistake["loc"][:3] for mistake in mistakes)
    first = min(mistakes, key=lambda it: (per_shape[it["loc"][:3]], it["type"] != "unexpected_keyword_argument"))
    return f"{'.'.join(map(str, first['loc']))}: {first['msg'].removeprefix('Value error, ')}".removeprefix(": ")


ROOMS = read_rooms(Path(__file__).with_suffix(".toml"))


def room_named(name: str) -> Room:
    """The room of this name. Raises UserError for one that does not exist."""
    if name not in ROOMS:
        known = f"known are {', '.join(ROOMS)}{nearest(name, ROOMS)}"
        raise UserError(f"room {shown(name)}: there is none of this name; {known}")
    return ROOMS[name]


PAPER = room_named("paper")
