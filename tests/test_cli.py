"""The command: what each verb answers, and that a mistake is one line that names the remedy."""

import io
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from homing_lib.__main__ import homing, main
from homing_lib.settings import Settings
from homing_lib.storage import ROOT
from homing_lib.study import findings, runs, studies, sweep
from homing_lib.study.questions.printed import LETTER
from homing_lib.study.runs import Study, load

TINY = {"images": "compact", "episodes": 2, "survey_steps": 20, "max_steps": 10}
RUN = ["run", *(f"--set={name}={value}" for name, value in TINY.items())]
HOMING = [sys.executable, "-m", "homing_lib"]
ENDLESS = [*HOMING, *RUN, "--set=episodes=100000"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["run", "--set", "alpha0=-1"], ("alpha0 = '-1'", "greater than or equal to 0.000000001")),
        (["run", "--set", "lambda_rule=fletcher-reves"], ("lambda_rule", "did you mean fletcher-reeves?")),
        (["run", "--set", "alpha=1"], ("setting alpha", "did you mean alpha0?")),
        (["run", "--set", "colour=red"], ("colour", "`homing settings`")),
        (["run", "--set", "alpha0"], ("alpha0", "NAME=VALUE")),
        (["run", "--set", "=1"], ("=1", "NAME=VALUE")),
        (["run", "--set", "a\nb=1"], ("setting a",)),
        (["run", "--set", "room=attik"], ("attik", "did you mean attic?")),
        (["run", "--set", "images=compact", "--set", "room=attic"], ('images="atlas"', "PyBullet")),
        (["run", "--seed", "first"], ("--seed", "first", "`homing run --help`")),
        (["run", "--seed=-1"], ("--seed", "-1", "0<=x")),
        (["run", "--seed", "9" * 5000], ("--seed", "`homing run --help`")),
        (["run", "--sed", "1"], ("--sed", "--seed")),
        (["run", "--out"], ("--out",)),
        (["run", "--out", "\0"], ("?", "another name")),
        (["film", "--episode", "1.5"], ("--episode", "1.5")),
        (["data", "headlin"], ("'headlin'", "`homing studies`", "did you mean headline?")),
        (["data", "headline", "--workers", "0"], ("--workers", "-1")),
        (["data", "headline", "--workers", "1000000"], ("--workers", "1000000", "x<=")),
        (["data", "headline", "--stamp", "x"], ("--stamp", "NAME")),
        (["claims", "C8", "varing"], ("'varing'", "did you mean varying?")),
        (["errata", "E3", "E99"], ("'E99'", "E1 to E")),
        (["where", "drivs"], ("'drivs'", "worth-map", "did you mean drives?")),
        (["notebook", "99-nothing"], ("99-nothing", "03-homing")),
        (["notebook", "03-homing", "--profile", "slow"], ("--profile", "'quick'")),
        (["notebook", "y" * 2000], ("yyy", "choose another")),
        (["dta"], ("'dta'", "Did you mean 'data'?", "`homing --help`")),
        (["\x1b[2J\udcff"], ("No such command",)),
        (["--fast"], ("--fast", "`homing --help`")),
        ([], ("command", "`homing --help`")),
    ],
    ids=lambda value: " ".join(value)[:40].encode("unicode_escape").decode(),
)
def test_a_mistake_is_one_line_that_names_what_is_wrong_and_the_remedy(arguments, words, capsys):
    assert main(arguments) == 1
    output, errors = capsys.readouterr()
    (line,) = errors.splitlines()
    assert output == ""
    assert line.startswith("homing: ")
    assert line.isprintable()
    assert len(line) < 900
    assert [word for word in words if word not in line] == []


def test_where_a_run_cannot_be_stored_it_is_not_begun(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("homing_lib.agent.run", None)
    (tmp_path / "file").touch()
    for out in (tmp_path, tmp_path / "file" / "run.npz", Path("/dev/null/run.npz")):
        assert main([*RUN, "--out", str(out)]) == 1
        (line,) = capsys.readouterr().err.splitlines()
        assert line.startswith(f"homing: {out}: ")


def test_one_run_prints_its_episodes_and_is_stored_where_it_is_told(tmp_path, capsys):
    path = tmp_path / "new folder" / "run.npz"
    assert main([*RUN, "--seed", "3", "--out", str(path)]) == 0
    assert capsys.readouterr().out == "steps per episode: 10 10\nhome reached in 0 of 2 episodes\n"
    stored = load(path)
    assert (stored.seed, stored.settings) == (3, Settings(**TINY))


def test_one_run_as_printed_begins_with_the_letter_and_changes_from_there(tmp_path):
    assert main([*RUN, "--as-printed", "--set", "tau0=0.03", "--out", str(tmp_path / "run.npz")]) == 0
    changed = TINY | {"tau0": 0.03}
    assert load(tmp_path / "run.npz").settings == LETTER.with_changes(**changed) != Settings(**changed)


def test_one_run_that_diverges_says_in_which_episode(capsys):
    wild = ["lambda_rule=fixed:1", "alpha0=1e9", "theta0=1e9", "max_steps=400"]
    assert main([*RUN, *(f"--set={change}" for change in wild)]) == 0
    assert "diverged in episode 1\n" in capsys.readouterr().out


def test_all_settings_are_listed_with_default_and_source(capsys):
    assert main(["settings"]) == 0
    lines = capsys.readouterr().out.splitlines()
    for line, (name, field) in zip(lines, Settings.model_fields.items(), strict=True):
        assert re.fullmatch(rf"{name} +{re.escape(str(field.default))} +{re.escape(field.description)}", line)


def test_all_studies_are_listed_with_their_reason(capsys):
    assert main(["studies"]) == 0
    lines = capsys.readouterr().out.splitlines()
    named = [re.fullmatch(r"([\w-]+) +\d+ conditions x +\d+ seeds  \w.*", line)[1] for line in lines]
    assert named == [study.name for study in studies.in_order()]


def test_help_says_of_every_verb_what_it_does_and_loads_no_numerical_library():
    program = "import sys\nfrom homing_lib.__main__ import main\nmain(['--help'])\nsys.exit('pandas' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert done.returncode == 0
    assert re.findall(r"^  (\w+)  +\w", done.stdout, re.M) == list(homing.commands)


@pytest.mark.parametrize(
    ("verb", "module"),
    [("demo", "homing_lib.publish.demo"), ("site", "homing_lib.publish.site"), ("lab", "homing_lib.teach.handouts")],
)
def test_a_builder_has_a_verb(verb, module, monkeypatch):
    written = []
    monkeypatch.setattr(f"{module}.write", lambda: written.append(module) or [])
    assert main([verb]) == 0
    assert written == [module]


# --- Data ------------------------------------------------------------------------------------------------------------


@pytest.fixture
def two_studies(tmp_path, monkeypatch):
    """Two studies of a project in `tmp_path`; returns the sweeps that are asked for, by name and options."""
    asked = []

    def swept(study, **options):
        asked.append((study.name, {name: value for name, value in options.items() if value not in (-1, False)}))
        return 7

    listed = [Study(name, "Why.", {"all": Settings(**TINY)}, range(3)) for name in ("one", "two")]
    monkeypatch.setattr(sweep, "sweep", swept)
    monkeypatch.setattr(runs, "SCRATCH", tmp_path / "scratch")  # which --force removes
    monkeypatch.setattr(studies, "in_order", lambda: iter(listed))
    monkeypatch.setattr(studies, "page", lambda: "the page\n")
    monkeypatch.setattr(studies, "PAGE", tmp_path / "STUDIES.md")
    monkeypatch.setattr(runs, "fingerprint", lambda _: "all data")
    monkeypatch.setattr(findings, "judge_all", lambda _: asked.append(("judged", {})))
    return asked


def test_all_data_are_swept_in_order_and_then_judged(two_studies, tmp_path):
    for path in (tmp_path / "STUDIES.md", tmp_path / "stamp"):
        path.write_bytes(b"\xff\xfe")  # whatever stood there, it is written anew
    assert main(["data", "--force", "--stamp", str(tmp_path / "stamp")]) == 0
    assert two_studies == [("one", {"force": True}), ("two", {"force": True}), ("judged", {})]
    assert (tmp_path / "stamp").read_text() == "all data\n"
    assert (tmp_path / "STUDIES.md").read_text() == "the page\n"


def test_the_data_of_names_are_swept_alone_if_all_are_known(two_studies, capsys):
    assert main(["data", "two", "--workers", "2"]) == 0
    assert capsys.readouterr().out == "two: 7 runs computed, 3 stored\n"
    assert main(["data", "two", "one"]) == 0
    assert main(["data", "tow", "one"]) == 1
    assert "did you mean two?" in capsys.readouterr().err
    assert two_studies == [("two", {"workers": 2}), ("one", {}), ("two", {})]


INSTALLED = """
import sys
from homing_lib.publish.cli import main
from homing_lib.study import runs, studies
commands = ("settings", "summary", "verify", "data", "data headline", "notebook 03-homing")
assert [main(command.split()) for command in commands] == [0, *[1] * 5]
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
    files = ["data/headline", "data/headline", *["Makefile"] * 2, "notebooks", "data/calibration.parquet"]
    lines = done.stderr.splitlines()
    assert len(lines) == len(files), done.stderr
    for line, file in zip(lines, files, strict=True):
        assert line.startswith(f"homing: {here / file}")
        assert "clone" in line
    assert list(here.iterdir()) == []


# --- Streams and interruptions ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("encoding", ["ascii", "cp1252"])
def test_an_output_of_any_encoding_takes_what_is_printed(encoding, monkeypatch):
    monkeypatch.setattr("homing_lib.publish.report.summary", lambda: "λ varies")
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(io.BytesIO(), encoding, newline=""))
    assert main(["summary"]) == 0
    assert sys.stdout.buffer.getvalue() == b"\\u03bb varies\n"


@pytest.mark.parametrize(
    ("shell", "code", "output", "errors"),
    [
        ("settings >&-", 0, False, False),
        ("settings 2>&-", 0, True, False),
        ("summary 2>&-", 0, True, False),
        ("fly >&-", 1, False, True),
        ("fly 2>&-", 1, False, False),
        ("settings <&- >&- 2>&-", 0, False, False),
        ("settings >/dev/full", 1, False, True),
        ("claims >/dev/full", 1, False, True),
        ("run --set alpha0=-1", 1, False, True),
    ],
)
def test_from_a_shell_closed_and_full_outputs_leave_at_most_one_line(shell, code, output, errors):
    command = f'exec "$0" -m homing_lib {shell}'
    done = subprocess.run(["sh", "-c", command, sys.executable], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == code, done.stderr
    assert (done.stdout != "") is output
    assert re.fullmatch(r"homing: .+\n" if errors else "", done.stderr)


def test_an_interrupt_from_the_keyboard_ends_a_run_with_code_130_and_says_that_it_resumes():
    process = subprocess.Popen(ENDLESS, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
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
    last = errors.decode().replace("\r", "\n").strip().splitlines()[-1]
    assert (process.returncode, output) == (130, b"")
    assert b"Traceback" not in errors
    assert last.startswith("homing: interrupted")
    assert "resumes" in last


@pytest.mark.parametrize("moment", [0.3, 0.8])
def test_an_interrupt_while_the_command_is_loaded_leaves_no_traceback(moment):
    process = subprocess.Popen(ENDLESS, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    try:
        time.sleep(moment)
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=60)
    finally:
        process.kill()
    assert process.returncode in (130, -signal.SIGINT)
    assert b"Traceback" not in errors


@pytest.mark.parametrize("verb", ["settings", "claims"])  # short enough for a buffer, and longer
def test_a_reader_that_has_had_enough_ends_the_command_without_a_word(verb):
    reading, writing = os.pipe()
    os.close(reading)
    ended = subprocess.run([*HOMING, verb], stdout=writing, stderr=subprocess.PIPE, text=True, timeout=60)
    os.close(writing)
    assert (ended.returncode, ended.stderr) == (141, "")
