"""The arena's views on a lattice of poses, rendered once, so that a study asks a table instead of a renderer.

An atlas answers what `robot.World` asks: histograms and infra-red readings of the nearest lattice pose, clearance
interpolated between lattice positions. The lattice is anchored at home, so that the snapshot is exact.
"""

import hashlib
import inspect
import signal
import sys
from importlib.metadata import version
from math import ceil, pi
from pathlib import Path
from typing import Any

import joblib
import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from homing_lib import arena, features
from homing_lib.arena import Arena
from homing_lib.features import Array
from homing_lib.robot import Pose
from homing_lib.rooms import Room
from homing_lib.settings import Settings
from homing_lib.storage import DamagedFile, read_arrays, write_arrays

FOLDER = Path(__file__).parent.parent / ".build" / "atlas"

_DEPENDS_ON = (
    "bin_size",
    "image_size",
    "field_of_view_deg",
    "camera_height_m",
    "camera_offset_m",
    "light",
    "body_diameter_m",
    "infrared_range_m",
    "atlas_spacing_m",
    "atlas_heading_deg",
)

_BLOCK = 3
"""Columns of the lattice that are rendered and kept together."""

_MARGIN_M = 0.02
"""Views are rendered from this far inside obstacles: a robot that touches one may be nearest to such a position."""


class Lattice:
    """Positions x0 + i spacing, y0 + j spacing over the whole room, and `headings` directions from home's."""

    def __init__(self, room: Room, settings: Settings) -> None:
        self.spacing = settings.atlas_spacing_m
        self.headings = 360 // settings.atlas_heading_deg
        self.x0, self.nx = _axis(room.home.x, room.size[0], self.spacing)
        self.y0, self.ny = _axis(room.home.y, room.size[1], self.spacing)
        self.heading0 = room.home.heading

    def pose(self, i: int, j: int, k: int) -> Pose:
        """The pose of lattice point i, j and heading k."""
        heading = self.heading0 + 2 * pi * k / self.headings
        return Pose(self.x0 + i * self.spacing, self.y0 + j * self.spacing, heading)


def _axis(anchor: float, length: float, spacing: float) -> tuple[float, int]:
    """The first of the points anchor + i spacing that cover [0, length], and how many they are."""
    before, after = ceil(anchor / spacing - 1e-9), ceil((length - anchor) / spacing - 1e-9)
    return anchor - before * spacing, before + after + 1


class Atlas:
    """Histograms, infra-red readings and clearances of one room, looked up. Build or load it with `open_atlas`.

    counts: pixels in each bin, shape (positions, headings, 3 B); infrared_m: shape (positions, headings, 8);
    clearance_m: shape (nx, ny); row: index into positions, shape (nx, ny), -1 where the robot cannot stand.
    """

    def __init__(
        self, lattice: Lattice, counts: NDArray[Any], infrared_m: NDArray[Any], clearance_m: Array, row: NDArray[Any]
    ) -> None:
        self.lattice = lattice
        self._counts = counts
        self._infrared = infrared_m
        self._clearance: list[list[float]] = clearance_m.tolist()  # Python numbers: two floats are quicker than arrays
        self._row: list[list[int]] = row.tolist()
        self._share_of_pixel = 3 / float(counts[0, 0].sum())
        self._x0, self._y0, self._heading0 = lattice.x0, lattice.y0, lattice.heading0
        self._per_metre, self._per_radian, self._headings = (
            1 / lattice.spacing,
            lattice.headings / (2 * pi),
            lattice.headings,
        )

    def histogram(self, pose: Pose) -> Array:
        """Scaled histograms of the nearest lattice pose (eq. 11), shape (3 B,)."""
        return self._counts[self._index(pose)] * self._share_of_pixel

    def infrared(self, pose: Pose) -> Array:
        """Metres that the sensors see at the nearest lattice pose, shape (8,)."""
        return self._infrared[self._index(pose)]

    def clearance(self, x: float, y: float) -> float:
        """Metres to the nearest obstacle, interpolated linearly between the four lattice positions around."""
        u, v = (x - self._x0) * self._per_metre, (y - self._y0) * self._per_metre
        i, j = int(u), int(v)
        u -= i
        v -= j
        low, high = self._clearance[i], self._clearance[i + 1]
        return (1 - u) * ((1 - v) * low[j] + v * low[j + 1]) + u * ((1 - v) * high[j] + v * high[j + 1])

    def _index(self, pose: Pose) -> tuple[int, int]:
        x, y, heading = pose
        row = self._row[round((x - self._x0) * self._per_metre)][round((y - self._y0) * self._per_metre)]
        if row < 0:
            raise ValueError(f"pose ({x:.3f}, {y:.3f}): the atlas has no view from there, the robot cannot stand there")
        return row, round((heading - self._heading0) * self._per_radian) % self._headings

    def close(self) -> None:
        """Nothing to free; an arena has."""


def open_atlas(room: Room, settings: Settings, folder: Path = FOLDER) -> Atlas:
    """The atlas of a room under these settings: loaded if a sound one is stored, else built, with progress.

    It is stored under the hash of all that it depends on; a process keeps those that it has opened.
    """
    path = folder / f"{room.name}-{digest(room, settings)}.npz"
    if path not in _opened:
        _opened[path] = _load(path, room, settings) or _build(path, room, settings)
    return _opened[path]


_opened: dict[Path, Atlas] = {}


def digest(room: Room, settings: Settings) -> str:
    """Twelve hexadecimal digits over room, camera, body, lattice, the code that renders, and Bullet's version."""
    code = inspect.getsource(arena) + inspect.getsource(features.histogram)
    values = [getattr(settings, name) for name in _DEPENDS_ON]
    return hashlib.sha256(f"{room} {values} {code} {version('pybullet')}".encode()).hexdigest()[:12]


def _load(path: Path, room: Room, settings: Settings) -> Atlas | None:
    try:
        _, arrays = read_arrays(path)
        return Atlas(Lattice(room, settings), **arrays)
    except FileNotFoundError:
        for outdated in path.parent.glob(f"{room.name}-*.npz"):
            _say(f"{outdated.name} is of another room, camera or code of the arena; a new atlas is built beside it")
    except DamagedFile as error:
        _say(f"{error}; it is built anew")
    except (TypeError, ValueError, IndexError) as error:
        _say(f"{path}: damaged file ({error}); it is built anew")
    return None


def _build(path: Path, room: Room, settings: Settings) -> Atlas:
    """Render blocks of columns in parallel, each kept as soon as it is done, then join them into one file."""
    lattice = Lattice(room, settings)
    parts = [path.with_suffix("") / f"{first:04}.npz" for first in range(0, lattice.nx, _BLOCK)]
    todo = [part for part in parts if not _is_sound(part)]
    if todo:
        blocks = joblib.Parallel(n_jobs=-1, return_as="generator_unordered")(
            joblib.delayed(_render_block)(part, room, settings) for part in todo
        )
        progress = tqdm(blocks, total=len(parts), initial=len(parts) - len(todo), desc=f"atlas of room {room.name}")
        for _ in progress:
            pass
    columns = [read_arrays(part)[1] for part in parts]
    arrays = {name: np.concatenate([column[name] for column in columns]) for name in columns[0]}
    row = np.full(arrays["clearance_m"].shape, -1)
    row[arrays["clearance_m"] >= -_MARGIN_M] = np.arange(len(arrays["counts"]))
    write_arrays(path, {"room": room.name, "settings": settings.model_dump()}, row=row, **arrays)
    for part in parts:
        part.unlink(missing_ok=True)
    parts[0].parent.rmdir()
    return Atlas(lattice, row=row, **arrays)


def _is_sound(part: Path) -> bool:
    try:
        read_arrays(part)
    except (FileNotFoundError, DamagedFile):
        return False
    return True


def _render_block(part: Path, room: Room, settings: Settings) -> None:
    """All that can be seen, felt and touched from the columns of one block."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent stops its workers; they need not say so
    lattice, first = Lattice(room, settings), int(part.stem)
    pixels = settings.image_size**2
    counts, infrared, clearances = [], [], []
    with Arena(room, settings) as world:
        for i in range(first, min(first + _BLOCK, lattice.nx)):
            for j in range(lattice.ny):
                x, y, _ = lattice.pose(i, j, 0)
                clearances.append(world.clearance(x, y))
                if clearances[-1] < -_MARGIN_M:
                    continue
                poses = [lattice.pose(i, j, k) for k in range(lattice.headings)]
                counts.append([world.histogram(pose) * pixels for pose in poses])
                infrared.append([world.infrared(pose) for pose in poses])
    bins = 3 * features.bins_per_channel(settings.bin_size)
    write_arrays(
        part,
        {"columns from": first},
        counts=np.rint(counts).astype(np.min_scalar_type(pixels)).reshape(-1, lattice.headings, bins),
        infrared_m=np.array(infrared, dtype=np.float32).reshape(-1, lattice.headings, 8),
        clearance_m=np.reshape(clearances, (-1, lattice.ny)),
    )


def _say(text: str) -> None:
    print(f"homing: {text}", file=sys.stderr)
