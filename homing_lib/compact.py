"""The paper's room on a coarse lattice, in one small file: the atlas that comes along, for machines without PyBullet.

`compact.atlas`, beside this file, is a gzip stream: one line of JSON, then arrays without gaps, little-endian, the last
index running fastest. In that line `arrays` says which, [name, type, shape]; f8 is a float of eight bytes, u1 a byte:

- `clearance_m` (nx, ny): at the position (x0 + i spacing, y0 + j spacing);
- `infrared_m` (positions, headings, 8): the sensors' readings, in the order of `robot.INFRARED_ANGLES_DEG`;
- `counts_low`, `counts_high` (positions, headings, 3 B): lower and upper byte of the pixels in each histogram bin, the
  B bins of red first, then green's, then blue's.

The positions are those whose clearance is at least -`margin_m`, in the order of `clearance_m`; heading k is home's plus
360 k / headings degrees. Further fields: `room` (name, size, home, start), `room_hash` (of all that the room is),
`settings` (of camera, body and lattice), `x0`, `y0`. Everything is as the renderer gave it, to the bit.
"""

import gzip
import json
import zlib
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from homing_lib.atlas import Atlas, Lattice, hashed, open_atlas
from homing_lib.errors import DamagedFile, UserError
from homing_lib.rooms import PAPER, Room
from homing_lib.settings import Settings
from homing_lib.storage import write_bytes

FILE = Path(__file__).with_name("compact.atlas")

SETTINGS = Settings(images="atlas", atlas_spacing_m=0.04, atlas_heading_deg=20)
"""Whose atlas it is: small enough to be kept with the code, near enough to the camera to learn on."""

_REMEDY = "install the package again or, in a clone, restore the file with git"


def open_compact(room: Room, settings: Settings) -> Atlas:
    """The atlas that comes along. Raises UserError if these settings or this room are not what it holds."""
    held, atlas = _loaded(FILE)
    usual = Settings().of_scope("lattice")  # nobody's wish; another lattice than that is asked for, and is not this one
    for name, value in {"room": room.name, **settings.of_scope("view", "lattice")}.items():
        if value not in (held[name], usual.get(name, held[name])):
            raise UserError(
                f'images = compact holds the paper\'s room with {name} = {held[name]}, not {value}; use images="atlas"'
            )
    return atlas


@cache
def _loaded(file: Path) -> tuple[dict[str, Any], Atlas]:
    header, arrays = read(file)
    if header["room_hash"] != hashed(PAPER):
        raise UserError(f"{file}: outdated file, of the paper's room as it was; write it anew: make compact")
    counts = arrays["counts_high"].astype(np.uint16) << 8 | arrays["counts_low"]
    lattice = Lattice(PAPER, Settings(**header["settings"]))
    held = {"room": PAPER.name, **header["settings"]}
    return held, Atlas(lattice, counts, arrays["infrared_m"], arrays["clearance_m"])


def read(file: Path = FILE) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """The first line and the arrays. Raises DamagedFile for a file that is missing or not whole."""
    try:
        line, _, content = gzip.decompress(file.read_bytes()).partition(b"\n")
        header, arrays, start = json.loads(line), {}, 0
        for name, kind, shape in header["arrays"]:
            arrays[name] = np.frombuffer(content, kind, int(np.prod(shape)), start).reshape(shape)
            start += arrays[name].nbytes
    except FileNotFoundError:
        raise DamagedFile(f"{file}: missing file; {_REMEDY}") from None
    except (OSError, EOFError, zlib.error, ValueError, KeyError, TypeError) as error:
        raise DamagedFile(f"{file}: damaged file ({error}); {_REMEDY}") from None
    return header, arrays


def write(file: Path = FILE, settings: Settings = SETTINGS) -> None:
    """Write the paper's atlas under these settings as such a file. The same atlas gives the same bytes."""
    lattice, made = Lattice(PAPER, settings), open_atlas(PAPER, settings)
    arrays = {
        "clearance_m": made.clearance_m.astype("<f8"),
        "infrared_m": made.infrared_m.astype("<f8"),
        "counts_low": (made.counts & 255).astype("u1"),
        "counts_high": (made.counts >> 8).astype("u1"),
    }
    header = {
        "room": {"name": PAPER.name, "size": PAPER.size, "home": PAPER.home, "start": PAPER.start},
        "room_hash": hashed(PAPER),
        "settings": settings.of_scope("view", "lattice"),
        "margin_m": lattice.margin,
        "x0": lattice.x0,
        "y0": lattice.y0,
        "arrays": [[name, array.dtype.str.lstrip("|"), array.shape] for name, array in arrays.items()],
    }
    content = [json.dumps(header).encode() + b"\n", *(array.tobytes() for array in arrays.values())]
    write_bytes(file, gzip.compress(b"".join(content), mtime=0))
