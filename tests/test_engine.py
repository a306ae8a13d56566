"""The engine: whole runs compiled, the same to the bit as in Python, and made by Python where they cannot be."""

import math
import random
import re
from pathlib import Path
from statistics import median
from types import ModuleType
from typing import Any

import gymnasium
import numpy as np
import pytest

import homing_lib
from homing_lib import agent, lambdas
from homing_lib.agent import SarsaAgent, run_episode
from homing_lib.errors import UserError
from homing_lib.lambdas import fletcher_reeves
from homing_lib.settings import Settings
from homing_lib.study import engine, rules
from homing_lib.study.robots import FrozenAgent
from tests import parity

pytest.importorskip("numba")

FILES = [Path(homing_lib.__file__).parent / "study" / name for name in ("compiled_world.py", "compiled.py")]
SOURCE = "\n".join(file.read_text(encoding="utf-8") for file in FILES)
TINY = Settings(images="compact", episodes=2, survey_steps=60, max_steps=80)


def same(one, other):
    return one.steps.tobytes() == other.steps.tobytes() and one.lengths.tolist() == other.lengths.tolist()


# Parity


@pytest.fixture(scope="module")
def atlases(tmp_path_factory):
    """Settings of small atlases with all kinds of views."""
    with parity.coarse_atlases(tmp_path_factory.mktemp("atlases"), random.Random(0), 3) as some:
        yield some


@pytest.mark.parametrize("seed", range(2))
def test_runs_drawn_by_chance_are_in_all_they_leave_behind_those_of_python(seed, atlases):
    """The long campaign: `python -m tests.parity`."""
    rng = random.Random(seed)
    assert [case for case in (parity.draw(rng, atlases) for _ in range(75)) if parity.differ(case)] == []


def test_the_cases_draw_every_setting_and_their_runs_are_long(atlases):
    rng = random.Random(0)
    cases = [parity.draw(rng, atlases) for _ in range(100)]
    undrawn = {"traces", *parity.SEEN, *(() if atlases else ("images", "room"))}
    for name in {*Settings.model_fields} - undrawn:
        assert len({getattr(case.settings, name) for case in cases}) > 1, name
    assert median(parity.left_by(case, engine.run, engine.run_episode).get("count", 0) for case in cases[:20]) >= 150


@pytest.mark.parametrize("name", ["_episodes", "surveyed"])
def test_a_case_that_could_be_compiled_and_is_not_is_no_case_that_is_the_same(name, monkeypatch):
    def refuse(*_):
        raise engine.ForPython

    monkeypatch.setattr(engine, name, refuse)
    with pytest.raises(AssertionError, match="not compiled"):
        parity.differ(parity.Case(TINY, 1, None, False))


def interpreted(source):
    """The compiled code without its compiler: slow, and quickly changed."""
    module = ModuleType("homing_lib.study.compiled")
    plain = source.replace("cache=KEPT", "cache=False").replace("@compiled\n", "").replace("@inlined\n", "")
    exec(re.sub(r"^from homing_lib.study.compiled_world import .*$", "", plain, flags=re.MULTILINE), module.__dict__)
    return module


FAULTS = {
    "none": ("", ""),
    "a broken sign": ("agent.discount * q_next - q", "agent.discount * q_next + q"),
    "a lost clip": ("if agent.clip and not", "if not agent.clip and not"),
    "a swapped stream": ("reflex, action, world_rng)", "reflex, action, agent_rng)"),
    "an episode that remembers the one before": ("has_before = 0.0, False", "has_before = 0.0, number > 0"),
    "the features of the step before": ("earlier = phi_sa if", "earlier = phi_prev if"),
    "a bound one too low": ("range(1, task.max_steps + 1)", "range(1, task.max_steps)"),
    "a penalty that is paid": ("reward -= task.wall_penalty", "reward += task.wall_penalty"),
    "the other order of a sum": ("((s0 + s1) + (s2 + s3))", "(((s0 + s1) + s2) + s3)"),
    "a reflex to the other side": ("0 if rng.random() < 0.5 else 1", "1 if rng.random() < 0.5 else 0"),
}


@pytest.mark.filterwarnings("ignore:overflow")
@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_in_the_compiled_code_is_found_by_the_cases(fault, monkeypatch):
    old, new = FAULTS[fault]
    assert old in SOURCE
    module = interpreted(SOURCE.replace(old, new, 1))
    monkeypatch.setattr(engine, "load", lambda: module)
    few = TINY.with_changes(survey_steps=10, max_steps=60, wall_penalty=3, overwrite_features=True)
    standard = {"update": "all", "lambda_rule": "fletcher-reeves:unclipped", "overwrite_features": False}
    changes: tuple[dict[str, Any], ...] = ({}, standard, {"lambda_rule": "fixed:0.7"})
    cases = [parity.Case(few.with_changes(**one), 3, None, False) for one in changes]
    assert any(map(parity.differ, cases)) == (fault != "none")


def test_a_run_longer_than_one_call_of_the_compiled_code_is_the_same(monkeypatch):
    whole = engine.run(TINY, 0)
    monkeypatch.setattr(engine, "ROWS", 1)
    assert same(engine.run(TINY, 0), whole)


# Rules


def halved(factor):
    return lambda *, delta, delta_prev, **_: factor if delta * delta_prev > 0 else 0.0


def calling(*, delta, phi, delta_prev, phi_prev, discount, **_):
    return max(0.0, fletcher_reeves(delta=delta, phi=phi, delta_prev=delta_prev, phi_prev=phi_prev, discount=discount))


def with_a_default(*, delta, size=0.25, **_):
    return size * (delta > 0)


def guarded(*, delta, delta_prev, **_):
    try:
        return delta / delta_prev
    except ZeroDivisionError:
        return 0.0


def counting():
    calls = 0

    def rule(**_):
        nonlocal calls
        calls += 1
        return 1 / calls

    return rule


def remembering(*, delta, _seen=[], **_):  # noqa: B006, which is its point
    _seen.append(delta)
    return 0.5


def keeping_count(**_):
    keeping_count.calls = getattr(keeping_count, "calls", 0) + 1
    return 0.5


def calling_itself(*, delta, depth=2, **_):
    return calling_itself(delta=delta, depth=depth - 1) if depth else 0.5


class Halved:
    def __call__(self, **_):
        return 0.5


COMPILED = [*lambdas.RULES.values(), lambdas.Fixed(0.3), halved(0.5), calling, with_a_default]
IN_PYTHON = {
    "it keeps a state": [counting, lambda: remembering, lambda: keeping_count],
    "it is no plain function": [Halved, lambda: lambda **seen: 0.5 if seen["delta"] > 0 else 0.0],
    "it calls itself, or catches what is raised": [lambda: calling_itself, lambda: guarded],
    "compiled it might compute otherwise": [
        lambda: lambda *, delta, **_: min(1.0, abs(delta) ** 0.5),
        lambda: lambda *, phi, **_: float(np.sum(phi)) / 1000,
        lambda: lambda *, delta, **_: math.tanh(abs(delta)),
        lambda: lambda *, phi, **_: 1 / np.linalg.norm(phi),
    ],
}


@pytest.mark.parametrize("rule", COMPILED)
def test_a_rule_that_depends_on_the_step_alone_is_compiled(rule):
    assert engine.compiles(rule)
    assert same(engine.run(TINY, 1, rule), agent.run(TINY, 1, rule))


@pytest.mark.parametrize(
    "make",
    [pytest.param(make, id=f"{why} {n}") for why, makes in IN_PYTHON.items() for n, make in enumerate(makes)],
)
def test_any_other_rule_is_for_python_and_gives_the_same_run(make):
    assert not engine.compiles(make())
    assert same(engine.run(TINY, 1, make()), agent.run(TINY, 1, make()))


FACTOR = 0.5


def of_a_constant(*, delta, **_):
    return FACTOR if delta > 0 else 0.0


def test_a_constant_that_was_changed_between_two_runs_is_the_new_one(monkeypatch):
    before = engine.run(TINY, 1, of_a_constant)
    monkeypatch.setitem(globals(), "FACTOR", 0.125)
    after = engine.run(TINY, 1, of_a_constant)
    assert set(np.unique(before.column("lambda"))) == {0, 0.5}
    assert set(np.unique(after.column("lambda"))) == {0, 0.125}
    assert set(np.unique(engine.run(TINY, 1, halved(0.75)).column("lambda"))) <= {0, 0.75}


def late_mistake(*, delta, phi, **_):
    return 0.5 if phi[0] < 2 and abs(delta) < 3 else np.nan


def divides(*, delta, **_):
    return float(np.float64(1.0) / (delta - delta))


@pytest.mark.parametrize("rule", [late_mistake, divides, lambda **_: "0.5", lambda *, delta, **_: delta.real + "x"])
def test_a_mistake_in_a_rule_is_raised_as_in_python(rule):
    raised = []
    for run in (agent.run, engine.run):
        with pytest.raises(Exception) as error:
            run(TINY, 1, rule)
        raised.append((error.type, str(error.value)))
    assert raised[0] == raised[1]


def without_a_ratio(*, delta, phi, **_):
    return 0.5 / (phi[0] < 2 and abs(delta) < 3)


def test_a_run_that_python_has_to_repeat_begins_as_it_began():
    repeated = []
    for run in (agent.run, engine.run):
        kept = SarsaAgent(TINY, np.random.default_rng(5), without_a_ratio)
        repeated.append(run(TINY, 1, agent=lambda *_, kept=kept: kept))
    assert same(*repeated)


def test_lambdas_that_are_drawn_are_drawn_one_after_the_other_whoever_compares_them():
    one, other = (rules.compare({"drawn": parity.resampled()}, range(3), TINY).steps["drawn"] for _ in range(2))
    rule = parity.resampled()
    expected = [agent.run(TINY, seed, rule).lengths for seed in range(3)]
    np.testing.assert_array_equal(one, expected)
    np.testing.assert_array_equal(other, expected)


# Who drives


class Forward(SarsaAgent):
    def choose(self, phi):
        return 2


def patched(*made):
    robot = SarsaAgent(*made)
    robot.choose = lambda phi: 2
    return robot


def frozen_and_patched(*made):
    robot = FrozenAgent(SarsaAgent(*made))
    robot.choose = lambda phi: 2
    return robot


@pytest.mark.parametrize("make", [Forward, patched, frozen_and_patched])
def test_an_agent_that_is_not_what_its_class_says_is_for_python(make):
    ours = engine.run(TINY, 1, agent=make)
    assert same(ours, agent.run(TINY, 1, agent=make))
    assert (ours.column("action") == 2).mean() > 0.5


def test_an_agent_of_other_features_is_refused_as_in_python():
    def other(settings, rng):
        return SarsaAgent(settings.with_changes(bin_size=6), rng)

    for run in (agent.run, engine.run):
        with pytest.raises(ValueError, match=r"dimension|shape"):
            run(TINY, 1, agent=other)


def test_what_a_closed_or_wrongly_asked_world_says_is_what_it_says_in_python():
    def afterwards(env, driver):
        for episode in (run_episode, engine.run_episode):
            with pytest.raises(UserError, match=r"^options = "):
                episode(env, FrozenAgent(driver), {"begin": 1})
        env.close()
        with pytest.raises(gymnasium.error.ClosedEnvironmentError):
            engine.run_episode(env, FrozenAgent(driver))

    engine.run(TINY, 1, afterwards=afterwards)


def test_every_episode_is_reported_and_a_run_that_diverges_says_in_which():
    numbers = []
    engine.run(TINY, 1, after_episode=numbers.append)
    assert numbers == [1, 2]
    wild = TINY.with_changes(lambda_rule="fixed:1", alpha0=1e9, theta0=1e9)
    assert engine.run(wild, 1).diverged == agent.run(wild, 1).diverged == 1
