"""Runs are computed and stored: what is there and sound is kept, what is missing is computed.

What is measured of runs is kept in blocks of seeds, a file of `runs.SCRATCH` each, as soon as it is known; studies with
the same measure share them. When a study is complete its files are written, and then the manifest that vouches for
them. Every file is whole or not there: a sweep may be stopped at any time, and started again. (What was finished is
kept, but for the few complete runs of the headline, which are written together.)
"""

import hashlib
import io
import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from tqdm import tqdm

from homing_lib import agent, parallel
from homing_lib.atlas import open_atlas
from homing_lib.errors import DamagedFile, UserError, nearest, shown
from homing_lib.rooms import room_named
from homing_lib.storage import npz_bytes, read_arrays, require_clone, write_bytes
from homing_lib.study import runs, studies
from homing_lib.study.runs import Job, Measure, Study, is_current, read_manifest, sha256

Kept = dict[int, Any]
"""Of runs of a job, by seed: the rows of their table; of a complete run the bytes of its file."""


def compute(names: Sequence[str] = (), *, workers: int = -1, force: bool = False) -> Iterator[tuple[Study, int]]:
    """Compute what is missing of all studies, or of those that are named: each, and how many runs it took.

    Runs that several studies ask for are computed once; what is deep only if it is named, else it must be there.
    workers: see `parallel.results`; force: all runs of these studies are computed from scratch. Raises UserError
    outside a clone, for a name that no study has, and for a deep study that is not there.
    """
    require_clone()
    _require_known(names)
    anew = set[Path]()
    for study in studies.in_order():
        if names and study.name not in names:
            continue
        if study.deep and not names:
            runs.require(study)
            continue
        if force and study.measure:
            for path in {job.path for job in study.jobs()} - anew:  # but for what another has just computed
                path.unlink(missing_ok=True)
                anew.add(path)
        yield study, sweep(study, workers=workers, force=force)


def _require_known(names: Sequence[str]) -> None:
    known = [study.name for study in studies.in_order()]
    for name in names:
        if name not in known:
            like = nearest(name, known)
            raise UserError(f"study {shown(name)}: there is none of this name; `homing studies` lists them{like}")


def sweep(study: Study, *, workers: int = -1, force: bool = False) -> int:
    """Compute what is missing of a study, and store it. Returns how many runs were computed.

    workers: see `parallel.results`; force: even if all is stored; of what was measured, blocks in `runs.SCRATCH` are
    still used. Raises UserError if a stored file is damaged or cannot be written, or if workers are lost.
    """
    for folder in (study.folder, runs.DATA):
        runs.remove_leftovers(folder)
    if not force and is_current(study):
        return 0
    before, jobs = read_manifest(study), study.jobs()
    kept = {job.path: _read(study, job) if study.measure else {} for job in jobs}
    todo = [
        job._replace(seeds=left)
        for job in jobs
        if (left := tuple(seed for seed in job.seeds if seed not in kept[job.path]))
    ]
    count = sum(len(job.seeds) for job in todo)
    if todo:
        for settings in (*study.conditions.values(), *study.atlases):
            if settings.images == "atlas":
                open_atlas(room_named(settings.room), settings)  # once, before the workers all want it
        with tqdm(total=count, desc=f"{study.name}: runs", unit="run") as bar:
            calls = [(study.measure, job) for job in todo]
            for job, computed in parallel.results(_compute, calls, workers=workers):
                kept[job.path] |= computed
                if study.measure:
                    write_bytes(job.path, _block(study, job, kept[job.path]))
                bar.update(len(job.seeds))
    if study.measure:
        _store(study, {study.table: _table(study, kept)}, before)
    else:
        _store(study, {path: content for path, of_seed in kept.items() for content in of_seed.values()}, before)
    return count


def _compute(measure: Measure | None, job: Job) -> tuple[Job, Kept]:
    """The runs of a job, in whichever process."""
    if measure is None:
        return job, {seed: runs.content_of(agent.run(job.settings, seed)) for seed in job.seeds}
    return job, {seed: _rows(measure(job.settings, seed)) for seed in job.seeds}


def _rows(columns: runs.Columns) -> Any:
    """A table as one array, which is read faster than ten."""
    return np.rec.fromarrays([*columns.values()], dtype=[(name, float) for name in columns])


# --- What is kept -----------------------------------------------------------------------------------------------------


def _read(study: Study, job: Job) -> Kept:
    """What is kept in a job's block; one that is damaged, or by another version of the library, counts as none."""
    with suppress(FileNotFoundError, DamagedFile):
        about, arrays = read_arrays(job.path)
        if _about(study, job).items() <= about.items():
            parts = np.split(arrays["rows"], np.cumsum(about["lengths"])[:-1])
            return dict(zip(about["seeds"], parts, strict=True))
    return {}


def _block(study: Study, job: Job, kept: Kept) -> bytes:
    """The rows of some seeds as the bytes of a file."""
    about = _about(study, job) | {"seeds": [*kept], "lengths": [len(rows) for rows in kept.values()]}
    return npz_bytes(about, {"rows": np.concatenate([*kept.values()])})


def _about(study: Study, job: Job) -> dict[str, Any]:
    """What fixes the content of a block."""
    return {"settings": job.settings.model_dump(), "measure": study.whole_measure, "made by": study.made_by}


def _table(study: Study, kept: Mapping[Path, Kept]) -> bytes:
    """All runs as one table of 32-bit numbers, in the order of the study."""
    rows_of = {(job.settings, seed): its for job in study.jobs() for seed, its in kept[job.path].items()}
    keys = [(label, seed) for label in study.conditions for seed in study.seeds]
    parts = [rows_of[study.conditions[label], seed] for label, seed in keys]
    rows, lengths = np.concatenate(parts), [len(part) for part in parts]
    labels = np.array([label for label, _ in keys], dtype=object)
    seeds = np.array([seed for _, seed in keys], dtype=np.int32)
    columns = {"condition": pd.Categorical(np.repeat(labels, lengths)), "seed": np.repeat(seeds, lengths)}
    with np.errstate(over="ignore"):  # the last numbers of a run that diverged become infinite
        columns |= {name: rows[name].astype(np.float32) for name in rows.dtype.names or ()}
    buffer = io.BytesIO()
    pd.DataFrame(columns).to_parquet(buffer, index=False, compression="zstd", compression_level=9)
    return buffer.getvalue()


def _store(study: Study, files: Mapping[Path, bytes], before: dict[str, Any]) -> None:
    """Write a study's files, then the manifest: their checksums, and what made them.

    before: the manifest as it was. It stays where the content came out the same, which is still what first made it.
    """
    checksums = {path.name: hashlib.sha256(content).hexdigest() for path, content in files.items()}
    now: dict[str, Any] = study.definition() | {"sha256": checksums, "made by": study.made_by}
    if now | {"made by": before.get("made by")} == before:
        now = before
    if checksums != before.get("sha256"):  # no manifest, while it would vouch for what is no longer there
        study.manifest.unlink(missing_ok=True)
    for path, content in files.items():
        if not path.exists() or sha256(path) != checksums[path.name]:
            write_bytes(path, content)
    if now != before:
        write_bytes(study.manifest, (json.dumps(now, indent=1) + "\n").encode())


# --- The same again ---------------------------------------------------------------------------------------------------


TOLERANCE = 1e-6
"""How far a repeated run may differ from the stored one on another processor, absolutely or relative to a number's
size: exponentials and dot products differ there in the last bits, and learning carries the difference on."""


def compare(stored: agent.Run, live: agent.Run) -> str:
    """How a repeated run compares with the stored one: "to the bit", "within tolerance", or "not"."""
    pairs: list[tuple[Any, Any]] = [(getattr(stored, name), getattr(live, name)) for name in (*runs.ARRAYS, "diverged")]
    if all(np.array_equal(a, b, equal_nan=True) for a, b in pairs):
        return "to the bit"
    if all(np.shape(a) == np.shape(b) and np.allclose(a, b, TOLERANCE, TOLERANCE, True) for a, b in pairs):
        return "within tolerance"
    return "not"


def verify(study: Study) -> str:
    """Repeat the first run of a study live, the robot driving in PyBullet, and compare it with the stored one."""
    path, settings, (seed,) = study.jobs()[0]
    stored = runs.load(path)
    with tqdm(total=settings.episodes, desc="live run: episodes", unit="episode") as bar:
        live = agent.run(settings, seed, after_episode=lambda _: bar.update())
    what = f"seed {seed}, {settings.episodes} episodes, {len(live.steps)} steps"
    match compare(stored, live):
        case "to the bit":
            return f"This machine reproduces the stored run to the bit ({what})."
        case "within tolerance":
            return f"This machine reproduces the stored run within {TOLERANCE:g}, though not to the bit ({what})."
    return f"This machine does NOT reproduce the stored run ({what}): its own results come from `make data FORCE=1`."
