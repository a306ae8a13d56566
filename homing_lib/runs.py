"""Many runs, each stored as one file under data/: what is there and sound is kept, what is missing is computed.

A file's name is the hash of its settings and its seed; it is written beside its place and renamed, so that it is either
whole or not there, whenever and by however many processes a sweep is stopped and started again.
"""

import hashlib
import platform
import signal
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import joblib
import numpy as np
from tqdm import tqdm

from homing_lib.agent import Run, run
from homing_lib.settings import Settings, UserError, parse_settings
from homing_lib.storage import DamagedFile, read_arrays, write_arrays

DATA = Path(__file__).parent.parent / "data"

TOLERANCE = 1e-6
"""How far a repeated run may stand from the stored one on another processor, absolutely or relative to a number's size:
exponentials and dot products differ there in the last bits, and learning carries the difference on."""

_REMEDY = "delete it, and `make data` computes it anew"
_ARRAYS = ("steps", "lengths", "reached")
_PACKAGES = ("numpy", "opencv-python-headless", "pybullet")


@dataclass(frozen=True)
class Study:
    """A question put to the robot: some settings, each run with the same seeds. Stored under data/<name>/."""

    name: str
    settings: tuple[Settings, ...]
    seeds: Sequence[int]

    def jobs(self) -> list[tuple[Settings, int]]:
        """All runs of the study."""
        return [(settings, seed) for settings in self.settings for seed in self.seeds]


HEADLINE = Study(
    "headline",
    (Settings(), Settings(controller="random")),
    range(1000, 1005),
)
"""Five runs of 20 episodes as the paper reports them, and five of a uniformly random policy in the same room."""

STUDIES = {study.name: study for study in (HEADLINE,)}


def path_of(folder: Path, settings: Settings, seed: int) -> Path:
    """Where a run is stored."""
    return folder / f"{settings.digest}-{seed}.npz"


def save(result: Run, path: Path) -> None:
    """Write a run. The same run gives the same bytes."""
    made_by = {package: version(package) for package in _PACKAGES} | {
        "python": platform.python_version(),
        "homing_lib": code_digest(),
    }
    about = {
        "settings": result.settings.model_dump(),
        "seed": result.seed,
        "diverged": result.diverged,
        "made by": made_by,
    }
    write_arrays(path, about, **{name: getattr(result, name) for name in _ARRAYS})


def load(path: Path) -> Run:
    """Read a run. Raises UserError with one line if the file is missing or damaged."""
    try:
        about, arrays = read_arrays(path)
        return Run(parse_settings(about["settings"]), about["seed"], diverged=about["diverged"], **arrays)
    except FileNotFoundError:
        raise UserError(f"{path}: there is no such run; `make data` computes it") from None
    except (KeyError, TypeError) as error:
        raise DamagedFile(f"{path}: damaged file (no {error}); {_REMEDY}") from None
    except UserError as error:
        raise DamagedFile(f"{error}; {_REMEDY}") from None


def load_study(study: Study, folder: Path | None = None) -> dict[Settings, list[Run]]:
    """All runs of a study by their settings, seeds in order."""
    folder = folder or DATA / study.name
    return {settings: [load(path_of(folder, settings, seed)) for seed in study.seeds] for settings in study.settings}


def sweep(study: Study, folder: Path | None = None, *, workers: int = -1, force: bool = False) -> int:
    """Compute what is missing of a study, or all of it (`force`). Returns how many runs were computed.

    Every stored file is read and checked first. workers: processes; -1 for one a core.
    """
    folder = folder or DATA / study.name
    todo = [job for job in study.jobs() if force or not _is_sound(path_of(folder, *job), *job)]
    if todo:
        folder.mkdir(parents=True, exist_ok=True)
        parallel = joblib.Parallel(n_jobs=min(workers, len(todo)), return_as="generator_unordered")
        finished = parallel(joblib.delayed(_compute)(folder, *job) for job in todo)
        for _ in tqdm(finished, total=len(todo), desc=f"{study.name}: runs", unit="run"):
            pass
    return len(todo)


def _compute(folder: Path, settings: Settings, seed: int) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent stops its workers; they need not say so
    save(run(settings, seed), path_of(folder, settings, seed))


def _is_sound(path: Path, settings: Settings, seed: int) -> bool:
    if not path.exists():
        return False
    stored = load(path)
    if (stored.settings, stored.seed) != (settings, seed):
        raise UserError(f"{path}: holds a run of other settings or another seed; delete it and run `make data`")
    return True


def fingerprint(studies: Iterable[Study]) -> str:
    """A hash of the content of all files of some studies: it changes when, and only when, the data do."""
    digest = hashlib.sha256()
    for study in studies:
        for job in study.jobs():
            path = path_of(DATA / study.name, *job)
            digest.update(path.name.encode() + hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()


def code_digest() -> str:
    """A hash of the library's source, twelve hexadecimal digits."""
    digest = hashlib.sha256()
    for source in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(source.name.encode() + source.read_bytes())
    return digest.hexdigest()[:12]


def compare(stored: Run, live: Run) -> str:
    """How a repeated run stands to the stored one: "to the bit", "within tolerance", or "not"."""
    pairs: list[tuple[Any, Any]] = [(getattr(stored, name), getattr(live, name)) for name in _ARRAYS]
    if stored.diverged == live.diverged and all(np.array_equal(a, b, equal_nan=True) for a, b in pairs):
        return "to the bit"
    if all(a.shape == b.shape and np.allclose(a, b, TOLERANCE, TOLERANCE, equal_nan=True) for a, b in pairs):
        return "within tolerance"
    return "not"


def verify(study: Study = HEADLINE, folder: Path | None = None) -> str:
    """Repeat the first run of a study live, the robot driving in PyBullet, and compare it with the stored one."""
    (settings, seed), *_ = study.jobs()
    stored = load(path_of(folder or DATA / study.name, settings, seed))
    with tqdm(total=settings.episodes, desc="live run: episodes", unit="episode") as bar:
        live = run(settings, seed, after_episode=lambda _: bar.update())
    outcome = compare(stored, live)
    what = f"seed {seed}, {settings.episodes} episodes, {len(live.steps)} steps"
    if outcome == "to the bit":
        return f"This machine reproduces the stored run to the bit ({what})."
    if outcome == "within tolerance":
        return f"This machine reproduces the stored run within {TOLERANCE:g}, though not to the bit ({what})."
    return f"This machine does NOT reproduce the stored run ({what}): its own results come from `make data FORCE=1`."
