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
    sources += ["notebooks/TEACHING.md", BYTE_CODE]
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
    assert asked(tmp_path) == ["data", "summary"]
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
STUDIED = ["verify", NUMBERS, *NOTEBOOKS, *SET, "demo", "site"]


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
        ("homing_lib/publish/report.py", [NUMBERS, *SET, "site", "lab"]),
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
        ("paper/lectures/blame.tex", [NUMBERS, *SET, "site"]),
    ],
)
def test_an_edit_remakes_what_it_touches_and_nothing_else(built, file, again):
    shutil.copytree(built, here := built.parent / "here", symlinks=True)
    ready(here)
    later(here / file)
    try:
        assert sorted(asked(here, *ALL)) == sorted(["data", *again, "summary"])
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
    assert asked(here) == ["data", "summary"]


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


# --- Environment -----------------------------------------------------------------------------------------------------


def test_without_a_fitting_python_make_says_so_in_one_line(tmp_path):
    for name in ("Makefile", "environment.lock", "pyproject.toml"):
        shutil.copy(ROOT / name, tmp_path)
    done = make(tmp_path, "PYTHON=python3.11-missing")
    (line,) = done.stderr.splitlines()
    assert "homing: 'python3.11-missing'" in line
    assert "apt-get install" in line
    assert done.returncode != 0
    assert not (tmp_path / ".venv").exists()


@pytest.fixture
def bare(tmp_path) -> Path:
    """A project without an environment, where the first Python that works is 3.12."""
    folder = tmp_path / "here"
    script(folder / "bin/python3.11", "#!/bin/sh\nexit 127\n")  # as pyenv's, for a version that is not chosen
    for minor in (12, 13):
        script(folder / f"bin/python3.{minor}", f'#!/bin/sh\ncase "$2" in *sys*) echo 3.{minor} ;; esac\n')
    for name in ("Makefile", "environment.lock"):
        shutil.copy(ROOT / name, folder)
    return folder


def planned(folder: Path, *arguments: str) -> str:
    """What make would do for an environment."""
    done = run("make", "-n", *arguments, ".venv/.ready", cwd=folder, path=f"{folder}/bin:{os.defpath}")
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_first_python_that_works_is_taken_or_the_one_that_is_named(bare):
    assert planned(bare) == "python3.12 .ci/environment.py .venv environment.lock\n"
    assert planned(bare, "PYTHON=python3.13") == "python3.13 .ci/environment.py .venv environment.lock\n"


def test_an_environment_is_kept_and_one_of_another_python_or_that_was_copied_is_made_anew(bare):
    (bare / ".venv").mkdir()
    (bare / ".venv/.ready").write_text(f"3.12 {bare}\n")
    assert "up to date" in planned(bare)
    assert "environment.py" in planned(bare, "PYTHON=python3.13")
    shutil.copytree(bare, copy := bare.with_name("it's a copy"))
    assert "environment.py" in planned(copy)


PIP = """
import os, sys
if sys.argv[1:] == ["config", "list"]:
    print("global.index-url='https://a'\\nglobal.user='1'\\ninstall.index-url='https://b?c=d'\\n:env:.target='/c'")
else:
    print(*sys.argv[1:], *sorted(name for name in os.environ if name[:4] == "PIP_"), os.environ["PIP_INDEX_URL"])
"""
VENV = "import subprocess, sys\nsubprocess.run([sys.executable, '-Im', 'venv', '--without-pip', *sys.argv[1:]])\n"


def test_an_environment_has_the_library_beside_it_wherever_it_is_copied_and_the_users_sources_alone(tmp_path):
    home = tmp_path / "höme"
    script(home / "homing_lib/__init__.py", "")
    script(home / "pip.py", PIP)  # found here before those of Python
    script(home / "venv.py", VENV)
    here = {"PIP_TARGET": "/c", "LC_ALL": "C"}
    done = run(sys.executable, ROOT / ".ci/environment.py", ".venv", "lock", cwd=home, path=os.defpath, **here)
    assert done.returncode == 0, done.stderr
    said, locked, package = done.stdout.splitlines()
    assert said.startswith(".venv: ")
    settings = "PIP_CONFIG_FILE PIP_DISABLE_PIP_VERSION_CHECK PIP_INDEX_URL https://b?c=d"
    assert locked.endswith(f"--require-hashes -r lock {settings}")
    assert package.endswith(f"--no-deps --no-build-isolation -e . {settings}")
    assert (home / ".venv/.ready").read_text(encoding="utf-8") == f"{VERSION} {home}\n"
    shutil.copytree(home, copy := tmp_path / "cöpy", symlinks=True)
    (copy / "elsewhere").mkdir()
    program = "import homing_lib, os; print(ascii(homing_lib.__file__))"
    found = run(copy / ".venv/bin/python", "-c", program, cwd=copy / "elsewhere", path=os.defpath, LC_ALL="C")
    assert found.stdout == ascii(f"{copy}/homing_lib/__init__.py") + "\n", found.stderr


def installing(folder: Path, user: int, apt: str, *arguments: str) -> tuple[int, list[str], str]:
    """Where LaTeX is missing: the code of its installation, what it says, and what apt-get was asked at last."""
    script(folder / "id", f"#!/bin/sh\necho {user}\n")
    script(folder / "sudo", "#!/bin/sh\nexit 1\n")
    script(folder / "sleep", "#!/bin/sh\n: > slept\n")
    script(folder / "apt-get", f'#!/bin/sh\necho "$*" >> log\n{apt}\n')
    (folder / "env").symlink_to("/usr/bin/env")
    done = run(ROOT / "paper/install-tex.sh", *arguments, cwd=folder, path=str(folder))
    log = folder / "log"
    return done.returncode, done.stderr.splitlines(), log.read_text().splitlines()[-1] if log.exists() else ""


WANTED = "--no-install-recommends latexmk texlive-latex-recommended lmodern"


@pytest.mark.parametrize(("arguments", "more"), [((), ""), (("lectures",), " texlive-pictures")])
def test_without_latex_root_gets_it_and_others_are_told_the_command(arguments, more, tmp_path):
    code, said, asked_last = installing(tmp_path, 0, "[ -e slept ]", *arguments)  # whose lists are locked at first
    assert (code, said) == (0, [])
    assert asked_last.endswith(f" install -q -y {WANTED}{more}")
    (others := tmp_path / "others").mkdir()
    code, (line,), asked_last = installing(others, 1000, "", *arguments)
    assert (code, asked_last) == (1, "")
    assert line.startswith("homing: ")
    assert line.endswith(f"sudo apt-get install {WANTED}{more}")


def test_where_latex_cannot_be_had_that_is_one_line(tmp_path):
    code, (line,), _ = installing(tmp_path, 0, "exit 100")
    assert code == 1
    assert line.startswith("homing: ")


def test_the_lock_pins_every_dependency_by_hash_and_names_no_address():
    lock = (ROOT / "environment.lock").read_text()
    assert not re.search(r"https?://|file:|--(extra-)?index|--find-links", lock)
    packages = re.findall(r"^(\S+)==(\S+)(?: ;.*)? \\\n    --hash=sha256:", lock, flags=re.MULTILINE)
    assert len(packages) == len(re.findall(r"^\w", lock, flags=re.MULTILINE))
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    optional = project["optional-dependencies"]
    wanted = [*project["dependencies"], *optional["camera"], *optional["dev"]]
    names = {re.match(r"[\w-]+", dependency)[0].replace("_", "-") for dependency in wanted}
    assert names <= {name for name, _ in packages}
