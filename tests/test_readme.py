"""What readers meet first: pages whose links and commands lead somewhere, code that runs, and notebooks."""

import json
import re
import sys
from functools import partial

import pytest

import homing_lib
from homing_lib.__main__ import homing
from homing_lib.publish import where
from homing_lib.storage import ROOT
from homing_lib.study import rules

PAGES = ("README.md", "CONTRIBUTING.md", "data/README.md", "notebooks/TEACHING.md")
TEXTS = {page: (ROOT / page).read_text(encoding="utf-8") for page in PAGES}
SAMPLES = dict(
    zip(
        ("agent.run", "step_sizes", "gymnasium.make"),
        re.findall(r"```python\n(.*?)```", TEXTS["README.md"], re.S),
        strict=True,
    )
)
LINKS = sorted({(page, path) for page in PAGES for path in re.findall(r"\]\((?!https?:)([^)#]+)", TEXTS[page])})


@pytest.mark.parametrize("shows", SAMPLES)
def test_each_sample_of_the_readme_runs_where_pybullet_cannot_be_loaded(shows, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "pybullet", None)
    monkeypatch.delitem(sys.modules, "homing_lib.arena", raising=False)
    monkeypatch.delattr(homing_lib, "arena", raising=False)
    monkeypatch.setattr(rules, "compare", partial(rules.compare, seeds=range(100, 103), choose=range(2)))
    assert shows in SAMPLES[shows]
    exec(SAMPLES[shows], {})
    assert "nan" not in capsys.readouterr().out


@pytest.mark.parametrize(("page", "path"), LINKS)
def test_what_is_linked_is_there(page, path):
    assert ((ROOT / page).parent / path).exists()


@pytest.mark.parametrize("text", [*PAGES, "paper/report.tex"])
def test_every_command_that_is_named_to_a_reader_is_there(text):
    written = (ROOT / text).read_text(encoding="utf-8")
    targets = re.findall(r"^(\w+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.M)
    assert {*re.findall(r"(?:`|\{|bin/)homing (\w+)", written)} <= {*homing.commands}
    assert {*re.findall(r"(?:`|\{|^)make ([a-z]+)", written, re.M)} <= {*targets}


@pytest.mark.parametrize("notebook", sorted((ROOT / "notebooks").glob("[0-9]*.ipynb")), ids=lambda path: path.stem)
def test_each_notebook_says_first_what_it_teaches_what_it_needs_and_how_long_it_takes(notebook):
    cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
    texts = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "markdown"]
    takes = r"\*\*It takes\*\* \d+ minutes to read and (\d+ seconds|half a minute|a minute) to run"
    for line in (r"\*\*You will learn\*\* \w", r"\*\*You need\*\* \S", takes):
        assert re.search(line, texts[0]), line
    headings = re.findall(r"^#+ .*", "\n".join(texts), re.M)
    assert not [heading for heading in headings if "$" in heading], "a table of contents shows the bare LaTeX"


def test_the_cell_of_a_figure_says_itself_which_finding_it_draws():
    for name, figure in where.drawn().items():
        cells = json.loads(figure.notebook.read_text(encoding="utf-8"))["cells"]
        (source,) = ("".join(cell["source"]) for cell in cells if cell["id"] == figure.cell)
        assert not [asked for asked in figure.asked if f'"{asked}"' not in source], name
