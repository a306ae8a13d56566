"""The lab: its solutions are proven, each usual mistake gets its hint, and it runs whole, solved, blank or broken."""

import re
import sys
from functools import partial
from itertools import count

import nbformat
import numpy as np
import pytest
from nbclient import NotebookClient

from homing_lib.publish import notebooks
from homing_lib.study import walk
from homing_lib.study.compiling import load
from homing_lib.study.rules import Rules
from homing_lib.teach import checks, experiments, handouts, lab

PARTS = ("the weights learnt alone", "the updates alone", "both together")


def robots(steps, spread=0.1, seed=1):
    """Twenty robots that take about so many steps, in episodes that are all alike."""
    return steps * np.random.default_rng(seed).uniform(1 - spread, 1 + spread, (20, 1)) * np.ones((1, 5))


LUCK = np.random.default_rng(0)
DRIVEN = Rules(
    {"my rule": robots(40), "fixed 0": robots(60), "form 2": robots(40, 0.9, 3), "gate": robots(25)}
    | {"the climb": robots(41)}
)
TRIED = {
    kind: robots(steps)[:, 0]
    for kind, steps in {"restored": 70, "frozen": 780, "forgetful": 402, "untrained": 955, "random": 358}.items()
}
EPISODE = walk.walks(4)[0]


def words(*said, **steps):
    """What a student says of the parts, and what the robots did."""
    return dict(zip(PARTS, said, strict=True)), TRIED | {kind: robots(*each)[:, 0] for kind, each in steps.items()}


def against(fixed_0="better", form_2="tie", gate="worse", climb="tie"):
    """What a student says after ten robots, and after all of them: here they show the same."""
    said = {"fixed 0": fixed_0, "form 2": form_2, "gate": gate, "the climb": climb}
    return said, said, DRIVEN


def guards(*answers):
    return dict(zip((0, 0.8, 1), answers, strict=True)), EPISODE


# --- The usual mistakes ----------------------------------------------------------------------------------------------

TASKS = dict(zip((task for task in lab.HINTS if task != "robot"), lab.TASKS, strict=True))


def in_place(e, phi, lambda_t, gamma):
    e *= gamma * lambda_t
    e += phi
    return e


def meddling(*, phi, **_):
    phi *= 2
    return 0.5


def a_gate(low=0.5, high=0.9):
    """A rule with two values."""
    return lambda *, delta, delta_prev, **_: low if delta * delta_prev < 0 else high


def form_1(sign=-1, change=lambda g, g_prev, step: g - g_prev, along="phi", of="trace_prev", gamma=True):
    """Form 1 with something the wrong way."""

    def rule(**step):
        g, g_prev = step["delta"] * step["phi"], step["delta_prev"] * step["phi_prev"]
        turn = change(g, g_prev, step)
        return sign * (turn @ step[along]) / ((step["discount"] if gamma else 1) * (turn @ step[of]))

    return rule


MISTAKES = {
    "trace.in-place": [in_place],
    "trace.no-gamma": [lambda e, phi, lambda_t, gamma: lambda_t * e + phi],
    "trace.no-lambda": [lambda e, phi, lambda_t, gamma: gamma * e + phi],
    "trace.shape": [lambda e, phi, lambda_t, gamma: np.outer(gamma * lambda_t * e, phi)],
    "trace.shape, a column": [lambda e, phi, lambda_t, gamma: (gamma * lambda_t * e + phi).reshape(-1, 1)],
    "trace.shape, a number": [lambda e, phi, lambda_t, gamma: gamma * lambda_t * e @ phi],
    "trace.scaled-feature": [lambda e, phi, lambda_t, gamma: gamma * lambda_t * e + lambda_t * phi],
    "trace.minus": [lambda e, phi, lambda_t, gamma: gamma * lambda_t * e - phi],
    "trace.faded-feature": [lambda e, phi, lambda_t, gamma: gamma * lambda_t * (e + phi)],
    "trace.average": [lambda e, phi, lambda_t, gamma: gamma * lambda_t * e + (1 - gamma * lambda_t) * phi],
    "trace.otherwise": [lambda e, phi, lambda_t, gamma: e + 2 * phi],
    "share.no-gamma": [lambda lambdas, gamma: np.prod(lambdas)],
    "share.gamma-once": [lambda lambdas, gamma: gamma * np.prod(lambdas)],
    "share.power-of-last": [lambda lambdas, gamma: (gamma * lambdas[-1]) ** len(lambdas)],
    "share.sum": [lambda lambdas, gamma: gamma * sum(lambdas)],
    "share.no-steps": [lambda lambdas, gamma: np.prod(gamma * lambdas) if len(lambdas) else 0.0],
    "share.otherwise": [lambda lambdas, gamma: np.prod(gamma * lambdas[1:])],
    "share.otherwise, γ once less": [lambda lambdas, gamma: gamma ** (len(lambdas) - 1) * np.prod(lambdas)],
    "share.otherwise, an array": [lambda lambdas, gamma: gamma * lambdas],
    "from-beta.no-gamma": [lambda beta, delta, delta_prev, gamma: beta * delta_prev / delta],
    "from-beta.upside-down": [lambda beta, delta, delta_prev, gamma: beta * delta / (gamma * delta_prev)],
    "from-beta.gamma-above": [lambda beta, delta, delta_prev, gamma: beta * gamma * delta_prev / delta],
    "from-beta.beta": [lambda beta, delta, delta_prev, gamma: beta],
    "from-beta.beta, over γ": [lambda beta, delta, delta_prev, gamma: beta / gamma],
    "from-beta.otherwise": [lambda beta, delta, delta_prev, gamma: -beta * delta_prev / (gamma * delta)],
    "form-1.array": [lambda *, phi, trace_prev, discount, **_: -phi * phi / (discount * trace_prev)],
    "form-1.no-features": [form_1(change=lambda g, g_prev, step: step["delta"] - step["delta_prev"])],
    "form-1.cancels, of a right Δg": [
        lambda *, delta, phi, delta_prev, phi_prev, trace_prev, discount: (
            -(dg := delta * phi - delta_prev * phi_prev) * phi / (discount * dg * trace_prev)
        )
    ],
    "form-1.cancels": [
        lambda *, delta, phi, delta_prev, trace_prev, discount, **_: (
            -(delta - delta_prev) * phi / (discount * (delta - delta_prev) * trace_prev)
        )
    ],
    "form-1.no-minus": [form_1(sign=1)],
    "form-1.no-gamma": [form_1(gamma=False)],
    "form-1.one-error": [form_1(change=lambda g, g_prev, step: g - step["delta"] * step["phi_prev"])],
    "form-1.feature-for-trace": [form_1(of="phi_prev")],
    "form-1.otherwise": [form_1(along="phi_prev")],
    "form-1.otherwise, no number": [lambda **_: np.nan],
    "first-reset.no-step": ["step 6", 28],
    "first-reset.first-step": [1, 28],
    "first-reset.one-early": [5, 28],
    "first-reset.two-early": [4, 28],
    "first-reset.above-1": [8, 28],
    "first-reset.no-gamma": [7, 36],
    "first-reset.late": [7, 28],
    "first-reset.otherwise": [3, 28],
    "guards.no-lambda": guards("zero", 0.8, 1),
    "guards.share-lost": guards(1, 0.2, 0),
    "guards.zero": guards(0, 0, 0),
    "guards.all-alike": guards(0.8, 0.8, 0.8),
    "guards.otherwise": guards(0, 0.5, 1),
    "reach.last-alone": guards(10, 10, 10),
    "reach.steps": guards(1, 10, len(EPISODE) - 1),
    "reach.steps, and the end": guards(1, 10, len(EPISODE)),
    "reach.end": guards(1, 10, len(set(EPISODE))),
    "reach.too-few": guards(1, 5, 10),
    "reach.otherwise": guards(1, 12, 10),
    "rule.no-keywords": [lambda delta, delta_prev: 0.5],
    "rule.divides": [lambda *, delta, delta_prev, **_: min(1, abs(delta_prev / delta)) if delta_prev else 0.5],
    "rule.divides-by-before": [lambda *, delta, delta_prev, **_: np.clip(delta / delta_prev, 0, 1)],
    "rule.changes": [meddling],
    "rule.array": [lambda *, phi, **_: np.clip(phi, 0, 1)],
    "rule.no-number": [lambda **_: "0.5"],
    "rule.not-finite": [lambda *, delta, delta_prev, **_: np.divide(delta, delta_prev)],
    "rule.above-1": [lambda *, delta, delta_prev, **_: 2 * min(1, abs(delta * delta_prev))],
    "rule.below-0": [lambda *, delta, delta_prev, **_: min(1, delta * delta_prev)],
    "rule.constant": [lambda **_: 0.8],
    "rule.by-chance": [lambda **_: LUCK.random()],
    "read.no-word": against(fixed_0="faster"),
    "read.alike": against(climb="better"),
    "read.chance": against(form_2="better"),
    "read.one-side": against(gate="tie"),
    "read.otherwise": against(fixed_0="worse", gate="better"),
    "drives.no-truth": words("no", "no", "yes"),
    "drives.together": words(False, False, False),
    "drives.fewer": words(False, False, True, forgetful=[180]),
    "drives.chance": words(False, True, True, forgetful=[360, 0.9, 3]),
    "drives.than-neither": words(True, False, True),
    "drives.otherwise": words(True, False, True, frozen=[1000]),
}
"""By task and hint, answers that get it."""


def judged(mistake):
    return TASKS[mistake.split(".")[0]].judge(*MISTAKES[mistake])


@pytest.mark.parametrize("mistake", MISTAKES)
def test_each_usual_mistake_gets_its_own_hint(mistake):
    task, name = mistake.partition(",")[0].split(".")
    verdict, message = judged(mistake)[1:]
    assert verdict == "wrong"
    texts = {hint: re.sub(r"\\\{.*?\\\}", ".+", re.escape(text)) for hint, text in lab.HINTS[task].items()}
    assert [hint for hint, text in texts.items() if re.fullmatch(text, message)] == [name], message


def test_no_hint_is_without_a_mistake_that_gets_it():
    hints = {f"{task}.{name}" for task, texts in lab.HINTS.items() if task in TASKS for name in texts if task != "race"}
    assert hints == {mistake.partition(",")[0] for mistake in MISTAKES}


@pytest.mark.parametrize(
    ("mistake", "what"),
    [
        ("first-reset.late", "before step 7"),
        ("guards.otherwise", "guard 0.8"),
        ("rule.divides", "δ = 0 "),
        ("trace.shape, a column", "(4, 1)"),
        ("rule.no-keywords", "`discount`"),
        ("rule.constant", "0.8"),
        ("read.otherwise", "fixed 0, 10 robots:"),
        ("drives.than-neither", "the weights learnt alone: 2.18 ["),
        ("drives.together", "both together: 0.20 ["),
    ],
)
def test_a_hint_names_what_it_is_about(mistake, what):
    assert what in judged(mistake).message


# --- The race --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("undefined", "mean", "reason"),
    [(0.21, 0, "undefined"), (0.2, 0.39, "forgets"), (0.2, 0.96, "never-forgets"), (0.2, 0.4, "otherwise")],
)
def test_a_rule_that_loses_the_race_is_behind_and_hears_by_how_much_and_why(
    undefined, mean, reason, monkeypatch, capsys
):
    errors = {"λ = 0.8": np.ones(3), "the rule": np.full(3, 2.0)}
    monkeypatch.setattr(walk, "race", lambda *_, **__: walk.Race({}, dict.fromkeys(errors, 0.3), errors))
    monkeypatch.setattr(experiments, "lambdas_given", lambda rule, seeds, step_size: (undefined, mean))
    monkeypatch.setattr(lab, "RACES", count(3))
    verdict, message = lab.race.judge(a_gate())[1:]
    assert verdict == "behind"
    assert capsys.readouterr().out == "Race no. 3.\n"
    hint = lab.HINTS["race"][reason].format(undefined=undefined, mean=mean)
    assert re.fullmatch(rf".* 2\.00 \[2\.00, 2\.00\] .* α = 0\.3: worse\. {re.escape(hint)}", message)


def test_what_is_no_rule_does_not_race_and_hears_why(capsys):
    for race in (lab.race, lab.practice):
        assert race.judge(lambda delta, delta_prev: 0.5)[1:] == judged("rule.no-keywords")[1:]
    assert capsys.readouterr().out == ""


# --- The lab as a whole ----------------------------------------------------------------------------------------------


def test_each_task_asks_in_the_students_own_words_what_the_guide_grades():
    guide = re.findall(r"^\*In your own words:\* (.*(?:\n.+)*)", handouts.GUIDE.read_text(encoding="utf-8"), re.M)
    asked = {cell.id: cell.source for cell in handouts.filled({}).cells if cell.id.startswith("words-")}
    assert [*asked] == [f"words-{task}" for task in range(1, 8)]
    for graded, cell in zip(guide, asked.values(), strict=True):
        questions = re.sub(r" \([^)]*\)", "", graded.replace("\n", " "))
        assert f"*{questions}*" in cell


def test_in_a_notebook_progress_is_a_widget_and_no_error():
    source = "from homing_lib.study import engine\nengine.side_by_side(lambda seed: seed, range(3), [])"
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(source)])
    load()  # compiled for the first time, the engine says so on stderr
    with notebooks.isolated():
        (cell,) = NotebookClient(notebook, kernel_name="python3").execute().cells
    assert "stderr" not in [output.get("name") for output in cell.outputs]
    assert [output for output in cell.outputs if "application/vnd.jupyter.widget-view+json" in output.get("data", {})]


@pytest.fixture
def run(monkeypatch, capsys):
    """Runs the code of the lab with some answers, on few walks and seeds; returns what each cell defines and prints."""
    race = walk.race
    monkeypatch.setattr(walk, "race", lambda rules, *_, **__: race(rules, range(2), range(1000, 1006), (0.1, 0.3)))
    monkeypatch.setattr(lab, "robot", partial(lab.robot, seeds=range(2)))
    monkeypatch.setattr(experiments, "tried", partial(experiments.tried, seeds=range(10)))
    monkeypatch.setattr(checks, "RECORD", {})
    monkeypatch.setitem(sys.modules, "pybullet", None)

    def run(answers):
        names, printed = {}, {}
        for cell in handouts.filled(answers).cells:
            if cell.cell_type == "code":
                capsys.readouterr()
                exec(cell.source, names)
                printed[cell.id] = capsys.readouterr().out.splitlines()
        return names, printed

    return run


def test_with_the_solutions_the_lab_runs_to_its_last_cell_and_proves_everything(run):
    _, printed = run(handouts.solutions())
    assert [*printed][-1] == "report"
    *outcomes, last = printed["report"]
    assert [re.match(r".*?: (\w+)\. ", line)[1] for line in outcomes] == ["proven"] * len(lab.TASKS)
    assert last.startswith("11 of 11")


def paragraphs(*computed):
    """Of the recap, one for each task."""
    parts = [part.split(" · ", 1) for part in experiments.recap(*computed).split("\n\n")]
    assert [task for task, _ in parts] == [f"**{task}**" for task in range(1, 8)]
    return [line for _, line in parts]


def test_left_blank_with_a_broken_rule_the_lab_runs_to_its_last_cell_with_a_stand_in(run):
    names, printed = run({"rule": "def my_rule(**step):\n    return 1 + step['delta_before']"})
    *outcomes, last = printed["report"]
    raised = [f"{task.title}: raised. Line 2: KeyError: 'delta_before'" for task in (lab.a_rule, lab.race)]
    assert [line for line in outcomes if "blank" not in line] == raised
    assert last.startswith("0 of 11")
    mine, *others = names["compared"].steps
    assert mine == "λ = 0.8, stand-in"
    assert others == [*DRIVEN.verdicts]
    assert [*names["words"]] == [*PARTS]
    assert mine in paragraphs(*(names[name] for name in ("seen", "raced", "compared", "tried")))[5]


@pytest.fixture
def reported(monkeypatch, capsys):
    """Of 5a, 5b and 6, what the report says; nothing is raced, and nobody drives."""
    race = walk.Race({}, {"the rule": 0.3}, {"λ = 0.8": np.ones(3), "the rule": np.ones(3)})
    monkeypatch.setattr(checks, "RECORD", {})
    monkeypatch.setattr(checks, "ABOUT", {})
    monkeypatch.setattr(walk, "race", lambda *_, **__: race)
    monkeypatch.setattr(lab.rules, "compare", lambda rules, seeds: Rules(dict.fromkeys(rules, robots(40))))
    monkeypatch.setattr(experiments, "rivals", lambda seeds: {})
    monkeypatch.setattr(lab, "TASKS", (lab.a_rule, lab.race, lab.read))

    def reported():
        capsys.readouterr()
        lab.report()
        return [re.match(r".*?: (\w+)\. ", line)[1] for line in capsys.readouterr().out.splitlines()[:-1]]

    return reported


def test_the_report_counts_no_race_and_no_robots_of_another_rule_than_5a(reported, capsys):
    def answer(*tasks, rule):
        for task in tasks:
            task(*against()) if task is lab.read else task(rule)

    first, second = a_gate(), a_gate(0.4)
    answer(lab.a_rule, lab.race, lab.robot, lab.read, rule=first)
    assert reported() == ["proven", "proven", "proven"]
    answer(lab.a_rule, rule=second)
    assert reported() == ["proven", "blank", "blank"]
    answer(lab.race, lab.read, rule=second)  # the robots that are read are still those of the first
    assert reported() == ["proven", "proven", "blank"]
    lab.report()
    assert "`compared = lab.robot(my_rule)`" in capsys.readouterr().out
    answer(lab.robot, lab.read, rule=second)
    assert reported() == ["proven", "proven", "proven"]
    answer(lab.practice, rule=first)
    assert reported() == ["proven", "proven", "proven"]


def test_the_cell_of_5a_run_again_with_the_same_rule_blanks_nothing(reported):
    cell = "def my_rule(*, delta, delta_prev, **_):\n    return LOW if delta * delta_prev < 0 else 0.9"
    for low, race in ((0.5, "proven"), (0.6, "blank")):
        exec(cell, names := {"LOW": 0.5})
        lab.a_rule(names["my_rule"])
        lab.race(names["my_rule"])
        exec(cell, again := {"LOW": low})
        lab.a_rule(again["my_rule"])
        assert reported()[1] == race


def test_a_stand_in_counts_while_5a_has_no_rule(reported):
    lab.a_rule(lambda **_: ...)
    lab.robot(lambda **_: ...)
    lab.read(*against())
    assert reported() == ["blank", "blank", "proven"]


@pytest.mark.parametrize(
    ("rule", "slow"), [(a_gate(), False), (lambda *, delta, **_: float(np.clip(delta, 0, 1)), True)]
)
def test_a_rule_that_takes_minutes_hears_so_before_it_drives(rule, slow, reported, capsys, monkeypatch):
    monkeypatch.setattr(lab, "load", lambda: True)
    monkeypatch.setattr(lab.engine, "compiles", lambda rule: not slow)
    lab.robot(rule)
    assert ("np.clip" in capsys.readouterr().out) == slow


@pytest.mark.parametrize("word", ["Better", " better ", "BETTER"])
def test_a_word_counts_in_any_case_and_with_spaces(word):
    assert lab.read.judge(*against(fixed_0=word)).verdict == "proven"


def test_after_ten_robots_and_after_all_other_words_may_be_right():
    luck = np.r_[robots(80)[:10], robots(10)[:10]]  # the first ten were unlucky
    driven = Rules({"my rule": robots(50), "fixed 0": luck})
    assert lab.read.judge({"fixed 0": "better"}, {"fixed 0": "tie"}, driven).verdict == "proven"
    assert "20 robots" in lab.read.judge({"fixed 0": "better"}, {"fixed 0": "better"}, driven).message


def test_in_the_table_of_task_3_whoever_forgets_gamma_predicts_another_step():
    (cell,) = (cell for cell in handouts.filled({}).cells if cell.id == "errors")
    seed = int(re.match(r"seed = (\d+)", cell.source)[1])
    weighted = np.prod(experiments.twelve_steps(seed)[:2], axis=0)
    ratio = weighted[1:] / weighted[:-1]
    without_gamma = 2 + int(np.flatnonzero((ratio < 0) | (ratio > 1))[0])
    assert lab.first_reset.judge(without_gamma, seed).message == lab.HINTS["first-reset"]["no-gamma"]
