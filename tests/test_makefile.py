"""The build remakes what changed and nothing else, and says in one line what is missing."""

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

ROOT = Path(__file__).parent.parent

# Stands in for .venv/bin/python: logs what it is asked to do, and writes what `homing` would.
PYTHON = """#!/bin/sh
shift 2
echo "${*:-page}" >> log
case ${1:-page} in
    page) mkdir -p notebooks/executed; touch notebooks/executed/demo.html ;;
    data) [ -e "$3" ] || touch "$3" ;;
    notebook) echo drawn > "figures/$2.pdf"; echo "figures/$2.pdf" ;;
    numbers) echo numbers ;;
esac
"""


def script(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    path.chmod(0o755)


def run(*command: str | Path, cwd: Path, path: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command, cwd=cwd, env={"PATH": path}, capture_output=True, text=True, check=False)


@pytest.fixture
def make(tmp_path):
    """Runs make in a project of two notebooks, with stand-ins for Python and LaTeX; returns what these were asked."""
    shutil.copy(ROOT / "Makefile", tmp_path)
    script(tmp_path / ".venv/bin/python", PYTHON)
    script(tmp_path / "bin/latexmk", "#!/bin/sh\necho report >> log\ntouch .build/paper/report.pdf\n")
    script(tmp_path / "paper/install-tex.sh", "#!/bin/sh\n")
    for name in ("homing_lib", "figures", "notebooks"):
        (tmp_path / name).mkdir()
    for name in ("homing_lib/td.py", "notebooks/01-a.ipynb", "notebooks/02-b.ipynb", "paper/report.tex"):
        (tmp_path / name).touch()
    version = f"{sys.version_info.major}.{sys.version_info.minor}"
    for name in ("environment.lock", "pyproject.toml", f".venv/.locked-{version}", ".venv/.ready"):
        (tmp_path / name).touch()

    def make(*arguments: str) -> list[str]:
        (tmp_path / "log").write_text("")
        path = f"{tmp_path}/bin:{os.environ['PATH']}"
        done = run("make", f"PYTHON={sys.executable}", "-j1", *arguments, cwd=tmp_path, path=path)
        assert done.returncode == 0, done.stderr
        return [line.partition(" --stamp")[0] for line in (tmp_path / "log").read_text().splitlines()]

    return make


def later(path: Path) -> None:
    """Changed just now, on file systems of any resolution and however long it took to come here."""
    now = time.time_ns() + 10**9
    os.utime(path, ns=(now, now))


ONE_BY_ONE = ["data", "verify", "summary", "numbers --latex", "notebook 01-a", "notebook 02-b", "report", "page"]


def test_a_fresh_clone_makes_everything_and_a_second_make_nothing(make):
    assert make() == ONE_BY_ONE
    assert make() == ["data"]


def test_two_at_a_time_nothing_is_made_twice_or_left_out(make):
    assert sorted(make("-j2")) == sorted(ONE_BY_ONE)


def test_a_touched_notebook_remakes_itself_and_the_report_only(make, tmp_path):
    make()
    later(tmp_path / "notebooks/02-b.ipynb")
    assert make() == ["data", "numbers --latex", "notebook 02-b", "report"]  # whose last pages list what notebooks draw


def test_a_touched_lecture_sets_its_slides_and_its_notes_anew_and_no_other(make, tmp_path):
    script(
        tmp_path / "bin/latexmk",
        """#!/bin/sh
        case "$*" in *-jobname=*) notes=-notes ;; *) notes= ;; esac
        for source; do :; done
        made=.build/lectures/$(basename "$source" .tex)$notes
        echo "$made" >> log
        touch "$made.pdf"
        """,
    )
    for name in ("one", "preamble", "two"):
        (tmp_path / "paper/lectures").mkdir(exist_ok=True)
        (tmp_path / f"paper/lectures/{name}.tex").touch()
    made = [f".build/lectures/{name}" for name in ("one", "one-notes", "two", "two-notes")]
    assert make("lectures") == ["data", "numbers --latex", "notebook 01-a", "notebook 02-b", *made]
    assert make("lectures") == ["data"]
    (tmp_path / f"{made[1]}.pdf").unlink()
    assert make("lectures") == ["data", *made[:2]]
    later(tmp_path / "paper/lectures/two.tex")  # whose numbers may be others
    assert make("lectures") == ["data", "numbers --latex", *made]


def test_changed_data_remake_all_that_reads_them(make, tmp_path):
    make()
    later(tmp_path / ".build/data")
    assert make("paper") == ["data", "numbers --latex", "notebook 01-a", "notebook 02-b", "report"]


def test_a_deleted_figure_is_made_again(make, tmp_path):
    make()
    (tmp_path / "figures/01-a.pdf").unlink()
    assert "notebook 01-a" in make()
    assert (tmp_path / "figures/01-a.pdf").exists()


@pytest.mark.parametrize(
    ("file", "again"),
    [
        ("figures/01-a.pdf", "notebook 01-a"),
        ("paper/numbers.tex", "numbers --latex"),
        (".build/notebooks/01-a", "notebook 01-a"),
    ],
)
def test_a_truncated_product_or_stamp_is_not_taken_for_made(make, tmp_path, file, again):
    make()
    whole = (tmp_path / file).read_bytes()
    (tmp_path / file).write_bytes(whole[:-2])
    assert again in make()
    assert (tmp_path / file).read_bytes() == whole
    assert make() == ["data"]


@pytest.mark.parametrize("stamp", ["data", "verified", "numbers", "notebooks/01-a"])
def test_a_folder_in_the_place_of_a_stamp_is_not_taken_for_one(make, tmp_path, stamp):
    make()
    (tmp_path / ".build" / stamp).unlink()
    (tmp_path / ".build" / stamp).mkdir()
    make()
    assert (tmp_path / ".build" / stamp).is_file()


def test_a_truncated_report_is_made_again(make, tmp_path):
    script(tmp_path / "bin/latexmk", "#!/bin/sh\necho pages > .build/paper/report.pdf\n")
    make()
    (tmp_path / "paper/report.pdf").write_text("pa")
    make()
    assert (tmp_path / "paper/report.pdf").read_text() == "pages\n"


def test_a_report_that_came_with_git_pull_stays_until_the_report_is_made_again(make, tmp_path):
    make()
    (tmp_path / "paper/report.pdf").write_text("pulled")
    make("notebooks")
    assert (tmp_path / "paper/report.pdf").read_text() == "pulled"


def test_without_a_fitting_python_make_says_so_in_one_line(tmp_path):
    for name in ("Makefile", "environment.lock", "pyproject.toml"):
        shutil.copy(ROOT / name, tmp_path)
    done = run("make", "-j1", "PYTHON=python3.11-missing", cwd=tmp_path, path=os.environ["PATH"])
    assert done.returncode != 0
    assert (
        "homing: 'python3.11-missing' is no Python 3.11, 3.12 or 3.13 with venv; on Debian: apt-get install"
        in done.stderr
    )
    assert len(done.stderr.splitlines()) == 2  # the second is make's own
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
    assert "compiling it takes 7 minutes" in plan
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
    ("asked", "needs", "more"),
    [((), "the report needs", ""), (("lectures",), "the lectures need", " texlive-pictures")],
    ids=["report", "lectures"],
)
def test_without_latex_root_gets_it_and_others_are_told_the_command(asked, needs, more, user, tmp_path):
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
        assert done.stderr == f"homing: {needs} LaTeX; run: sudo apt-get install {packages}\n"
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
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert line.startswith("homing: the packages of LaTeX cannot be listed; all but the report is made")


def test_notebooks_run_under_the_settings_of_the_makefile():
    makefile = (ROOT / "Makefile").read_text()
    for name, value in REPRODUCIBLE.items():
        assert f"export {name} := {value}\n" in makefile


def test_the_lock_pins_every_dependency_by_hash_and_names_no_address():
    lock = (ROOT / "environment.lock").read_text()
    assert not re.search(r"https?://|file:|--(extra-)?index|--find-links", lock)
    packages = re.findall(r"^(\S+)==(\S+)(?: ;.*)? \\\n    --hash=sha256:", lock, flags=re.MULTILINE)
    assert len(packages) == len(re.findall(r"^\w", lock, flags=re.MULTILINE))
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    wanted = [
        *project["dependencies"],
        *(one for name in ("camera", "dev") for one in project["optional-dependencies"][name]),
    ]
    names = {re.match(r"[\w-]+", dependency)[0].replace("_", "-") for dependency in wanted}
    assert names <= {name for name, _ in packages}
