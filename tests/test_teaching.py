"""The page for teachers: its minutes add up, and the demonstration opens in the states that it links."""

import json
import re

import pytest

from homing_lib.__main__ import main
from homing_lib.publish import demo
from homing_lib.settings import Settings
from homing_lib.storage import ROOT
from homing_lib.teach import handouts, lab

TEACHING = (ROOT / "notebooks/TEACHING.md").read_text(encoding="utf-8")
STATES = sorted({*re.findall(r"\]\([^)#]+#([^)]+)\)", TEACHING)})
LECTURES = {"Lecture 1": "blame", "Lecture 2": "matter"}

# What of a browser's addresses the page uses.
ADDRESSES = """
class URLSearchParams {
  constructor(text = "") {
    const pairs = String(text).split("&").filter(Boolean).map((pair) => pair.split("="));
    this.pairs = new Map(pairs.map((pair) => pair.map((part) => decodeURIComponent(part.replaceAll("+", " ")))));
  }
  set(name, value) { this.pairs.set(name, String(value)); }
  toString() { return [...this.pairs].map((pair) => pair.map(encodeURIComponent).join("=")).join("&"); }
  [Symbol.iterator]() { return this.pairs[Symbol.iterator](); }
}
"""


def timetable(of: str) -> list[tuple[range, range]]:
    """Of a lecture or the lab: the minutes and the slides or tasks, if any, of each row."""
    rows = re.search(rf"^\| {of} \|.*\n\|---.*\n((?:\|.*\n)+)", TEACHING, re.MULTILINE)[1].splitlines()
    cells = [[re.findall(r"\d+", cell) for cell in row.split("|")[1:3]] for row in rows]
    return [
        (range(int(start), int(end)), range(int(parts[0]), int(parts[-1]) + 1) if parts else range(0))
        for (start, end), parts in cells
    ]


@pytest.mark.parametrize(("of", "minutes"), [("Lecture 1", 45), ("Lecture 2", 45), ("Lab", 90)])
def test_a_timetable_leaves_no_minute_and_no_slide_or_task_out(of, minutes):
    rows = timetable(of)
    assert [minute for time, _ in rows for minute in time] == list(range(minutes))
    count = 7
    if of in LECTURES:
        count = (ROOT / f"paper/lectures/{LECTURES[of]}.tex").read_text(encoding="utf-8").count(r"\begin{frame}")
    assert [part for _, parts in rows for part in parts] == list(range(1, count + 1))


def test_the_lab_takes_as_long_as_its_own_headings_and_its_guide_say():
    tasks = re.findall(r"## (\d · [^\"\\]*) \((\d+) minutes\)", handouts.LAB.read_text(encoding="utf-8"))
    assert [([int(title[0])], int(minutes)) for title, minutes in tasks] == [
        (list(task), len(time)) for time, task in timetable("Lab") if task
    ]
    assert tasks == re.findall(r"^\| (\d · .*?) \| (\d+) \|", handouts.GUIDE.read_text(encoding="utf-8"), re.M)


def test_in_each_task_of_the_lab_half_of_the_points_are_for_checks_and_all_checks_have_some():
    rows = re.findall(r"^\| \d · .* \| (\d.*) \| (\d) \|$", handouts.GUIDE.read_text(encoding="utf-8"), re.M)
    points = [dict(re.findall(r"(\w+): (\S)", checks.replace(",", " "))) for checks, _ in rows]
    assert [sum(0.5 if one == "½" else int(one) for one in each.values()) for each in points] == [
        int(words) for _, words in rows
    ]
    assert [check for each in points for check in each] == [task.title.split(" · ")[0] for task in lab.TASKS]


def test_the_students_set_up_check_ends_with_a_table_of_one_row(capsys):
    readme = handouts.GUIDE.with_name("README.md").read_text(encoding="utf-8")
    exec(re.search(r'^\.venv/bin/python -c "(.*)"$', readme, re.MULTILINE)[1], {})
    assert [line.split(" | ")[0] for line in capsys.readouterr().out.splitlines()] == ["| learner", "| ---", "| gate"]


@pytest.fixture
def page():
    """What of the demonstration needs no browser."""
    mini_racer = pytest.importorskip("py_mini_racer", reason="needs mini-racer, a JavaScript engine in a wheel")
    engine = mini_racer.MiniRacer()
    data = {"settings": Settings(images="compact").model_dump(mode="json")}
    engine.eval(f"{ADDRESSES}\n{demo.scripts()}\nconst DATA = {json.dumps(data)};\n{demo.source('state.js')}")
    yield engine.eval
    engine.close()


@pytest.mark.parametrize("state", STATES)
def test_the_demonstration_understands_every_state_that_it_is_opened_in(state, page):
    assert page("readAddress('#nonsense=1&rule=magic')") != ""
    assert page(f"readAddress({json.dumps('#' + state)})") == ""
    assert page("readOwn()") == ""
    wanted = dict(part.split("=") for part in state.split("&"))
    assert {name: page(f"encodeURIComponent(state[{json.dumps(name)}])") for name in wanted} == {
        name: value.replace(":", "%3A") for name, value in wanted.items()
    }


def test_with_each_guard_the_first_step_that_is_paid_changes_as_many_states_as_the_page_says(page):
    said = re.findall(r"(\d+) (?:state )?with \[guard [\d.]+\]\(executed/demo\.html(#\S+&at=(\d+))\)", TEACHING)
    assert len(said) == 3
    for states, address, step in said:
        page(f"readAddress({json.dumps(address)})")
        page("walk = new Walk(lambdaSpec(chosen()), state.alpha, state.seed); walk.finish(1)")
        assert page("walk.steps.findIndex((step) => step.reward) + 1") == int(step)
        assert page("walk.steps.at(-1).trace.filter((value) => value > 0.01).length") == int(states)


def test_the_set_up_check_is_one_command_that_ends_with_how_often_the_robot_found_home(capsys):
    (command,) = re.findall(r"^    .venv/bin/homing (.*)$", TEACHING, re.MULTILINE)
    assert main(command.split()) == 0
    assert re.fullmatch(r"home reached in \d of 3 episodes", capsys.readouterr().out.splitlines()[-1])


def test_no_finding_is_typed():
    """Decimals are settings of the demonstration or versions, percentages and intervals would be findings."""
    words = re.sub(r"\]\([^)]*\)", "]", TEACHING)
    assert set(re.findall(r"\d+\.\d+", words)) <= {"0.9", "0.8", "0.7", "0.01", "3.11", "3.12", "3.13"}
    assert not re.search(r"\d ?%|\[\d+\.\d", words)
