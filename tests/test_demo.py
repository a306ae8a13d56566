"""The demonstration computes what the library computes: from the same settings and seed, the same run."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import trim_mean

from homing_lib import agent
from homing_lib.agent import STEP_COLUMNS
from homing_lib.environment import HomingEnv, free_pose
from homing_lib.lambdas import RULES, dot
from homing_lib.settings import Settings
from homing_lib.study import measures, robots, walk
from tests.javascript import Engine

SMALL = Settings(images="compact", episodes=4, survey_steps=200, max_steps=300)
RULE_NAMES = (*RULES, "fixed:0", "fixed:0.9", "fletcher-reeves:on_zero=1")


def as_json(settings: Settings, **changes: Any) -> dict[str, Any]:
    return settings.model_dump(mode="json") | changes


def assert_same_run(engine: Engine, settings: Settings, seed: int, own: str | None = None, rule: Any = None) -> None:
    """Every action, length and reset equal; weights and delta within 1e-12 and lambda within 1e-10.

    Form 1 divides what nearly cancels by what nearly cancels, which leaves the last bit of an exponential in the tenth
    digit of lambda and so, a few steps later, moves delta by some 1e-12: there it is held to 1e-11. Where weights run
    away, the value of one feature is held to 1e-12 of the largest.
    """
    learners: list[Any] = []
    ours = agent.run(settings, seed, rule, afterwards=lambda _, agent: learners.append(getattr(agent, "learner", None)))
    theirs = engine(
        """const { episodes, diverged, agent } = run(world, settings, seed);
           const weights = [...agent.learner?.weights ?? []];
           return { steps: rows(episodes).flat(), lengths: episodes.map((episode) => episode.steps.length),
             reached: episodes.map((episode) => episode.reached), diverged, weights };""",
        settings=as_json(settings, **({"lambda_rule": f"own:{own}"} if own else {})),
        seed=seed,
    )
    assert theirs["lengths"] == ours.lengths.tolist()
    assert theirs["reached"] == ours.reached.tolist()
    assert theirs["diverged"] == ours.diverged
    values = np.reshape(np.array(theirs["steps"], float), (-1, len(STEP_COLUMNS))).T
    steps = dict(zip(STEP_COLUMNS, values, strict=True))
    for name in ("action", "clipped", "at_wall"):
        np.testing.assert_array_equal(steps[name], ours.column(name), name)
    largest = max(1.0, np.abs(ours.column("delta")).max(initial=0) / settings.n_features)
    if learners and learners[0]:
        weights = learners[0].weights.ravel()
        np.testing.assert_allclose(theirs["weights"], weights, rtol=1e-12, atol=1e-12, err_msg="weights")
        largest = max(largest, np.abs(weights).max())
    tolerance = dict.fromkeys(STEP_COLUMNS, 1e-12)
    tolerance |= {"change": 1e-12 * largest, "lambda": 1e-10}
    if settings.lambda_rule.startswith("hestenes-stiefel"):
        tolerance["delta"] = 1e-11
    if largest > 10:
        tolerance["delta"] = 1e-12 * largest * settings.n_features
    for name, most in tolerance.items():
        relative = 0 if name == "delta" else most
        np.testing.assert_allclose(steps[name], ours.column(name), rtol=relative, atol=most, err_msg=name)


# --- Random numbers --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", [0, 1, 1004, 2**32, 2**40 + 5, 12345678901234567890123456789012345678901234567890])
def test_the_random_streams_are_those_of_numpy(engine, seed):
    sequence, rng = np.random.SeedSequence(seed), np.random.default_rng(seed)
    spawned, drawn = engine(
        """const sequence = new SeedSequence(BigInt(seed)), rng = new Generator(BigInt(seed));
           const draw = () => [rng.random(), rng.integers(3), rng.uniform(-2, 5), rng.integers(2)];
           return [[...sequence.spawn(3), ...sequence.spawn(2)].map((child) => child.generateState(5)),
             Array.from({ length: 50 }, draw)];""",
        seed=str(seed),
    )
    assert spawned == [child.generate_state(5).tolist() for child in (*sequence.spawn(3), *sequence.spawn(2))]
    assert drawn == [[rng.random(), int(rng.integers(3)), rng.uniform(-2, 5), int(rng.integers(2))] for _ in range(50)]


def test_whole_numbers_are_drawn_by_the_same_rejection(engine):
    """Of a million and a half, one in three thousand is rejected: some of these are."""
    rng, count = np.random.default_rng(5), 1_500_000
    drawn = engine(
        "const rng = new Generator(5); return Array.from({ length: 20000 }, () => rng.integers(count));", count=count
    )
    assert drawn == [int(rng.integers(count)) for _ in range(20_000)]


# --- The robot -------------------------------------------------------------------------------------------------------


def test_a_whole_run_is_the_same(engine):
    assert_same_run(engine, Settings(images="compact"), 1)


@pytest.mark.parametrize("rule", RULE_NAMES)
def test_every_rule_gives_the_same_run(engine, rule):
    for seed in (0, 1, 2):
        assert_same_run(engine, SMALL.with_changes(lambda_rule=rule), seed)


@pytest.mark.parametrize(
    "changes",
    [
        {"update": "all"},
        {"bootstrap_terminal": False},
        {"multiplier": 6.0, "epsilon0": 0.1, "alpha0": 0.004, "theta0": 0.1, "discount": 0.9, "wall_penalty": 1.0},
        {"controller": "random"},
        {"controller": "climb"},
        {"lambda_rule": "fletcher-reeves:unclipped", "alpha0": 0.01},
        {"lambda_rule": "fixed:1", "update": "all"},
    ],
    ids=str,
)
def test_every_setting_of_the_page_gives_the_same_run(engine, changes):
    for seed in (3, 4):
        assert_same_run(engine, SMALL.with_changes(**changes), seed)


def test_a_run_that_diverges_does_so_in_the_same_episode(engine):
    lost = SMALL.with_changes(lambda_rule="fletcher-reeves:unclipped", update="all", alpha0=1.0)
    assert agent.run(lost, 0).diverged
    assert_same_run(engine, lost, 0)


def test_a_robot_that_starts_elsewhere_or_is_kidnapped_goes_the_same_way(engine):
    with HomingEnv(SMALL, observation="features") as env:
        start, away = (free_pose(env.world, env.room, np.random.default_rng(seed)) for seed in (1, 2))
    ours: list[Any] = []

    def afterwards(env: HomingEnv, trained: agent.Agent) -> None:
        trained.begin_episode(SMALL.episodes + 1)
        ours.append(agent.run_episode(robots.Kidnapped(env, 8, away), trained, {"start": start})[0])

    agent.run(SMALL, 6, afterwards=afterwards)
    theirs = engine(
        """const experiment = run(world, settings, 6);
           experiment.total++;
           experiment.env.start = poseOf(start);
           for (let step = 0; step < 8; step++) experiment.step();
           experiment.kidnap(poseOf(away));
           while (experiment.step());
           return rows(experiment.episodes).at(-1);""",
        settings=as_json(SMALL),
        start=start,
        away=away,
    )
    assert len(theirs) > 8
    np.testing.assert_allclose(np.array(theirs)[:, :4], ours[0][:, :4], atol=1e-12)


@pytest.mark.parametrize("seed", [6, 7])
def test_a_frozen_robot_drives_as_the_librarys_and_learns_on_from_there(engine, seed):
    """Two frozen trials, then one more episode with the learning on, at the rates of the episode after the training."""
    trials, weights = [], []

    def afterwards(env: HomingEnv, trained: agent.Agent) -> None:
        trained.begin_episode(SMALL.episodes + 1)
        frozen = robots.FrozenAgent(trained)
        for driver in (frozen, frozen, trained):
            driver.begin_episode(SMALL.episodes + 1)
            trials.append(agent.run_episode(env, driver)[0])
            weights.append(trained.learner.weights.ravel().tolist())

    agent.run(SMALL, seed, afterwards=afterwards)
    theirs = engine(
        """const experiment = run(world, settings, seed);
           const weights = [true, true, false].map((frozen) => {
             experiment.total++;
             experiment.freeze(frozen);
             while (experiment.step());
             return [...experiment.agent.learner.weights];
           });
           const { episodes } = experiment;
           return { weights, trials: rows(episodes.slice(-3)), frozen: episodes.map((episode) => episode.frozen) };""",
        settings=as_json(SMALL),
        seed=seed,
    )
    assert theirs["frozen"] == [0] * SMALL.episodes + [1, 1, 0]
    assert weights[0] == weights[1] != weights[2]
    for trial, steps in zip(trials, theirs["trials"], strict=True):
        np.testing.assert_allclose(steps, trial, atol=1e-10)
    np.testing.assert_allclose(theirs["weights"], weights, atol=1e-12)


def test_a_robot_that_learns_on_in_mid_episode_begins_with_no_trace_and_no_error_before(engine):
    trace, phi, step = engine(
        """const experiment = new Experiment(world, settings, 1);
           for (const frozen of [false, true]) {
             experiment.freeze(frozen);
             for (let step = 0; step < 9; step++) experiment.step();
           }
           experiment.freeze(false);
           const { phi } = experiment, step = experiment.step();
           return [[...experiment.agent.learner.trace], [...phi], step];""",
        settings=as_json(SMALL, lambda_rule="fixed:0.9"),
    )
    assert [share for share in trace if share] == phi
    assert (step["lambda"], step["frozen"]) == (0, False)


def test_the_shortest_way_is_as_long(engine):
    near = SMALL.with_changes(multiplier=3.0)  # home begins early, which makes the search short
    (ours,) = measures.shortest(near, 0)["steps"]
    theirs = engine(
        """const search = searching(new Experiment(world, settings, 0).env);
           for (;;) { const { done, value } = search.next(); if (done) return value; }""",
        settings=as_json(near),
    )
    assert theirs == ours > 5


# --- The walk --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("rule", RULE_NAMES)
def test_every_rule_gives_the_same_walks(engine, rule):
    script = "const walk = new Walk(lambdaSpec(rule), 0.1, 7); walk.finish(10); return walk.errors;"
    errors = [np.sqrt(0.3), *walk.learning(rule, 7, 0.1)]
    assert engine(script, rule=rule) == pytest.approx(errors, abs=1e-12)


def test_walks_that_diverge_end(engine):
    told = engine(
        """const walk = new Walk(lambdaSpec("fletcher-reeves:on_zero=1:unclipped"), 1, 1);
           walk.finish(100);
           return [walk.walks, walk.step()];"""
    )
    assert told == [1, False]


# --- Rules of one's own, and many seeds ------------------------------------------------------------------------------

OWN = {
    "0.7 if delta * delta_prev > 0 else 0": lambda delta, delta_prev, **_: 0.7 if delta * delta_prev > 0 else 0,
    "delta * dot(phi, phi) / (discount * delta_prev * dot(phi_prev, phi_prev))": RULES["fletcher-reeves"],
    "return min(abs(delta), .9) ** 2": lambda delta, **_: min(abs(delta), 0.9) ** 2,
    "0 < delta < 1 or not delta_prev": lambda delta, delta_prev, **_: 0 < delta < 1 or not delta_prev,
    "np.sign(delta) / 2 if delta_prev > 0 and delta > 0 else phi @ trace_prev / 1000 % 1": (
        lambda delta, delta_prev, phi, trace_prev, **_: (
            0.5 if delta_prev > 0 and delta > 0 else float(dot(phi, trace_prev)) / 1000 % 1
        )
    ),
    "δ × |φ|² / (γ · δ₋ × φ₋·φ₋)": RULES["fletcher-reeves"],
    "(δ − δ₋) > 0 and dot(e₋, φ) > 0": lambda delta, delta_prev, phi, trace_prev, **_: (
        delta - delta_prev > 0 and float(dot(trace_prev, phi)) > 0
    ),
    "1 / (delta - delta)": lambda delta, **_: 1 / (delta - delta),
}


@pytest.mark.parametrize("text", OWN)
def test_a_rule_of_ones_own_is_the_same_in_both_languages(engine, text):
    assert_same_run(engine, SMALL, 5, text, OWN[text])


@settings(deadline=None)  # the engine's time is the machine's
@given(st.lists(st.integers(0, 2000), min_size=1, max_size=12))
def test_many_seeds_are_summed_up_as_in_the_library(engine, values):
    rng = np.random.default_rng(0)
    draws = [[rng.integers(len(values)) for _ in values] for _ in range(400)]
    resampled = trim_mean(np.array(values, float)[draws], 0.25, axis=1)
    summary = engine("return iqmInterval(values);", values=values)
    assert summary["value"] == pytest.approx(trim_mean(values, 0.25))
    np.testing.assert_allclose([summary["low"], summary["high"]], np.percentile(resampled, (2.5, 97.5)))
