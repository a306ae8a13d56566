"""Many runs, stored so that nothing is lost: what is there and sound is kept, what is missing is computed.

One file for a block of seeds, named by the hash of its settings and by the seeds, written beside its place and renamed:
it is either whole or not there, whenever, wherever and by however many processes a sweep is stopped and started again.
Studies that measure the same share these files, so that runs which two of them ask for are computed once.
"""

import hashlib
import io
import json
import logging
import multiprocessing.resource_tracker
import os
import platform
import re
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from operator import index
from pathlib import Path
from typing import Any

import joblib
import numpy as np
import pandas as pd
import psutil
from joblib.externals.loky.backend import resource_tracker
from tqdm import tqdm

import homing_lib
from homing_lib.agent import STEP_COLUMNS, Run, run
from homing_lib.atlas import open_atlas
from homing_lib.errors import RESUMES, DamagedFile, UserError, shown
from homing_lib.features import Array
from homing_lib.parallel import init_worker, quieten
from homing_lib.rooms import room_named
from homing_lib.settings import Settings
from homing_lib.storage import MARK, ROOT, npz_bytes, read_arrays, read_bytes, write_bytes

DATA = ROOT / "data"  # what is committed: complete runs of the headline, and one table for every other study

SCRATCH = ROOT / ".build" / "runs"  # the runs from which tables are made

BLOCK = 10  # seeds of runs that are stored together, unless the camera makes each of them last

TOLERANCE = 1e-6
"""How far a repeated run may stand from the stored one on another processor, absolutely or relative to a number's size:
exponentials and dot products differ there in the last bits, and learning carries the difference on."""

Columns = dict[str, Array]
"""A tidy table: columns of equal length by their names. They are listed in data/README.md."""

Measure = Callable[[Settings, int], Columns]
"""The table of one run, by its settings and seed."""

_REMEDY = "delete it, and `make data` computes it from scratch"
_ARRAYS = ("steps", "lengths", "reached")
_PACKAGES = ("numpy", "opencv-python-headless", "pybullet")


@dataclass(frozen=True, eq=False)
class Study:
    """A question put to the robot: some conditions, each run with the same seeds.

    reason: why it is asked; conditions: settings by their labels. measure: the table of one run; all are stored as one,
    data/<name>.parquet; without it, the runs themselves, with every step, under data/<name>/. atlases: of further
    settings that the measure looks at.
    """

    name: str
    reason: str
    conditions: Mapping[str, Settings]
    seeds: Sequence[int]
    measure: Measure | None = None
    atlases: Sequence[Settings] = ()

    def __post_init__(self) -> None:
        """Seeds may be NumPy's; UserError for what is none."""
        object.__setattr__(self, "seeds", seeds_of(self.seeds))

    @property
    def folder(self) -> Path:
        """Where its runs are stored: complete ones by themselves, others with all that are measured so."""
        if self.measure is None:
            return DATA / self.name
        return SCRATCH / self._whole_name()

    @property
    def table(self) -> Path:
        """Where its table is stored; its manifest stands beside it."""
        return DATA / f"{self.name}.parquet"

    @property
    def measured(self) -> str:
        """What is kept of a run."""
        return self.measure.__name__ if self.measure else "every step"

    def jobs(self) -> list["_Job"]:
        """All runs, each once, by what one file holds; those of one seed near each other: they share its survey."""
        blocks: dict[int, list[int]] = {}
        for seed in self.seeds:
            blocks.setdefault(seed // BLOCK, []).append(seed)
        return [
            (settings, (seed,) if self._alone(settings) else tuple(block))
            for block in blocks.values()
            for seed in block
            for settings in dict.fromkeys(self.conditions.values())
            if self._alone(settings) or seed == block[0]
        ]

    def _whole_name(self) -> str:
        """Of the measure, by which its runs are known to be measured so."""
        measure: Any = self.measure
        return f"{measure.__module__}.{measure.__qualname__}".translate({ord(c): "_" for c in '<>:"|?*'})

    def _alone(self, settings: Settings) -> bool:
        return self.measure is None or settings.images == "camera"

    def __len__(self) -> int:
        """How many runs it has."""
        return len(self.seeds) * len(set(self.conditions.values()))

    def definition(self) -> dict[str, Any]:
        """What fixes the numbers of this study, for its manifest: of settings a hash, and what is not default."""
        seeds = [int(seed) for seed in self.seeds]
        return {
            "seeds": f"{seeds[0]}-{seeds[-1]}" if seeds == [*range(seeds[0], seeds[-1] + 1)] else seeds,
            "measure": self.measured,
            "conditions": {
                label: {"digest": settings.digest} | settings.model_dump(exclude_defaults=True)
                for label, settings in self.conditions.items()
            },
        }


def missing(path: Path, otherwise: str) -> UserError:
    """What is said of a file of the repository that is not there; `otherwise`: if it is not the repository itself."""
    if (ROOT / MARK).exists():
        return UserError(f"{path}: {otherwise}")
    where = f"neither {ROOT} nor a folder above it, nor where homing_lib is installed, is a clone of its repository"
    return UserError(f"{path}: missing, for {where}; clone it and work there")


def seeds_of(seeds: Any) -> Sequence[int]:
    """Seeds as Python's own numbers. Raises UserError, in one line, unless they are 0, 1, 2, ..., each once."""
    try:
        plain = seeds if isinstance(seeds, range) else [index(seed) for seed in seeds]
    except TypeError:
        raise UserError(f"seeds = {shown(seeds)}: must be a list or range of 0, 1, 2, ...") from None
    if not plain or min(plain) < 0 or len({*plain}) < len(plain):
        raise UserError(f"seeds = {shown(seeds)}: must be some of 0, 1, 2, ..., each once")
    return plain


# --- One run ------------------------------------------------------------------------------------------------------


def path_of(folder: Path, settings: Settings, *seeds: int) -> Path:
    """Where a run is stored, or a block of them."""
    together = len(seeds) == seeds[-1] - seeds[0] + 1
    named = dict.fromkeys((seeds[0], seeds[-1]) if together else seeds)
    return folder / f"{settings.digest}-{('-' if together else '.').join(map(str, named))}.npz"


def save(result: Run, path: Path) -> None:
    """Write a run. The same run gives the same bytes."""
    write_bytes(path, content_of(result))


def content_of(result: Run) -> bytes:
    """A run as the bytes of a file."""
    about = {"settings": result.settings.model_dump(), "seed": result.seed, "diverged": result.diverged}
    return npz_bytes(about, {name: getattr(result, name) for name in _ARRAYS})


def load(path: Path) -> Run:
    """Read a run. Raises UserError with one line if the file is missing or damaged."""
    return _run(path, *_read(path))


def _run(path: Path, about: dict[str, Any], arrays: dict[str, Any]) -> Run:
    try:
        one = Run(Settings(**about["settings"]), index(about["seed"]), diverged=index(about["diverged"]), **arrays)
        steps, episodes = one.lengths.sum(), len(one.lengths)
        if one.steps.shape != (steps, len(STEP_COLUMNS)) or one.reached.shape != (episodes,):
            raise ValueError("its arrays do not fit each other")
    except (KeyError, TypeError, ValueError, AttributeError, UserError) as error:
        raise DamagedFile(f"{path}: damaged file ({error}); {_REMEDY}") from None
    return one


def _read(path: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    try:
        return read_arrays(path)
    except FileNotFoundError:
        raise missing(path, "there is no such run; `make data` computes it") from None
    except DamagedFile as error:
        raise DamagedFile(f"{error}; {_REMEDY}") from None


def _made_by() -> dict[str, str]:
    made_by = dict.fromkeys(_PACKAGES, "none")
    for package in _PACKAGES:
        with suppress(PackageNotFoundError):
            made_by[package] = version(package)
    source = hashlib.sha256()
    for file in sorted(Path(homing_lib.__file__).parent.rglob("*")):
        if file.suffix in (".py", ".toml"):
            source.update(file.name.encode() + file.read_bytes())
    return made_by | {"python": platform.python_version(), "homing_lib": source.hexdigest()[:12]}


MADE_BY = _made_by()
"""Versions of what makes a run: packages, Python, and this library as a hash of its source. Taken when the library is
imported: its files may have changed when the run ends."""


# --- Many runs ----------------------------------------------------------------------------------------------------


def sweep(
    study: Study, *, workers: int = -1, cluster: str | None = None, force: bool = False, anew: set[Path] | None = None
) -> int:
    """Compute what is missing of a study, or all of it (`force`). Returns how many runs were computed.

    workers: processes on this machine, -1 for one per core; cluster: address of a Dask scheduler to use instead. What
    one file holds is kept as soon as it is finished. anew: files that are not computed again though it is forced, since
    another study made them just now; those made here are added. Raises UserError if a stored file is damaged or workers
    are lost.
    """
    if cluster == "":
        raise UserError("--cluster: the address is empty; give that of a Dask scheduler, or leave the option out")
    if study.measure and not force and _table_is_current(study):
        return 0
    remove_leftovers(study.folder)
    remove_leftovers(DATA)
    before, anew = _read_manifest(study), anew if anew is not None else set()
    held = _held(study, anew if force else None) if study.measure else {}
    todo = [
        (settings, tuple(seed for seed in seeds if (settings, seed) not in held)) for settings, seeds in study.jobs()
    ]
    if not study.measure:
        todo = [job for job in todo if force or not _is_sound(study, before, *job)]
    todo = [(settings, seeds) for settings, seeds in todo if seeds]
    client = _connect(cluster) if cluster and todo else None  # before anything changes
    if force:
        _manifest(study).unlink(missing_ok=True)  # it vouches for what is about to change
    vouched = _Vouched(study, before, todo, force)
    count = sum(len(seeds) for _, seeds in todo)
    if todo:
        for settings in (*study.conditions.values(), *study.atlases):
            if settings.images == "atlas":
                open_atlas(room_named(settings.room), settings)  # once, before the workers all want it
        results = _on_cluster(client, study, todo) if client else _on_cores(workers, study, todo)
        with tqdm(total=count, desc=f"{study.name}: runs", unit="run") as bar:
            for settings, seeds, found, origin in results:
                path = path_of(study.folder, settings, *seeds)
                if study.measure:
                    _store(path, study, settings, seeds, found, origin)
                    held |= {(settings, seed): (one, origin) for seed, one in zip(seeds, found, strict=True)}
                    anew.add(path)
                else:
                    save(found[0], path)
                    vouched.add(path, origin)
                bar.update(len(seeds))
    if study.measure:
        vouched.origins = _write_table(study, held)
        vouched.sha256 = {study.table.name: _sha256(study.table)}
    vouched.write()
    return count


def remove_leftovers(folder: Path, of: str = "*") -> None:
    """Remove what processes that are gone were writing when they were killed: files of one stem, or all."""
    for part in folder.glob(f".{of}.*.part*"):
        process = part.name.rpartition(".part")[0].rpartition(".")[2]
        if process.isdecimal() and not psutil.pid_exists(int(process)):
            part.unlink(missing_ok=True)


_Job = tuple[Settings, tuple[int, ...]]
_Result = tuple[Settings, tuple[int, ...], list[Any], dict[str, str]]
_Held = dict[tuple[Settings, int], tuple[Columns, dict[str, str]]]
"""What was measured of a run, and what made it, by settings and seed."""


def _on_cores(workers: int, study: Study, todo: Sequence[_Job]) -> Iterator[_Result]:
    quieten()
    parallel = joblib.Parallel(
        min(workers, len(todo)), return_as="generator_unordered", initializer=init_worker, initargs=(os.getpid(),)
    )
    results: Any = None
    try:
        with _interrupts_later():
            results = parallel(joblib.delayed(_compute)(study.measure, *job) for job in todo)
        yield from results
    except BrokenProcessPool:
        raise UserError(f"a worker process was killed (too little memory?); {RESUMES}") from None
    finally:
        del results  # which stops it, if it goes on


@contextmanager
def _interrupts_later() -> Iterator[None]:
    """Ctrl-C counts when the block ends, whichever thread it reaches, and never in processes that are started in it."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    came: list[Any] = []
    before = signal.signal(signal.SIGINT, lambda *what: came.append(what))
    if has_masks := hasattr(signal, "pthread_sigmask"):
        resource_tracker.ensure_running()  # both trackers unblock it when they start
        multiprocessing.resource_tracker.ensure_running()
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # which processes inherit
    try:
        yield
    finally:
        if has_masks:
            signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
        signal.signal(signal.SIGINT, before)
    if came and callable(before):
        before(*came[0])


_PROBE = """
import logging, os, sys
from distributed import Client
logging.disable()
print("asks", flush=True)
try:
    Client(sys.argv[1], timeout="5s")
except BaseException as error:
    print(" ".join(str(error).split()), flush=True)
else:
    print("answered", flush=True)
os._exit(0)
"""


def _connect(address: str) -> Any:
    """A client of the Dask scheduler there. UserError if none answers within some seconds, whatever does instead.

    Another process asks first: with a server of another kind the client waits for ever, and cannot be stopped.
    """
    probe = subprocess.Popen(
        [sys.executable, "-c", _PROBE, address], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    )
    with probe:
        assert probe.stdout is not None
        probe.stdout.readline()  # from here on: how long it takes to be loaded says nothing
        try:
            answer = probe.communicate(timeout=8)[0].strip()
        except subprocess.TimeoutExpired:
            answer = "what is there does not speak as one"
        finally:
            probe.kill()
    if answer != "answered":
        raise UserError(f"--cluster {address}: no Dask scheduler answers there ({answer[:120] or 'no reason given'})")
    from distributed import Client

    logging.getLogger("distributed.client").setLevel(logging.CRITICAL)  # what it would say at length is said here
    try:
        return Client(address, timeout="5s")
    except (OSError, ValueError) as error:
        raise UserError(f"--cluster {address}: no Dask scheduler answers there ({error})") from None


def _on_cluster(client: Any, study: Study, todo: Sequence[_Job]) -> Iterator[_Result]:
    from distributed import CancelledError, KilledWorker, as_completed
    from distributed.comm.core import CommClosedError

    address = client.scheduler.address
    with client:
        futures = [client.submit(_compute, study.measure, *job, pure=False) for job in todo]
        try:
            for future in as_completed(futures):
                yield future.result()
                future.release()
        except (CancelledError, CommClosedError):
            raise UserError(f"--cluster {address}: the connection to the Dask scheduler was lost; {RESUMES}") from None
        except KilledWorker:
            raise UserError(f"--cluster {address}: workers keep dying of the same run; {RESUMES}") from None


def _compute(measure: Measure | None, settings: Settings, seeds: tuple[int, ...]) -> _Result:
    return settings, seeds, [(measure or run)(settings, seed) for seed in seeds], MADE_BY


def _store(
    path: Path, study: Study, settings: Settings, seeds: Sequence[int], found: Sequence[Columns], origin: dict[str, str]
) -> None:
    about: dict[str, Any] = {"settings": settings.model_dump(), "seeds": list(seeds), "measure": study._whole_name()}
    about |= {"made by": origin, "rows": [len(next(iter(columns.values()))) for columns in found]}
    columns = {name: np.concatenate([one[name] for one in found]) for name in found[0]}
    table = np.empty(sum(about["rows"]), [(name, column.dtype) for name, column in columns.items()])
    for name, column in columns.items():
        table[name] = column  # one array is read faster than ten
    write_bytes(path, npz_bytes(about | {"sha256": _hash_of(about, {"table": table})}, {"table": table}))


def _held(study: Study, only: set[Path] | None) -> _Held:
    """What is stored of a study's runs, and sound. only: in these files; others of these settings are removed, so that
    none stands beside what is computed anew. Raises UserError if one is damaged.

    What a file's own hash does not vouch for might be anything: it is left out, and computed anew.
    """
    wanted = {settings.digest: settings for settings in study.conditions.values()}
    held: _Held = {}
    for path in sorted(study.folder.glob("[!.]*.npz")):
        named = re.fullmatch(r"(\w+)-(\d+)(?:[-.\d]*[-.](\d+))?", path.stem)
        if named is None or named[1] not in wanted:
            continue
        settings, first, last = wanted[named[1]], int(named[2]), int(named[3] or named[2])
        if not any(first <= seed <= last for seed in study.seeds):
            continue
        if only is not None and path not in only:
            path.unlink()
            continue
        about, arrays = _read(path)
        table, own = arrays.get("table"), about.pop("sha256", None)
        if own != _hash_of(about, arrays) or about.get("measure") != study._whole_name():
            continue
        if about["settings"] != settings.model_dump() or path != path_of(study.folder, settings, *about["seeds"]):
            raise UserError(f"{path}: holds other runs than its name says; {_REMEDY}")
        assert table is not None
        parts = np.split(table, np.cumsum(about["rows"])[:-1])
        for seed, rows in zip(about["seeds"], parts, strict=True):
            held[settings, seed] = {name: rows[name] for name in table.dtype.names}, about["made by"]
    return held


def _is_sound(study: Study, manifest: Mapping[str, Any], settings: Settings, seeds: Sequence[int]) -> bool:
    """Whether a complete run is stored, and vouched for. Raises UserError if its file is damaged, or of another."""
    path = path_of(study.folder, settings, *seeds)
    if not path.exists() or path.name not in manifest.get("sha256", {}):
        return False
    load_one(study, settings, *seeds)
    return True


def _hash_of(about: Mapping[str, Any], arrays: Columns) -> str:
    found = hashlib.sha256(json.dumps(about, sort_keys=True).encode())
    for name, array in sorted(arrays.items()):
        found.update(f"{name} {array.dtype} {array.shape}".encode() + array.tobytes())
    return found.hexdigest()


def load_study(study: Study) -> dict[str, list[Run]]:
    """The complete runs of a study by condition, seeds in order."""
    return {
        label: [load_one(study, settings, seed) for seed in study.seeds] for label, settings in study.conditions.items()
    }


def load_one(study: Study, settings: Settings, seed: int) -> Run:
    """A complete run of a study. Raises UserError if it is missing, or not what its manifest vouches for."""
    path = path_of(study.folder, settings, seed)
    about, arrays = _read(path)
    _check(path, _read_manifest(study))
    if (about.get("settings"), about.get("seed")) != (settings.model_dump(), seed):
        raise UserError(f"{path}: holds a run of other settings or another seed; {_REMEDY}")
    return _run(path, about, arrays)


# --- Episodes -------------------------------------------------------------------------------------------------------


def episode_matrix(runs: Sequence[Run], column: str | None = None) -> Array:
    """Numbers of each episode, shape (runs, episodes): its steps, or a column of `STEP_COLUMNS` summed over them.

    Of what a run that diverged did not finish, the sums are NaN, and the steps are `max_steps`: it would not come home.
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
    """The same of a study's table: shape (runs, episodes), seeds in order."""
    rows = table[table.condition == condition].sort_values(["seed", "episode"])
    values = rows[column].to_numpy(np.float64).reshape(rows.seed.nunique(), -1)
    return np.where(np.isnan(values), Settings().max_steps, values) if column == "steps" else values


# --- Tables and manifests ---------------------------------------------------------------------------------------------


def load_table(study: Study) -> pd.DataFrame:
    """A study's table: columns `condition`, `seed`, those of its measure, and one for each setting that varies (where
    no other has that name). Raises UserError if it is not sound.
    """
    if not _table_is_current(study):
        raise missing(study.table, "missing, or of an older version of this study; `make data` computes it")
    table = pd.read_parquet(io.BytesIO(read_bytes(study.table)))
    every = {label: dict(settings) for label, settings in study.conditions.items()}
    for name in Settings.model_fields:
        if name not in table and len({str(values[name]) for values in every.values()}) > 1:
            table[name] = table.condition.astype(object).map({label: values[name] for label, values in every.items()})
    return table


def _write_table(study: Study, held: _Held) -> list[dict[str, str]]:
    """Join the runs into one table, 32-bit numbers. Returns what made each run."""
    labels, seeds = zip(*[(label, seed) for label in study.conditions for seed in study.seeds], strict=True)
    found, origins = zip(
        *[held[study.conditions[label], seed] for label, seed in zip(labels, seeds, strict=True)], strict=True
    )
    rows = [len(next(iter(columns.values()))) for columns in found]
    condition = pd.Categorical(np.repeat(np.array(labels, dtype=object), rows))
    table: dict[str, Any] = {"condition": condition, "seed": np.repeat(np.array(seeds, dtype=np.int32), rows)}
    with np.errstate(over="ignore"):  # the last numbers of a run that diverged become infinite
        for name in found[0]:
            table[name] = np.concatenate([columns[name] for columns in found]).astype(np.float32)
    frame = pd.DataFrame(table)
    buffer = io.BytesIO()
    frame.to_parquet(buffer, index=False, compression="zstd", compression_level=9)
    _manifest(study).unlink(missing_ok=True)  # whoever is killed here leaves a table without one, to be joined again
    write_bytes(study.table, buffer.getvalue())
    return list(origins)


def _manifest(study: Study) -> Path:
    return study.table.with_suffix(".json")


def _files(study: Study) -> list[Path]:
    """What is committed of a study, beside its manifest."""
    return (
        [study.table]
        if study.measure
        else [path_of(study.folder, settings, *seeds) for settings, seeds in study.jobs()]
    )


def _sha256(file: Path) -> str:
    try:
        return hashlib.sha256(read_bytes(file)).hexdigest()
    except DamagedFile as error:
        raise DamagedFile(f"{error}; {_REMEDY}") from None


def _read_manifest(study: Study) -> dict[str, Any]:
    """The manifest, empty if there is none. Raises DamagedFile."""
    file = _manifest(study)
    try:
        manifest = json.loads(read_bytes(file))
        if not isinstance(manifest, dict) or not _are_texts(manifest.get("sha256")):
            raise ValueError("no hashes of the files that it is about")
        if not _is_origin(manifest.get("made by")):
            raise ValueError("it does not say what made them")
    except FileNotFoundError:
        return {}
    except DamagedFile as error:
        raise DamagedFile(f"{error}; {_REMEDY}") from None
    except (ValueError, RecursionError) as error:
        raise DamagedFile(f"{file}: damaged file ({error}); {_REMEDY}") from None
    return manifest


def _are_texts(what: Any) -> bool:
    return isinstance(what, dict) and all(isinstance(value, str) for value in what.values())


def _is_origin(what: Any) -> bool:
    return _are_texts(what) and MADE_BY.keys() <= what.keys()


class _Vouched:
    """The manifest of a study, as it grows: what a complete run is, is said as soon as it is stored."""

    def __init__(self, study: Study, before: Mapping[str, Any], todo: Sequence[_Job], force: bool) -> None:
        self._study, self._before = study, before
        files = {file.name for file in _files(study)}
        hashes = {name: value for name, value in before.get("sha256", {}).items() if name in files}
        kept = hashes.keys() - {path_of(study.folder, settings, *seeds).name for settings, seeds in todo}
        self.sha256: dict[str, str] = {} if force else hashes
        self.origins: Sequence[Mapping[str, str]] = [before["made by"]] if kept else []

    def add(self, file: Path, origin: Mapping[str, str]) -> None:
        """Vouch for a run that was just stored. One that came out the same is still what first made it."""
        name, found = file.name, _sha256(file)
        same = self._before.get("sha256", {}).get(name) == found
        self.origins = [*self.origins, self._before["made by"] if same else origin]
        self.sha256[name] = found
        self.write()

    def write(self) -> None:
        """Say what made the stored files."""
        order = [file.name for file in _files(self._study)]
        now = self._study.definition() | {"sha256": {name: self.sha256[name] for name in order if name in self.sha256}}
        parts = {name: {part for origin in self.origins for part in origin[name].split(", ")} for name in MADE_BY}
        now["made by"] = {name: ", ".join(sorted(some)) for name, some in parts.items()}
        if self._study.measure and {**self._before, **now} | {"made by": 0} == {**self._before, "made by": 0}:
            now["made by"] = self._before["made by"]
        if now != _read_manifest(self._study):
            write_bytes(_manifest(self._study), (json.dumps(now, indent=1) + "\n").encode())


def _check(file: Path, manifest: Mapping[str, Any]) -> None:
    """Raise DamagedFile unless the manifest vouches for the content of this file."""
    vouched = manifest.get("sha256", {}).get(file.name)
    if vouched is None:
        raise DamagedFile(f"{file}: no manifest vouches for it; `make data` computes it anew")
    if vouched != _sha256(file):
        raise DamagedFile(f"{file}: damaged file (its content is not what its manifest says); {_REMEDY}")


def _table_is_current(study: Study) -> bool:
    """Whether the stored table is of this very study. Raises DamagedFile if it is, but is not as it was written."""
    manifest = _read_manifest(study)
    of_this_study = manifest | study.definition() == manifest
    if current := of_this_study and study.table.name in manifest["sha256"] and study.table.exists():
        _check(study.table, manifest)
    return current


def fingerprint(studies: Iterable[Study]) -> str:
    """A hash of the stored content of some studies: it changes when, and only when, the data do."""
    contents = "".join(file.name + _sha256(file) for study in studies for file in _files(study))
    return hashlib.sha256(contents.encode()).hexdigest()


def compare(stored: Run, live: Run) -> str:
    """How a repeated run stands to the stored one: "to the bit", "within tolerance", or "not"."""
    pairs: list[tuple[Any, Any]] = [(getattr(stored, name), getattr(live, name)) for name in (*_ARRAYS, "diverged")]
    if all(np.array_equal(a, b, equal_nan=True) for a, b in pairs):
        return "to the bit"
    if all(np.shape(a) == np.shape(b) and np.allclose(a, b, TOLERANCE, TOLERANCE, True) for a, b in pairs):
        return "within tolerance"
    return "not"


def verify(study: Study) -> str:
    """Repeat the first run of a study live, the robot driving in PyBullet, and compare it with the stored one."""
    (settings, (seed,)), *_ = study.jobs()
    stored = load(path_of(study.folder, settings, seed))
    with tqdm(total=settings.episodes, desc="live run: episodes", unit="episode") as bar:
        live = run(settings, seed, after_episode=lambda _: bar.update())
    what = f"seed {seed}, {settings.episodes} episodes, {len(live.steps)} steps"
    outcome = compare(stored, live)
    if outcome == "to the bit":
        return f"This machine reproduces the stored run to the bit ({what})."
    if outcome == "within tolerance":
        return f"This machine reproduces the stored run within {TOLERANCE:g}, though not to the bit ({what})."
    return f"This machine does NOT reproduce the stored run ({what}): its own results come from `make data FORCE=1`."
