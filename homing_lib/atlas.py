"""The arena's views on a lattice of poses, rendered once, so that a study asks a table instead of a renderer.

An atlas answers what `robot.World` asks: histograms and infra-red readings of the nearest lattice pose, clearance
interpolated between lattice positions. The lattice is anchored at home, so that the snapshot is exact. Looking up needs
no simulator; building one does.
"""

import gzip
import hashlib
import inspect
import json
import sys
from contextlib import AbstractContextManager
from functools import cache
from math import ceil, pi, sqrt
from pathlib import Path
from typing import Any

import numpy as np
from filelock import FileLock, Timeout
from numpy.typing import NDArray
from tqdm import tqdm

from homing_lib import features, parallel
from homing_lib.errors import DamagedFile, UserError, shown
from homing_lib.features import Array
from homing_lib.robot import INFRARED_ANGLES_DEG
from homing_lib.rooms import PAPER, Pose, Room
from homing_lib.settings import Settings
from homing_lib.storage import ROOT, npz_bytes, read_arrays, read_bytes, version_of, write_bytes

FOLDER = ROOT / ".build" / "atlas"
_OUTSIDE_M = -0.1  # the clearance outside the lattice, which is outside the room
_source = cache(inspect.getsource)  # which parses the whole file
_opened: dict[Path, "Atlas"] = {}


def camera_available() -> bool:
    """Whether PyBullet can be loaded; if it can, it is now."""
    try:
        import homing_lib.arena  # noqa: F401
    except UserError:
        return False
    return True


def require_camera(what: str) -> None:
    """Raises UserError, which says what cannot be done, where PyBullet cannot be loaded and no atlas would do."""
    if not camera_available():
        remedy = "`pip install pybullet` builds it (some minutes where there is no wheel, and a C++ compiler)"
        raise UserError(f"{what} needs PyBullet, which is not installed: {remedy}")


class Lattice:
    """Positions x0 + i spacing, y0 + j spacing over the whole room, and `headings` directions from home's."""

    def __init__(self, room: Room, settings: Settings) -> None:
        self.home, self.spacing = room.home, settings.atlas_spacing_m
        self.headings = 360 // settings.atlas_heading_deg
        self._i_home, self.nx = _axis(room.home.x, room.size[0], self.spacing)
        self._j_home, self.ny = _axis(room.home.y, room.size[1], self.spacing)
        self.x0, self.y0, _ = self.pose(0, 0, 0)
        # A free body may be half a cell's diagonal inside an obstacle, and its nearest position as far again.
        self.margin = sqrt(2) * self.spacing

    def pose(self, i: int, j: int, k: int) -> Pose:
        """The pose of lattice point i, j and heading k: home's to the bit at home."""
        x, y, heading = self.home
        x, y = x + (i - self._i_home) * self.spacing, y + (j - self._j_home) * self.spacing
        return Pose(x, y, heading + 2 * pi * k / self.headings)


def _axis(anchor: float, length: float, spacing: float) -> tuple[int, int]:
    """Of the points anchor + n spacing that cover [0, length]: how many before the anchor, and how many in all."""
    before, after = ceil(anchor / spacing - 1e-9), ceil((length - anchor) / spacing - 1e-9)
    return before, before + after + 1


class Atlas:
    """Histograms, infra-red readings and clearances of one room, looked up. Build or load it with `open_atlas`.

    counts: pixels in each bin, shape (positions, headings, 3 B), and `views` the same, shape (lattice poses, 3 B);
    infrared_m: shape (positions, headings, 8); clearance_m: shape (nx, ny). The positions are those where a body can
    nearly stand, in the order of clearance_m; `position`, shape (nx, ny): the first lattice pose of each, or -1.
    `readings`, shape (lattice poses, 8): infrared_m. From x0, y0, heading0 a lattice has steps per_metre, per_radian.
    """

    def __init__(self, lattice: Lattice, counts: NDArray[Any], infrared_m: Array, clearance_m: Array) -> None:
        self.counts, self.infrared_m, self.clearance_m = counts, infrared_m, clearance_m
        self.views = counts.reshape(-1, counts.shape[2])
        self.readings = infrared_m.reshape(len(self.views), -1)
        self.pixels, self.most = int(counts[0, 0].sum()) // 3, self.views.max(axis=0)  # of a channel; in each bin
        self.position = position = np.full(clearance_m.shape, -1)
        position[clearance_m >= -lattice.margin] = np.arange(len(counts)) * lattice.headings
        # Python's own numbers and lists: for one item they are quicker than arrays.
        self._position: list[list[int]] = position.tolist()
        self._clearance: list[list[float]] = clearance_m.tolist()
        self.x0, self.y0, self.heading0 = lattice.x0, lattice.y0, lattice.home.heading
        self._last_i, self._last_j, self.headings = lattice.nx - 1, lattice.ny - 1, lattice.headings
        self.per_metre, self.per_radian = 1 / lattice.spacing, lattice.headings / (2 * pi)

    def histogram(self, pose: Pose) -> Array:
        """Scaled histograms of the nearest lattice pose (eq. 11), shape (3 B,)."""
        view: Array = self.views[self.nearest(pose)].astype(np.float64)  # first, since dividing integers is slower
        view /= self.pixels
        return view

    def infrared(self, pose: Pose) -> Array:
        """Metres that the sensors see at the nearest lattice pose, shape (8,)."""
        return self.readings[self.nearest(pose)]

    def clearance(self, x: float, y: float) -> float:
        """Metres to the nearest obstacle, interpolated linearly between the four lattice positions around."""
        u, v = (x - self.x0) * self.per_metre, (y - self.y0) * self.per_metre
        if not (0 <= u < self._last_i and 0 <= v < self._last_j):
            return _OUTSIDE_M
        i, j = int(u), int(v)
        u, v = u - i, v - j
        low, high = self._clearance[i], self._clearance[i + 1]
        return (1 - u) * ((1 - v) * low[j] + v * low[j + 1]) + u * ((1 - v) * high[j] + v * high[j + 1])

    def nearest(self, pose: Pose) -> int:
        """The number of the nearest lattice pose: 0, 1, ... in the order of `counts`."""
        x, y, heading = pose
        position = self._position[round((x - self.x0) * self.per_metre)][round((y - self.y0) * self.per_metre)]
        if position < 0:
            raise ValueError(f"pose ({x:.3f}, {y:.3f}): the atlas has no view from there, the robot cannot stand there")
        return position + round((heading - self.heading0) * self.per_radian) % self.headings


def open_atlas(room: Room, settings: Settings, folder: Path | None = None, *, workers: int = -1) -> Atlas:
    """The atlas of a room under these settings: loaded if a sound one is stored, else built, with progress.

    It is stored under the hash of all that it depends on, in place of one of the same settings by other code; a process
    keeps those that it has opened. Building takes a minute; whoever asks meanwhile waits. workers: processes, -1 for
    one per core. Without PyBullet, one that other packages made is as good, and UserError is raised where there is
    none.
    """
    folder, name = folder or FOLDER, f"{room.name}-{digest(room, settings)}"
    path = folder / f"{name}.npz"
    if not path.exists() and not camera_available():
        path = next(folder.glob(f"{name.rpartition('-')[0]}-*.npz"), path)
    if path not in _opened:
        arrays = read_stored(path)
        if arrays is None:
            from homing_lib import arena  # noqa: F401, which refuses here where there is nothing to build with

            with _build_lock(path):
                # By now another process may have built it.
                arrays = read_stored(path, quiet=True) or _build(path, room, settings, workers)
            for other in {*folder.glob(f"{name.rsplit('-', 2)[0]}-*.npz")} - {path}:
                other.unlink(missing_ok=True)
        _opened[path] = Atlas(Lattice(room, settings), **arrays)
    return _opened[path]


COMPACT = Path(__file__).with_name("compact.atlas")
"""The paper's room on a coarse lattice, which ships with the library, for machines without PyBullet (see
`publish.compact`)."""


def open_compact(room: Room, settings: Settings) -> Atlas:
    """The atlas that ships with the library. Raises UserError if these settings or this room are not what it holds."""
    header, atlas = read_compact(COMPACT)
    held = {"room": PAPER.name, **header["settings"]}
    default = Settings().of_scope("lattice")  # asked for by nobody, unlike any other lattice
    for name, value in {"room": room.name, **settings.of_scope("view", "lattice")}.items():
        if value not in (held[name], default.get(name, held[name])):
            held_only = f"images = compact holds the paper's room with {name} = {held[name]}, not {value}"
            raise UserError(f'{held_only}; use images="atlas", which needs PyBullet')
    return atlas


@cache
def read_compact(file: Path) -> tuple[dict[str, Any], Atlas]:
    """The first line of such a file, and the atlas. Raises DamagedFile unless it is there, whole and of this room."""
    try:
        line, _, content = gzip.decompress(read_bytes(file)).partition(b"\n")
        header, arrays, start = json.loads(line), {}, 0
        if header["room_hash"] != hashed(PAPER):
            raise DamagedFile(f"{file}: outdated file, of the paper's room as it was; write it anew: make compact")
        for name, kind, shape in header["arrays"]:
            arrays[name] = np.frombuffer(content, kind, int(np.prod(shape)), start).reshape(shape)
            start += arrays[name].nbytes
        counts = arrays["counts_high"].astype(np.uint16) << 8 | arrays["counts_low"]
        lattice = Lattice(PAPER, Settings(**header["settings"]))
        atlas = Atlas(lattice, counts, arrays["infrared_m"], arrays["clearance_m"])
    except UserError:
        raise
    except Exception as error:  # gzip, JSON and NumPy raise what they like
        what = "missing file" if isinstance(error, FileNotFoundError) else f"damaged file ({shown(str(error))})"
        raise DamagedFile(f"{file}: {what}; install the package again or, in a clone, restore it with git") from None
    return header, atlas


@cache  # each run asks
def digest(room: Room, settings: Settings) -> str:
    """A hash over all that the bytes of an atlas depend on, in three parts: settings; room and code; packages."""
    made_by = (features.bins_per_channel, features.histogram, Lattice, _axis, render)
    rendered_by = [Path(__file__).with_name(name).read_text(encoding="utf-8") for name in ("arena.py", "surfaces.py")]
    parts = (
        settings.of_scope("view", "lattice"),
        (room, INFRARED_ANGLES_DEG, rendered_by, [_source(part) for part in made_by]),
        [version_of(package) for package in ("pybullet", "opencv-python-headless", "numpy")],
    )
    return "-".join(map(hashed, parts))


def hashed(part: Any) -> str:
    """Eight hexadecimal digits of a hash over something's `repr`."""
    return hashlib.sha256(repr(part).encode()).hexdigest()[:8]


def read_stored(path: Path, *, quiet: bool = False) -> dict[str, NDArray[Any]] | None:
    """The arrays of a file; None if there is none, or, having said so, if it is damaged."""
    try:
        about, arrays = read_arrays(path)
        if about != {"name": path.stem, "arrays": sorted(arrays)}:
            raise DamagedFile(f"{path}: damaged file (not what was written under this name, or by an older version)")
    except FileNotFoundError:
        return None
    except DamagedFile as error:
        if not quiet:
            tqdm.write(f"homing: {error}; it is built anew", file=sys.stderr)
        return None
    return arrays


def _build(path: Path, room: Room, settings: Settings, workers: int) -> dict[str, NDArray[Any]]:
    """Render the columns of the lattice in parallel, and store them."""
    jobs = [(i, room, settings) for i in range(Lattice(room, settings).nx)]
    rendered = parallel.results(_column, jobs, workers=workers)
    parts = dict(tqdm(rendered, f"atlas of room {room.name}", total=len(jobs)))
    arrays = {name: np.concatenate([parts[i][name] for i, *_ in jobs]) for name in parts[0]}
    write_bytes(path, npz_bytes({"name": path.stem, "arrays": sorted(arrays)}, arrays))
    return arrays


def _column(i: int, room: Room, settings: Settings) -> tuple[int, dict[str, NDArray[Any]]]:
    return i, render(i, room, settings)


def render(i: int, room: Room, settings: Settings) -> dict[str, NDArray[Any]]:
    """All that can be seen, felt and touched from one column of the lattice."""
    from homing_lib.arena import Arena

    lattice = Lattice(room, settings)
    pixels, bins = settings.image_size**2, 3 * features.bins_per_channel(settings.bin_size)
    counts, infrared, clearances = [], [], []
    with Arena(room, settings) as world:
        for j in range(lattice.ny):
            x, y, _ = lattice.pose(i, j, 0)
            clearances.append(world.clearance(x, y))
            if clearances[-1] >= -lattice.margin:
                poses = [lattice.pose(i, j, k) for k in range(lattice.headings)]
                counts.append([world.histogram(pose) * pixels for pose in poses])
                infrared.append([world.infrared(pose) for pose in poses])
    return dict(
        counts=np.rint(counts).astype(np.min_scalar_type(pixels)).reshape(-1, lattice.headings, bins),
        infrared_m=np.reshape(infrared, (-1, lattice.headings, len(INFRARED_ANGLES_DEG))),
        clearance_m=np.reshape(clearances, (-1, lattice.ny)),
    )


def _build_lock(path: Path) -> AbstractContextManager[Any]:
    """The right to build this file; whoever else wants it waits. It ends with the process, however that ends."""
    lock = FileLock(path.with_suffix(".lock"))
    try:
        return lock.acquire(blocking=False)
    except Timeout:
        tqdm.write(f"homing: another process is building {path}; waiting for it", file=sys.stderr)
        return lock.acquire()
