"""What a study is, and what is stored of it: complete runs, a file each, or one table; and a manifest, which says what
was run, by what, and the checksum of each file. `sweep` computes and writes; here is read, and refused what is damaged.
"""

import hashlib
import io
import json
import platform
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from operator import index
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

import homing_lib
from homing_lib.agent import STEP_COLUMNS, Run
from homing_lib.errors import DamagedFile, UserError, shown
from homing_lib.features import Array
from homing_lib.settings import Settings
from homing_lib.storage import ROOT, missing, npz_bytes, read_arrays, read_bytes, version_of

DATA = ROOT / "data"  # what is committed: complete runs of the headline, and one table for every other study

SCRATCH = ROOT / ".build" / "runs"  # what was measured of runs, from which tables are made

BLOCK = 10  # seeds of a condition in one file of SCRATCH; of what takes long, with the camera or deep, one

LEFTOVER_S = 3600  # a file that nobody has gone on writing for so long was left behind

Columns = dict[str, Array]
"""A tidy table: columns of equal length by their names."""

Measure = Callable[[Settings, int], Columns]
"""Makes a run, of these settings and this seed, and returns the table that is kept of it."""

ARRAYS = ("steps", "lengths", "reached")


class Job(NamedTuple):
    """Runs of one condition that one file holds."""

    path: Path
    settings: Settings
    seeds: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class Study:
    """A question put to the robot: some conditions, each run with the same seeds.

    reason: why it is asked; given: its conditions, settings by their labels, or what returns them once the tables of
    the studies that it `needs` are there. measure: the table of one run; all are stored as one,
    data/<name>.parquet; without it, the runs themselves, with every step, under data/<name>/. atlases: further settings
    whose atlases the measure looks at. deep: its runs need torch and take minutes, so that `make deep` alone computes
    it, and keeps each as soon as it is done.
    """

    name: str
    reason: str
    given: Mapping[str, Settings] | Callable[[], Mapping[str, Settings]]
    seeds: Sequence[int]
    measure: Measure | None = None
    atlases: Sequence[Settings] = ()
    deep: bool = False
    needs: Sequence["Study"] = ()

    def __post_init__(self) -> None:
        """Seeds may be NumPy's. Raises UserError for what is no seed."""
        object.__setattr__(self, "seeds", seeds_of(self.seeds))

    @cached_property
    def conditions(self) -> Mapping[str, Settings]:
        """Settings by their labels. Raises UserError if a table on which they depend is not there."""
        return self.given() if callable(self.given) else self.given

    @property
    def folder(self) -> Path:
        """Where its runs are kept; tables of runs together with those of other studies of the same measure."""
        return SCRATCH / self.whole_measure if self.measure else DATA / self.name

    @property
    def table(self) -> Path:
        """Where its table is stored."""
        return DATA / f"{self.name}.parquet"

    @property
    def manifest(self) -> Path:
        """Where its manifest is stored."""
        return DATA / f"{self.name}.json"

    @property
    def files(self) -> list[Path]:
        """What is committed of it, beside its manifest."""
        return [self.table] if self.measure else [job.path for job in self.jobs()]

    @property
    def whole_measure(self) -> str:
        """The name of its measure with the module, fit for a folder."""
        measure: Any = self.measure
        return f"{measure.__module__}.{measure.__qualname__}".translate({ord(c): "_" for c in '<>:"|?*'})

    def jobs(self) -> list[Job]:
        """All runs, each once, by the file that holds them. Runs of one seed stand together: they share its survey."""
        blocks: dict[tuple[int, int], list[int]] = {}
        conditions = [*dict.fromkeys(self.conditions.values())]
        for seed, (number, settings) in product(self.seeds, enumerate(conditions)):
            alone = self.measure is None or self.deep or settings.images == "camera"
            blocks.setdefault((number, seed if alone else seed - seed % BLOCK), []).append(seed)
        return [
            Job(path_of(self.folder, conditions[number], first), conditions[number], tuple(seeds))
            for (number, first), seeds in blocks.items()
        ]

    def __len__(self) -> int:
        """How many runs it has."""
        return len(self.seeds) * len(set(self.conditions.values()))

    @property
    def made_by(self) -> dict[str, str]:
        """Versions of what makes its runs."""
        return MADE_BY | {package: version_of(package) for package in _DEEPER if self.deep}

    def definition(self) -> dict[str, Any]:
        """What fixes its numbers, for the manifest: of settings a hash, and what is not default."""
        seeds = [int(seed) for seed in self.seeds]
        return {
            "seeds": f"{seeds[0]}-{seeds[-1]}" if seeds == [*range(seeds[0], seeds[-1] + 1)] else seeds,
            "measure": self.measure.__name__ if self.measure else "every step",
            "conditions": {
                label: {"digest": settings.digest} | settings.model_dump(exclude_defaults=True)
                for label, settings in self.conditions.items()
            },
        }


def seeds_of(seeds: Any) -> Sequence[int]:
    """Seeds as Python's own numbers. Raises UserError, in one line, unless they are 0, 1, 2, ..., each once."""
    try:
        plain = seeds if isinstance(seeds, range) else [index(seed) for seed in seeds]
    except TypeError:
        raise UserError(f"seeds = {shown(seeds)}: must be a list or range of 0, 1, 2, ...") from None
    if not plain or min(plain) < 0 or len({*plain}) < len(plain):
        raise UserError(f"seeds = {shown(seeds)}: must be some of 0, 1, 2, ..., each once")
    return plain


@contextmanager
def _with_remedy() -> Iterator[None]:
    try:
        yield
    except DamagedFile as error:
        raise DamagedFile(f"{error}; delete it, and `make data` computes it from scratch") from None


def remove_leftovers(folder: Path, of: str = "*") -> None:
    """Remove what was being written, of files of this stem or of all, when its process was killed.

    Told by age: a process number says nothing of another machine, or container, that shares the folder.
    """
    for part in folder.glob(f".{of}.[0-9]*.part*"):
        with suppress(OSError):  # it has just been renamed, or removed by somebody else
            if time.time() - part.stat().st_mtime > LEFTOVER_S:
                part.unlink()


# --- Complete runs ------------------------------------------------------------------------------------------------


def path_of(folder: Path, settings: Settings, seed: int) -> Path:
    """Where a run is stored, or a block of them that begins with this seed."""
    return folder / f"{settings.digest}-{seed}.npz"


def content_of(result: Run) -> bytes:
    """A run as the bytes of a file: the same for the same run."""
    about = {"settings": result.settings.model_dump(), "seed": result.seed, "diverged": result.diverged}
    return npz_bytes(about, {name: getattr(result, name) for name in ARRAYS})


@_with_remedy()
def load(path: Path) -> Run:
    """Read a run. Raises UserError with one line if the file is missing or damaged."""
    try:
        about, arrays = read_arrays(path)
        result = Run(Settings(**about["settings"]), index(about["seed"]), diverged=index(about["diverged"]), **arrays)
        steps = (result.lengths.sum(), len(STEP_COLUMNS))
        if result.steps.shape != steps or result.reached.shape != result.lengths.shape:
            raise ValueError("its arrays do not fit each other")
    except FileNotFoundError:
        raise missing(path, "there is no such run; `make data` computes it") from None
    except DamagedFile:
        raise
    except (KeyError, TypeError, ValueError, AttributeError, UserError) as error:
        raise DamagedFile(f"{path}: damaged file ({error})") from None
    return result


def load_study(study: Study) -> dict[str, list[Run]]:
    """The complete runs of a study by condition, seeds in order."""
    return {
        label: [load_one(study, settings, seed) for seed in study.seeds] for label, settings in study.conditions.items()
    }


def load_one(study: Study, settings: Settings, seed: int) -> Run:
    """A complete run of a study. Raises UserError if it is missing, or its checksum is not the manifest's."""
    path = path_of(study.folder, settings, seed)
    result = load(path)
    check(path, read_manifest(study))
    return result


# --- Tables -------------------------------------------------------------------------------------------------------


def load_table(study: Study) -> pd.DataFrame:
    """A study's table: columns `condition`, `seed`, those of its measure, and one for each setting that varies (unless
    the measure has a column of that name). Raises UserError if it is missing, damaged or of another definition.
    """
    require(study)
    table = pd.read_parquet(io.BytesIO(read_bytes(study.table)))
    every = {label: dict(settings) for label, settings in study.conditions.items()}
    for name in Settings.model_fields:
        if name not in table and len({str(values[name]) for values in every.values()}) > 1:
            table[name] = table.condition.astype(object).map({label: values[name] for label, values in every.items()})
    return table


def episode_matrix(runs: Sequence[Run], column: str | None = None) -> Array:
    """Numbers of each episode, shape (runs, episodes): its steps, or a column of `STEP_COLUMNS` summed over them.

    Of episodes that a run did not finish because it diverged, the sums are NaN, and the steps are `max_steps`: it would
    not come home.
    """
    table = np.full((len(runs), max(one.settings.episodes for one in runs)), np.nan)
    for row, one in zip(table, runs, strict=True):
        if column is None:
            row[: one.settings.episodes] = one.settings.max_steps
            row[: len(one.lengths)] = one.lengths
        else:
            sums = np.cumsum([0.0, *one.column(column)])
            row[: len(one.lengths)] = np.diff(sums[[0, *one.ended]])
    return table


def episodes_of(table: Any, condition: str, column: str = "steps") -> Array:
    """Numbers of each episode from a study's table, shape (runs, episodes), seeds in order."""
    rows = table[table.condition == condition].sort_values(["seed", "episode"])
    values = rows[column].to_numpy(np.float64).reshape(rows.seed.nunique(), -1)
    return np.where(np.isnan(values), Settings().max_steps, values) if column == "steps" else values


# --- Manifests ----------------------------------------------------------------------------------------------------


def source_hash(house: Path) -> str:
    """A hash of the library in this folder as far as runs depend on it: its model and study."""
    source = hashlib.sha256()
    for file in sorted([house / "rooms.toml", *house.glob("*.py"), *house.glob("study/**/*.py")]):
        source.update(file.name.encode() + file.read_bytes())
    return source.hexdigest()[:12]


MADE_BY = {package: version_of(package) for package in ("numpy", "opencv-python-headless", "pybullet")}
MADE_BY |= {"python": platform.python_version(), "homing_lib": source_hash(Path(homing_lib.__file__).parent)}
"""Versions of what makes a run. Taken when the library is imported: its files may have changed when the run ends."""

_DEEPER = ("stable-baselines3", "torch")


@_with_remedy()
def read_manifest(study: Study) -> dict[str, Any]:
    """The manifest, empty if there is none. Raises DamagedFile."""
    try:
        manifest: dict[str, Any] = json.loads(read_bytes(study.manifest))
        texts = [*manifest["sha256"].values(), *(manifest["made by"][name] for name in MADE_BY)]
        if not all(isinstance(text, str) for text in texts):
            raise ValueError("it does not say what is stored and what made it")
    except FileNotFoundError:
        return {}
    except (KeyError, TypeError, ValueError, AttributeError, RecursionError) as error:
        raise DamagedFile(f"{study.manifest}: damaged file ({error})") from None
    return manifest


@_with_remedy()
def sha256(file: Path) -> str:
    """Of its content. Raises FileNotFoundError, or DamagedFile for what cannot be read."""
    return hashlib.sha256(read_bytes(file)).hexdigest()


def check(file: Path, manifest: Mapping[str, Any]) -> None:
    """Raise DamagedFile unless the content of this file has the checksum that the manifest has for it."""
    expected = manifest.get("sha256", {}).get(file.name)
    if expected is None:
        raise DamagedFile(f"{file}: no manifest vouches for it; `make data` computes it anew")
    if expected != sha256(file):
        with _with_remedy():
            raise DamagedFile(f"{file}: damaged file (its content is not what its manifest says)")


def is_current(study: Study) -> bool:
    """Whether all is stored, and of this very study. Raises DamagedFile if a file is not as it was written."""
    manifest = read_manifest(study)
    files = study.files
    current = manifest | study.definition() == manifest and {file.name for file in files} <= manifest["sha256"].keys()
    if not current or not all(file.exists() for file in files):
        return False
    for file in files:
        check(file, manifest)
    return True


def require(study: Study) -> None:
    """Raises UserError unless a study is stored, sound and as it stands."""
    if not is_current(study):
        computes = f"`make {'deep' if study.deep else 'data'}` computes it"
        raise missing(study.table, f"missing, or of an older version of this study; {computes}")


def fingerprint(studies: Iterable[Study]) -> str:
    """A hash of the stored content of some studies: it changes when, and only when, the data do."""
    contents = "".join(file.name + sha256(file) for study in studies for file in study.files)
    return hashlib.sha256(contents.encode()).hexdigest()
