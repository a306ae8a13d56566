"""An experiment as the paper describes it: look at home, survey, then learn for some episodes (Fig. 2, section IV)."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, Protocol

import gymnasium
import numpy as np
from numpy.typing import NDArray

from homing_lib import lambdas
from homing_lib.environment import HomingEnv, seed_of, survey
from homing_lib.errors import UserError
from homing_lib.features import Array, HomeModel, similarity
from homing_lib.lambdas import LambdaRule
from homing_lib.policy import action_probabilities, decrease_rate, sample
from homing_lib.sarsa import Diverged, LinearSarsa, silent
from homing_lib.settings import Settings

STEP_COLUMNS = (
    *("x", "y", "heading"),  # of the pose reached: m, m, rad
    *("action", "reward", "similarity"),  # action driven and credited; reward; NRB of the view from there
    *("delta", "lambda", "clipped"),  # TD error; lambda, and whether it was reset
    *("change", "at_wall"),  # Euclidean length of the weights' change; stopped, or turning away
)
"""What an episode records at every step."""


class SarsaAgent:
    """Sarsa(lambda_t) with the dynamic exploration policy: what Fig. 2 does between two images.

    lambda_rule: a function to use in place of the settings' rule.
    """

    def __init__(self, settings: Settings, rng: np.random.Generator, lambda_rule: LambdaRule | None = None) -> None:
        self.settings, self.rng = settings, rng
        self.epsilon, self.temperature = settings.epsilon0, settings.tau0
        chosen = lambdas.lambda_spec(settings.lambda_rule)
        rule = chosen.rule if lambda_rule is None else lambdas.checked(lambda_rule)
        self.learner = LinearSarsa(
            settings.n_features,
            3,
            step_size=settings.alpha0,
            discount=settings.discount,
            lambda_rule=Overwritten(rule) if settings.overwrite_features else rule,
            initial_weight=settings.theta0,
            clip=chosen.clip,
            on_zero=chosen.on_zero,
            traces=settings.traces,
            update=settings.update,
            bootstrap_terminal=settings.bootstrap_terminal,
        )

    def begin_episode(self, number: int) -> None:
        """Set step size, epsilon and tau for episode 1, 2, ... (eq. 23; Fig. 2: after it) and clear the traces."""
        self.learner.step_size, self.epsilon, self.temperature = self.rates(number)
        self.learner.begin_episode()

    def rates(self, number: int) -> tuple[float, float, float]:
        """Step size, epsilon and tau of episode 1, 2, ..."""
        rate = decrease_rate(number, self.settings.first_episode)
        return self.settings.alpha0 * rate, self.settings.epsilon0 * rate, self.settings.tau0 * rate

    def choose(self, phi: Array) -> int:
        """Draw an action from eq. (22)."""
        values = self.learner.value_list(phi)
        exploring: Any = {"epsilon": self.epsilon, "temperature": self.temperature, "mixture": self.settings.mixture}
        return sample(action_probabilities(values, **exploring), self.rng)

    def learn(
        self, phi: Array, action: int, reward: float, phi_next: Array, next_action: int, terminal: bool, at_wall: bool
    ) -> tuple[float, float, bool, float]:
        """One update. Returns the TD error, lambda, whether it was clipped, and the length of the weights' change."""
        if at_wall and not self.settings.learn_at_walls:
            return 0.0, 0.0, False, 0.0
        delta = self.learner.learn(phi, action, reward, phi_next, next_action, terminal)
        return delta, self.learner.lambda_, self.learner.clipped, self.learner.change


class RandomAgent:
    """Every action with the same probability, nothing learnt: the reference."""

    def __init__(self, settings: Settings, rng: np.random.Generator) -> None:
        self.rng = rng

    def begin_episode(self, number: int) -> None:
        """Nothing to prepare."""

    def choose(self, phi: Array) -> int:
        """Draw an action."""
        return int(self.rng.integers(3))

    def learn(self, *_: Any) -> tuple[float, float, bool, float]:
        """Nothing to learn."""
        return 0.0, 0.0, False, 0.0


class ClimbingAgent(RandomAgent):
    """Snapshot homing without learning: keep to an action while the similarity rises, else draw another."""

    def begin_episode(self, number: int) -> None:
        """Forget the last view."""
        self._action, self._similarity = 0, float("inf")  # the first action is thus drawn from the two others

    def choose(self, phi: Array) -> int:
        """The last action if the view has come closer to the snapshot, else one of the two others."""
        seen, before = similarity(phi), self._similarity
        if seen <= before:
            self._action = (self._action + 1 + int(self.rng.integers(2))) % 3
        self._similarity = seen
        return self._action


class Agent(Protocol):
    """Whoever chooses actions, and may learn: `SarsaAgent` is an example."""

    def begin_episode(self, number: int) -> None: ...

    def choose(self, phi: Array) -> int: ...

    def learn(
        self, phi: Array, action: int, reward: float, phi_next: Array, next_action: int, terminal: bool, at_wall: bool
    ) -> tuple[float, float, bool, float]: ...


_REFERENCES: dict[str, type[RandomAgent]] = {"random": RandomAgent, "climb": ClimbingAgent}


@dataclass(frozen=True)
class Overwritten:
    """A rule as Fig. 2's last lines feed it: phi_t is overwritten before it is kept, so that phi_(t-1) is phi_t."""

    rule: LambdaRule

    def __call__(self, **seen: Any) -> float:
        return self.rule(**{**seen, "phi_prev": seen["phi"]})

    def __str__(self) -> str:
        return lambdas.name_of(self.rule)


@silent
def run_episode(
    env: gymnasium.Env[Any, Any], agent: Agent, options: dict[str, Any] | None = None
) -> tuple[Array, bool]:
    """One episode, whatever supplies the images. Returns its steps and whether home was reached.

    env: observes features. The agent must have begun its episode. Steps: shape (T, len(STEP_COLUMNS)).
    """
    steps = []
    phi, info = env.reset(options=options)
    action = agent.choose(phi)
    while True:
        phi_next, reward, terminated, truncated, info = env.step(action)
        action, reflex, at_wall = info["action"], info["reflex"], info["at_wall"]
        next_action = agent.choose(phi_next) if reflex < 0 else reflex
        learnt = agent.learn(phi, action, float(reward), phi_next, next_action, terminated, at_wall)
        steps.append((*info["pose"], action, reward, info["similarity"], *learnt, at_wall))
        if terminated or truncated:
            return np.array(steps, dtype=np.float64), terminated
        phi, action = phi_next, next_action


Episodes = tuple[Array, NDArray[np.int64], NDArray[np.bool_], int]
"""What a `Run` has of its episodes: steps, lengths, reached, diverged."""


def run_episodes(env: HomingEnv, agent: Agent, count: int, after_episode: Callable[[int], object]) -> Episodes:
    """Episodes 1, 2, ... count, or up to one in which the weights leave the finite numbers."""
    episodes, reached, diverged = [np.empty((0, len(STEP_COLUMNS)))], [], 0
    for number in range(1, count + 1):
        agent.begin_episode(number)
        try:
            steps, home = run_episode(env, agent)
        except Diverged:
            diverged = number
            break
        episodes.append(steps)
        reached.append(home)
        after_episode(number)
    lengths = np.array([len(steps) for steps in episodes[1:]], dtype=np.int64)
    return np.concatenate(episodes), lengths, np.array(reached, dtype=bool), diverged


@dataclass(frozen=True)
class Run:
    """One experiment from snapshot to last episode.

    steps: shape (all steps, len(STEP_COLUMNS)); lengths: steps of each finished episode; reached: whether each ended
    at home; diverged: the episode (1, 2, ...) in which the weights left the finite numbers and the run ended, or 0.
    """

    settings: Settings
    seed: int
    steps: Array
    lengths: NDArray[np.int64]
    reached: NDArray[np.bool_]
    diverged: int

    @property
    def ended(self) -> NDArray[np.int64]:
        """Index into `steps` just past each episode's last."""
        return np.cumsum(self.lengths)

    def column(self, name: str) -> Array:
        """One column of the steps, all episodes in a row."""
        return self.steps[:, STEP_COLUMNS.index(name)]

    def episode(self, number: int) -> Array:
        """The steps of episode 1, 2, ...; negative numbers count from the last."""
        if number == 0:
            raise IndexError("episodes count from 1")
        index = number - (number > 0)
        return self.steps[self.ended[index] - self.lengths[index] : self.ended[index]]


def run(
    settings: Settings,
    seed: int,
    lambda_rule: LambdaRule | None = None,
    after_episode: Callable[[int], object] = lambda number: None,
    afterwards: Callable[[HomingEnv, Any], object] = lambda env, agent: None,
    *,
    agent: Callable[[Settings, np.random.Generator], Agent] | None = None,
    survey: Callable[..., HomeModel] = survey,
    episodes: Callable[..., Episodes] = run_episodes,
) -> Run:
    """The whole experiment, fixed to the bit by settings and seed.

    lambda_rule: a function of one's own in place of the settings' rule (see `lambdas`), of which the run keeps no note.
    after_episode is told 1, 2, ... for progress; afterwards gets the world and the trained agent, before both are gone
    (not if the run diverged). agent: makes who drives, in place of the settings' controller. survey, episodes: what
    does the work, `survey` and `run_episodes` or others that do the same (`study.engine`).
    """
    seed = seed_of("seed", seed)
    survey_seed, agent_seed, world_seed = np.random.SeedSequence(seed).spawn(3)
    if agent and lambda_rule:
        raise UserError("lambda_rule: an agent that is passed in has its own; pass one of the two")
    make = agent or partial(_controller, lambda_rule=lambda_rule)
    with HomingEnv(settings, observation="features", survey_seed=survey_seed) as env:
        driver = make(settings, np.random.default_rng(agent_seed))
        env.surveyed(survey)
        env.reset(seed=int(world_seed.generate_state(1)[0]))
        result = Run(settings, seed, *episodes(env, driver, settings.episodes, after_episode))
        if not result.diverged:
            afterwards(env, driver)
    return result


def _controller(settings: Settings, rng: np.random.Generator, lambda_rule: LambdaRule | None) -> Agent:
    """Who drives by the setting `controller`."""
    if settings.controller == "sarsa":
        return SarsaAgent(settings, rng, lambda_rule)
    if lambda_rule is None:
        return _REFERENCES[settings.controller](settings, rng)
    raise UserError(f"lambda_rule: controller = {settings.controller!r} has no use for one; 'sarsa' has")
