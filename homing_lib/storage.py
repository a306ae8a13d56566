"""Where the project's files stand, and files that are whole or not there: bytes, or arrays with what they are about."""

import json
import os
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from importlib.metadata import distributions
from io import BytesIO
from pathlib import Path
from secrets import token_hex
from typing import Any

import numpy as np
from numpy.lib.format import read_array
from numpy.typing import NDArray

from homing_lib.errors import DamagedFile, UserError

MARK = Path("data", "STUDIES.md")  # a folder that has it is a checkout
_PLACES = (Path(__file__).parent.parent, Path.cwd(), *Path.cwd().parents)

ROOT = next((folder for folder in _PLACES if (folder / MARK).exists()), Path.cwd())
"""Where data/, figures/ and notebooks/ stand, and .build/ is made: the checkout that this package stands in; if it was
installed without, the one worked in, or this folder."""


def require_clone() -> None:
    """Raises UserError where there is no clone of the repository, so that nothing is computed or built elsewhere."""
    makefile = ROOT / "Makefile"  # which a clone has, and the lab as handed out has not
    if not makefile.is_file():
        raise missing(makefile, "")


def missing(path: Path, remedy: str) -> UserError:
    """The error for a file of the repository that is not there. remedy: what helps in a clone."""
    if (ROOT / "Makefile").is_file():
        return UserError(f"{path}: {remedy}")
    where = f"neither {ROOT} nor a folder above it, nor where homing_lib is installed, is a clone of its repository"
    return UserError(f"{path}: missing, for {where}; clone it and work there")


def present(path: Path, remedy: str = "missing; restore it with git") -> Path:
    """The path of a file of the repository. Raises UserError, as `missing` has it, if it is not there."""
    if not path.exists():
        raise missing(path, remedy)
    return path


def npz_bytes(about: dict[str, Any], arrays: dict[str, NDArray[Any]]) -> bytes:
    """A compressed npz. The same content gives the same bytes."""
    buffer = BytesIO()
    contents: dict[str, Any] = {"about": np.array(json.dumps(about, sort_keys=True)), **arrays}
    np.savez_compressed(buffer, **contents)
    return buffer.getvalue()


@contextmanager
def atomic_write(path: Path) -> Iterator[Path]:
    """Atomic write: yields a temporary path of the same suffix, then renames it to `path`, or to what that links to.

    Raises UserError.
    """
    part = None
    try:
        place = Path(os.path.realpath(path)) if path.is_symlink() else path
        if "\0" in str(path) or place.is_symlink() or (place.exists() and not place.is_file()):
            raise OSError("this names no ordinary file; choose another name")
        # Not by the number of the process alone: in another container that shares the folder it is another process's.
        part = place.with_name(f".{place.stem}.{os.getpid()}-{token_hex(4)}.part{place.suffix}")
        place.parent.mkdir(parents=True, exist_ok=True)
        yield part
        part.replace(place)
    except OSError as error:
        raise UserError(f"{path}: cannot be written ({error.strerror or error})") from None
    finally:
        with suppress(OSError):
            if part:
                part.unlink(missing_ok=True)


def write_bytes(path: Path, content: bytes) -> None:
    """Write a file that is whole, or not there. Raises UserError if it cannot be written."""
    with atomic_write(path) as part:
        part.write_bytes(content)


def read_bytes(path: Path) -> bytes:
    """The content of a file. Raises FileNotFoundError, or DamagedFile for what cannot be read."""
    try:
        if path.exists() and not path.is_file():  # from a pipe, nothing might ever come
            raise OSError("no ordinary file")
        return path.read_bytes()
    except FileNotFoundError:
        raise
    except OSError as error:
        raise DamagedFile(f"{path}: damaged file ({error.strerror or error})") from None


def read_arrays(path: Path) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """What a file is about, and its arrays. Raises FileNotFoundError, or DamagedFile (every byte is checked)."""
    whole_file = BytesIO(read_bytes(path))
    try:
        with zipfile.ZipFile(whole_file) as archive:  # not np.load, which interprets bytes before it has checked them
            contents = {name.removesuffix(".npy"): BytesIO(archive.read(name)) for name in archive.namelist()}
        arrays = {name: read_array(content, allow_pickle=False) for name, content in contents.items()}
        return dict(json.loads(str(arrays.pop("about")))), arrays
    except Exception as error:  # zipfile, its decompressors, NumPy and JSON raise what they like
        detail = (str(error) or type(error).__name__).splitlines()[0][:80]
        raise DamagedFile(f"{path}: damaged file ({detail})") from None


@cache
def version_of(package: str) -> str:
    """Which version of a package is installed, or "none"."""
    return next((found.version for found in distributions(name=package)), "none")
