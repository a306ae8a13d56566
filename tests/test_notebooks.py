"""Executed notebooks are a function of their sources, and a failure is told in one line."""

import base64
import re
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

from homing_lib.errors import UserError
from homing_lib.publish import notebooks
from homing_lib.storage import ROOT

SOURCES = sorted(notebooks.NOTEBOOKS.glob("[0-9]*.ipynb"))

PARAMETERS = 'profile = "full"\nfigures_dir = None'
DRAWS = """
from homing_lib.publish import charts, figures
figure = charts.passing_shares({"some": 0.1})
figures.save(figure, figures_dir, "bar")
"""
PLAYS = """
from homing_lib.publish import charts, figures
from homing_lib.teach import widgets
figure = widgets.play(lambda lambda_: charts.passing_shares({"some": lambda_}), lambda_=0.1)
figures.save(figure, figures_dir, "played")
"""
UNSTABLE = """
import sys, time, matplotlib.pyplot as plt
for word in ("one", "two"):
    print(word, flush=True)
    print("progress", file=sys.stderr, flush=True)
    time.sleep(0.05)
print(object(), flush=True)
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


def test_executing_twice_gives_the_same_bytes_and_leaves_the_source_alone(write, tmp_path):
    source = write(PARAMETERS, UNSTABLE)
    before = source.read_bytes()
    runs = []
    for _ in range(2):
        written = notebooks.execute(str(source))
        runs.append([path.read_bytes() for path in written])
    assert [path.relative_to(tmp_path).as_posix() for path in written] == [
        "notebooks/executed/tiny.ipynb",
        "figures/line.pdf",
        "figures/profile.txt",
    ]
    assert runs[0] == runs[1]
    assert source.read_bytes() == before

    executed = nbformat.read(written[0], as_version=4)
    nbformat.validate(executed)
    printed, figure = executed.cells[-1].outputs
    assert printed.text == "one\ntwo\n<object object>\n"
    assert "image/png" in figure.data
    assert str(tmp_path) not in written[0].read_text(encoding="utf-8")


def test_the_quick_profile_writes_only_where_it_is_told(write, tmp_path):
    source = write(PARAMETERS, UNSTABLE)
    quick = tmp_path / "quick"
    notebooks.execute(str(source), "quick", output_dir=quick, figures_dir=quick / "figures")
    assert (quick / "tiny.ipynb").exists()
    assert (quick / "figures" / "profile.txt").read_text(encoding="utf-8") == "quick"
    assert not (source.parent / "executed").exists()
    assert list((tmp_path / "figures").glob("*")) == []
    assert str(tmp_path) not in (quick / "tiny.ipynb").read_text(encoding="utf-8")


def test_what_another_notebook_draws_meanwhile_is_not_taken_for_its_own(write, tmp_path):
    meanwhile = "open('../figures/other.pdf', 'w').close()"
    written = notebooks.execute(str(write(PARAMETERS, DRAWS, meanwhile)))
    assert [path.name for path in written] == ["tiny.ipynb", "bar.pdf", "bar.png"]
    assert (tmp_path / "figures/other.pdf").exists()


def test_every_figure_is_shown_where_it_is_drawn(write):
    source = write(PARAMETERS, DRAWS, DRAWS, DRAWS)
    copy, *_ = notebooks.execute(str(source))
    assert [images(cell) for cell in code_cells(copy)[-3:]] == [1, 1, 1]


def test_under_controls_the_copy_shows_the_figure_and_nothing_of_the_controls(write):
    copy, *_ = notebooks.execute(str(write(PARAMETERS, PLAYS)))
    (shown,) = code_cells(copy)[-1].outputs
    assert "image/png" in shown.data
    assert "HBox" not in copy.read_text(encoding="utf-8")
    assert "widgets" not in nbformat.read(copy, as_version=4).metadata


def test_by_hand_a_notebook_shows_its_figures_and_writes_none(write, tmp_path, monkeypatch):
    monkeypatch.delenv("MPLBACKEND", raising=False)  # which make sets
    source = write(PARAMETERS, DRAWS, DRAWS)
    notebook = nbformat.read(source, as_version=4)
    NotebookClient(notebook, resources={"metadata": {"path": str(source.parent)}}).execute()
    assert [images(cell) for cell in notebook.cells] == [0, 1, 1]
    assert [path.name for path in tmp_path.rglob("*") if path.is_file()] == ["tiny.ipynb"]


def test_a_figure_that_needs_the_camera_is_shown_as_it_is_stored(write):
    source = write(PARAMETERS, 'from homing_lib.publish import figures\nfigures.stored("fig1-home-view")')
    copy, *_ = notebooks.execute(str(source))
    printed, shown = code_cells(copy)[-1].outputs
    assert "figures/fig1-home-view.png" in printed.text
    assert base64.b64decode(shown.data["image/png"]) == (ROOT / "figures" / "fig1-home-view.png").read_bytes()


def test_a_failing_cell_is_named_in_one_line_and_the_earlier_copy_and_figures_stay(write, tmp_path):
    copy, *figures = notebooks.execute(str(write(PARAMETERS, DRAWS)))
    before = [path.read_bytes() for path in (copy, *figures)]
    with pytest.raises(UserError) as failure:
        notebooks.execute(str(write(PARAMETERS, DRAWS.replace("0.1", "0.2"), "# one over nothing\n1 / 0")))
    assert re.fullmatch(r"tiny\.ipynb, cell \[4\] `# one over nothing`: ZeroDivisionError: .+", str(failure.value))
    assert [path.read_bytes() for path in (copy, *figures)] == before
    assert list(copy.parent.iterdir()) == [copy]


def test_a_kernel_that_dies_and_a_place_that_cannot_be_written_are_named_in_one_line(write, tmp_path):
    with pytest.raises(UserError, match=r"^tiny\.ipynb: .*died"):
        notebooks.execute(str(write(PARAMETERS, "import os\nos._exit(1)")))
    (tmp_path / "file").touch()
    with pytest.raises(UserError, match="file: no folder"):
        notebooks.execute(str(write(PARAMETERS)), output_dir=tmp_path / "file")


def test_nothing_of_the_users_own_set_up_reaches_what_is_built(write, tmp_path, monkeypatch):
    source = write(
        PARAMETERS, "import numpy as np\nnp.array([1 / 3])", "import matplotlib.pyplot as plt\nplt.plot([1, 2]);"
    )
    plain, *_ = notebooks.execute(str(source))
    before = plain.read_bytes()
    mine = "import numpy as np\nnp.set_printoptions(precision=1)\nprint('mine')\n"
    for path, text in {
        "startup.py": mine,
        "ipython/profile_default/startup/00.py": mine,
        "ipython/profile_default/ipython_config.py": "c.InlineBackend.figure_formats = {'svg'}\n",
        "jupyter/jupyter_config.py": "raise SystemExit\n",
        "jupyter/kernels/python3/kernel.json": '{"argv": ["false"], "display_name": "mine", "language": "python"}',
        "matplotlib/matplotlibrc": "lines.linewidth: 9\nfigure.facecolor: red\n",
    }.items():
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).write_text(text)
    monkeypatch.setenv("PYTHONSTARTUP", str(tmp_path / "startup.py"))
    monkeypatch.setenv("IPYTHONDIR", str(tmp_path / "ipython"))
    for name in ("JUPYTER_CONFIG_DIR", "JUPYTER_DATA_DIR", "JUPYTER_PATH"):
        monkeypatch.setenv(name, str(tmp_path / "jupyter"))
    monkeypatch.setenv("MATPLOTLIBRC", str(tmp_path / "matplotlib"))
    notebooks.execute(str(source))
    assert plain.read_bytes() == before


def test_problems_names_stored_results_and_a_missing_parameters_cell(write):
    assert notebooks.problems(write(PARAMETERS)) == []
    source = write("profile = 'quick'")
    notebook = nbformat.read(source, as_version=4)
    notebook.cells[0].execution_count = 1
    nbformat.write(notebook, source)
    outputs, parameters = notebooks.problems(source)
    assert "outputs" in outputs
    assert "parameters" in parameters
    notebook.nbformat_minor = 4
    source.write_text(nbformat.writes(notebook, version=nbformat.NO_CONVERT))
    assert "4.5" in notebooks.problems(source)[0]


@pytest.mark.parametrize("source", SOURCES, ids=lambda path: path.stem)
def test_every_source_notebook_is_clean(source):
    assert notebooks.problems(source) == []


@pytest.mark.parametrize("source", SOURCES, ids=lambda path: path.stem)
def test_every_executed_notebook_shows_at_least_the_figures_that_it_saves(source):
    saved = len(re.findall(r"figures\.(?:save|show)\(", source.read_text(encoding="utf-8")))
    assert saved > 0
    assert sum(map(images, code_cells(source.parent / "executed" / source.name))) >= saved
