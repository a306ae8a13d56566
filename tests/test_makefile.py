"""The build remakes what changed and nothing else, and says in one line what is missing."""

import json
import os
import re
import shutil
import subprocess
import sys
import time
import tomllib
from pathlib import Path

import pytest

from homing_lib.publish.notebooks import REPRODUCIBLE
from tests.test_architecture import imported

ROOT = Path(__file__).parent.parent
LIBRARY = sorted(path.relative_to(ROOT) for path in (ROOT / "homing_lib").rglob("*.*") if path.parent.name[0] != "_")
VERSION = f"{sys.version_info.major}.{sys.version_info.minor}"

# Stands in for .venv/bin/python: logs what it is asked to do, and writes what `homing` would.
PYTHON = """#!/bin/sh
shift 2
echo "$*" >> log
case $1 in
    demo) mkdir -p notebooks/executed; echo page > notebooks/executed/demo.html ;;
    site) mkdir -p .build/site; echo page > .build/site/index.html ;;
    lab) mkdir -p .build/lab; echo zip > .build/lab/lab-teacher.zip ;;
    data) [ -e "$3" ] || touch "$3" ;;
    notebook) echo drawn > "figures/$2.pdf"; echo "figures/$2.pdf" ;;
    numbers) echo numbers ;;
esac
"""
LATEX = """#!/bin/sh
case "$*" in *-jobname=*) notes=-notes ;; *) notes= ;; esac
for source; do :; done
made=$(basename "$source" .tex)$notes
echo "$made" >> log
mkdir -p .build/lectures .build/paper
echo pages > .build/$(dirname "$source" | sed s/paper.lectures/lectures/)/$made.pdf
"""


def script(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    path.chmod(0o755)


def run(*command: str | Path, cwd: Path, path: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command, cwd=cwd, env={"PATH": path}, capture_output=True, text=True, check=False)


def project(folder: Path) -> Path:
    """All files of the library, empty, two notebooks and a lecture, with stand-ins for Python and LaTeX."""
    shutil.copy(ROOT / "Makefile", folder)
    script(folder / ".venv/bin/python", PYTHON)
    script(folder / "bin/latexmk", LATEX)
    script(folder / "paper/install-tex.sh", "#!/bin/sh\n")
    sources = ["notebooks/01-a.ipynb", "notebooks/02-b.ipynb", "notebooks/lab.ipynb", "notebooks/demo/page.html"]
    sources += ["paper/report.tex", "paper/lectures/preamble.tex", "paper/lectures/blame.tex", "figures/film.gif"]
    ready = ["environment.lock", "pyproject.toml", f".venv/.locked-{VERSION}", ".venv/.ready"]
    for path in (folder / name for name in [*sources, "README.md", *LIBRARY, *ready]):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    return folder


def asked(folder: Path, *arguments: str) -> list[str]:
    """Runs make; what the stand-ins were asked to do."""
    (folder / "log").write_text("")
    path = f"{folder}/bin:{os.environ['PATH']}"
    done = run("make", f"PYTHON={sys.executable}", "-j1", *arguments, cwd=folder, path=path)
    assert done.returncode == 0, done.stderr
    return [line.partition(" --stamp")[0] for line in (folder / "log").read_text().splitlines()]


@pytest.fixture
def make(tmp_path):
    """Runs make in a project of its own; returns what the stand-ins were asked."""
    project(tmp_path)
    return lambda *arguments: asked(tmp_path, *arguments)


def later(path: Path) -> None:
    """Changed just now, on file systems of any resolution and however long it took to come here."""
    now = time.time_ns() + 10**9
    os.utime(path, ns=(now, now))


NOTEBOOKS = ["notebook 01-a", "notebook 02-b"]
NUMBERS = "numbers --latex"
ONE_BY_ONE = ["data", "verify", "summary", NUMBERS, *NOTEBOOKS, "report", "demo"]
BUILT = [*ONE_BY_ONE, "blame", "blame-notes", "site", "lab"]


def test_a_fresh_clone_makes_everything_and_a_second_make_nothing(make):
    assert make() == ONE_BY_ONE
    assert make() == ["data"]
    assert make("lectures", "site", "lab") == ["data", *BUILT[len(ONE_BY_ONE) :]]
    assert make("lectures", "site", "lab") == ["data"]


def test_two_at_a_time_nothing_is_made_twice_or_left_out(make):
    assert sorted(make("-j2", "all", "lectures", "site", "lab")) == sorted(BUILT)


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """A project in which everything is made."""
    folder = project(tmp_path_factory.mktemp("built"))
    asked(folder, "all", "lectures", "site", "lab")
    return folder


LIVE = ["verify", "summary"]
SET = ["report", "blame", "blame-notes"]


@pytest.mark.parametrize(
    ("file", "again"),
    [
        ("homing_lib/td.py", BUILT[1:]),
        ("homing_lib/rooms.toml", BUILT[1:]),
        ("homing_lib/study/findings.py", BUILT[1:]),
        ("homing_lib/study/questions/varying.py", BUILT[1:]),
        ("homing_lib/publish/style.py", [*NOTEBOOKS, *SET, "demo", "site", "lab"]),
        ("homing_lib/publish/report.py", ["summary", NUMBERS, *SET, "site", "lab"]),
        ("homing_lib/publish/demo.py", ["demo", "site", "lab"]),
        ("homing_lib/publish/site.py", ["site", "lab"]),
        ("homing_lib/publish/cli.py", ["lab"]),
        ("homing_lib/teach/exercises.py", [*NOTEBOOKS, *SET, "site", "lab"]),
        ("homing_lib/teach/lab.py", ["lab"]),
        ("homing_lib/__main__.py", ["lab"]),
        ("notebooks/02-b.ipynb", [NUMBERS, "notebook 02-b", *SET, "site"]),
        ("notebooks/lab.ipynb", ["site", "lab"]),
        ("notebooks/demo/page.html", ["demo", "site"]),
        ("paper/report.tex", [NUMBERS, *SET, "site"]),
        ("paper/lectures/blame.tex", [NUMBERS, *SET, "site"]),
        (".build/data", BUILT[1:]),
    ],
)
def test_an_edit_remakes_what_it_touches_and_nothing_else(built, file, again):
    shutil.copytree(built, here := built.parent / "here", symlinks=True, dirs_exist_ok=True)
    later(here / file)
    try:
        assert sorted(asked(here, "all", "lectures", "site", "lab")) == sorted(["data", *again])
    finally:
        shutil.rmtree(here)


def test_a_notebook_is_executed_again_after_an_edit_of_any_file_that_it_imports(tmp_path):
    project(tmp_path)
    rules = run("make", "-pn", f"PYTHON={sys.executable}", cwd=tmp_path, path=os.environ["PATH"]).stdout
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


@pytest.mark.parametrize(
    ("file", "again"),
    [
        ("figures/01-a.pdf", "notebook 01-a"),
        ("paper/numbers.tex", NUMBERS),
        ("paper/report.pdf", "report"),
        ("notebooks/executed/demo.html", "demo"),
        (".build/notebooks/01-a", "notebook 01-a"),
    ],
)
@pytest.mark.parametrize("harm", ["truncated", "deleted", "a folder"])
def test_a_damaged_product_or_stamp_is_made_again(make, tmp_path, file, again, harm):
    make()
    path = tmp_path / file
    whole = path.read_bytes()
    path.unlink()
    if harm == "truncated":
        path.write_bytes(whole[:-2])
    if harm == "a folder":
        if ".build" not in file:
            return  # what stands there is the user's
        path.mkdir()
    assert again in make()
    assert path.read_bytes() == whole
    assert make() == ["data"]


def test_a_report_that_came_with_git_pull_stays_until_the_report_is_made_again(make, tmp_path):
    make()
    (tmp_path / "paper/report.pdf").write_text("pulled")
    make("notebooks")
    assert (tmp_path / "paper/report.pdf").read_text() == "pulled"


def test_help_names_every_target_that_is_not_a_file(tmp_path):
    shutil.copy(ROOT / "Makefile", tmp_path)
    told = run("make", "help", cwd=tmp_path, path=os.environ["PATH"]).stdout
    phony = re.search(r"^\.PHONY: (.*)$", (ROOT / "Makefile").read_text(), re.M)[1].split()
    assert re.findall(r"^make (\w+) +\w", told, re.M) != []
    assert {*re.findall(r"^make (\w+) +\w", told, re.M)} == {*phony} - {"help", "FORCE"}


# --- Environment -----------------------------------------------------------------------------------------------------


def test_without_a_fitting_python_make_says_so_in_one_line(tmp_path):
    for name in ("Makefile", "environment.lock", "pyproject.toml"):
        shutil.copy(ROOT / name, tmp_path)
    done = run("make", "-j1", "PYTHON=python3.11-missing", cwd=tmp_path, path=os.environ["PATH"])
    ours, _ = done.stderr.splitlines()  # the second is make's own
    assert ours.startswith("homing: 'python3.11-missing'")
    assert "apt-get install" in ours
    assert done.returncode != 0
    assert not (tmp_path / ".venv").exists()


def planned(folder: Path, *arguments: str) -> str:
    """What make would do for an environment, where the first Python that works is 3.12."""
    for name in ("Makefile", "environment.lock", "pyproject.toml"):
        shutil.copy(ROOT / name, folder)
    script(folder / "bin/python3.11", "#!/bin/sh\nexit 127\n")  # as pyenv's, for a version that is not chosen
    for minor in (12, 13):
        answer = f"#!/bin/sh\ncase $2 in *python3*) echo python3.{minor} ;; *) echo 3.{minor} ;; esac\n"
        script(folder / f"bin/python3.{minor}", answer)
    done = run("make", "-n", *arguments, ".venv/.ready", cwd=folder, path=f"{folder}/bin:{os.environ['PATH']}")
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_first_python_that_answers_is_taken_and_pybullet_alone_compiled_where_it_has_no_wheel(tmp_path):
    plan = planned(tmp_path)
    assert "python3.12 -m venv .venv\n" in plan
    assert "compiling" in plan
    assert "--only-binary :all: --no-binary pybullet --require-hashes" in plan


def test_an_environment_of_another_python_is_made_anew_and_one_of_the_same_is_kept(tmp_path):
    (tmp_path / ".venv").mkdir()
    planned(tmp_path)
    (tmp_path / ".venv/.locked-3.12").touch()
    (tmp_path / ".venv/.ready").touch()
    assert "up to date" in planned(tmp_path, "--assume-old=environment.lock", "--assume-old=pyproject.toml")
    assert "rm -rf .venv\npython3.13 -m venv .venv\n" in planned(tmp_path, "PYTHON=python3.13")


@pytest.mark.parametrize("user", [0, 1000])
@pytest.mark.parametrize(
    ("asked", "more"), [((), ""), (("lectures",), " texlive-pictures")], ids=["report", "lectures"]
)
def test_without_latex_root_gets_it_and_others_are_told_the_command(asked, more, user, tmp_path):
    script(tmp_path / "id", f"#!/bin/sh\necho {user}\n")
    script(tmp_path / "sudo", "#!/bin/sh\nexit 1\n")
    script(tmp_path / "apt-get", f'#!/bin/sh\necho "$*" >> {tmp_path}/log\n')
    (tmp_path / "env").symlink_to("/usr/bin/env")
    done = run(ROOT / "paper/install-tex.sh", *asked, cwd=tmp_path, path=str(tmp_path))
    packages = f"--no-install-recommends latexmk texlive-latex-recommended lmodern{more}"
    if user == 0:
        assert done.returncode == 0
        wait = "-o DPkg::Lock::Timeout=600"
        assert (tmp_path / "log").read_text() == f"{wait} update -q\n{wait} install -q -y {packages}\n"
    else:
        assert done.returncode == 1
        (line,) = done.stderr.splitlines()
        assert line.startswith("homing: ")
        assert line.endswith(f"sudo apt-get install {packages}")
        assert not (tmp_path / "log").exists()


def test_the_lock_of_the_lists_is_waited_for_and_where_latex_cannot_be_had_that_is_one_line(tmp_path):
    script(tmp_path / "id", "#!/bin/sh\necho 0\n")
    script(tmp_path / "sleep", f"#!/bin/sh\necho slept >> {tmp_path}/log\n")
    (tmp_path / "env").symlink_to("/usr/bin/env")
    script(tmp_path / "apt-get", f"#!/bin/sh\n[ -e {tmp_path}/log ]\n")  # locked once, then everything goes well
    done = run(ROOT / "paper/install-tex.sh", cwd=tmp_path, path=str(tmp_path))
    assert (done.returncode, (tmp_path / "log").read_text()) == (0, "slept\n")
    script(tmp_path / "apt-get", "#!/bin/sh\nexit 100\n")
    done = run(ROOT / "paper/install-tex.sh", cwd=tmp_path, path=str(tmp_path))
    (line,) = done.stderr.splitlines()
    assert done.returncode == 1
    assert line.startswith("homing: ")


def test_notebooks_run_under_the_settings_of_the_makefile():
    exported = dict(re.findall(r"^export (\w+) := (.*)$", (ROOT / "Makefile").read_text(), re.M))
    assert {name: exported[name] for name in REPRODUCIBLE} == REPRODUCIBLE


def test_the_lock_pins_every_dependency_by_hash_and_names_no_address():
    lock = (ROOT / "environment.lock").read_text()
    assert not re.search(r"https?://|file:|--(extra-)?index|--find-links", lock)
    packages = re.findall(r"^(\S+)==(\S+)(?: ;.*)? \\\n    --hash=sha256:", lock, flags=re.MULTILINE)
    assert len(packages) == len(re.findall(r"^\w", lock, flags=re.MULTILINE))
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    wanted = [
        *project["dependencies"],
        *(one for some in ("camera", "dev") for one in project["optional-dependencies"][some]),
    ]
    names = {re.match(r"[\w-]+", dependency)[0].replace("_", "-") for dependency in wanted}
    assert names <= {name for name, _ in packages}
