"""From a figure to its code and data: what `homing where` says is what the notebooks do."""

import re

import nbformat
import pytest

from homing_lib.errors import UserError
from homing_lib.publish import where
from homing_lib.storage import ROOT

SETUP = """
from homing_lib.publish import charts, figures
from homing_lib.study import findings, runs, studies
from homing_lib.study.questions import worth
from homing_lib.study.runs import load_table

found = findings.finding("drives")
"""
CELLS = {
    "unrelated": 'table = runs.load_table(studies.CALIBRATION)\nrows = {name: name for name in "ab"}',
    "own": 'lines = []\nshares = {}\nfor name in ("x", "y"):\n    shares[name] = draw(name)',
    "drawn": """
def mean(which):
    return load_table(which).steps.mean()

table = mean(studies.UNLEARNT)
shares = {name: value for name, value in [("robot", table)]}
figures.save(charts.passing_shares(shares), figures_dir, "first")
""",
    "filled": """
panels = {}
for study in (worth.MAP, studies.UNLEARNT):
    panels[study.name] = load_table(study)
figure = charts.passing_shares(panels)
figures.save(figure, figures_dir, "second")
""",
    "asked": 'figures.show("C8", charts.passing_shares(found), figures_dir)',
    "live": 'if True:\n    figures.save(charts.passing_shares({}), figures_dir, "live")',
}


@pytest.fixture
def written(tmp_path, monkeypatch):
    """A project of one notebook."""
    cells = [nbformat.v4.new_code_cell(code, id=name) for name, code in {"set-up": SETUP, **CELLS}.items()]
    nbformat.write(nbformat.v4.new_notebook(cells=cells), tmp_path / "01-one.ipynb")
    monkeypatch.setattr(where, "NOTEBOOKS", tmp_path)
    return where.drawn()


@pytest.mark.parametrize(
    ("name", "cell", "studies", "asked"),
    [
        ("first", "drawn", ["unlearnt"], []),  # not what had the same name before
        ("second", "filled", ["worth-map", "unlearnt"], []),
        ("live", "live", [], []),
    ],
)
def test_a_figure_rests_on_what_its_cell_reads_and_on_nothing_else(name, cell, studies, asked, written):
    figure = written[name]
    assert (figure.notebook.name, figure.cell) == ("01-one.ipynb", cell)
    assert [study.name for study in figure.studies] == studies
    assert figure.asked == asked
    assert figure.function.__name__ == "passing_shares"


def test_a_figure_of_findings_rests_on_the_studies_of_their_questions(written):
    asked = where.findings.questions()
    assert written["C8"].asked == ["drives", "C8"]
    names = {study.name for name in ("drives", "C8") for study in asked[name].studies}
    assert {study.name for study in written["C8"].studies} == names


# --- The repository --------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def every():
    return where.drawn()


@pytest.fixture
def origin(every, monkeypatch):
    """What `homing where` says; the notebooks are read but once."""
    monkeypatch.setattr(where, "drawn", lambda: every)
    return where.origin


def test_every_figure_of_the_repository_is_there_and_has_a_cell_that_draws_it(every):
    assert {*every} == {path.stem for path in (ROOT / "figures").glob("*.pdf")}
    for name, figure in every.items():
        cells = {cell.id: cell.source for cell in nbformat.read(figure.notebook, as_version=4).cells}
        assert f'"{name}"' in cells[figure.cell]
        assert where.draws(figure.function)


def test_a_figure_is_named_by_its_file_its_beginning_or_its_number_in_the_report(origin):
    assert origin("fig6") == origin("fig6-learning")
    numbered = where.in_report()
    for number in (3, len(numbered)):
        name = numbered[number - 1]
        assert origin(str(number)) == origin(name)
        assert f"Figure {number} of" in origin(name)
    assert origin(f"fig{len(numbered)}") == origin(str(len(numbered)))  # no file begins so
    typeset = str(numbered.index("") + 1)
    for wrong in ("0", "-1", typeset, str(len(numbered) + 1), "fig", "driv", ""):
        with pytest.raises(UserError, match=re.escape(repr(wrong))):
            origin(wrong)


def test_what_is_said_leads_to_cell_function_judge_data_and_seeds(origin):
    told = origin("conjugate")
    for word in ("08-what-drives-it.ipynb", "questions/conjugate.py", "`homing claims conjugate`"):
        assert word in told
    assert re.search(r"data/conjugate\.parquet: 100 runs, seeds 10000 to 10049; `homing data conjugate`", told)
    assert re.search(r"data/headline\.json: 10 runs, seeds 1000 to 1004", told)
    function, file, line = re.search(r"drawn by  (\w+) in (\S+), line (\d+)", told).groups()
    code = (ROOT / file).read_text(encoding="utf-8").splitlines()[int(line) - 1 :][:3]
    assert f"def {function}(" in "".join(code)
