"""A file is whole or not there, and one that cannot be written or read is named in one line."""

import os
from pathlib import Path

import numpy as np
import pytest

from homing_lib.errors import DamagedFile, UserError
from homing_lib.storage import atomic_write, npz_bytes, read_arrays, read_bytes, write_bytes

posix = pytest.mark.skipif(os.name == "nt", reason="pipes and links are POSIX's")


def contents(folder):
    return {file.name: file.read_text(encoding="utf-8") for file in folder.iterdir()}


def test_a_file_appears_under_its_name_only_when_all_is_written_whoever_else_writes_it(tmp_path):
    path = tmp_path / "new folder" / "film.mp4"
    # Two writers of one process number: in two containers that share the folder.
    with atomic_write(path) as part, atomic_write(path) as other:
        part.write_text("all", encoding="utf-8")
        other.write_text("half", encoding="utf-8")
        assert not path.exists()
        assert (part.parent, part.suffix) == (path.parent, ".mp4")
        assert part != other
    assert contents(path.parent) == {"film.mp4": "all"}


def test_who_fails_in_the_middle_leaves_the_old_file_and_nothing_beside_it(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("old", encoding="utf-8")
    with pytest.raises(KeyboardInterrupt), atomic_write(path) as part:
        part.write_text("half", encoding="utf-8")
        raise KeyboardInterrupt
    assert contents(tmp_path) == {"a.txt": "old"}


@posix
def test_a_link_is_followed_and_stays_one(tmp_path):
    link, target = tmp_path / "link", tmp_path / "there" / "target"
    link.symlink_to(target)
    write_bytes(link, b"new")
    assert link.is_symlink()
    assert target.read_bytes() == b"new"


def test_arrays_come_back_as_they_were_the_same_bytes_each_time_and_never_a_pickle(tmp_path):
    path, arrays = tmp_path / "a.npz", {"x": np.arange(6.0).reshape(2, 3), "n": np.array([1, 2], np.uint8)}
    assert npz_bytes({"b": 1, "a": [2]}, arrays) == npz_bytes({"a": [2], "b": 1}, arrays)
    write_bytes(path, npz_bytes({"a": [2]}, arrays))
    about, read = read_arrays(path)
    assert about == {"a": [2]}
    assert {name: (a.dtype, a.tolist()) for name, a in read.items()} == {
        name: (a.dtype, a.tolist()) for name, a in arrays.items()
    }
    write_bytes(path, npz_bytes({}, {"x": np.array([{}], dtype=object)}))
    with pytest.raises(DamagedFile, match="allow_pickle"):
        read_arrays(path)


@posix
@pytest.mark.parametrize("name", ["", ".", "/", "a\0b", "x" * 300, "file/a.txt", "pipe", "folder", "loop"])
def test_a_file_that_cannot_be_written_is_named_in_one_line_and_nothing_is_left(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("file").touch()
    Path("folder").mkdir()
    os.mkfifo("pipe")
    Path("loop").symlink_to("loop")
    before = sorted(tmp_path.iterdir())
    with pytest.raises(UserError, match="cannot be written") as refusal:
        write_bytes(Path(name), b"new")
    assert "\n" not in str(refusal.value)
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize("content", [b"", b"PK no zip", npz_bytes({}, {"x": np.ones(99)})[:-9], None])
def test_what_cannot_be_read_is_a_damaged_file_and_what_is_not_there_another_matter(content, tmp_path):
    path = tmp_path / "a.npz"
    with pytest.raises(FileNotFoundError):
        read_bytes(path)
    path.mkdir() if content is None else path.write_bytes(content)
    with pytest.raises(DamagedFile, match=r"a\.npz: damaged file \(.+\)$"):
        read_arrays(path)
