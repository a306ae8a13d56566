"""Executed notebooks are a function of their sources, and a failure is told in one line."""

import base64
import re
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

from homing_lib.errors import UserError
from homing_lib.publish import figures, notebooks
from homing_lib.storage import ROOT

SOURCES = sorted(notebooks.NOTEBOOKS.glob("[0-9]*.ipynb"))

PARAMETERS = 'profile = "full"  # or "quick"\nfigures_dir = None  # a folder to save the figures in'
DRAWS = """
from homing_lib.publish import charts, figures
figure = charts.passing_shares({"some": 0.1})
figures.save(figure, figures_dir, "bar")
"""
PLAYS = """
from homing_lib.publish import charts
from homing_lib.teach import widgets
widgets.play(lambda lambda_: charts.passing_shares({"some": lambda_}), lambda_=0.1)
"""
STORED = 'from homing_lib.publish import figures\nfigures.stored("fig1-home-view")'
ANOTHERS = "open('../figures/other.pdf', 'w').close()"
UNSTABLE = """
import sys, time, matplotlib.pyplot as plt, numpy as np
for word in ("one", "two"):
    print(word, flush=True)
    print("progress", file=sys.stderr, flush=True)
    time.sleep(0.05)
print(object(), np.array([1 / 3]), flush=True)
plt.plot([1, 2])
plt.savefig(f"{figures_dir}/line.pdf")
plt.show()
_ = open(f"{figures_dir}/profile.txt", "w").write(profile)
"""


@pytest.fixture
def write(tmp_path: Path):
    """Writes tmp_path/notebooks/tiny.ipynb from the sources of its code cells, the first tagged `parameters`."""

    def write(*sources: str) -> Path:
        notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(source) for source in sources])
        notebook.cells[0].metadata["tags"] = ["parameters"]
        path = tmp_path / "notebooks" / "tiny.ipynb"
        path.parent.mkdir(exist_ok=True)
        nbformat.write(notebook, path)
        return path

    return write


def code_cells(path: Path) -> list:
    return [cell for cell in nbformat.read(path, as_version=4).cells if cell.cell_type == "code"]


def images(cell) -> int:
    return sum("image/png" in output.get("data", {}) for output in cell.get("outputs", []))


MINE = "import numpy as np\nnp.set_printoptions(precision=1)\nprint('mine')\n"
SET_UP = {
    "startup.py": MINE,
    "ipython/profile_default/startup/00.py": MINE,
    "ipython/profile_default/ipython_config.py": "c.InlineBackend.figure_formats = {'svg'}\n",
    "jupyter/jupyter_config.py": "raise SystemExit\n",
    "jupyter/kernels/python3/kernel.json": '{"argv": ["false"], "display_name": "mine", "language": "python"}',
    "matplotlib/matplotlibrc": "lines.linewidth: 9\nfigure.facecolor: red\nsavefig.bbox: tight\n",
    "path/numpy.py": "raise ImportError('mine')\n",
}
VARIABLES = {
    "PYTHONSTARTUP": "startup.py",
    "PYTHONPATH": "path",
    "IPYTHONDIR": "ipython",
    "JUPYTER_CONFIG_DIR": "jupyter",
    "JUPYTER_DATA_DIR": "jupyter",
    "JUPYTER_PATH": "jupyter",
    "MATPLOTLIBRC": "matplotlib",
}


@pytest.fixture
def own_set_up(tmp_path, monkeypatch):
    """A user who has set up everything otherwise, with a folder for temporary files that is long and oddly named."""
    for path, text in SET_UP.items():
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).write_text(text)
    (odd := tmp_path / ("a\\back 'slash é" + "x" * 90)).mkdir()

    def use() -> Path:
        for name, path in VARIABLES.items():
            monkeypatch.setenv(name, str(tmp_path / path))
        monkeypatch.setenv("PYTHONWARNINGS", "error")
        monkeypatch.setenv("LC_ALL", "C")
        monkeypatch.setattr("tempfile.tempdir", str(odd))
        return odd

    return use


def test_executing_twice_gives_the_same_bytes_whatever_the_user_has_set_up(write, tmp_path, own_set_up):
    source = write(PARAMETERS, UNSTABLE)
    before = source.read_bytes()
    first = {path: path.read_bytes() for path in notebooks.execute(str(source))}
    odd = own_set_up()
    again = {path: path.read_bytes() for path in notebooks.execute(str(source))}
    assert first == again
    assert source.read_bytes() == before
    assert list(odd.iterdir()) == []

    copy, *others = first
    assert copy == tmp_path / "notebooks/executed/tiny.ipynb"
    assert others == [tmp_path / "figures/line.pdf", tmp_path / "figures/profile.txt"]
    executed = nbformat.read(copy, as_version=4)
    nbformat.validate(executed)
    assert 'figures_dir = "../figures"' in executed.cells[1].source
    printed, figure = executed.cells[-1].outputs
    assert printed.text == "one\ntwo\n<object object> [0.33333333]\n"
    assert "image/png" in figure.data


def test_a_notebook_runs_where_no_temporary_folder_has_a_path_short_enough_for_the_sockets_of_a_kernel(
    write, own_set_up, monkeypatch
):
    monkeypatch.setattr("os.access", lambda *_: False)  # nor into /tmp
    own_set_up()
    copy, *_ = notebooks.execute(str(write(PARAMETERS, "print(1)")))
    assert code_cells(copy)[-1].outputs[0].text == "1\n"


def test_figures_are_shown_where_they_are_drawn_and_written_where_it_is_told(write, tmp_path):
    source = write(PARAMETERS, DRAWS, DRAWS, ANOTHERS, PLAYS, STORED, "print(profile)")
    (tmp_path / "figures").mkdir()
    quick = tmp_path / "quick"
    copy, *drawn = notebooks.execute(str(source), "quick", output_dir=quick, figures_dir=quick / "figures")
    assert copy == quick / "tiny.ipynb"
    assert drawn == [quick / "figures" / f"bar.{kind}" for kind in ("pdf", "png")]
    assert not (source.parent / "executed").exists()
    assert [path.name for path in (tmp_path / "figures").iterdir()] == ["other.pdf"]
    assert str(tmp_path) not in copy.read_text(encoding="utf-8")

    *_, first, second, _, played, stored, printed = code_cells(copy)
    assert [images(cell) for cell in (first, second, played, stored)] == [1, 1, 1, 1]
    assert len(played.outputs) == 1  # nothing of the controls
    assert "widgets" not in nbformat.read(copy, as_version=4).metadata
    picture = stored.outputs[-1].data["image/png"]
    assert base64.b64decode(picture) == (ROOT / "figures" / "fig1-home-view.png").read_bytes()
    assert printed.outputs[0].text == "quick\n"


def test_by_hand_a_notebook_shows_its_figures_and_writes_none(write, tmp_path, monkeypatch):
    monkeypatch.delenv("MPLBACKEND", raising=False)  # which make sets
    source = write(PARAMETERS.replace("None", "''"), DRAWS, DRAWS)
    notebook = nbformat.read(source, as_version=4)
    NotebookClient(notebook, resources={"metadata": {"path": str(source.parent)}}).execute()
    assert [images(cell) for cell in notebook.cells] == [0, 1, 1]
    assert [path.name for path in tmp_path.rglob("*") if path.is_file()] == ["tiny.ipynb"]


def test_a_failing_cell_is_named_in_one_line_and_the_earlier_copy_and_figures_stay(write, tmp_path):
    source = write(PARAMETERS, DRAWS, "# one over nothing\n1 / 0")
    earlier = [tmp_path / "notebooks/executed/tiny.ipynb", tmp_path / "figures/bar.pdf"]
    for path in earlier:
        path.parent.mkdir()
        path.write_text("earlier")
    with pytest.raises(UserError, match=r"^tiny\.ipynb, cell \[4\] `# one over nothing`: ZeroDivisionError: .+"):
        notebooks.execute(str(source))
    assert [path.read_text() for path in earlier] == ["earlier"] * 2
    assert [[*path.parent.iterdir()] for path in earlier] == [[path] for path in earlier]


def test_a_kernel_that_dies_is_named_in_one_line(write):
    with pytest.raises(UserError, match=r"^tiny\.ipynb: .*died"):
        notebooks.execute(str(write(PARAMETERS, "import os\nos._exit(1)")))


@pytest.mark.parametrize("which", ["output_dir", "figures_dir"])
def test_a_place_that_cannot_be_written_is_named_before_anything_is_executed(which, write, tmp_path, monkeypatch):
    monkeypatch.setattr("papermill.execute_notebook", None)
    for place in (tmp_path / "file", Path("/proc/1")):
        (tmp_path / "file").touch()
        with pytest.raises(UserError, match=f"^{place}: no folder to write to"):
            notebooks.execute(str(write(PARAMETERS)), **{which: place})


def test_a_profile_that_there_is_not_is_refused():
    figures.check_profile("full")
    figures.check_profile("quick")
    with pytest.raises(UserError, match=r"'quik'.*'full' or 'quick'"):
        figures.check_profile("quik")


@pytest.mark.parametrize("source", SOURCES, ids=lambda path: path.stem)
def test_a_source_has_no_results_and_all_that_its_tools_need(source):
    notebook = nbformat.read(source, as_version=nbformat.NO_CONVERT)
    assert (notebook.nbformat, notebook.nbformat_minor) >= (4, 5)  # since when cells have ids
    assert not [cell.id for cell in notebook.cells if cell.get("outputs") or cell.get("execution_count")]
    tagged = [cell.source for cell in notebook.cells if "parameters" in cell.metadata.get("tags", [])]
    assert tagged == [PARAMETERS]
    assert any("figures.check_profile(profile)" in cell.source for cell in notebook.cells)
    assert notebook.metadata.language_info["file_extension"] == ".py"  # or nbconvert makes a text of it


@pytest.mark.parametrize("source", SOURCES, ids=lambda path: path.stem)
def test_every_executed_notebook_shows_at_least_the_figures_that_it_saves(source):
    saved = len(re.findall(r"figures\.(?:save|show)\(", source.read_text(encoding="utf-8")))
    assert saved > 0 or source.stem == "05-atlas"  # of tables alone
    assert sum(map(images, code_cells(source.parent / "executed" / source.name))) >= saved
