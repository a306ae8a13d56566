"""A file is whole or not there, and one that cannot be written is named in one line."""

import pytest

from homing_lib.errors import UserError
from homing_lib.storage import whole


def test_a_file_appears_under_its_name_only_when_all_is_written(tmp_path):
    path = tmp_path / "new folder" / "film.mp4"
    with whole(path) as part:
        part.write_text("half", encoding="utf-8")
        assert not path.exists()
        assert part.parent == path.parent
        assert part.suffix == ".mp4"
        part.write_text("all", encoding="utf-8")
    assert [(file.name, file.read_text(encoding="utf-8")) for file in path.parent.iterdir()] == [("film.mp4", "all")]


def test_who_fails_in_the_middle_leaves_the_old_file_and_nothing_beside_it(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("old", encoding="utf-8")
    with pytest.raises(KeyboardInterrupt), whole(path) as part:
        part.write_text("half", encoding="utf-8")
        raise KeyboardInterrupt
    assert [(file.name, file.read_text(encoding="utf-8")) for file in tmp_path.iterdir()] == [("a.txt", "old")]


def test_a_file_that_cannot_be_written_is_named_in_one_line(tmp_path):
    (tmp_path / "file").write_text("", encoding="utf-8")
    path = tmp_path / "file" / "a.txt"
    with pytest.raises(UserError, match=r"^.*a\.txt: cannot be written \(.+\)$"), whole(path) as part:
        part.write_text("", encoding="utf-8")
