"""Arrays and what they are about, in one file that is whole or not there: used for runs and for atlases."""

import json
import os
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib.format import read_array
from numpy.typing import NDArray

from homing_lib.errors import DamagedFile, UserError

_MARK = Path("data", "STUDIES.md")
_PLACES = (Path(__file__).parent.parent, Path.cwd(), *Path.cwd().parents)

ROOT = next((folder for folder in _PLACES if (folder / _MARK).exists()), Path.cwd())
"""Where data/, figures/ and notebooks/ stand, and .build/ is made: the checkout that this package stands in; if it was
installed without, the one worked in, or this folder."""


def missing(path: Path, otherwise: str) -> UserError:
    """What is said of a file of the repository that is not there; `otherwise`: if it is not the repository itself."""
    if (ROOT / _MARK).exists():
        return UserError(f"{path}: {otherwise}")
    where = f"neither {ROOT} nor a folder above it, nor where homing_lib is installed, is a clone of its repository"
    return UserError(f"{path}: missing, for {where}; clone it and work there")


def write_arrays(path: Path, about: dict[str, Any], **arrays: NDArray[Any]) -> None:
    """Write a compressed npz beside its place, then rename it. The same content gives the same bytes."""
    buffer = BytesIO()
    contents: dict[str, Any] = {"about": np.array(json.dumps(about, sort_keys=True)), **arrays}
    np.savez_compressed(buffer, **contents)
    write_bytes(path, buffer.getvalue())


@contextmanager
def whole(path: Path) -> Iterator[Path]:
    """A place beside `path`, of its suffix, that is renamed to it in the end. Raises UserError if it cannot be."""
    part = path.with_name(f".{path.stem}.{os.getpid()}.part{path.suffix}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield part
        part.replace(path)
    except OSError as error:
        raise UserError(f"{path}: cannot be written ({error.strerror or error})") from None
    finally:
        with suppress(OSError):
            part.unlink(missing_ok=True)


def write_bytes(path: Path, content: bytes) -> None:
    """Write a file that is whole, or not there. Raises UserError if it cannot be written."""
    with whole(path) as part:
        part.write_bytes(content)


def read_arrays(path: Path) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """What a file is about, and its arrays. Raises FileNotFoundError, or DamagedFile (every byte is checked)."""
    try:
        with zipfile.ZipFile(path) as archive:  # not by np.load, which interprets bytes before it has checked them
            contents = {name.removesuffix(".npy"): BytesIO(archive.read(name)) for name in archive.namelist()}
        arrays = {name: read_array(content, allow_pickle=False) for name, content in contents.items()}
        return json.loads(str(arrays.pop("about"))), arrays
    except FileNotFoundError:
        raise
    except (zipfile.BadZipFile, zlib.error, ValueError, KeyError, EOFError, OSError, RuntimeError) as error:
        detail = (str(error) or type(error).__name__).splitlines()[0]
        raise DamagedFile(f"{path}: damaged file ({detail})") from None
