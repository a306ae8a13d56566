"""Write homing_lib/compact.atlas, the atlas that ships with the library: `python -m homing_lib.publish.compact`.

A gzip stream: one line of JSON, then its `arrays`, [name, type, shape], without gaps, the last index running fastest;
<f8 is a little-endian float of eight bytes, u1 a byte. `clearance_m[i, j]`: at (x0 + i spacing, y0 + j spacing); the
positions of the others are those where it is at least -`margin_m`, in that order, and heading k is home's plus
360 k / headings degrees. `infrared_m`: of the sensors in the order of `robot.INFRARED_ANGLES_DEG`. `counts_low`,
`counts_high`: lower and upper byte of the pixels in each histogram bin, all of red first, then green, then blue.
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
    arrays = {"clearance_m": made.clearance_m.astype("<f8"), "infrared_m": made.infrared_m.astype("<f8")}
    arrays |= {"counts_low": (made.counts & 255).astype("u1"), "counts_high": (made.counts >> 8).astype("u1")}
    header = {
        "room": {name: getattr(PAPER, name) for name in ("name", "size", "home", "start")},
        "room_hash": hashed(PAPER),
        "settings": settings.of_scope("view", "lattice"),
        **{"margin_m": lattice.margin, "x0": lattice.x0, "y0": lattice.y0},
        "arrays": [[name, array.dtype.str.lstrip("|"), array.shape] for name, array in arrays.items()],
    }
    content = [json.dumps(header).encode() + b"\n", *(array.tobytes() for array in arrays.values())]
    write_bytes(file, gzip.compress(b"".join(content), mtime=0))


if __name__ == "__main__":
    write()
