"""What becomes of a robot that has learnt: frozen, restored for each trial, guided by the climb, or kidnapped."""

from typing import Any

import gymnasium
import numpy as np

from homing_lib.agent import ClimbingAgent, RandomAgent, SarsaAgent
from homing_lib.environment import HomingEnv
from homing_lib.features import Array, similarity
from homing_lib.rooms import Pose
from homing_lib.settings import Settings

CLIMBING = 0.7
"""In which share of its steps a robot that is guided by the climb does what the climb would."""


def _best(agent: Any, phi: Array) -> int:
    """The action of the largest value, the first of equals."""
    values: list[float] = agent.learner.value_list(phi)
    return values.index(max(values))


class FrozenAgent(RandomAgent):
    """A trained agent that only drives: its weights as they are, the exploration of its episode, or none (`greedy`)."""

    def __init__(self, agent: Any, *, greedy: bool = False) -> None:
        self.agent, self.greedy = agent, greedy

    def choose(self, phi: Array) -> int:
        """As the agent would; greedy: its best action."""
        return _best(self.agent, phi) if self.greedy else self.agent.choose(phi)


class RestoredAgent:
    """A learner that begins each episode with the weights that it has now: saved ones, or, as new, the initial ones."""

    def __init__(self, agent: SarsaAgent) -> None:
        self.agent, self.begins_with = agent, agent.learner.weights.copy()
        self.choose, self.learn = agent.choose, agent.learn

    def begin_episode(self, number: int) -> None:
        """Back to those weights; the rates are those of the episode."""
        self.agent.begin_episode(number)
        self.agent.learner.weights[:] = self.begins_with


class ClimbGuidedAgent(ClimbingAgent):
    """A trained agent that no longer learns and explores by climbing, where it explored at random while it learnt.

    In a share of its steps, drawn one by one, it does what `ClimbingAgent` would: it keeps to the last action, its own
    or the climb's, while the similarity rises, and else draws another. In the rest it takes its best action.
    """

    def __init__(self, agent: SarsaAgent, share: float, rng: np.random.Generator) -> None:
        self.agent, self.share, self.rng = agent, share, rng
        self.begin_episode(1)

    def choose(self, phi: Array) -> int:
        """The climb's action, or the best."""
        if self.rng.random() < self.share:
            return super().choose(phi)
        self._action, self._similarity = _best(self.agent, phi), similarity(phi)
        return self._action


def driver(kind: str, agent: SarsaAgent, settings: Settings, weights: Array, rng: np.random.Generator) -> Any:
    """Who drives in trials after a training: `agent` itself, or one made from it. The agent is changed: it gets these
    weights, shape (3, n), this generator, and the rates of the episode that comes next.

    kind: "learning on"; "restored", learning, each trial from these weights ("forgetful", if those are the initial
    ones); "frozen", not learning ("untrained", likewise); "greedy", nor exploring; "climbing", frozen and guided by the
    climb; "climb"; "random".
    """
    agent.rng = rng
    agent.begin_episode(settings.episodes + 1)
    agent.learner.weights[:] = weights
    match kind:
        case "learning on":
            return agent
        case "restored" | "forgetful":
            return RestoredAgent(agent)
        case "frozen" | "greedy" | "untrained":
            return FrozenAgent(agent, greedy=kind == "greedy")
        case "climbing":
            return ClimbGuidedAgent(agent, CLIMBING, rng)
        case "climb":
            return ClimbingAgent(settings, rng)
        case "random":
            return RandomAgent(settings, rng)
    raise ValueError(kind)


class Kidnapped(gymnasium.Wrapper[Any, Any, Any, Any]):
    """The same world, in which somebody carries the robot to another pose after some steps."""

    def __init__(self, env: HomingEnv, after: int, pose: Pose) -> None:
        super().__init__(env)
        self.home_env, self.after, self.pose = env, after, pose

    def reset(self, **arguments: Any) -> Any:
        self._left = self.after
        return super().reset(**arguments)

    def step(self, action: Any) -> Any:
        """One step; after the stated number of them the robot finds itself elsewhere before it moves."""
        if self._left == 0:
            self.home_env.robot.place(self.pose)
        self._left -= 1
        return super().step(action)
