"""The lab: its solutions are proven, its usual mistakes get a hint each, and it runs whole, solved, blank or broken."""

import io
import re
import sys
import zipfile
from functools import partial

import numpy as np
import pytest

from homing_lib.study import walk
from homing_lib.study.questions import drives
from homing_lib.study.rules import Rules
from homing_lib.teach import checks, handouts, lab


def test_an_answer_that_was_given_before_the_rule_changed_is_no_longer_proven(capsys, monkeypatch):
    monkeypatch.setattr(checks, "RECORD", {})
    monkeypatch.setattr(lab, "TASKS", (lab.a_rule, lab.read))
    lab.a_rule(lambda **_: 0.5)
    words = {"fixed 0": "better", "form 2": "tie", "gate": "worse", "the climb": "tie"}
    for again, told in ((False, "2 of 2 proven."), (True, "1 of 2 proven."), (False, "2 of 2 proven.")):
        if again:
            lab.a_rule(lambda **_: 0.6)
        else:
            lab.read(words, DRIVEN)
        capsys.readouterr()
        lab.report()
        *_, read, last = capsys.readouterr().out.splitlines()
        assert last == told
        assert ("blank. It was answered for an earlier rule" in read) == again


# --- The lab: its solutions, and the usual mistakes, each with the hint that it is to get -----------------------------


@pytest.fixture(scope="module")
def solved() -> dict:
    """What the solutions define, one after the other."""
    names = {"np": np, "walk": walk, "lab": lab, "seen": lab.parting(28), "found": DRIVEN, "tried": TRIED}
    for cell, source in handouts.solutions().items():
        exec(source, names)
        names[f"words of {cell}"] = names.get("words")
    return names


def late(steps, spread=0.1, seed=1):
    """Twenty robots that take about so many steps, in episodes that are all alike."""
    return steps * np.random.default_rng(seed).uniform(1 - spread, 1 + spread, (20, 1)) * np.ones((1, 5))


DRIVEN = Rules(
    {"my rule": late(40), "fixed 0": late(60), "form 2": late(40, 0.9, 3), "gate": late(25), "the climb": late(41)}
)
EPISODE = walk.walks(4)[0]

TRIED = {
    kind: late(steps)[:, 0]
    for kind, steps in {"restored": 70, "frozen": 780, "forgetful": 402, "untrained": 955, "random": 358}.items()
}
PARTS = ("the weights learnt alone", "the updates alone", "both together")


def said(*words: object, **changed: float) -> tuple[dict, dict]:
    """What a student says of the parts, and what the robots did."""
    return dict(zip(PARTS, words, strict=False)), TRIED | {kind: late(steps)[:, 0] for kind, steps in changed.items()}


TASKS = {
    "trace": (lab.trace, lambda it: (it["trace"],)),
    "share": (lab.share, lambda it: (it["share_left"],)),
    "from-beta": (lab.from_beta, lambda it: (it["lambda_of"],)),
    "form-1": (lab.form_1, lambda it: (it["form_1"],)),
    "first-reset": (lab.first_reset, lambda it: (it["predicted"], 28)),
    "guards": (lab.guards, lambda it: (it["same_as"], EPISODE)),
    "reach": (lab.reach, lambda it: (it["changed"], EPISODE)),
    "rule": (lab.a_rule, lambda it: (it["my_rule"],)),
    "read": (lab.read, lambda it: (it["words of read"], DRIVEN)),
    "drives": (lab.drives, lambda it: (it["words of drives"], TRIED)),
}


def in_place(e, phi, lambda_t, gamma):
    e *= gamma * lambda_t
    e += phi
    return e


def ratio(*, delta, delta_prev, **_):
    return np.divide(delta, delta_prev)


def meddling(*, phi, **_):
    phi *= 2
    return 0.5


def form_1(sign=-1, change=lambda g, g_prev, delta: g - g_prev, along="phi", of="trace_prev", gamma=True):
    """Form 1 with something the wrong way."""

    def rule(**step):
        g, g_prev = step["delta"] * step["phi"], step["delta_prev"] * step["phi_prev"]
        turn = change(g, g_prev, step)
        above = turn @ (g if along == "g" else step[along])
        return sign * above / ((step["discount"] if gamma else 1) * (turn @ step[of]))

    return rule


MISTAKES = {
    lab.trace: {
        "γ is missing": lambda e, phi, lambda_t, gamma: lambda_t * e + phi,
        "λ is missing": lambda e, phi, lambda_t, gamma: gamma * e + phi,
        "The new feature has faded": lambda e, phi, lambda_t, gamma: gamma * lambda_t * (e + phi),
        "Nothing is left": lambda e, phi, lambda_t, gamma: phi,
        "no average": lambda e, phi, lambda_t, gamma: gamma * lambda_t * e + (1 - gamma * lambda_t) * phi,
        "array e itself was changed": in_place,
        "not the sum": lambda e, phi, lambda_t, gamma: gamma * lambda_t * e - phi,
    },
    lab.share: {
        "γ is missing": lambda lambdas, gamma: np.prod(lambdas),
        "γ counts once": lambda lambdas, gamma: gamma * np.prod(lambdas),
        "power of one λ": lambda lambdas, gamma: (gamma * lambdas[-1]) ** len(lambdas),
        "multiplied, not added": lambda lambdas, gamma: gamma * sum(lambdas),
        "power of the mean": lambda lambdas, gamma: (gamma * np.mean(lambdas)) ** len(lambdas),
        "another share": lambda lambdas, gamma: np.prod(gamma * lambdas[1:]),
    },
    lab.from_beta: {
        "γ is missing": lambda beta, delta, delta_prev, gamma: beta * delta_prev / delta,
        "upside down": lambda beta, delta, delta_prev, gamma: beta * delta / (gamma * delta_prev),
        "wrong side of the fraction": lambda beta, delta, delta_prev, gamma: beta * gamma * delta_prev / delta,
        "β is the share of the old direction": lambda beta, delta, delta_prev, gamma: beta,
        "Put e = ": lambda beta, delta, delta_prev, gamma: -beta * delta_prev / (gamma * delta),
    },
    lab.form_1: {
        "The minus is missing": form_1(sign=1),
        "γ is missing": form_1(gamma=False),
        "the error of its own step": form_1(change=lambda g, g_prev, step: g - step["delta"] * step["phi_prev"]),
        "not for the feature before": form_1(of="phi_prev"),
        "δ once too often": form_1(along="g"),
        "not at right angles": form_1(along="phi_prev"),
        "this is an array": lambda *, phi, trace_prev, discount, **_: -phi * phi / (discount * trace_prev),
    },
    lab.first_reset: {
        "at the first step there is no step before": (1, 28),
        "one too early": (5, 28),
        "its entry 0 belongs to step 2": (4, 28),
        "it was below 0 already": (8, 28),
        "γ is missing": (7, 36),
        "too late": (7, 28),
        "within \\[0, 1\\], and none left it before": (3, 28),
        "a step is one whole number": ("step 6", 28),
    },
    lab.guards: {
        "not the one that is lost": ({0: 1, 0.8: 0.2, 1: 0}, EPISODE),
        "the guard stands in": ({0: 0, 0.8: 0, 1: 0}, EPISODE),
        "do not all act alike": ({0: 0.8, 0.8: 0.8, 1: 0.8}, EPISODE),
        "what are δ and the δ before": ({0: 0, 0.8: 0.5, 1: 1}, EPISODE),
        "0.8 is missing": ({0: 0, 1: 1}, EPISODE),
        "write a dictionary: \\{0: ..., 0.8: ..., 1: ...\\}": ([0, 0.8, 1], EPISODE),
        "a number from 0 to 1": ({0: "zero", 0.8: 0.8, 1: 1}, EPISODE),
    },
    lab.reach: {
        "something is learnt": ({0: 0, 0.8: 10, 1: 10}, EPISODE),
        "the last feature alone": ({0: 10, 0.8: 10, 1: 10}, EPISODE),
        "is one state": ({0: 1, 0.8: 10, 1: len(EPISODE) - 1}, EPISODE),
        "is beyond the end": ({0: 1, 0.8: 10, 1: len(set(EPISODE))}, EPISODE),
        "not visited": ({0: 1, 0.8: 10, 1: 19}, EPISODE),
        "never quite": ({0: 1, 0.8: 5, 1: 10}, EPISODE),
        "only states on the way": ({0: 1, 0.8: 12, 1: 10}, EPISODE),
        "0.8 is missing": ({0: 1, 1: 10}, EPISODE),
        "write a dictionary": ([1, 10, 10], EPISODE),
    },
    lab.a_rule: {
        "called by keyword": lambda delta, delta_prev: 0.5,
        "without a word": ratio,
        "after 0. Say which λ stands in there: `if delta_prev == 0": (
            lambda *, delta, delta_prev, **_: np.clip(delta / delta_prev, 0, 1)
        ),
        "stands in there: ask for 0": (
            lambda *, delta, delta_prev, **_: min(1, abs(delta_prev / delta)) if delta_prev else 0.5
        ),
        "Cut to \\[0, 1\\] last": lambda *, delta, delta_prev, **_: 2 * min(1, abs(delta * delta_prev)),
        "below 0": lambda *, delta, delta_prev, **_: min(1, delta * delta_prev),
        "a str": lambda **_: "0.5",
        "an array": lambda *, phi, **_: np.clip(phi, 0, 1),
        "It changes phi": meddling,
    },
    lab.read: {
        "fixed 0: the wrong way round": (
            {"fixed 0": "worse", "form 2": "tie", "gate": "better", "the climb": "tie"},
            DRIVEN,
        ),
        "form 2: .* chance": ({"fixed 0": "better", "form 2": "better", "gate": "worse", "the climb": "tie"}, DRIVEN),
        "gate: .* something may be said": (
            {"fixed 0": "better", "form 2": "tie", "gate": "tie", "the climb": "tie"},
            DRIVEN,
        ),
        "the climb: .* lies between": (
            {"fixed 0": "better", "form 2": "tie", "gate": "worse", "the climb": "better"},
            DRIVEN,
        ),
        "the climb is missing": ({"fixed 0": "better", "form 2": "tie", "gate": "worse"}, DRIVEN),
        "write a dictionary": ("better", DRIVEN),
        "say better": ({"fixed 0": "faster", "form 2": "tie", "gate": "worse", "the climb": "tie"}, DRIVEN),
    },
    lab.drives: {
        "the weights learnt alone: 2.18 .* fewer than with neither part": said(True, False, True),
        "the weights learnt alone: 2.79 .* Above 1 random actions are home sooner": said(
            True, False, True, frozen=1000
        ),
        "the updates alone: 1.01 .* chance": said(False, True, True, forgetful=360),
        "the updates alone: 0.50 .* which is fewer\\.$": said(False, False, True, forgetful=180),
        "neither part does it alone": said(False, False, False),
        "both together is missing": said(False, False),
        "say True or False": said("no", "no", "yes"),
        "write a dictionary": (False, TRIED),
    },
}


@pytest.mark.parametrize("name", TASKS)
def test_each_solution_is_proven(name, solved):
    task, answers = TASKS[name]
    assert str(task.judge(*answers(solved))).startswith(f"{task.title}: proven. {task.proves}")


@pytest.mark.parametrize(
    ("task", "hint"),
    [(task, hint) for task, hints in MISTAKES.items() for hint in hints],
    ids=lambda it: getattr(it, "title", it),
)
def test_each_usual_mistake_gets_a_hint_of_its_own(task, hint):
    answers = MISTAKES[task][hint]
    found = task.judge(*(answers if isinstance(answers, tuple) else (answers,)))
    assert found.verdict == "wrong"
    own = [one for one in MISTAKES[task] if re.search(one, found.told, re.I)]
    assert own == [hint], found.told


@pytest.mark.parametrize("answer", [6, 6.0, np.int64(6)])
def test_a_step_may_be_any_kind_of_whole_number(answer):
    assert lab.first_reset.judge(answer, 28).verdict == "proven"


def test_without_the_minus_what_should_be_0_is_twice_what_the_hint_says():
    rng = np.random.default_rng(0)
    change, e, phi = rng.normal(size=(3, 4))
    without = (change @ phi) / (0.9 * change @ e)
    assert change @ (0.9 * without * e + phi) == pytest.approx(2 * change @ phi)


def test_each_check_of_the_lab_says_what_it_proves_and_three_mistakes_of_each_are_recorded():
    assert all(task.proves.endswith(".") for task in lab.TASKS)
    assert {task for task in MISTAKES if len(MISTAKES[task]) >= 3} == {*lab.TASKS} - {lab.race}
    assert len(RACED) >= 3


RACED = {
    "it has no λ": lambda *, delta, delta_prev, **_: 0.9 if delta / delta_prev > 0 else 0.5,
    "it forgets too soon": lambda *, delta, delta_prev, **_: 0.9 if delta * delta_prev > 0 else 0.0,
    "it never forgets": lambda **_: 1.0,
}


def test_how_often_a_rule_has_no_lambda_is_told_of_all_walks_of_the_race_together():
    rule, seeds = RACED["it has no λ"], range(1000, 1006)
    each = [lab._asked_how_often(rule, [seed], 0.1)[0] for seed in seeds]
    assert min(each) < lab._asked_how_often(rule, seeds, 0.1)[0] < max(each)
    with pytest.raises(checks.Wrong) as lost:
        lab.raced(rule, judge=seeds, choose=range(2))
    at = float(re.search(r"at α = ([\d.]+):", str(lost.value))[1])
    assert f"In {lab._asked_how_often(rule, seeds, at)[0]:.0%} of the steps" in str(lost.value)


@pytest.mark.parametrize("hint", RACED)
def test_a_rule_that_loses_the_race_hears_its_interval_and_why(hint):
    with pytest.raises(checks.Wrong) as lost:
        lab.raced(RACED[hint], judge=range(1000, 1006), choose=range(2))
    told = str(lost.value)
    assert re.match(r"Its error is \d\.\d\d \[.*\] of that of λ = 0\.8, at α = [\d.]+: worse\. ", told)
    assert [one for one in RACED if one in told] == [hint]


def test_robots_are_tried_as_the_study_tries_them_and_the_table_has_their_means():
    tried = lab.tried(range(3))
    settings = drives.after(10, images="compact")
    for seed in range(3):
        stored = drives.tried(settings, seed)
        assert [tried[kind][seed] for kind in drives.KINDS] == stored["steps"].tolist()
    *_, learnt, initial, _, beside = lab.four_ways(tried).splitlines()
    for line, kinds in (
        (learnt, ("restored", "frozen")),
        (initial, ("forgetful", "untrained")),
        (beside, ("climb", "random")),
    ):
        assert re.findall(r"(\d+) \[", line) == [f"{tried[kind].mean():.0f}" for kind in kinds]


# --- The lab as a whole, and its archives ----------------------------------------------------------------------------


@pytest.fixture
def run(monkeypatch, capsys):
    """Runs the code of the lab with some answers, on few walks and seeds; returns the lines of its report.

    What it defines and what the cell after the report prints are `run.names` and `run.recap`.
    """
    race = walk.race
    monkeypatch.setattr(walk, "race", lambda rules, *_, **__: race(rules, range(2), range(1000, 1006), (0.1, 0.3)))
    monkeypatch.setattr(lab, "robot", partial(lab.robot, seeds=range(2)))
    monkeypatch.setattr(lab, "tried", partial(lab.tried, seeds=range(10)))
    monkeypatch.setattr(checks, "RECORD", {})
    monkeypatch.setitem(sys.modules, "pybullet", None)

    def run(answers):
        run.names, printed = {}, {}
        for cell in handouts.filled(answers).cells:
            if cell.cell_type == "code":
                capsys.readouterr()
                exec(cell.source, run.names)
                printed[cell.id] = capsys.readouterr().out.splitlines()
        run.recap = printed["recap"]
        return printed["report"]

    return run


def test_with_the_solutions_the_lab_runs_to_its_last_cell_and_proves_everything(run):
    *found, last = run(handouts.solutions())
    assert [re.match(r".*?: (\w+)\. ", line)[1] for line in found] == ["proven"] * len(lab.TASKS)
    assert last == "11 of 11 proven."
    assert [line[:4] for line in run.recap] == [f"{task} · " for task in range(1, 8)]


def test_the_recap_says_what_was_computed(capsys):
    errors = {"λ = 0.8": 2, "λ = 0": 4, "form 2, guard 0": 5, "form 2, guard 0.8": 2, "form 2, guard 1": 8}
    raced = walk.Race({}, dict.fromkeys(errors, 0.1), {label: np.full(3, error) for label, error in errors.items()})
    mine, climb = np.array([[80.0, 60, 40, 35]]), np.full((1, 4), 50.0)
    told = []
    for first in (mine, mine + 20):
        lab.recap(lab.parting(28), raced, Rules({"my rule": first, "the climb": climb}), TRIED | {"climb": climb})
        told.append(capsys.readouterr().out.splitlines())
    once, never = told
    assert "is -1 times form 2" in once[1]
    assert "at step 6;" in once[2]
    assert "does not come back" in once[2]
    assert "a factor of up to 4.00; guards 0 and 0.8 from λ = 0 and 0.8 by up to 1.25. The guard" in once[3]
    assert "takes 50 steps per episode; my rule takes as few in episode 3, and by then 40 more in all." in once[5]
    assert "my rule takes more in each of 4 episodes, and by then 95 more in all." in never[5]
    for one in ("learns on takes 69 steps", "frozen it takes 774", "weights 399; the climb 50", "is worse than chance"):
        assert one in never[6]


def test_left_blank_the_lab_runs_to_its_last_cell_and_says_so(run):
    *found, last = run({})
    assert found == [f"{task.title}: blank. Nothing is checked yet." for task in lab.TASKS]
    assert last == "0 of 11 proven."
    mine, *others = run.names["found"].steps
    assert mine == "λ = 0.8, stand-in"
    assert [*DRIVEN.verdicts] == others
    assert [*run.names["words"]] == [*PARTS]
    assert mine in run.recap[-2]


def test_what_does_not_even_run_is_told_and_stops_nothing_after_it(run):
    broken = "def my_rule(**step):\n    return 1 + step['delta_before']"
    *found, last = run(handouts.solutions() | {"rule": broken})
    assert [line for line in found if "proven" not in line] == [
        f"{task.title}: raised. Line 2: KeyError: 'delta_before'" for task in (lab.a_rule, lab.race)
    ]
    assert last == "9 of 11 proven."


def test_the_lab_and_notebook_4_race_every_rule_at_the_same_step_sizes():
    for name in ("lab", "04-variable-lambda"):
        source = (handouts.NOTEBOOKS / f"{name}.ipynb").read_text(encoding="utf-8")
        assert "walk.race(" in source
        assert "step_sizes=" not in source


def test_each_cell_to_fill_has_a_solution_and_the_students_archive_none():
    packed = handouts.students()
    given = packed["lab.ipynb"].decode()
    to_fill = [cell.id for cell in handouts.filled({}).cells if "answer" in cell.metadata.get("tags", [])]
    assert to_fill == list(handouts.solutions())
    for source in handouts.solutions().values():
        answers = [
            line for line in source.splitlines() if "return" in line or line.startswith(("predicted", "visited"))
        ]
        assert not [line for line in answers if line.strip() in given]
    assert not [name for name in packed if "teacher" in name or "tests" in name]


def test_the_lab_says_of_each_task_what_is_learnt_and_its_minutes_and_they_are_ninety():
    prose = [cell.source for cell in handouts.filled({}).cells if cell.cell_type == "markdown"]
    tasks = [text for text in prose if re.match(r"## \d", text)]
    minutes = [int(re.match(r"## \d · .* \((\d+) minutes\)\n\n\*\*You learn\*\* ", text)[1]) for text in tasks]
    assert sum(minutes) == 90
    rows = re.findall(r"^\| (\d · .*?) \| (\d+) \|", handouts.GUIDE.read_text(encoding="utf-8"), re.M)
    assert [(re.match(r"## (.*) \(", text)[1], str(one)) for text, one in zip(tasks, minutes, strict=True)] == rows


def test_an_archive_of_the_same_files_is_the_same_to_the_byte_and_holds_one_folder():
    files = {"b": b"2", "a/c": b"1"}
    once, again = handouts.archive("lab", files), handouts.archive("lab", dict(reversed(files.items())))
    assert once == again
    with zipfile.ZipFile(io.BytesIO(once)) as packed:
        assert {name: packed.read(name) for name in packed.namelist()} == {"lab/a/c": b"1", "lab/b": b"2"}
