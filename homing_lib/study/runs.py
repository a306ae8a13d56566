"""Many runs, stored so that nothing is lost: what is there and sound is kept, what is missing is computed.

One file per run, named by the hash of its settings and its seed, written beside its place and renamed: it is either
whole or not there, whenever, wherever and by however many processes a sweep is stopped and started again.
"""

import hashlib
import io
import json
import logging
import multiprocessing.resource_tracker
import os
import platform
import signal
import threading
import time
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import joblib
import numpy as np
import pandas as pd
import psutil
from joblib.externals.loky.backend import resource_tracker
from tqdm import tqdm

import homing_lib
from homing_lib.agent import Run, run
from homing_lib.atlas import open_atlas
from homing_lib.errors import RESUMES, DamagedFile, UserError
from homing_lib.features import Array
from homing_lib.rooms import room_named
from homing_lib.settings import Settings
from homing_lib.storage import ROOT, missing, read_arrays, write_arrays, write_bytes

DATA = ROOT / "data"  # what is committed: complete runs of the headline, and one table for every other study

SCRATCH = ROOT / ".build" / "runs"  # the single runs from which tables are made

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


@dataclass(frozen=True)
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

    @property
    def folder(self) -> Path:
        """Where its single runs are stored."""
        return (SCRATCH if self.measure else DATA) / self.name

    @property
    def table(self) -> Path:
        """Where its table is stored; its manifest stands beside it."""
        return DATA / f"{self.name}.parquet"

    @property
    def measured(self) -> str:
        """What is kept of a run."""
        return self.measure.__name__ if self.measure else "every step"

    def jobs(self) -> list[tuple[Settings, int]]:
        """All runs, each once, those of one seed together: they share its survey."""
        return [(settings, seed) for seed in self.seeds for settings in dict.fromkeys(self.conditions.values())]

    def definition(self) -> dict[str, Any]:
        """What fixes the numbers of this study, as its manifest keeps it."""
        return {
            "seeds": [int(seed) for seed in self.seeds],
            "measure": self.measured,
            "conditions": {label: settings.model_dump() for label, settings in self.conditions.items()},
        }


# --- One run ------------------------------------------------------------------------------------------------------


def path_of(folder: Path, settings: Settings, seed: int) -> Path:
    """Where a run is stored."""
    return folder / f"{settings.digest}-{seed}.npz"


def save(result: Run, path: Path) -> None:
    """Write a run. The same run gives the same bytes."""
    about = {"settings": result.settings.model_dump(), "seed": result.seed, "diverged": result.diverged}
    write_arrays(path, about, **{name: getattr(result, name) for name in _ARRAYS})


def load(path: Path) -> Run:
    """Read a run. Raises UserError with one line if the file is missing or damaged."""
    return _run(path, *_read(path))


def _run(path: Path, about: dict[str, Any], arrays: dict[str, Any]) -> Run:
    try:
        return Run(Settings(**about["settings"]), about["seed"], diverged=about["diverged"], **arrays)
    except (KeyError, TypeError, UserError) as error:
        raise DamagedFile(f"{path}: damaged file ({error}); {_REMEDY}") from None


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
    for file in sorted(Path(homing_lib.__file__).parent.rglob("*.py")):
        source.update(file.name.encode() + file.read_bytes())
    return made_by | {"python": platform.python_version(), "homing_lib": source.hexdigest()[:12]}


MADE_BY = _made_by()
"""Versions of what makes a run: packages, Python, and this library as a hash of its source. Taken when the library is
imported: its files may have changed when the run ends."""


# --- Many runs ----------------------------------------------------------------------------------------------------


def sweep(study: Study, *, workers: int = -1, cluster: str | None = None, force: bool = False) -> int:
    """Compute what is missing of a study, or all of it (`force`). Returns how many runs were computed.

    workers: processes on this machine, -1 for one per core; cluster: address of a Dask scheduler to use instead. Runs
    are kept as they finish. Raises UserError if a stored file is damaged or workers are lost.
    """
    if study.measure and not force and _table_is_current(study):
        return 0
    _remove_leftovers(study)
    before = _read_manifest(study)
    todo = [job for job in study.jobs() if force or not _is_sound(study, *job)]
    client = _connect(cluster) if cluster and todo else None  # before anything changes
    if force:
        _manifest(study).unlink(missing_ok=True)  # it vouches for what is about to change
    if todo:
        for settings in (*study.conditions.values(), *study.atlases):
            if settings.images == "atlas":
                open_atlas(room_named(settings.room), settings)  # once, before the workers all want it
        results = _on_cluster(client, study, todo) if client else _on_cores(workers, study, todo)
        for result in tqdm(results, total=len(todo), desc=f"{study.name}: runs", unit="run"):
            _store(study, *result)
    origins = _write_table(study) if study.measure else [MADE_BY]
    _write_manifest(study, origins, before)
    return len(todo)


def _remove_leftovers(study: Study) -> None:
    """Remove what processes that are gone were writing when they were killed."""
    for part in (*study.folder.glob(".*.part*"), *DATA.glob(".*.part*")):
        process = part.name.rpartition(".part")[0].rpartition(".")[2]
        if process.isdecimal() and not psutil.pid_exists(int(process)):
            part.unlink(missing_ok=True)


_Job = tuple[Settings, int]
_Result = tuple[Settings, int, Run | Columns, dict[str, str]]


def _on_cores(workers: int, study: Study, todo: Sequence[_Job]) -> Iterator[_Result]:
    parallel = joblib.Parallel(
        min(workers, len(todo)), return_as="generator_unordered", initializer=_begin_work, initargs=(os.getpid(),)
    )
    results: Any = None
    with _quiet_end():
        try:
            with _interrupts_later():
                results = parallel(joblib.delayed(_compute)(study.measure, *job) for job in todo)
            yield from results
        except BrokenProcessPool:
            raise UserError(f"a worker process was killed (too little memory?); {RESUMES}") from None
        finally:
            del results  # which stops it, if it goes on


@contextmanager
def _quiet_end() -> Iterator[None]:
    """Whoever interrupts need not hear what was left unfinished, nor that a thread of loky stumbled over it."""
    before = threading.excepthook
    threading.excepthook = lambda what: None if what.exc_type is KeyError else before(what)
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "[0-9]+ tasks (have been successfully|which were still)", UserWarning)
            yield
    finally:
        threading.excepthook = before


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


def _begin_work(parent: int) -> None:
    """What a worker does first: it leaves Ctrl-C to its parent, and sees to it that it ends when that is gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with, args=(parent,), daemon=True).start()


def _end_with(parent: int) -> None:
    while os.getppid() == parent and psutil.pid_exists(parent):  # the first never changes on Windows
        time.sleep(2)
    os._exit(1)


def _connect(address: str) -> Any:
    from distributed import Client

    logging.getLogger("distributed.client").setLevel(logging.CRITICAL)  # what it would say at length is said below
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


def _compute(measure: Measure | None, settings: Settings, seed: int) -> _Result:
    return settings, seed, (measure or run)(settings, seed), MADE_BY


def _store(study: Study, settings: Settings, seed: int, result: Run | Columns, origin: dict[str, str]) -> None:
    path = path_of(study.folder, settings, seed)
    if isinstance(result, Run):
        save(result, path)
    else:
        about = {"settings": settings.model_dump(), "seed": seed, "measure": study.measured, "made by": origin}
        write_arrays(path, about, **result)


def _is_sound(study: Study, settings: Settings, seed: int) -> bool:
    """Whether a run is stored. Raises UserError if its file is damaged, or of another run than its name says."""
    if not path_of(study.folder, settings, seed).exists():
        return False
    about, _ = _stored(study, settings, seed)
    return study.measure is None or about.get("measure") == study.measured


def _stored(study: Study, settings: Settings, seed: int) -> tuple[dict[str, Any], dict[str, Any]]:
    path = path_of(study.folder, settings, seed)
    about, arrays = _read(path)
    if not study.measure:
        _check(path, _read_manifest(study))
    if (about.get("settings"), about.get("seed")) != (settings.model_dump(), seed):
        raise UserError(f"{path}: holds a run of other settings or another seed; {_REMEDY}")
    return about, arrays


def load_study(study: Study) -> dict[str, list[Run]]:
    """The complete runs of a study by condition, seeds in order."""
    return {
        label: [_run(path_of(study.folder, settings, seed), *_stored(study, settings, seed)) for seed in study.seeds]
        for label, settings in study.conditions.items()
    }


# --- Episodes -------------------------------------------------------------------------------------------------------


def by_episode(runs: Sequence[Run], column: str | None = None) -> Array:
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
    """A study's table: columns `condition`, `seed`, then those of its measure. Raises UserError if it is not sound."""
    if not _table_is_current(study):
        raise missing(study.table, "missing, or of an older version of this study; `make data` computes it")
    return pd.read_parquet(study.table)


def _write_table(study: Study) -> list[dict[str, str]]:
    """Join the runs into one table, 32-bit numbers. Returns what made each run."""
    parts, origins = [], []
    for label, settings in study.conditions.items():
        for seed in study.seeds:
            about, columns = _stored(study, settings, seed)
            origins.append(about["made by"])
            with np.errstate(over="ignore"):  # the last numbers of a run that diverged become infinite
                narrow = {name: values.astype(np.float32) for name, values in columns.items()}
            parts.append(pd.DataFrame({"condition": label, "seed": np.int32(seed), **narrow}))
    frame = pd.concat(parts, ignore_index=True).astype({"condition": "category"})
    buffer = io.BytesIO()
    frame.to_parquet(buffer, index=False, compression="zstd", compression_level=9)
    _manifest(study).unlink(missing_ok=True)  # whoever is killed here leaves a table without one, to be joined again
    write_bytes(study.table, buffer.getvalue())
    return origins


def _manifest(study: Study) -> Path:
    return study.table.with_suffix(".json")


def _files(study: Study) -> list[Path]:
    """What is committed of a study, beside its manifest."""
    return [study.table] if study.measure else [path_of(study.folder, *job) for job in study.jobs()]


def _sha256(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()


def _read_manifest(study: Study) -> dict[str, Any]:
    """The manifest, empty if there is none."""
    try:
        manifest = json.loads(_manifest(study).read_text(encoding="utf-8"))
        if not isinstance(manifest, dict) or not isinstance(manifest.get("sha256"), dict):
            raise ValueError("no hashes of the files that it is about")
    except FileNotFoundError:
        return {}
    except ValueError as error:
        raise DamagedFile(f"{_manifest(study)}: damaged file ({error}); {_REMEDY}") from None
    return manifest


def _write_manifest(study: Study, origins: Sequence[Mapping[str, str]], before: Mapping[str, Any]) -> None:
    """Say what made the stored files. If they came out the same again, that is still what first made them."""
    now = study.definition() | {"sha256": {file.name: _sha256(file) for file in _files(study)}}
    made_by = {name: ", ".join(sorted({origin[name] for origin in origins})) for name in MADE_BY}
    now["made by"] = before["made by"] if {**before, **now} == before else made_by
    if now != _read_manifest(study):
        write_bytes(_manifest(study), (json.dumps(now, indent=1) + "\n").encode())


def _check(file: Path, manifest: Mapping[str, Any]) -> None:
    """Raise DamagedFile if the manifest vouches for another content of this file."""
    if manifest and manifest["sha256"].get(file.name) not in (None, _sha256(file)):
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
    (settings, seed), *_ = study.jobs()
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
