"""What is asked is judged by its tables, stored, read back, and judged anew only when it would come out otherwise."""

import ast
import importlib.util
import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from homing_lib.errors import UserError
from homing_lib.settings import Settings
from homing_lib.study import findings, runs, studies, sweep
from homing_lib.study.bootstrap import Interval
from homing_lib.study.findings import Comparison
from homing_lib.study.questions import varying, worth

ASKED = findings.questions()
STUDY = Path(findings.__file__).parent

SOURCE = '''
from homing_lib.settings import Settings
from homing_lib.study.findings import compare_steps, estimate, question
from homing_lib.study.measures import curve
from homing_lib.study.runs import Study

SMALL = Settings(images="compact", episodes=2, survey_steps=20, max_steps=10)
FLIGHTS = Study("flights", "Why not?", {"a": SMALL, "b": SMALL.with_changes(alpha0=1.0)}, range(3), curve)
JUDGED = []

@question("C2", "Claims come after.", "By construction.")
def arithmetic():
    return "by construction", {}

@question("flies", "Does it fly?", """Yes, if it takes
    ten steps.""", FLIGHTS)
def flies(table):
    JUDGED.append(len(table))
    taken = table[table.condition == "a"].groupby("seed").steps.sum()
    found = {"of b": compare_steps(taken, taken, comparisons=2), "steps": estimate(taken)}
    return "yes" if found["steps"].value == 20 else "no", found
'''


@pytest.fixture
def asked(tmp_path, monkeypatch):
    """Call it with the source of a file of questions, and it is the only one; its tables are computed."""
    monkeypatch.setattr(runs, "DATA", tmp_path / "data")
    monkeypatch.setattr(runs, "SCRATCH", tmp_path / "scratch")
    monkeypatch.setattr(findings, "FILE", tmp_path / "data" / "findings.json")
    monkeypatch.setattr(findings, "REGISTERED", {})
    findings.stored.cache_clear()

    def ask(source=SOURCE):
        findings.REGISTERED.clear()
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
        findings.finding("flies")
    findings.judge_all()
    found = findings.finding("flies")
    assert list(findings.stored()) == ["flies", "C2"]
    assert (found.verdict, found.question.text) == ("yes", "Does it fly?")
    assert found.question.predicate == "Yes, if it takes ten steps."
    assert found.comparisons == {"of b": Comparison(1, 1, 1, "the same", 2), "steps": Comparison(20, 20, 20)}
    assert found == findings.judge("flies")
    assert module.JUDGED == [12, 12]
    assert findings.verdicts() == {"flies": "yes", "flies.of b": "the same", "C2": "by construction"}
    assert findings.table(["flies"]).splitlines()[-1] == "| flies | Does it fly? | **yes** |"


def test_it_is_judged_anew_when_its_table_or_the_library_changes_and_only_then(asked, monkeypatch):
    module = asked()
    findings.judge_all()
    before = findings.FILE.stat().st_mtime_ns
    findings.judge_all()
    assert (module.JUDGED, findings.FILE.stat().st_mtime_ns) == ([12], before)
    more = replace(module.FLIGHTS, seeds=range(4))
    sweep.sweep(more, workers=1)
    findings.REGISTERED["flies"] = findings.REGISTERED["flies"]._replace(studies=(more,))
    findings.judge_all()
    assert module.JUDGED == [12, 16]
    monkeypatch.setitem(runs.MADE_BY, "homing_lib", "edited")
    findings.judge_all()
    assert module.JUDGED == [12, 16, 16]


def test_a_question_that_is_no_longer_asked_is_forgotten_and_a_new_one_is_not_judged_yet(asked):
    asked(SOURCE.replace('"C2"', '"C3"'))
    findings.judge_all()
    asked()
    with pytest.raises(UserError, match=r"^C2: not judged yet; `make data` judges$"):
        findings.finding("C2")
    findings.judge_all()
    assert list(findings.stored()) == ["flies", "C2"]


def test_questions_come_in_their_order_then_those_that_have_none_then_the_claims_by_number(monkeypatch):
    monkeypatch.setattr(findings, "REGISTERED", {})
    for name, order in {"C10": {}, "new": {}, "C9": {}, "b": {"order": 1}, "a": {"order": 2}}.items():
        findings.question(name, "?", "Yes.", **order)(lambda: ("yes", {}))
    assert list(findings.questions()) == ["b", "a", "new", "C9", "C10"]


@pytest.mark.parametrize("content", ["", "[]", '{"flies": 1}', '{"flies": {"verdict": "yes", "made from": "x"}}'])
def test_damaged_findings_are_one_line_with_the_remedy(content, asked):
    asked()
    findings.FILE.write_text(content)
    for read in (findings.stored, findings.judge_all):
        with pytest.raises(UserError, match=r"^[^\n]*: damaged file \(.*\); delete it, and `make data` judges anew$"):
            read()


def test_a_name_that_there_is_not_is_refused_with_what_there_is_and_the_nearest(asked):
    asked()
    findings.judge_all()
    with pytest.raises(UserError, match=r"^'flys': no such question or claim; there are flies, C2.*did you mean flies"):
        findings.finding("flys")
    with pytest.raises(UserError, match=r"flies: no comparison 'step'.*did you mean steps"):
        findings.finding("flies")["step"]
    with pytest.raises(ValueError, match="flies is judged already, in asked_here"):
        findings.question("flies", "Does it?", "No.")(test_a_question_is_judged_stored_and_read_back)


def test_steps_are_compared_by_their_ratio_and_shares_by_their_difference():
    ours, theirs = np.array([1.0, 2, 3, 4]), np.array([2.0, 4, 6, 8])
    assert findings.compare_steps(ours, theirs) == Comparison(0.5, 0.5, 0.5, "fewer", 0)
    assert findings.compare_steps(theirs, ours, comparisons=3) == Comparison(2, 2, 2, "more", 3)
    assert findings.compare_to_first({"a": theirs, "b": ours, "c": theirs}) == {
        "b": Comparison(0.5, 0.5, 0.5, "fewer"),
        "c": Comparison(1, 1, 1, "the same"),
    }
    assert findings.compare_shares([True] * 4, [False] * 4) == Comparison(1, 1, 1, "more", 0)
    assert findings.compare_shares([0.51] * 4, [0.5] * 4, comparisons=2)[3:] == ("the same", 2)
    assert findings.compare_to_limit([0.5] * 4, 0.6, comparisons=6) == Comparison(0.5, 0.5, 0.5, "below", 6)
    assert findings.compare_to_limit([0.5] * 4, 0.6, comparisons=0) == Comparison(0.5, 0.5, 0.5, "below", 0)
    assert findings.estimate([True, False]).value == 0.5
    assert findings.exact(3) == Comparison(3, 3, 3)
    assert f"{Comparison(0.5, 0.4, 0.6111, 'fewer'):.2f}" == "0.50 [0.40, 0.61]"


def test_a_comparison_that_is_judged_with_others_has_the_wider_interval():
    ours, theirs = np.random.default_rng(0).exponential(100, (2, 40))
    for compare in (
        lambda k: findings.compare_steps(ours, theirs, comparisons=k),
        lambda k: findings.compare_shares(ours / 1e3, theirs / 1e3, comparisons=k),
        lambda k: findings.compare_to_limit(ours, 100, comparisons=k),
    ):
        alone, together = compare(1), compare(8)
        assert together.low < alone.low < alone.value == together.value < alone.high < together.high


@pytest.mark.parametrize(
    ("limit", "side"), [(0.8, "above"), (0.9, "undecided"), (1.1, "undecided"), (1.2, "below"), (np.nan, "undecided")]
)
def test_a_side_of_a_limit_is_allowed_by_the_whole_interval_alone(limit, side):
    assert findings.side_of(Interval(1, 0.9, 1.1), limit) == side


@pytest.mark.parametrize(
    ("words", "verdict"),
    [
        (["fewer", "the same"], "supported"),
        (["fewer"], "supported"),
        (["fewer", "more"], "contradicted"),
        (["undecided", "more"], "contradicted"),
        (["fewer", "undecided"], "inconclusive"),
    ],
)
def test_one_word_contradicts_and_all_support(words, verdict):
    assert findings.verdict_of(words, ["the same", "fewer"], ["more"]) == verdict
    named = dict(zip(findings.OF_A_CLAIM, findings.OF_A_QUESTION, strict=True))
    assert findings.verdict_of(iter(words), ["the same", "fewer"], ["more"], findings.OF_A_QUESTION) == named[verdict]


def test_as_text_a_star_is_for_what_is_judged():
    found = findings.Finding("C8", "no", {f"{judged}": Comparison(1, 0.9, 1.2, "more", judged) for judged in (2, 0)})
    lines = findings.as_text(found).splitlines()[2:]
    assert [line.startswith("  * ") for line in lines] == [True, False]


# The questions of the study


def test_every_claim_of_the_paper_is_judged_and_a_question_stands_in_a_file_of_its_name():
    claims = [f"C{number}" for number in range(1, 18)]
    assert [one.name for one in ASKED.values() if one.is_claim] == claims
    questions = {one.name: one.judge.__module__.rpartition(".")[2] for one in ASKED.values() if not one.is_claim}
    assert list(questions) == list(questions.values())
    assert {*questions.values(), "claims"} == {file.stem for file in (STUDY / "questions").glob("[a-z]*.py")}


def test_every_question_has_its_predicate_without_docstrings_too():
    program = (
        "import json\nfrom homing_lib.study import findings\n"
        "print(json.dumps({name: one.predicate for name, one in findings.questions().items()}))"
    )
    command = [sys.executable, "-OO", "-c", program]
    told = json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
    assert told == {name: one.predicate for name, one in ASKED.items()}
    assert all(told.values())


def test_the_study_knows_its_questions_by_their_folder_alone():
    for file in STUDY.glob("*.py"):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import | ast.ImportFrom):
                names = [getattr(node, "module", ""), *(alias.name for alias in node.names)]
                assert not any(f"{name}".startswith("homing_lib.study.questions") for name in names), file


def test_the_tables_that_are_judged_are_of_studies_on_the_list():
    listed = {study.name for study in studies.in_order()}
    assert {table.name for one in ASKED.values() for table in one.studies} <= listed


def test_the_rooms_where_worth_also_asks_with_another_step_size_are_those_where_another_was_chosen():
    chosen = {room: varying.chosen(room, "taken", varying.FORM_2).alpha0 for room in studies.ROOMS}
    assert tuple(room for room, alpha in chosen.items() if alpha != Settings().alpha0) == worth.OWN_STEP_SIZE


def test_what_is_stored_is_what_the_tables_say():
    for name in ("printed", "C3", "C12", "conjugate"):
        kept, anew = findings.finding(name), findings.judge(name)
        assert anew.verdict == kept.verdict
        words = [{key: one.verdict for key, one in found.comparisons.items()} for found in (kept, anew)]
        assert words[0] == words[1]
    assert list(findings.stored()) == list(ASKED)
