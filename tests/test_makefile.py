"""The build remakes what changed and nothing else, also after a failure, and once what it made was damaged."""

import json
import os
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

from homing_lib.publish.notebooks import REPRODUCIBLE
from homing_lib.storage import ROOT
from tests.test_architecture import imported

LIBRARY = sorted(path.relative_to(ROOT) for path in (ROOT / "homing_lib").rglob("*.*") if path.parent.name[0] != "_")
VERSION = f"{sys.version_info.major}.{sys.version_info.minor}"

# Stands in for .venv/bin/python: logs what it is asked, writes what `homing` would, and fails where it is told to.
PYTHON = """#!/bin/sh
shift 2
echo "$*" >> log
case $1 in
    demo) mkdir -p notebooks/executed; echo page > notebooks/executed/demo.html ;;
    site) mkdir -p .build/site; echo page > .build/site/index.html ;;
    lab) mkdir -p .build/lab; echo zip > .build/lab/lab-teacher.zip ;;
    data) [ -e "$3" ] || echo hash > "$3" ;;
    notebook) echo drawn > "figures/$2.pdf"; echo "figures/$2.pdf" ;;
    *) echo "what $1 prints" ;;
esac
! grep -qsx "$1" failing
"""
LATEX = """#!/bin/sh
case "$*" in *-jobname=*) notes=-notes ;; *) notes= ;; esac
for source; do :; done
made=$(basename "$source" .tex)$notes
echo "$made" >> log
mkdir -p .build/lectures .build/paper
echo pages > .build/$(dirname "$source" | sed s/paper.lectures/lectures/)/$made.pdf
! grep -qsx "$made" failing
"""


BYTE_CODE = "homing_lib/teach/__pycache__/lab.cpython-311.pyc"
"""What Python leaves beside a source; nothing is made from it."""


def script(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    path.chmod(0o755)


def run(*command: str | Path, cwd: Path, path: str, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        command, cwd=cwd, env={"PATH": path} | environment, capture_output=True, text=True, check=False
    )


def ready(folder: Path, environment: str = ".venv") -> None:
    """Stand-ins for an environment that is up to date."""
    script(folder / environment / "bin/python", PYTHON)
    (folder / environment / ".ready").write_text(f"{VERSION} {folder}\n")


def project(folder: Path) -> Path:
    """All files of the library, empty, two notebooks and a lecture, with stand-ins for Python and LaTeX."""
    shutil.copy(ROOT / "Makefile", folder)
    script(folder / "bin/latexmk", LATEX)
    script(folder / "paper/install-tex.sh", "#!/bin/sh\n")
    sources = ["notebooks/01-a.ipynb", "notebooks/02-b.ipynb", "notebooks/lab.ipynb", "notebooks/demo/page.html"]
    sources += ["paper/report.tex", "paper/lectures/preamble.tex", "paper/lectures/blame.tex", "figures/film.gif"]
    sources += ["notebooks/TEACHING.md", "paper/references.bib", BYTE_CODE]
    for path in (folder / name for name in [*sources, "README.md", "environment.lock", "pyproject.toml", *LIBRARY]):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    ready(folder)
    return folder


def make(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    return run("make", f"PYTHON={sys.executable}", "-j1", *arguments, cwd=folder, path=f"{folder}/bin:{os.defpath}")


def asked(folder: Path, *arguments: str) -> list[str]:
    """Runs make; what the stand-ins were asked to do."""
    (folder / "log").write_text("")
    done = make(folder, *arguments)
    assert done.returncode == 0, done.stderr
    return [line.partition(" --stamp")[0] for line in (folder / "log").read_text().splitlines()]


def later(path: Path) -> None:
    """Changed just now, on file systems of any resolution and however long it took to come here."""
    now = time.time_ns() + 10**9
    os.utime(path, ns=(now, now))


NOTEBOOKS = ["notebook 01-a", "notebook 02-b"]
NUMBERS = "numbers --latex"
REPORT = ["data", "verify", NUMBERS, *NOTEBOOKS, "report"]
OTHERS = ["blame", "blame-notes", "site", "lab"]
ALL = ("all", "lectures", "site", "lab")


def test_a_fresh_clone_makes_everything_and_a_second_make_nothing(tmp_path):
    project(tmp_path)
    assert asked(tmp_path) == [*REPORT, "demo", "summary"]
    assert asked(tmp_path) == ["data"]
    assert asked(tmp_path, *ALL[1:]) == ["data", *OTHERS]
    assert asked(tmp_path, *ALL[1:]) == ["data"]


def test_two_at_a_time_nothing_is_made_twice_or_left_out(tmp_path):
    assert sorted(asked(project(tmp_path), "-j2", *ALL)) == sorted([*REPORT, "demo", "summary", *OTHERS])


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """A project in which everything is made."""
    asked(folder := project(tmp_path_factory.mktemp("built")), *ALL)
    return folder


SET = ["report", "blame", "blame-notes"]
STUDIED = ["verify", "summary", NUMBERS, *NOTEBOOKS, *SET, "demo", "site"]


@pytest.mark.parametrize(
    ("file", "again"),
    [
        ("homing_lib/td.py", [*STUDIED, "lab"]),
        ("homing_lib/rooms.toml", [*STUDIED, "lab"]),
        ("homing_lib/study/findings.py", [*STUDIED, "lab"]),
        ("homing_lib/study/questions/varying.py", [*STUDIED, "lab"]),
        (".build/data", STUDIED),
        ("homing_lib/publish/style.py", [*NOTEBOOKS, *SET, "demo", "site", "lab"]),
        ("homing_lib/publish/curves.py", [*NOTEBOOKS, *SET, "site", "lab"]),
        ("homing_lib/publish/report.py", [NUMBERS, *SET, "summary", "site", "lab"]),
        ("homing_lib/publish/demo.py", ["demo", "site", "lab"]),
        ("homing_lib/publish/site.py", ["site", "lab"]),
        ("homing_lib/publish/cli.py", ["lab"]),
        ("homing_lib/teach/exercises.py", [*NOTEBOOKS, *SET, "site", "lab"]),
        ("homing_lib/teach/lab.py", ["lab"]),
        ("homing_lib/teach/lab.toml", ["lab"]),
        ("homing_lib/teach/experiments.py", ["lab"]),
        (BYTE_CODE, []),
        ("homing_lib/__main__.py", ["lab"]),
        ("pyproject.toml", ["lab"]),
        ("notebooks/02-b.ipynb", [NUMBERS, "notebook 02-b", *SET, "site"]),
        ("notebooks/lab.ipynb", ["site", "lab"]),
        ("notebooks/TEACHING.md", ["site"]),
        ("notebooks/demo/page.html", ["demo", "site"]),
        ("paper/report.tex", [NUMBERS, *SET, "site"]),
        ("paper/references.bib", ["report", "site"]),
        ("paper/lectures/blame.tex", [NUMBERS, *SET, "site"]),
    ],
)
def test_an_edit_remakes_what_it_touches_and_nothing_else(built, file, again):
    shutil.copytree(built, here := built.parent / "here", symlinks=True)
    ready(here)
    later(here / file)
    try:
        assert sorted(asked(here, *ALL)) == sorted(["data", *again])
    finally:
        shutil.rmtree(here)


def test_a_notebook_is_executed_again_after_an_edit_of_any_file_that_it_imports(tmp_path):
    rules = make(project(tmp_path), "-pn").stdout
    needs = {*re.search(r"^\.build/notebooks/%: (.*)$", rules, re.M)[1].split()}
    codes = ["".join(cell["source"]) for path in (ROOT / "notebooks").glob("[0-9]*.ipynb") for cell in cells(path)]
    known, new = set(), set().union(*map(imported, codes))
    while new:
        known |= new
        files = [path for name in new for path in files_of(name)]
        assert [path for path in files if str(path.relative_to(ROOT)) not in needs] == []
        new = set().union(*(imported(path.read_text(encoding="utf-8")) for path in files)) - known
    assert "homing_lib.publish.style" in known


def cells(notebook: Path) -> list:
    every = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
    return [cell for cell in every if cell["cell_type"] == "code"]


def files_of(name: str) -> list[Path]:
    """The file of a module or package; none for what one of them holds."""
    path = ROOT / name.replace(".", "/")
    return [file for file in (path.with_suffix(".py"), path / "__init__.py") if file.is_file()]


@pytest.mark.parametrize("failing", [*REPORT, "demo", "summary", *OTHERS])
def test_whatever_fails_ends_make_with_an_error_and_is_made_again(failing, tmp_path):
    project(tmp_path)
    (tmp_path / "failing").write_text(f"{failing.split()[0]}\n")
    assert make(tmp_path, *ALL).returncode != 0
    (tmp_path / "failing").unlink()
    assert failing in asked(tmp_path, *ALL)


@pytest.mark.parametrize(
    "said", [r"Overfull \hbox (3pt too wide)", "LaTeX Warning: Reference `a' on page 1 undefined", "Half-empty page 4"]
)
def test_a_report_of_which_latex_complains_is_not_kept(said, tmp_path):
    log = project(tmp_path) / ".build/paper/report.log"
    log.parent.mkdir(parents=True)
    log.write_text(f"{said}\n")
    done = make(tmp_path, "paper")
    assert done.returncode != 0
    assert said in done.stderr
    assert not (tmp_path / "paper/report.pdf").exists()


@pytest.mark.parametrize(
    ("file", "kept", "again"),
    [
        ("figures/01-a.pdf", 3, "notebook 01-a"),
        ("paper/numbers.tex", 0, NUMBERS),
        ("paper/report.pdf", 3, "report"),
        ("notebooks/executed/demo.html", None, "demo"),
        (".build/notebooks/01-a", 0, "notebook 01-a"),
        (".build/notebooks/02-b", 9, "notebook 02-b"),
    ],
)
def test_a_damaged_product_or_stamp_is_made_again(built, file, kept, again, tmp_path):
    shutil.copytree(built, here := tmp_path / "here", symlinks=True)
    ready(here)
    path = here / file
    whole = path.read_bytes()
    path.unlink() if kept is None else path.write_bytes(whole[:kept])
    assert again in asked(here)
    assert path.read_bytes() == whole
    assert asked(here) == ["data"]


def test_the_environment_of_a_class_packs_the_lab_where_there_is_no_other(tmp_path):
    project(tmp_path)
    shutil.rmtree(tmp_path / ".venv")
    ready(tmp_path, ".build/class")
    assert asked(tmp_path, "lab") == ["lab"]


def test_help_names_every_target_that_is_not_a_file(tmp_path):
    shutil.copy(ROOT / "Makefile", tmp_path)
    named = re.findall(r"^make (\w+) +\w", make(tmp_path, "help").stdout, re.M)
    phony = re.search(r"^\.PHONY: (.*)$", (ROOT / "Makefile").read_text(), re.M)[1].split()
    assert {*named} == {*phony} - {"help", "FORCE"}


def test_nothing_of_the_users_own_set_up_reaches_a_command(tmp_path):
    script(project(tmp_path) / ".venv/bin/python", "#!/bin/sh\nenv > seen\n")
    theirs = {"PYTHONPATH": "x", "PYTHONWARNINGS": "error", "PYTHONHASHSEED": "7", "MATPLOTLIBRC": "x"}
    run("make", f"PYTHON={sys.executable}", "data", cwd=tmp_path, path=os.defpath, **theirs, TEXINPUTS="x")
    seen = dict(line.split("=", 1) for line in (tmp_path / "seen").read_text().splitlines())
    texs = {"TEXMFHOME", "TEXMFCONFIG", "TEXMFVAR"}
    assert {name for name in seen if name.startswith(("PYTHON", "TEX"))} == {"PYTHONHASHSEED", "PYTHONUTF8", *texs}
    assert {name: seen[name] for name in REPRODUCIBLE} == REPRODUCIBLE
    assert seen["MATPLOTLIBRC"] == os.devnull
