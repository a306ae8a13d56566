"""Arrays and what they are about, in one file that is whole or not there: used for runs and for atlases."""

import io
import json
import os
import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from homing_lib.settings import UserError


class DamagedFile(UserError):
    """A file that is there and cannot be read: one line that names it and says what is wrong."""


def write_arrays(path: Path, about: dict[str, Any], **arrays: NDArray[Any]) -> None:
    """Write a compressed npz beside its place, then rename it. The same content gives the same bytes."""
    buffer = io.BytesIO()
    contents: dict[str, Any] = {"about": np.array(json.dumps(about, sort_keys=True)), **arrays}
    np.savez_compressed(buffer, **contents)
    write_bytes(path, buffer.getvalue())


def write_bytes(path: Path, content: bytes) -> None:
    """Write a file beside its place, then rename it: it is whole, or not there."""
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        part.write_bytes(content)
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)


def read_arrays(path: Path) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """What a file is about, and its arrays. Raises FileNotFoundError, or DamagedFile (every byte is checked)."""
    try:
        with np.load(path, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
        return json.loads(str(arrays.pop("about"))), arrays
    except FileNotFoundError:
        raise
    except (zipfile.BadZipFile, zlib.error, ValueError, KeyError, EOFError, OSError, NotImplementedError) as error:
        detail = (str(error) or type(error).__name__).splitlines()[0]
        raise DamagedFile(f"{path}: damaged file ({detail})") from None
