"""Environments and LaTeX are set up where they are missing, from the user's sources alone, or one line says how."""

import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from tests.test_makefile import ROOT, VERSION, make, run, script


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


# --- LaTeX and git of a user's own -----------------------------------------------------------------------------------


@pytest.mark.skipif(not (shutil.which("kpsewhich") and shutil.which("make")), reason="needs LaTeX and make")
def test_a_users_own_latex_is_not_in_what_make_typesets(tmp_path):
    for own in ("texmf/tex/latex", "inputs"):
        (tmp_path / own).mkdir(parents=True)
        (tmp_path / own / "caption.sty").touch()
    hostile = {"HOME": str(tmp_path), "TEXMFHOME": f"{tmp_path}/texmf", "TEXINPUTS": f"{tmp_path}/inputs:"}
    look = ["make", "--eval=found: ; @kpsewhich caption.sty", "found"]
    shutil.copy(ROOT / "Makefile", tmp_path)
    # Not as a part of the make that runs the tests, which would name the folder.
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("MAKE", "MFLAGS"))}
    environment |= hostile
    found = subprocess.run(look, cwd=tmp_path, env=environment, capture_output=True, text=True, check=True).stdout
    assert found.strip().endswith("caption.sty")
    assert str(tmp_path) not in found


@pytest.mark.skipif(not (shutil.which("git") and (ROOT / ".git").exists()), reason="needs a clone")
def test_in_every_checkout_text_has_the_ends_of_lines_that_sh_and_make_read():
    listing = ["git", "-c", "safe.directory=*", "ls-files", "--eol"]
    listed = subprocess.run(listing, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    assert [line for line in listed.splitlines() if "attr/-text" not in line or "crlf" in line] == []
