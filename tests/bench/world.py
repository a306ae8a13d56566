"""What a step costs, whole: render or look up, features, motion, contact, infra-red, learning. Every bound is a ratio.

Each contestant repeats its own block of steps, always the same; they take turns, and the best of each is reported, in
time of the processor: whatever else the machine does at the time can only add to it.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # read once, when numpy is loaded

from collections.abc import Callable, Iterator
from importlib.util import find_spec
from time import process_time
from typing import Any
from unittest.mock import patch

import numpy as np
import pybullet

from homing_lib.agent import SarsaAgent, run_episode
from homing_lib.environment import HomingEnv, survey
from homing_lib.features import HomeModel
from homing_lib.settings import Settings

BLOCKS, STEPS, RUNS = 20, 100, 4
CAMERA = Settings(images="camera", max_steps=STEPS, multiplier=1e9, survey_steps=500)  # no view resembles home so much
ATLAS = Settings(images="atlas")

Block = Callable[[], int]
"""Makes steps, and says how many."""


def episode(env: HomingEnv) -> Block:
    """The first episode of a run, cut after some steps; the agent is always as new."""

    def block() -> int:
        env.np_random = np.random.default_rng(0)
        agent = SarsaAgent(env.settings, np.random.default_rng(0))
        agent.begin_episode(1)
        return len(run_episode(env, agent)[0])

    return block


def whole_runs(model: HomeModel) -> Block:
    """Runs of twenty episodes on the atlas, in Python, each of another seed and in an environment of its own."""

    def block() -> int:
        steps = 0
        for seed in range(RUNS):
            with HomingEnv(ATLAS, observation="features", model=model) as env:
                env.reset(seed=seed)
                agent = SarsaAgent(ATLAS, np.random.default_rng(seed))
                for number in range(1, ATLAS.episodes + 1):
                    agent.begin_episode(number)
                    steps += len(run_episode(env, agent)[0])
        return steps

    return block


def renders(block: Block) -> Block:
    """The calls of getCameraImage that a block makes, and nothing else."""
    calls: list[tuple[Any, Any]] = []
    render = pybullet.getCameraImage

    def recorded(*args: Any, **options: Any) -> Any:
        calls.append((args, options))
        return render(*args, **options)

    with patch.object(pybullet, "getCameraImage", recorded):
        steps = block()

    def again() -> int:
        for args, options in calls:
            render(*args, **options)
        return steps

    return again


def miniworld() -> Block:
    """Steps of a room in Miniworld at the same image size."""
    import pyglet

    pyglet.options["headless"] = True
    import gymnasium
    import miniworld  # noqa: F401, which registers its environments

    size = CAMERA.image_size
    env = gymnasium.make("MiniWorld-OneRoom-v0", obs_width=size, obs_height=size, max_episode_steps=STEPS + 1)

    def block() -> int:
        env.reset(seed=0)
        for step in range(STEPS):
            env.step(2 * (step % 2))  # turn left, go ahead
        return STEPS

    return block


def stable_baselines3(env: HomingEnv) -> Block:
    """Steps of DQN, with its defaults, on the same features."""
    import torch
    from stable_baselines3 import DQN

    torch.set_num_threads(1)
    model = DQN("MlpPolicy", env, learning_starts=1, device="cpu", seed=0)

    def block() -> int:
        model.learn(STEPS, reset_num_timesteps=False)
        return STEPS

    return block


def best_us(blocks: dict[str, Block]) -> dict[str, float]:
    """Least microseconds a step of each contestant."""
    best = dict.fromkeys(blocks, np.inf)
    for _ in range(BLOCKS):
        for name, block in blocks.items():
            start = process_time()
            steps = block()
            best[name] = min(best[name], (process_time() - start) / steps * 1e6)
    return best


def rows() -> Iterator[tuple[str, float, str, float | None]]:
    """(name, value, unit, largest value allowed or None); nan for an optional package that is not installed."""
    with (
        HomingEnv(CAMERA, observation="features") as camera,
        HomingEnv(ATLAS, observation="features") as atlas,
    ):
        camera.model = atlas.model = survey(atlas.world, ATLAS, atlas.home, np.random.default_rng(0))
        step = episode(camera)
        blocks = {"camera": step, "bare": renders(step), "atlas": whole_runs(atlas.model)}
        peers = {
            "Miniworld, step at the same image size": ("miniworld", miniworld),
            "Stable-Baselines3, DQN step on the same features": (
                "stable_baselines3",
                lambda: stable_baselines3(HomingEnv(ATLAS, observation="features", model=atlas.model)),
            ),
        }
        for name, (package, make) in peers.items():
            if find_spec(package):
                blocks[name] = make()
        best = best_us(blocks)
    yield "step with the camera", best["camera"], "us", None
    yield "bare getCameraImage of the same views", best["bare"], "us", None
    yield "step with the atlas, in Python", best["atlas"], "us", None
    yield "step with the camera / bare getCameraImage", best["camera"] / best["bare"], "", 1.2
    yield "step with the atlas, in Python / step with the camera", best["atlas"] / best["camera"], "", 1 / 30
    yield "step with the atlas, in Python / bare getCameraImage", best["atlas"] / best["bare"], "", None
    for name in peers:
        yield name if name in best else f"{name}: not installed", best.get(name, np.nan), "us", None
