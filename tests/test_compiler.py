"""The compiler of the engine: what it made is kept where that can be, and where it is missing all is the same."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import homing_lib
from homing_lib.lambdas import Fixed
from homing_lib.settings import Settings
from homing_lib.study import rules

pytest.importorskip("numba")

HOUSE = Path(homing_lib.__file__).parent
TINY = Settings(images="compact", episodes=2, survey_steps=60, max_steps=80)

SMALL_ENGINE = """
from numba import config, njit
KEPT = bool(config.CACHE_DIR)
@njit(cache=KEPT)
def number():
    return 1
def warm():
    number()
"""


@pytest.fixture
def copy(tmp_path):
    """The library elsewhere, with next to nothing to be compiled; call it to ask in a new process what that returns."""
    shutil.copytree(HOUSE, tmp_path / "homing_lib", ignore=shutil.ignore_patterns("__pycache__"))
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "STUDIES.md").touch()
    source = tmp_path / "homing_lib" / "study" / "compiled.py"
    source.write_text(SMALL_ENGINE, encoding="utf-8")

    def ask(program="from homing_lib.study import engine; print(engine.load().number(), engine.load().KEPT)", **env):
        environment = {name: value for name, value in os.environ.items() if name != "HOMING_ENGINE_SAID"}
        environment |= {"HOME": str(tmp_path / "home"), "PYTHONPATH": str(tmp_path)} | env
        environment["PYTHONDONTWRITEBYTECODE"] = "1"  # Python too goes by a file's age
        command = [sys.executable, "-c", program]
        done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=120)
        return done.stdout.split(), [line for line in done.stderr.splitlines() if "homing: " in line], done.returncode

    ask.folder, ask.source = tmp_path, source
    return ask


COMPILING = ["homing: compiling the engine, once; this may take half a minute"]


def test_a_changed_engine_is_compiled_anew_though_its_file_seems_as_old_and_as_long_and_says_so(copy):
    assert copy() == (["1", "True"], COMPILING, 0)
    before = copy.source.stat()
    copy.source.write_text(SMALL_ENGINE.replace("return 1", "return 2"), encoding="utf-8")
    os.utime(copy.source, ns=(before.st_atime_ns, before.st_mtime_ns))
    assert copy.source.stat().st_size == before.st_size
    program = "import numba; from homing_lib.study import engine; print(engine.load().number(), numba.config.CACHE_DIR)"
    theirs = str(copy.folder / "theirs")  # numba's own settings stay as they are
    for said in (COMPILING, []):
        assert copy(program, NUMBA_CACHE_DIR=theirs) == (["2", theirs], said, 0)
    assert len(list((copy.folder / ".build" / "numba").iterdir())) == 2


def test_where_the_checkout_cannot_be_written_the_users_folder_keeps_what_is_compiled_and_else_nothing_does(copy):
    (copy.folder / ".build").touch()  # a file, in which there can be no folder
    assert copy() == (["1", "True"], COMPILING, 0)
    assert list((copy.folder / "home").rglob("*.nbi"))
    answer, (line,), code = copy(HOME=os.devnull, XDG_CACHE_HOME=os.devnull)
    assert (answer, code) == (["1", "False"], 0)
    assert line.startswith(f"homing: compiled code cannot be kept in {os.devnull}")


@pytest.mark.parametrize("broken", ["numba", "the engine"])
def test_without_a_compiler_all_is_the_same_and_slower_and_that_is_said_once(copy, broken):
    if broken == "the engine":
        copy.source.write_text("raise RuntimeError('no such machine')", encoding="utf-8")
    answer, said, code = copy(
        f"import sys; sys.modules.update({{'numba': None}} if {broken == 'numba'} else {{}})\n"
        "from homing_lib.settings import Settings\nfrom homing_lib.study import rules\n"
        "from homing_lib.lambdas import Fixed\n"
        f"tiny = Settings(**{TINY.model_dump()!r})\n"
        "for _ in range(2):\n    print(rules.compare({'a': Fixed(0.5)}, [3, 4], tiny).steps['a'].sum())"
    )
    expected = rules.compare({"a": Fixed(0.5)}, [3, 4], TINY).steps["a"].sum()
    assert (answer, code) == ([str(expected)] * 2, 0)
    (line,) = [line for line in said if line not in COMPILING]
    assert line.endswith("ten times as long; their results are the same")
