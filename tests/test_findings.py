"""What is asked is judged by its tables, stored, read back, and judged anew only when it would come out otherwise."""

import ast
import importlib.util
import json
import pkgutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import homing_lib.study.questions
from homing_lib.errors import UserError
from homing_lib.study import findings, runs, studies, sweep
from homing_lib.study.bootstrap import Interval
from homing_lib.study.findings import Comparison

ASKED = findings.questions()
STUDY = Path(findings.__file__).parent
FILES = {one.name for one in pkgutil.iter_modules(homing_lib.study.questions.__path__)}

SOURCE = '''
from homing_lib.settings import Settings
from homing_lib.study.findings import bound, estimate, of, question, steps
from homing_lib.study.measures import curve
from homing_lib.study.runs import Study

SMALL = Settings(images="compact", episodes=2, survey_steps=20, max_steps=10)
FLIGHTS = Study("flights", "Why not?", {"a": SMALL, "b": SMALL.with_changes(alpha0=1.0)}, range(3), curve)
JUDGED = []

@question("flies", "Does it fly?", """Yes, if it takes
    ten steps.""", FLIGHTS)
def flies(table):
    JUDGED.append(len(table))
    taken = table[table.condition == "a"].groupby("seed").steps.sum().to_numpy(float)
    found = {"of b": steps(taken, taken, comparisons=2), "steps": estimate(taken)}
    return "yes" if found["steps"].value == 20 else "no", found

@question("C2", "Claims come after.", "By construction.")
def arithmetic():
    return "by construction", {}
'''


@pytest.fixture
def asked(tmp_path, monkeypatch):
    """Call it with the source of a file of questions, and it is the only one; its tables are computed."""
    monkeypatch.setattr(runs, "DATA", tmp_path / "data")
    monkeypatch.setattr(runs, "SCRATCH", tmp_path / "scratch")
    monkeypatch.setattr(findings, "FILE", tmp_path / "data" / "findings.json")
    monkeypatch.setattr(findings, "_QUESTIONS", {})
    findings.stored.cache_clear()

    def ask(source=SOURCE):
        findings._QUESTIONS.clear()
        path = tmp_path / "asked_here.py"
        path.write_text(source, encoding="utf-8")
        spec = importlib.util.spec_from_file_location("asked_here", path)
        module = importlib.util.module_from_spec(spec)
        monkeypatch.setitem(sys.modules, "asked_here", module)
        exec(source, module.__dict__)
        sweep.sweep(module.FLIGHTS, workers=1)
        return module

    yield ask
    findings.stored.cache_clear()


def test_a_question_is_judged_stored_and_read_back(asked):
    module = asked()
    with pytest.raises(UserError, match=r"findings\.json: missing; `make data` judges$"):
        findings.stored()
    findings.judge_all()
    found = findings.finding("flies")
    assert list(findings.stored()) == ["flies", "C2"]
    assert (found.verdict, found.question.text, found.question.predicate) == (
        "yes",
        "Does it fly?",
        "Yes, if it takes ten steps.",
    )
    assert found["of b"] == Comparison(1, 1, 1, "the same", 2)
    assert found["steps"] == Comparison(20, 20, 20)
    assert found == findings.judge("flies")
    assert module.JUDGED == [12, 12]
    assert findings.verdicts() == {"flies": "yes", "flies.of b": "the same", "C2": "by construction"}
    assert findings.table(["flies"]).splitlines()[-1] == "| flies | Does it fly? | **yes** |"
    told = findings.as_text(found).splitlines()
    assert told[:2] == ["flies: Does it fly? yes", "  Predicate: Yes, if it takes ten steps."]
    assert [line.split() for line in told[2:]] == [
        ["*", "of", "b", "1.00", "[1.00,", "1.00]", "the", "same,", "tells", "1.00"],
        ["steps", "20", "[20,", "20]"],
    ]


def test_it_is_judged_anew_when_its_table_or_its_judge_changes_and_only_then(asked):
    module = asked()
    findings.judge_all()
    before = findings.FILE.stat().st_mtime_ns
    findings.judge_all()
    assert (module.JUDGED, findings.FILE.stat().st_mtime_ns) == ([12], before)
    more = replace(module.FLIGHTS, seeds=range(4))
    sweep.sweep(more, workers=1)
    findings._QUESTIONS["flies"] = findings._QUESTIONS["flies"]._replace(studies=(more,))
    findings.judge_all()
    assert module.JUDGED == [12, 16]
    module = asked(SOURCE.replace("== 20", "== 19"))
    findings.judge_all()
    assert module.JUDGED == [12]
    assert findings.finding("flies").verdict == "no"


def test_a_question_that_is_no_longer_asked_is_forgotten(asked):
    asked()
    findings.judge_all()
    asked(SOURCE[: SOURCE.index('@question("C2"')])
    findings.judge_all()
    assert list(findings.stored()) == ["flies"]


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"{",
        b"\xff\xfe",
        b"[]",
        b'{"flies": 1}',
        b'{"flies": {"verdict": "yes", "made from": "x"}}',
        b'{"flies": {"verdict": "yes", "made from": "x", "comparisons": {"steps": 20}}}',
        b'{"flies": {"verdict": "yes", "made from": "x", "comparisons": {"steps": [1, 2, 3, "", true, 6]}}}',
        b"[" * 100_000,
    ],
)
def test_damaged_findings_are_one_line_with_the_remedy(content, asked):
    asked()
    findings.FILE.write_bytes(content)
    for read in (findings.stored, findings.judge_all):
        with pytest.raises(UserError) as refusal:
            read()
        assert str(refusal.value).startswith(f"{findings.FILE}: damaged file (")
        assert str(refusal.value).endswith("); delete it, and `make data` judges anew")
        assert "\n" not in str(refusal.value)
    findings.FILE.unlink()
    findings.judge_all()
    assert findings.finding("flies").verdict == "yes"


def test_an_unknown_name_is_refused_with_what_there_is_and_the_nearest(asked):
    asked()
    findings.judge_all()
    with pytest.raises(UserError, match=r"^'flys': no such question or claim; there are flies, C2.*did you mean flies"):
        findings.finding("flys")
    with pytest.raises(KeyError, match=r"flies: no comparison 'step'.*did you mean steps"):
        findings.finding("flies")["step"]


def test_a_name_that_is_judged_elsewhere_is_refused(asked):
    asked()

    def flight():
        return "no", {}

    with pytest.raises(ValueError, match="flies is judged already, in asked_here"):
        findings.question("flies", "Does it?", "No.")(flight)


def test_steps_are_compared_by_their_ratio_and_shares_by_their_difference():
    ours, theirs = np.array([1.0, 2, 3, 4]), np.array([2.0, 4, 6, 8])
    assert findings.steps(ours, theirs) == Comparison(0.5, 0.5, 0.5, "fewer", 0)
    assert findings.steps(theirs, ours, comparisons=3) == Comparison(2, 2, 2, "more", 3)
    assert findings.shares([True] * 4, [False] * 4) == Comparison(1, 1, 1, "more", 0)
    assert findings.shares([0.51] * 4, [0.5] * 4, comparisons=2)[3:] == ("the same", 2)
    assert findings.estimate([True, False]).value == 0.5
    assert [findings.bound(Interval(1, 0.9, 1.1), limit) for limit in (0.8, 0.9, 1.1, 1.2)] == [
        "above",
        "undecided",
        "undecided",
        "below",
    ]
    assert f"{Comparison(0.5, 0.4, 0.6111, 'fewer'):.2f}" == "0.50 [0.40, 0.61]"


# The questions of the study


def test_every_file_of_questions_asks_one_and_is_named_as_it_and_every_claim_of_the_paper_is_judged():
    assert {one.judge.__module__.rpartition(".")[2] for one in ASKED.values()} == FILES
    assert FILES - {"claims"} == {*findings.ORDER} <= {*ASKED}
    claims = [f"C{number}" for number in range(1, 18)]
    assert list(ASKED) == [*findings.ORDER, *claims]
    assert [one.name for one in ASKED.values() if one.is_claim] == claims


def test_every_question_has_its_predicate_without_docstrings_too():
    program = (
        "import json\nfrom homing_lib.study import findings\n"
        "print(json.dumps({name: one.predicate for name, one in findings.questions().items()}))"
    )
    command = [sys.executable, "-OO", "-c", program]
    told = json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
    assert told == {name: one.predicate for name, one in ASKED.items()}
    assert [name for name, predicate in told.items() if len(predicate.split()) < 8] == []


@pytest.mark.parametrize("file", sorted(STUDY.glob("*.py")), ids=lambda file: file.stem)
def test_the_study_knows_its_questions_by_their_folder_alone(file):
    imported = set()
    for node in ast.parse(file.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.Import):
            imported |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            imported |= {f"{node.module}.{alias.name}" for alias in node.names}
    assert {name for name in imported if name.startswith("homing_lib.study.questions")} <= {
        "homing_lib.study.questions"
    }


def test_the_tables_that_are_judged_are_of_studies_on_the_list():
    listed = {study.name for study in studies.in_order()}
    assert {table.name for one in ASKED.values() for table in one.tables} <= listed


def test_what_is_stored_is_what_the_tables_say():
    for name in ("printed", "C3", "C12", "conjugate"):
        kept, anew = findings.finding(name), findings.judge(name)
        assert anew.verdict == kept.verdict
        assert {key: one.verdict for key, one in anew.comparisons.items()} == {
            key: one.verdict for key, one in kept.comparisons.items()
        }
    assert list(findings.stored()) == list(ASKED)


@pytest.mark.parametrize(("judged", "bound"), [(1, 1.959964), (8, 2.734369)])
def test_the_smallest_ratio_that_an_interval_tells_is_as_far_from_1_as_its_half_width_and_the_power_ask(judged, bound):
    error = 0.05
    found = Comparison(1.0, np.exp(-bound * error), np.exp(bound * error), "the same", judged)
    assert found.smallest_ratio == pytest.approx(np.exp((bound + 0.841621) * error), rel=1e-6)
