"""Deep learners as a user would install them: PPO and DQN of Stable-Baselines3, with that library's defaults.

PPO: Schulman et al., arXiv 1707.06347 (2017). DQN: Mnih et al., Nature 518 (2015). Library: Raffin et al., JMLR 22
(2021). On features they learn with two layers of 64 units, on images with the network of DQN's authors. A step costs
about a millisecond of one core on features, several on images.

They drive the environment by themselves, not through `agent.run`; its docstring says in what that differs. `make deep`
installs what is imported here, and nothing else needs it.
"""

from functools import partial
from typing import Any

import numpy as np

from homing_lib.agent import Agent, register
from homing_lib.environment import HomingEnv
from homing_lib.errors import UserError
from homing_lib.settings import Settings

LEARNERS = ("ppo", "dqn")
"""Values of the setting `controller`."""


def episode_lengths(settings: Settings, seed: int, steps: int) -> list[int]:
    """Steps of the episodes that end while the settings' controller learns from so many environment steps, or from the
    few more that complete its last batch. Raises UserError without Stable-Baselines3.
    """
    try:
        import stable_baselines3
        import torch
        from stable_baselines3.common.monitor import Monitor
    except ImportError:
        needs = "needs Stable-Baselines3 and torch; `make deep` installs both"
        raise UserError(f"controller = {settings.controller!r}: {needs}") from None
    torch.set_num_threads(1)
    torch.use_deterministic_algorithms(True)
    survey_seed, own_seed, world_seed = np.random.SeedSequence(seed).spawn(3)
    # All that is ever stored fits, as it would in the default, a million steps, which reserves 4 GB.
    options = {"buffer_size": steps} if settings.controller == "dqn" else {}
    seen: Any
    policy, seen = ("CnnPolicy", "image") if settings.images == "camera" else ("MlpPolicy", "features")
    with Monitor(HomingEnv(settings, observation=seen, survey_seed=survey_seed)) as env:
        learner = getattr(stable_baselines3, settings.controller.upper())
        model = learner(policy, env, seed=int(own_seed.generate_state(1)[0]), device="cpu", **options)
        model.get_env().seed(int(world_seed.generate_state(1)[0]))  # else the world has the learner's
        model.learn(steps)
        return list(env.get_episode_lengths())


def _drives_by_itself(name: str, settings: Settings, rng: np.random.Generator) -> Agent:
    raise UserError(f"controller = {name!r}: it drives by itself, in `homing_lib.study.methods.deep.episode_lengths`")


for _name in LEARNERS:
    register(_name, partial(_drives_by_itself, _name))
