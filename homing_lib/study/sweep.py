"""Runs are computed, and stored so that nothing is lost: what is there and sound is kept, what is missing is computed.

What is measured of runs is kept in blocks of seeds, a file of `runs.SCRATCH` each, as soon as it is known; studies that
measure the same share them. When all is there, a study's table is written, and then the manifest that vouches for it.
Every file is whole or not there, whenever, wherever and by however many processes a sweep is stopped and started again.
"""

import io
import json
import shutil
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
from homing_lib.settings import Settings
from homing_lib.storage import npz_bytes, read_arrays, write_bytes
from homing_lib.study import runs, studies
from homing_lib.study.runs import Job, Measure, Study, check, is_current, read_manifest, save, sha256

Kept = dict[int, Any]
"""What is there of the runs of a job, by seed: the rows of their table; of a complete run the hash of its file."""


def compute(
    names: Sequence[str] = (), *, workers: int = -1, cluster: str | None = None, force: bool = False
) -> Iterator[tuple[Study, int]]:
    """Compute what is missing of all studies, or of those that are named: each, and how many runs it took.

    Runs that several studies ask for are computed once. workers, cluster: see `parallel.results`; force: all runs are
    computed from scratch, and what is kept in `runs.SCRATCH` is thrown away.
    """
    _require_known(names)
    if force:
        shutil.rmtree(runs.SCRATCH, ignore_errors=True)
    left = set(names)
    for study in studies.in_order():
        if not names or study.name in left:
            yield study, sweep(study, workers=workers, cluster=cluster, force=force)
            left.discard(study.name)
            if names and not left:  # those that come after might need tables that are not there
                return


def _require_known(names: Sequence[str]) -> None:
    try:
        known = [study.name for study in studies.in_order()]
    except UserError:  # a table that chooses the settings of others is still to be computed
        return
    for name in names:
        if name not in known:
            like = nearest(name, known)
            raise UserError(f"study {shown(name)}: there is none of this name; `homing studies` lists them{like}")


def sweep(study: Study, *, workers: int = -1, cluster: str | None = None, force: bool = False) -> int:
    """Compute what is missing of a study. Returns how many runs were computed.

    workers, cluster: see `parallel.results`; force: though all is stored, whatever is not in `runs.SCRATCH`. Raises
    UserError if a stored file is damaged or cannot be written, or if workers are lost.
    """
    for folder in (study.folder, runs.DATA):
        runs.remove_leftovers(folder)
    if not force and is_current(study):
        return 0
    before = read_manifest(study)
    jobs = study.jobs()
    kept = {job.path: _read(study, job, {} if force else before) for job in jobs}
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
            for job, found in parallel.results(_compute, calls, workers=workers, cluster=cluster):
                _keep(study, job, found, kept, before)
                bar.update(len(job.seeds))
    if study.measure is None:
        _vouch(study, _hashes(kept), before)
    else:
        table = _table(study, kept)
        _vouch(study, {}, before)  # who is killed here leaves a table without a manifest, to be written again
        write_bytes(study.table, table)
        _vouch(study, {study.table.name: sha256(study.table)}, before)
    return count


def _compute(measure: Measure | None, job: Job) -> tuple[Job, Kept]:
    """The runs of a job, or their rows, in whichever process, on whichever machine."""
    if measure is None:
        return job, {seed: agent.run(job.settings, seed) for seed in job.seeds}
    return job, {seed: _rows(measure(job.settings, seed)) for seed in job.seeds}


def _rows(columns: runs.Columns) -> Any:
    """A table as one array, which is read faster than ten."""
    return np.rec.fromarrays([*columns.values()], dtype=[(name, float) for name in columns])


# --- What is kept -----------------------------------------------------------------------------------------------------


def _read(study: Study, job: Job, manifest: Mapping[str, Any]) -> Kept:
    """What is kept of a job's runs, and of others in the same file. Raises DamagedFile if a complete run is there, and
    is not what the manifest vouches for; a block that is not as this version wrote it counts as none.
    """
    if study.measure is None:
        if job.path.name not in manifest.get("sha256", {}) or not job.path.exists():
            return {}
        check(job.path, manifest)
        return {job.seeds[0]: manifest["sha256"][job.path.name]}
    with suppress(FileNotFoundError, DamagedFile):
        about, arrays = read_arrays(job.path)
        if _about(study, job).items() <= about.items():
            parts = np.split(arrays["rows"], np.cumsum(about["lengths"])[:-1])
            return dict(zip(about["seeds"], parts, strict=True))
    return {}


def _keep(study: Study, job: Job, found: Kept, kept: dict[Path, Kept], before: dict[str, Any]) -> None:
    """Store what was found of a job, beside what was kept of it."""
    if study.measure is None:
        _vouch(study, _hashes(kept), before)  # for no file that is about to change
        (seed,) = job.seeds
        save(found[seed], job.path)
        kept[job.path] = {seed: sha256(job.path)}
        _vouch(study, _hashes(kept), before)
    else:
        rows = kept[job.path] = kept[job.path] | found
        about = _about(study, job) | {"seeds": [*rows], "lengths": [len(some) for some in rows.values()]}
        write_bytes(job.path, npz_bytes(about, {"rows": np.concatenate([*rows.values()])}))


def _about(study: Study, job: Job) -> dict[str, Any]:
    """What fixes the content of a block."""
    return {"settings": job.settings.model_dump(), "measure": study.whole_measure, "made by": runs.MADE_BY}


def _table(study: Study, kept: Mapping[Path, Kept]) -> bytes:
    """All runs as one table of 32-bit numbers, in the order of the study."""
    of_condition: dict[Settings, Kept] = {}
    for job in study.jobs():
        of_condition.setdefault(job.settings, {}).update(kept[job.path])
    of_label = {label: of_condition[settings] for label, settings in study.conditions.items()}
    keys = [(label, seed) for label in study.conditions for seed in study.seeds]
    parts = [of_label[label][seed] for label, seed in keys]
    rows, lengths = np.concatenate(parts), [len(part) for part in parts]
    labels = np.array([label for label, _ in keys], dtype=object)
    seeds = np.array([seed for _, seed in keys], dtype=np.int32)
    columns = {"condition": pd.Categorical(np.repeat(labels, lengths)), "seed": np.repeat(seeds, lengths)}
    with np.errstate(over="ignore"):  # the last numbers of a run that diverged become infinite
        columns |= {name: rows[name].astype(np.float32) for name in rows.dtype.names or ()}
    buffer = io.BytesIO()
    pd.DataFrame(columns).to_parquet(buffer, index=False, compression="zstd", compression_level=9)
    return buffer.getvalue()


def _hashes(kept: Mapping[Path, Kept]) -> dict[str, str]:
    """Of the complete runs that are there, by file."""
    return {path.name: known for path, of_seed in kept.items() for known in of_seed.values()}


def _vouch(study: Study, hashes: Mapping[str, str], before: dict[str, Any]) -> None:
    """Write the manifest: what is stored of a study, and what made it.

    before: the manifest as it was. Content that came out the same is still what first made it.
    """
    now: dict[str, Any] = study.definition() | {"sha256": dict(hashes), "made by": runs.MADE_BY}
    if now | {"made by": before.get("made by")} == before:
        now = before
    if not hashes:
        study.manifest.unlink(missing_ok=True)
    elif now != read_manifest(study):
        write_bytes(study.manifest, (json.dumps(now, indent=1) + "\n").encode())


# --- The same again ---------------------------------------------------------------------------------------------------


def verify(study: Study) -> str:
    """Repeat the first run of a study live, the robot driving in PyBullet, and compare it with the stored one."""
    path, settings, (seed,) = study.jobs()[0]
    stored = runs.load(path)
    with tqdm(total=settings.episodes, desc="live run: episodes", unit="episode") as bar:
        live = agent.run(settings, seed, after_episode=lambda _: bar.update())
    what = f"seed {seed}, {settings.episodes} episodes, {len(live.steps)} steps"
    match runs.compare(stored, live):
        case "to the bit":
            return f"This machine reproduces the stored run to the bit ({what})."
        case "within tolerance":
            return f"This machine reproduces the stored run within {runs.TOLERANCE:g}, though not to the bit ({what})."
    return f"This machine does NOT reproduce the stored run ({what}): its own results come from `make data FORCE=1`."
