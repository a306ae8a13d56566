"""Write the atlas that comes along, homing_lib/compact.atlas: the paper's room on a coarse lattice, in one small file.

It is a gzip stream: one line of JSON, then arrays without gaps, little-endian, the last index running fastest. In that
line `arrays` says which, [name, type, shape]; f8 is a float of eight bytes, u1 a byte:

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
from pathlib import Path

from homing_lib.atlas import COMPACT, Lattice, hashed, open_atlas
from homing_lib.rooms import PAPER
from homing_lib.settings import Settings
from homing_lib.storage import write_bytes

SETTINGS = Settings(images="atlas", atlas_spacing_m=0.04, atlas_heading_deg=20)
"""Whose atlas it is: small enough to be kept with the code, near enough to the camera to learn on."""


def write(file: Path = COMPACT, settings: Settings = SETTINGS) -> None:
    """Write the paper's atlas under these settings as such a file. The same atlas gives the same bytes."""
    lattice, made = Lattice(PAPER, settings), open_atlas(PAPER, settings)
    low, high = (made.counts & 255).astype("u1"), (made.counts >> 8).astype("u1")
    floats = {"clearance_m": made.clearance_m.astype("<f8"), "infrared_m": made.infrared_m.astype("<f8")}
    arrays = {**floats, "counts_low": low, "counts_high": high}
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


if __name__ == "__main__":
    write()
