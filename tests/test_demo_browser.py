"""The demonstration in a real browser, as a user meets it: from disk, offline, by mouse and by finger."""

import json

import numpy as np
import pytest

from homing_lib import agent
from homing_lib.settings import Settings
from homing_lib.study import walk
from tests.browser import Browser, opened, title

WEIGHTS = "[...robotView.experiment.agent.learner.weights]"
MOMENT = "JSON.stringify([state, view().steps, robotView.experiment?.episodes, at('own').value])"


def typed(browser: Browser, field: str, text: str) -> None:
    browser.click(f"#{field}")
    browser(f"at('{field}').select()")
    browser.type(text)


def in_room(browser: Browser, *places: tuple[float, float]) -> list[tuple[float, float]]:
    """Places of the room on the screen."""
    browser("scrollTo(0, 0)")
    return browser(
        f"""(() => {{
          const box = at('r-room').getBoundingClientRect(), {{ x, y }} = roomScale(box.width);
          return {json.dumps(places)}.map((place) => [box.x + x(place[0]), box.y + y(place[1])]);
        }})()"""
    )


def test_a_run_is_played_paused_and_made_step_by_step(browser):
    opened(browser, "view=robot")
    browser.click("#robot-play")
    browser.until("robotView.steps.length > 2")
    browser.click("#robot-play")
    made = browser("state.made")
    browser.click("#robot-step")
    assert browser("[state.made, robotView.steps.length, player.mode]") == [made + 1, made + 1, None]
    browser.click("#robot-again")
    assert browser("[state.made, robotView.steps.length]") == [0, 0]


# --- Addresses -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("state", "clicks", "part"),
    [
        ("view=robot&seed=2&made=40&rule=polak-ribiere&alpha0=0.002", ["robot-kidnap", "robot-step"], "kidnap=40"),
        ("view=robot&seed=64&made=843", ["frozen", *["robot-step"] * 3, "frozen", "robot-step"], "frozen=843%3B846"),
        ("view=robot&seed=2&made=50000", ["robot-kidnap", "robot-one"], "more=1"),
        ("rule=gate&reset=0&with=own:0.5*delta;inverse&guard=0.3", ["walk-ten", "walk-step"], "at="),
        ("rule=own&own=exp(delta)&look=forward&alpha=0.4", ["walk-one"], "own=exp"),
    ],
)
def test_an_address_leads_back_to_the_same_moment(browser, state, clicks, part):
    opened(browser, state)
    for element in clicks:
        browser.click(f"#{element}")
    before, link = browser(MOMENT), browser("address()")
    assert part in link
    opened(browser, link)
    assert browser(MOMENT) == before
    assert browser("address()") == link


def test_an_address_that_makes_no_sense_is_told_of_and_harmless(browser):
    """Each part that cannot be read is named; what can be read is taken."""
    wrong = {
        "rule=magic": "rule cannot be “magic”",
        "seed=-1": "seed must be a whole number",
        "at=2.5": "at must be a whole number",
        "alpha0=x": "alpha0 must be",
        "constructor=1": "“constructor” is not known",
        "with=magic;gate": "no lambda rule “magic”",
    }
    opened(browser, "&".join([*wrong, "own=alert(1)", "view=robot", "start=9,9,9", "kidnap=;;x", "frozen=x"]))
    message = browser("at('message').textContent")
    assert [word for word in wrong.values() if word not in message] == []
    assert browser("[state.rule, state.seed, state.view, kept()]") == ["fletcher-reeves", 1, "robot", ["gate"]]


def test_a_rule_of_ones_own_is_typed_and_a_wrong_one_is_explained_while_the_last_is_at_work(browser):
    opened(browser, "rule=own&own=exp(delta)&at=30")
    steps = "JSON.stringify(walkView.steps)"
    before = browser(steps)
    typed(browser, "own", "0.5 if dlta > 0 else 0")
    browser.until("at('own-error').textContent")
    assert "mean delta?" in browser("at('own-error').textContent")
    assert browser("nameOf(chosen())") == "your last readable rule"
    opened(browser, browser("address()"))
    assert browser("at('own').value") == "exp(delta)"
    assert browser(steps) == before
    typed(browser, "own", "0.25")
    browser.until("walkView.steps.slice(1).every((step) => step.lambda === 0.25)")
    assert browser("at('own-error').textContent") == ""


@pytest.mark.parametrize("seed", ["-3", "1.5"])
def test_what_is_no_seed_is_refused_with_a_word_and_the_run_stays(browser, seed):
    opened(browser, "seed=2&at=30")
    typed(browser, "seed", seed)
    browser.press("Enter")
    browser("at('seed').blur()")
    assert browser("at('message').textContent").startswith("A seed is a whole number")
    assert browser("[state.seed, walkView.steps.length > 0]") == [2, True]


# --- Rules beside each other -----------------------------------------------------------------------------------------


def test_a_rule_is_compared_over_seeds_with_those_chosen_before_it(browser):
    """The links to try lead there, every run is the library's, and the title holds what they come to."""
    opened(browser, "view=robot")
    for rule in ("gate", "gate:opposite"):
        browser(f"document.querySelector('[data-for=robot] li a[href*=\"rule={rule}&\"]').click()")
        browser.until(f"!player.mode && state.rule === '{rule}' && robotView.experiment.done && !jobs.has('seeds')")
    assert browser("kept()") == ["fletcher-reeves", "gate"]
    opened(browser, browser("address()") + "&seeds=2")
    browser.until("!robotView.working")
    said = title(browser, "r-curve")
    assert "so far" not in said
    for rule in ("fletcher-reeves", "gate", "gate:opposite"):
        runs = [agent.run(Settings(images="compact", lambda_rule=rule), seed).lengths.tolist() for seed in (1, 2)]
        assert browser(f"robotView.rows('{rule}')") == runs
        late, name = np.mean(runs, axis=0)[-5:].mean(), browser(f"nameOf('{rule}')")
        assert f"{late:.3g} with {name}" in said


def test_ten_seeds_run_between_frames_and_can_be_stopped(browser):
    opened(browser, "view=robot&alpha=0.4")
    browser.click("#robot-seeds")
    browser.until("robotView.rows(chosen()).length >= 1")
    assert browser("at('robot-seeds').textContent").startswith("Stop ")
    browser.click("#robot-seeds")
    done = browser("robotView.rows(chosen()).length")
    assert 1 <= done < 10
    assert browser("[state.seeds, robotView.working]") == [done, False]
    assert f"&seeds={done}" in browser("address()")
    assert "alpha=" not in browser("address()")  # which is the walk's


def test_at_most_three_rules_are_kept_and_each_can_be_dropped(browser):
    opened(browser, "rule=fixed&lambda=0.5")
    for rule in ("gate", "inverse", "absolute", "polak-ribiere", "gate"):
        browser(f"at('rule').value = '{rule}'; at('rule').dispatchEvent(new Event('change'))")
    assert browser("compared().map(({ name }) => name)") == ["inverse", "absolute", "form 3", "gate"]
    browser.click("#kept button")
    assert browser("kept()") == ["absolute", "polak-ribiere"]


# --- The walk --------------------------------------------------------------------------------------------------------


def test_the_cell_of_the_trace_that_is_clicked_says_its_value(browser):
    opened(browser, "rule=fixed&lambda=0.6&at=300")
    title(browser, "w-trace")
    step, row, place, changed = browser(
        """(() => {
          const { canvas } = CHARTS.find((chart) => chart.canvas.id === "w-trace"), { steps } = walkView, u = unit();
          const step = steps.findLastIndex((one, k) => k < steps.length - 1 && one.trace.includes(1));
          const row = steps[step].trace.indexOf(1), [top, bottom] = [44 * u, 0.5 * canvas.clientHeight];
          canvas.scrollIntoView({ block: "center" });
          const { left, top: edge } = canvas.getBoundingClientRect();
          const across = timeAxis(canvas.clientWidth / u, steps.length).x(step) * u;
          const place = [left + across, edge + bottom - ((row + 0.5) * (bottom - top)) / STATES];
          return [step, row, place, steps[step].trace.filter((value) => Math.abs(value) > 0.01).length];
        })()"""
    )
    browser.drag(place)
    browser.until("state.row >= 0")
    said = title(browser, "w-trace")
    assert said.startswith(f"The error of step {step + 1} changes {changed} states (traces above 0.01)")
    assert f"state {row} is 1." in said


def test_the_walk_measures_its_rules_as_a_race_does(browser):
    opened(browser, "rule=gate&with=gate:opposite")
    browser("DATA.stepSizes.splice(2); [...walkView.comparing()].length")
    assert "(mean of 20 seeds)" in title(browser, "w-error")
    browser("walkView.known.forEach((runs) => runs.splice(2))")
    for rule in ("gate", "gate:opposite"):
        stored = [[walk.learning(rule, 1000 + seed, size).mean() for size in walk.RACE_SIZES[:2]] for seed in range(2)]
        theirs = browser(f"walkView.sweep('{rule}').map(({{ error }}) => error)")
        assert theirs == pytest.approx(np.mean(stored, axis=0).tolist(), abs=1e-12)


# --- The robot -------------------------------------------------------------------------------------------------------


def test_frozen_twice_at_a_step_is_not_at_all_and_a_restart_forgets_it(browser):
    opened(browser, "view=robot&seed=64&made=843")
    learnt = browser(WEIGHTS)
    for _ in range(3):
        browser.click("#frozen")
    browser.click("#robot-step")
    assert title(browser, "r-room").startswith("Episode 11, frozen, step 1")
    assert browser(WEIGHTS) == learnt
    browser.click("#robot-again")
    assert browser("[state.frozen, robotView.frozen, at('frozen').checked]") == ["", False, False]


def test_the_page_understands_every_link_of_its_own(browser):
    opened(browser, "view=robot")
    links = "[...document.querySelectorAll('main a')].map((a) => a.getAttribute('href'))"
    assert len(browser(links)) > 10
    assert browser(f"{links}.map((link) => readAddress(link)).filter(Boolean)") == []
    frozen = browser(f"{links}.filter((link) => link.includes('frozen'))")
    opened(browser, frozen[0])
    assert browser("robotView.experiment.episodes.map((episode) => episode.frozen)") == [0] * 10
    assert browser("robotView.steps.every((step) => step.frozen)")


def test_the_start_is_dragged_and_turned_and_a_robot_under_way_is_kidnapped_where_it_fits(browser):
    opened(browser, "view=robot")
    x, y, heading = browser("Object.values(robotView.experiment.env.start)")
    ahead = browser("handleAt(roomScale(at('r-room').clientWidth / unit()).scale)")
    ring = x + ahead * np.cos(heading), y + ahead * np.sin(heading)
    browser.drag(*in_room(browser, ring, (x + 0.1, y + 0.1), (x, y + 0.2)))
    assert browser("Object.values(robotView.experiment.env.start)") == pytest.approx([x, y, np.pi / 2], abs=0.02)
    browser.drag(*in_room(browser, (0.25, 0.5), (0.3, 0.6), (0.4, 0.7)))
    assert browser("Object.values(robotView.experiment.env.start)")[:2] == pytest.approx([0.4, 0.7], abs=0.02)
    browser.click("#robot-step")
    x, y = browser("[robotView.pose.x, robotView.pose.y]")
    browser.drag(*in_room(browser, (x, y), (0.5, 0.3), (0.6, 0.2)))
    assert browser("[robotView.pose.x, robotView.pose.y]") == pytest.approx([0.6, 0.2], abs=0.02)
    assert browser("state.kidnap").startswith("1:")
    browser.drag(*in_room(browser, (0.6, 0.2), (0.9, 0.4), (1.12, 0.5)))
    assert "does not fit" in browser("at('message').textContent")
    assert browser("robotView.pose.x") == pytest.approx(0.6, abs=0.02)


def test_a_trained_robot_that_is_put_down_after_its_last_episode_drives_on(browser):
    opened(browser, "view=robot&made=50000&seed=2")
    x, y = browser("[robotView.pose.x, robotView.pose.y]")
    held, there = in_room(browser, (x, y), (0.4, 0.3))
    browser.mouse("mousePressed", held)
    browser.mouse("mouseMoved", there)
    assert "episode 21 begins here, with all that it has learnt" in title(browser, "r-room")
    browser.mouse("mouseReleased", there)
    assert browser("player.mode") == "play"
    browser.until("robotView.experiment.underWay && robotView.steps.length > 2")
    browser("player.pause()")
    assert browser("robotView.experiment.from.x") == pytest.approx(0.4, abs=0.02)
    assert browser("[state.more, state.start]") == [1, ""]


def test_a_robot_that_is_carried_while_it_plays_plays_on(browser):
    opened(browser, "view=robot")
    browser.click("#robot-play")
    browser.until("robotView.steps.length > 2")
    browser.click("#robot-kidnap")
    browser.until(f"state.made > {browser('state.made')} + 2")
    held, there = in_room(browser, browser("[robotView.pose.x, robotView.pose.y]"), (0.4, 0.3))
    browser.mouse("mousePressed", held)
    made = browser("state.made")
    browser("new Promise((done) => setTimeout(done, 400))")
    assert browser("state.made") == made  # while it is held
    browser.mouse("mouseMoved", there)
    browser.mouse("mouseReleased", there)
    browser.until(f"player.mode === 'play' && state.made > {made} + 2")
    assert browser("legs(robotView.experiment.from, robotView.steps).filter((leg) => leg.carried).length") == 2


def test_the_data_are_saved_and_are_the_run(browser, tmp_path):
    opened(browser, "view=robot&seed=1&made=60")
    browser.call("Browser.setDownloadBehavior", behavior="allow", downloadPath=str(tmp_path))
    browser.click("#save-data")
    table = tmp_path / "homing-robot-fletcher-reeves-seed-1.csv"
    for _ in range(100):
        browser("new Promise((done) => setTimeout(done, 100))")
        if table.exists():
            break
    about, header, *rows = table.read_text(encoding="utf-8").splitlines()
    assert "made=60" in about
    column = header.split(",").index("delta")
    run = agent.run(Settings(images="compact", episodes=20), 1)
    assert [float(row.split(",")[column]) for row in rows] == pytest.approx(run.column("delta")[:60].tolist(), abs=1e-9)
