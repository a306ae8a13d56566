import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from homing_lib.publish.cli import main
from homing_lib.settings import Settings
from homing_lib.study.questions.printed import LETTER
from homing_lib.study.runs import load

ROOT = Path(__file__).parent.parent
TINY = ["--set", "images=compact", "--set", "episodes=2", "--set", "survey_steps=20", "--set", "max_steps=10"]


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        ("run --set alpha0=-1", "setting alpha0 = '-1': Input should be greater than or equal to 0.000000001"),
        ("run --set lambda_rule=steepest", "setting lambda_rule = 'steepest': unknown lambda rule 'steepest'; known: "),
        ("run --set colour=red", "setting colour: there is none of this name; `homing settings` lists them"),
        ("run --set alpha0", "--set alpha0: expected NAME=VALUE"),
        ("run --set room=cellar", "room 'cellar': there is none of this name; known are paper, "),
        ("run --seed first", "argument --seed: 'first': must be 0, 1, 2, ...; see `homing run --help`"),
        ("run --seed=-1", "argument --seed: '-1': must be 0, 1, 2, ...; see `homing run --help`"),
        (
            "sweep headline --workers 0",
            "argument --workers: '0': must be 1, 2, ... processes, or -1 for one per core",
        ),
        ("run --sed 1", "unrecognized arguments: --sed 1; see `homing --help`"),
        ("fly", "argument COMMAND: invalid choice: 'fly' (choose from 'run', "),
        ("", "the following arguments are required: COMMAND; see `homing --help`"),
        ("sweep everything", "study 'everything': there is none of this name; `homing studies` lists them"),
    ],
)
def test_a_mistake_is_answered_in_one_line_and_a_code_that_is_not_zero(arguments, line, capsys):
    assert main(arguments.split()) == 1
    output, errors = capsys.readouterr()
    assert output == ""
    assert errors.startswith(f"homing: {line}")
    assert errors.count("\n") == 1


def test_from_a_shell_too_a_mistake_is_one_line_without_a_traceback():
    command = [sys.executable, "-m", "homing_lib", "run", "--set", "alpha0=-1"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stdout == ""
    assert done.stderr == "homing: setting alpha0 = '-1': Input should be greater than or equal to 0.000000001\n"


def test_a_file_that_cannot_be_written_is_named_in_one_line(capsys):
    assert main(["run", *TINY, "--out", "/dev/null/run.npz"]) == 1
    last = capsys.readouterr().err.splitlines()[-1]
    assert re.match(r"homing: .*/dev/null", last)


def test_a_long_name_is_shortened_and_the_remedy_is_still_there(capsys):
    assert main(["notebook", "y" * 2000]) == 1
    line = capsys.readouterr().err
    assert len(line) < 900
    assert line.endswith("yyy.ipynb: cannot be used (File name too long); move it away or choose another\n")


def test_one_run_prints_its_episodes_and_is_stored_where_it_is_told(tmp_path, capsys):
    path = tmp_path / "new folder" / "run.npz"
    assert main(["run", "--seed", "3", *TINY, "--out", str(path)]) == 0
    assert capsys.readouterr().out == "steps per episode: 10 10\nhome reached in 0 of 2 episodes\n"
    stored = load(path)
    assert (stored.seed, stored.settings) == (3, Settings(images="compact", episodes=2, survey_steps=20, max_steps=10))


def test_one_run_as_printed_begins_with_the_letter_and_changes_from_there(tmp_path):
    assert main(["run", "--as-printed", *TINY, "--set", "tau0=0.03", "--out", str(tmp_path / "run.npz")]) == 0
    tiny = dict(images="compact", episodes=2, survey_steps=20, max_steps=10, tau0=0.03)
    assert load(tmp_path / "run.npz").settings == LETTER.with_changes(**tiny) != Settings(**tiny)


def test_one_run_that_diverges_says_in_which_episode(capsys):
    setting = ["--set", "lambda_rule=fixed:1", "--set", "alpha0=1e9", "--set", "theta0=1e9", "--set", "max_steps=400"]
    assert main(["run", *TINY, *setting]) == 0
    assert "diverged in episode 1\n" in capsys.readouterr().out


def test_all_settings_are_listed_with_default_and_source(capsys):
    assert main(["settings"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == list(Settings.model_fields)
    for line, (name, field) in zip(lines, Settings.model_fields.items(), strict=True):
        assert re.fullmatch(rf"{name} +{re.escape(str(field.default))} +{re.escape(field.description)}", line)


def test_all_studies_are_listed_with_their_reason(capsys):
    assert main(["studies"]) == 0
    lines = capsys.readouterr().out.splitlines()
    named = [re.fullmatch(r"([\w-]+) +\d+ conditions x +\d+ seeds  \w.*", line)[1] for line in lines]
    assert len({*named}) == len(named)
    assert {"headline", "calibration", "finalists", "varying", "worth-everywhere"} <= {*named}


INSTALLED = """
import sys
from homing_lib.publish.cli import main
from homing_lib.study import runs, studies
assert [main(command.split()) for command in ("settings", "summary", "verify", "notebook 03-homing")] == [0, 1, 1, 1]
try:
    runs.load_table(studies.CALIBRATION)
except runs.UserError as error:
    sys.exit(f"homing: {error}")
"""


def test_installed_without_its_repository_the_package_says_in_one_line_what_is_missing_and_where_it_looked(tmp_path):
    shutil.copytree(ROOT / "homing_lib", tmp_path / "site" / "homing_lib", ignore=shutil.ignore_patterns("__pycache__"))
    here = tmp_path / "here"
    here.mkdir()
    done = subprocess.run(
        [sys.executable, "-c", INSTALLED],
        cwd=here,
        env=os.environ | {"PYTHONPATH": str(tmp_path / "site")},
        capture_output=True,
        text=True,
        check=False,
    )
    files = ["data/headline", "data/headline", "notebooks", "data/calibration.parquet"]
    lines = done.stderr.splitlines()
    assert len(lines) == len(files), done.stderr
    for line, file in zip(lines, files, strict=True):
        assert line.startswith(f"homing: {here / file}")
        assert f": missing, for neither {here} nor a folder above it, nor where homing_lib is installed, is a" in line
        assert line.endswith("; clone it and work there")
    assert list(here.iterdir()) == []


def test_an_interrupt_from_the_keyboard_ends_a_run_with_code_130_and_one_line():
    process = subprocess.Popen(
        [sys.executable, "-m", "homing_lib", "run", *TINY, "--set", "episodes=100000"],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    try:
        seen = b""
        deadline = time.monotonic() + 120
        while b"episode/s" not in seen:  # it is learning
            assert time.monotonic() < deadline
            seen += process.stderr.read1()
        process.send_signal(signal.SIGINT)
        output, errors = process.communicate(timeout=60)
    finally:
        process.kill()
    assert process.returncode == 130
    assert output == b""
    assert b"Traceback" not in errors
    last = errors.decode().replace("\r", "\n").strip().splitlines()[-1]
    assert last == "homing: interrupted; what was finished is kept; the same command resumes from there"


def test_where_a_run_cannot_be_stored_it_is_not_begun(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("homing_lib.agent.run", None)
    for out in (tmp_path, tmp_path / "file" / "run.npz"):
        (tmp_path / "file").touch()
        assert main(["run", *TINY, "--out", str(out)]) == 1
        (line,) = capsys.readouterr().err.splitlines()
        assert line.startswith(f"homing: {out}: cannot be written (")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["sweep", "headline", "--workers", "1000000"], "must be at most "),
        (["run", "--seed", "9" * 5000], "at most 18 digits"),
        (["run", "--set", "=1"], "--set =1: expected NAME=VALUE"),
        (["run", "--set", "a\nb=1"], "setting a"),
        (["run", "--set", "alpha=1"], "did you mean alpha0?"),
        (["run", "--set", "room=attik"], "did you mean attic?"),
        (["run", "--set", "lambda_rule=fletcher-reves"], "did you mean fletcher-reeves?"),
        (["sweep", "headlin"], "did you mean headline?"),
        (["report"], "invalid choice: 'report'"),
        (["run", "--set", "images=compact", "--set", "room=attic"], 'use images="atlas", which needs PyBullet'),
    ],
)
def test_a_line_is_one_line_short_and_names_the_remedy_or_the_nearest(arguments, said, capsys):
    assert main(arguments) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert said in line
    assert len(line) < 500


def test_what_is_not_utf_8_in_the_page_of_studies_or_the_stamp_is_written_anew(tmp_path, monkeypatch):
    from homing_lib.study import findings, studies

    page, stamp = tmp_path / "STUDIES.md", tmp_path / "stamp"
    monkeypatch.setattr(studies, "PAGE", page)
    monkeypatch.setattr(studies, "page", lambda: "the page\n")
    monkeypatch.setattr(studies, "in_order", lambda: iter(()))
    monkeypatch.setattr(findings, "FILE", tmp_path / "findings.json")
    monkeypatch.setattr(findings, "questions", dict)
    for path in (page, stamp):
        path.write_bytes(b"\xff\xfe")
    assert main(["data", "--stamp", str(stamp)]) == 0
    assert page.read_text(encoding="utf-8") == "the page\n"
    assert len(stamp.read_text(encoding="utf-8")) == 65


@pytest.mark.parametrize("moment", [0.3, 0.8])
def test_an_interrupt_while_the_command_is_loaded_leaves_no_traceback(moment):
    process = subprocess.Popen(
        [sys.executable, "-m", "homing_lib", "run", *TINY, "--set", "episodes=100000"],
        cwd=ROOT,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
    )
    try:
        time.sleep(moment)
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=60)
    finally:
        process.kill()
    assert process.returncode in (130, -signal.SIGINT)
    assert b"Traceback" not in errors


def test_a_reader_that_has_had_enough_ends_the_command_without_a_word():
    reading, writing = os.pipe()
    os.close(reading)
    command = [sys.executable, "-m", "homing_lib", "settings"]
    ended = subprocess.run(command, stdout=writing, stderr=subprocess.PIPE, text=True, timeout=60)
    os.close(writing)
    assert (ended.returncode, ended.stderr) == (141, "")
