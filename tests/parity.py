"""Runs drawn by chance, compiled and in Python, are the same to the bit, or refused alike: `python -m tests.parity`.

A case draws settings from their own schema, a lambda rule, who drives, and what is tried after learning. Compared are
every column of every step, lengths, weights, traces and the states of both generators.
"""

import argparse
import math
import random
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple, get_args
from unittest.mock import patch

import numpy as np
from tqdm import tqdm

from homing_lib import agent, atlas, lambdas
from homing_lib.agent import SarsaAgent
from homing_lib.environment import HomingEnv, free_pose
from homing_lib.errors import UserError
from homing_lib.lambdas import dot, fletcher_reeves
from homing_lib.rooms import ROOMS, room_named
from homing_lib.settings import Settings
from homing_lib.study import engine
from homing_lib.study.robots import ClimbGuidedAgent, FrozenAgent, RestoredAgent
from homing_lib.study.rules import ResampledLambda

FIXED = ("images", "room", "traces", "lambda_rule", "episodes", "max_steps", "start", "controller")
"""Settings that are drawn in a way of their own. Other traces than accumulating ones are for Python."""

SEEN = [name for name in Settings.model_fields if name in Settings().of_scope("view", "lattice")]


class Case(NamedTuple):
    """What is run. rule: makes one of one's own, anew for each run, or None; forgets: initial weights each time."""

    settings: Settings
    seed: int
    rule: Callable[[], Any] | None
    forgets: bool


def value(rng: random.Random, name: str) -> Any:
    """A value of a setting: one of its choices; near the default, or at one of its bounds."""
    field = Settings.model_fields[name]
    default, choices = field.default, get_args(field.annotation)
    if isinstance(default, bool):
        return rng.random() < 0.5
    if choices:
        return rng.choice(choices)
    low, high = (
        next((getattr(one, kind) for one in field.metadata if hasattr(one, kind)), bound)
        for kind, bound in (("ge", 0.0), ("le", 1e9))
    )
    if rng.random() < 0.05 and name != "survey_steps":
        return type(default)(low if rng.random() < 0.5 else min(high, 100))
    drawn = default * math.exp(rng.uniform(-1.5, 1.5)) if default else rng.choice([0.0, rng.uniform(low, min(high, 5))])
    return type(default)(min(max(drawn, low), high))


def half() -> Any:
    """A rule by a gate of its own, with a constant in its closure."""
    size = 0.5
    return lambda *, delta, delta_prev, **_: size if delta * delta_prev > 0 else 0.0


def written_out() -> Any:
    """Form 2 as a student writes it."""

    def rule(*, delta, phi, delta_prev, phi_prev, discount, **_):  # type: ignore[no-untyped-def]
        return delta * (phi @ phi) / (discount * delta_prev * (phi_prev @ phi_prev))

    return rule


def traced() -> Any:
    """A rule that looks at the trace, calls another, and is cut by hand."""

    def rule(*, delta, phi, delta_prev, phi_prev, trace_prev, discount, size=0.9):  # type: ignore[no-untyped-def]
        ratio = fletcher_reeves(delta=delta, phi=phi, delta_prev=delta_prev, phi_prev=phi_prev, discount=discount)
        return max(0.0, min(1.0, ratio)) * (1 if dot(trace_prev, phi) > 100 else size)

    return rule


def resampled() -> Any:
    """Lambdas from a pool."""
    return ResampledLambda([0, 0.25, 1], [8, 1, 1], np.random.default_rng(1))


RULES: tuple[Callable[[], Any], ...] = (half, written_out, traced, resampled)


def draw(rng: random.Random, atlases: list[Settings]) -> Case:
    """A case. atlases: settings of those that are there, beside the compact one."""
    while True:
        base = rng.choice([Settings(images="compact"), *atlases])
        drawn = {name: value(rng, name) for name in Settings.model_fields if name not in (*FIXED, *SEEN)}
        changes = {name: one for name, one in drawn.items() if rng.random() < 0.5}
        name = rng.choice([*lambdas.RULES, f"fixed:{rng.choice([0, 1, round(rng.random(), 2)])}"])
        options = [option for option in (":unclipped", f":on_zero={rng.random():.1f}") if rng.random() < 0.15]
        changes |= {"lambda_rule": name + "".join(options), "episodes": rng.randint(1, 6)}
        changes |= {"max_steps": rng.choice([300, 300, rng.randint(1, 300)])}
        changes |= {"start": rng.choice(["room", "uniform"])}
        if rng.random() < 0.7:  # hardly a view is home, and episodes are long
            changes |= {"multiplier": 12 * math.exp(rng.uniform(1, 6))}
        changes |= {"controller": rng.choice(["sarsa"] * 8 + ["random", "climb"])}
        try:
            settings = base.with_changes(**changes)
        except UserError:  # values that do not go together
            continue
        sarsa = settings.controller == "sarsa"
        rule = rng.choice(RULES) if sarsa and rng.random() < 0.25 else None
        return Case(settings, rng.randrange(10**6), rule, sarsa and rule is None and rng.random() < 0.1)


def left_by(case: Case, run: Callable[..., agent.Run], run_episode: Callable[..., Any]) -> dict[str, Any]:
    """All that a run, and what is tried after it, leaves behind."""
    found: dict[str, Any] = {}

    def keep(env: HomingEnv, driver: Any, name: str) -> None:
        sarsa = getattr(driver, "agent", driver)
        found[f"generators {name}"] = sarsa.rng.bit_generator.state, env.np_random.bit_generator.state
        if isinstance(sarsa, SarsaAgent):
            learner = sarsa.learner
            found[f"weights {name}"] = learner.weights.tobytes(), learner.trace.tobytes()
            found[f"rates {name}"] = learner.steps, learner.step_size, sarsa.epsilon, sarsa.temperature

    def afterwards(env: HomingEnv, driver: Any) -> None:
        keep(env, driver, "after learning")
        rng = np.random.default_rng(case.seed)
        with HomingEnv(case.settings.with_changes(max_steps=40), observation="features", model=env.model) as world:
            world.reset(seed=case.seed)
            tried: dict[str, Any] = {"going on": driver}
            if type(driver) is SarsaAgent:
                tried |= {"frozen": FrozenAgent(driver), "greedy": FrozenAgent(driver, greedy=True)}
                tried |= {"guided": ClimbGuidedAgent(driver, 0.5, rng), "restored": RestoredAgent(driver)}
            for name, robot in tried.items():
                for options in {"start": free_pose(env.world, env.room, rng)}, None:
                    robot.begin_episode(case.settings.episodes + 1)
                    try:
                        steps, home = run_episode(world, robot, options)
                        found[f"{name}, {options is None}"] = steps.tobytes(), home
                    except agent.Diverged as error:
                        found[f"{name}, {options is None}"] = str(error)
            keep(world, driver, "after trials")

    how: dict[str, Any] = {"agent": lambda *made: RestoredAgent(SarsaAgent(*made))} if case.forgets else {}
    try:
        made = run(case.settings, case.seed, case.rule and case.rule(), afterwards=afterwards, **how)
    except (UserError, ValueError) as error:
        return {"refused": str(error)}
    return found | {
        "steps": made.steps.tobytes(),
        "lengths": (made.lengths.tobytes(), made.reached.tobytes(), made.diverged),
        "count": len(made.steps),
    }


def differ(case: Case) -> list[str]:
    """In what a compiled run differs from the one in Python."""

    def run(*what: Any, **how: Any) -> agent.Run:
        result = agent.run(*what, **how)
        # In Python only to say what is wrong, or where a rule of one's own has no ratio.
        refused = case.rule or result.diverged == result.settings.episodes == 1
        assert "episodes" in how or refused, f"not compiled: {case}"
        return result

    def run_episode(*what: Any) -> Any:
        result = agent.run_episode(*what)  # which raises Diverged, or else:
        assert case.rule, f"not compiled: {case}"
        return result

    in_python = SimpleNamespace(run=run, run_episode=run_episode, STEP_COLUMNS=agent.STEP_COLUMNS)
    with patch.object(engine, "in_python", in_python):
        ours = left_by(case, engine.run, engine.run_episode)
    theirs = left_by(case, agent.run, agent.run_episode)
    return [name for name in {**ours, **theirs} if ours.get(name) != theirs.get(name)]


@contextmanager
def coarse_atlases(folder: Path, rng: random.Random, count: int) -> Iterator[list[Settings]]:
    """Settings of small atlases, with views drawn from the schema too, rendered where there is PyBullet."""
    found: list[Settings] = []
    with patch.object(atlas, "FOLDER", folder):
        while atlas.camera_available() and len(found) < count:
            changes = {name: value(rng, name) for name in SEEN if rng.random() < 0.5}
            changes |= {"image_size": rng.choice([8, 15, 16, 24, 32]), "atlas_spacing_m": 0.1, "atlas_heading_deg": 45}
            try:
                settings = Settings(images="atlas", room=rng.choice([*ROOMS]), **changes)
                atlas.open_atlas(room_named(settings.room), settings, workers=1)
            except UserError:
                continue
            found.append(settings)
        yield found


def main() -> int:
    """Returns zero if no case differs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("cases", type=int, nargs="?", default=10_000)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    rng, came = random.Random(options.seed), Counter[str]()
    with tempfile.TemporaryDirectory() as folder, coarse_atlases(Path(folder), rng, 12) as atlases:
        for _ in tqdm(range(options.cases), unit="case", smoothing=0):
            case = draw(rng, atlases)
            differs = differ(case)
            came["differ" if differs else "the same"] += 1
            if differs:
                tqdm.write(f"{differs}: {case}")
    print(", ".join(f"{name} {count}" for name, count in came.items()))
    return int(bool(came["differ"]))


if __name__ == "__main__":
    raise SystemExit(main())
