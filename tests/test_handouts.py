"""The archives of the lab: blank for students, solved for the teacher, the same bytes twice; else a refusal."""

import io
import zipfile

import pytest

from homing_lib.errors import UserError
from homing_lib.teach import handouts

SOLVED = b"the lab, executed"


@pytest.fixture
def desk(tmp_path, monkeypatch):
    """Copies of the lab and the guide to spoil; nothing is executed."""
    (tmp_path / "lab").mkdir()
    for name, path in {"LAB": "lab.ipynb", "GUIDE": "lab/teacher.md"}.items():
        (tmp_path / path).write_bytes(getattr(handouts, name).read_bytes())
        monkeypatch.setattr(handouts, name, tmp_path / path)
    (tmp_path / "lab" / "README.md").write_text("Unpack this.\n", encoding="utf-8")
    monkeypatch.setattr(handouts, "executed", lambda answers: SOLVED)
    return tmp_path


def contents(path):
    with zipfile.ZipFile(path) as packed:
        return {name: packed.read(name) for name in packed.namelist()}


def test_both_archives_are_written_the_same_twice(desk):
    first, again = handouts.write(desk / "first"), handouts.write(desk / "again")
    assert [path.name for path in first] == ["lab.zip", "lab-teacher.zip"]
    assert [path.read_bytes() for path in first] == [path.read_bytes() for path in again]
    students, teacher = map(contents, first)
    assert {name.split("/")[0] for name in students} == {"lab"}
    assert teacher == {"lab-teacher/README.md": handouts.GUIDE.read_bytes(), "lab-teacher/lab-solved.ipynb": SOLVED}
    assert {"lab/README.md", "lab/pyproject.toml", "lab/homing_lib/teach/lab.toml"} <= {*students}
    assert {name for name in students if name.endswith(".ipynb")} == {"lab/lab.ipynb"}
    assert not [name for name in students if "teacher" in name or "tests" in name]
    assert students["lab/homing_lib/compact.atlas"] == (handouts.ROOT / "homing_lib/compact.atlas").read_bytes()


def test_the_order_of_files_does_not_change_an_archive():
    files = {"b": b"2", "a/c": b"1"}
    once, again = handouts.archive("lab", files), handouts.archive("lab", dict(reversed(files.items())))
    assert once == again
    assert contents(io.BytesIO(once)) == {"lab/a/c": b"1", "lab/b": b"2"}


def test_each_cell_to_fill_has_a_solution_above_its_check_and_the_students_lab_has_none_of_it():
    given = handouts.students()["lab.ipynb"].decode()
    blank, solved = (
        {cell.id: cell.source for cell in handouts.filled(answers).cells if cell.cell_type == "code"}
        for answers in ({}, handouts.solutions())
    )
    assert blank["trace"].splitlines()[-1] == solved["trace"].splitlines()[-1] == "lab.trace(trace)"
    to_fill = {cell for cell in blank if "..." in blank[cell]}
    assert {cell for cell in blank if blank[cell] != solved[cell]} == to_fill == {*handouts.solutions()}
    for answer in ("gamma * lambda_t * e + phi", "np.prod(gamma", "(gamma * delta)", "change @ phi", "len(set("):
        assert any(answer in source for source in solved.values())
        assert answer not in given


MISFITS = {
    "a solution lost": (lambda lab, guide: (lab, guide.replace("```python reach", "```python")), "teacher.md: reach: "),
    "a solution of no cell": (lambda lab, guide: (lab, f"{guide}\n```python further\n1\n```\n"), ".md: further: "),
    "a cell filled in": (
        lambda lab, guide: (lab.replace("return ...  # the new trace", "return e  # the new trace"), guide),
        "lab.ipynb.*trace.*put",
    ),
    "no guide": (lambda lab, guide: (lab, None), "teacher.md.*restore"),
    "no lab": (lambda lab, guide: (None, guide), "lab.ipynb.*restore"),
}


@pytest.mark.parametrize(("spoil", "named"), MISFITS.values(), ids=MISFITS)
def test_what_does_not_fit_is_refused_before_anything_is_written(spoil, named, desk):
    for path, text in zip(
        (handouts.LAB, handouts.GUIDE),
        spoil(handouts.LAB.read_text(encoding="utf-8"), handouts.GUIDE.read_text(encoding="utf-8")),
        strict=True,
    ):
        path.unlink() if text is None else path.write_text(text, encoding="utf-8")
    with pytest.raises(UserError, match=named) as refused:
        handouts.write(desk / "out")
    assert "\n" not in str(refused.value)
    assert not (desk / "out").exists()
