"""A file is whole or not there, and one that cannot be written is named in one line."""

import os
from pathlib import Path

import pytest

from homing_lib.errors import DamagedFile, UserError
from homing_lib.storage import atomic_write, read_bytes, write_bytes


def test_a_file_appears_under_its_name_only_when_all_is_written(tmp_path):
    path = tmp_path / "new folder" / "film.mp4"
    with atomic_write(path) as part:
        part.write_text("half", encoding="utf-8")
        assert not path.exists()
        assert part.parent == path.parent
        assert part.suffix == ".mp4"
        part.write_text("all", encoding="utf-8")
    assert [(file.name, file.read_text(encoding="utf-8")) for file in path.parent.iterdir()] == [("film.mp4", "all")]


def test_who_fails_in_the_middle_leaves_the_old_file_and_nothing_beside_it(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("old", encoding="utf-8")
    with pytest.raises(KeyboardInterrupt), atomic_write(path) as part:
        part.write_text("half", encoding="utf-8")
        raise KeyboardInterrupt
    assert [(file.name, file.read_text(encoding="utf-8")) for file in tmp_path.iterdir()] == [("a.txt", "old")]


def test_a_file_that_cannot_be_written_is_named_in_one_line(tmp_path):
    (tmp_path / "file").write_text("", encoding="utf-8")
    path = tmp_path / "file" / "a.txt"
    with pytest.raises(UserError, match=r"^.*a\.txt: cannot be written \(.+\)$"), atomic_write(path) as part:
        part.write_text("", encoding="utf-8")


posix = pytest.mark.skipif(os.name == "nt", reason="pipes and links are POSIX's")


@posix
def test_a_pipe_or_a_folder_is_not_written_over_nor_waited_for(tmp_path):
    pipe, folder = tmp_path / "pipe", tmp_path / "folder"
    os.mkfifo(pipe)
    folder.mkdir()
    for path in (pipe, folder):
        with pytest.raises(UserError, match=r"cannot be written \(this names no ordinary file; choose another name\)$"):
            write_bytes(path, b"new")
        with pytest.raises(DamagedFile, match=r"damaged file \(no ordinary file\)$"):
            read_bytes(path)
    assert pipe.is_fifo()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["folder", "pipe"]


@posix
def test_a_link_is_followed_and_stays_one_and_a_link_to_itself_is_refused(tmp_path):
    link, target, loop = tmp_path / "link", tmp_path / "there" / "target", tmp_path / "loop"
    link.symlink_to(target)
    loop.symlink_to(loop)
    write_bytes(link, b"new")
    assert link.is_symlink()
    assert target.read_bytes() == b"new"
    with pytest.raises(UserError, match="cannot be written"):
        write_bytes(loop, b"new")


@pytest.mark.parametrize("name", ["", ".", "/", "a\0b", "x" * 300])
def test_a_name_that_no_file_has_is_refused_in_one_line(name):
    with pytest.raises(UserError, match="cannot be written"):
        write_bytes(Path(name), b"new")
