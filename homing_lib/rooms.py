"""What a room is made of: what stands where, and how it looks. `rooms.toml` describes each, `arena.py` builds it."""

import tomllib
from math import radians
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import BeforeValidator, ConfigDict, ValidationError
from pydantic.dataclasses import dataclass

from homing_lib.errors import UserError, nearest, shown

_STRICT = ConfigDict(extra="forbid", allow_inf_nan=False)


class Pose(NamedTuple):
    """Position in metres, heading in radians anticlockwise from the x axis."""

    x: float
    y: float
    heading: float


def _in_radians(told: Any) -> Any:
    """A pose as it is, or as a file tells it, with a heading in degrees."""
    if isinstance(told, Pose):
        return told
    x, y, heading_deg = told
    return Pose(x, y, radians(heading_deg))


@dataclass(frozen=True, config=_STRICT)
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


@dataclass(frozen=True, config=_STRICT)
class _Thing:
    """What stands on the floor: its centre, and further measures, in metres."""

    name: str
    x: float
    y: float


@dataclass(frozen=True, config=_STRICT)
class Box(_Thing):
    """Upright, seen and touched from all sides. front: the face towards -x, where it differs (a television's)."""

    size: tuple[float, float, float]
    texture: Texture
    front: Texture | None = None


@dataclass(frozen=True, config=_STRICT)
class Cone(_Thing):
    """Upright."""

    radius: float
    height: float
    texture: Texture


@dataclass(frozen=True, config=_STRICT)
class Ball(_Thing):
    """As high as it is wide."""

    radius: float
    texture: Texture


@dataclass(frozen=True, config=_STRICT)
class Picture:
    """On a wall, flat: centre along the wall and above the floor, width and height, in metres."""

    wall: Literal["east", "north", "west", "south"]
    along: float
    height: float
    size: tuple[float, float]
    texture: Texture


@dataclass(frozen=True, config=_STRICT)
class Room:
    """A rectangle from (0, 0) to `size` with walls east (+x), north (+y), west and south, and what stands in it.

    home: where the snapshot is taken; start: where training episodes begin, and no home_objects are in sight.
    """

    name: str
    size: tuple[float, float]
    home: Annotated[Pose, BeforeValidator(_in_radians)]
    start: Annotated[Pose, BeforeValidator(_in_radians)]
    floor: Texture
    walls: dict[str, Texture]
    objects: tuple[Box | Cone | Ball, ...] = ()
    pictures: tuple[Picture, ...] = ()
    home_objects: tuple[str, ...] = ()
    wall_height: float = 0.75
    texture_seed: int = 2014


def _described(file: Path) -> dict[str, Room]:
    """The rooms of such a file, by name. Raises UserError, in one line, if it is not there or not right."""
    rooms, where = {}, ""
    try:
        entries: dict[str, Any] = tomllib.loads(file.read_text(encoding="utf-8"))
        for name, entry in entries.items():
            where = f"room {name}: "
            like = entries[entry.pop("like")] if "like" in entry else {}
            objects = [*like.get("objects", ()), *entry.get("objects", ())]
            entries[name] = {**like, **entry, "objects": objects}
            rooms[name] = Room(name=name, **entries[name])
    except (OSError, ValueError, TypeError, KeyError, AttributeError) as error:
        told = " ".join(_problem(error).split())[:300]
        raise UserError(f"{file}: {where}{told}; mend it, or restore it with git") from None
    return rooms


def _problem(error: Exception) -> str:
    """What went wrong; of much that pydantic found, an unknown name, or the first."""
    if not isinstance(error, ValidationError):
        return f"like = {error}: no room above has this name" if isinstance(error, KeyError) else str(error)
    first = min(error.errors(), key=lambda one: one["type"] != "unexpected_keyword_argument")
    return f"{'.'.join(map(str, first['loc']))}: {first['msg']}"


ROOMS = _described(Path(__file__).with_suffix(".toml"))
PAPER = ROOMS["paper"]


def room_named(name: str) -> Room:
    """The room of this name. Raises UserError for one that does not exist."""
    if name not in ROOMS:
        known = f"known are {', '.join(ROOMS)}{nearest(name, ROOMS)}"
        raise UserError(f"room {shown(name)}: there is none of this name; {known}")
    return ROOMS[name]
