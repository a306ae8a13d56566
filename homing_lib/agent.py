"""An experiment as the paper describes it: look at home, survey, then learn for some episodes (Fig. 2, section IV)."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from inspect import signature
from typing import Any, NamedTuple, Protocol

import gymnasium
import numpy as np
from numpy.typing import NDArray

from homing_lib.environment import HomingEnv
from homing_lib.errors import UserError, misfit, seed_of, shown
from homing_lib.features import Array, HomeModel, similarity
from homing_lib.lambdas import AnyRule, LambdaRule, lambda_spec, name_of
from homing_lib.policy import action_probabilities, decrease_rate, sample
from homing_lib.sarsa import Diverged, LinearSarsa, silent
from homing_lib.settings import CONTROLLERS, Settings
from homing_lib.survey import surveys

STEP_COLUMNS = (
    *("x", "y", "heading"),  # of the pose reached: m, m, rad
    *("action", "reward", "similarity"),  # action driven and credited; reward; NRB of the view from there
    *("delta", "lambda", "clipped"),  # TD error; lambda, and whether it was reset
    *("change", "at_wall"),  # Euclidean length of the weights' change; stopped, or turning away
)
"""What an episode records at every step."""


class Learnt(NamedTuple):
    """What an agent says of one step of learning, for the records: by default, that nothing was learnt."""

    delta: float = 0.0  # TD error
    lambda_: float = 0.0
    clipped: bool = False  # whether lambda was reset to [0, 1]
    change: float = 0.0  # Euclidean length of the weights' change


class Agent(Protocol):
    """Whoever chooses the actions, and may learn. Pass `run` a function that makes one from settings and rng:

        run(settings, seed, agent=lambda settings, rng: MyAgent(settings.n_features, rng))

    rng: the agent's own generator, fixed by the seed. The survey, the start and the world's generator are fixed too, so
    that agents can be compared seed by seed (where their paths part, so does what the world draws: the reflex's side,
    wheel slip, later uniform starts).
    """

    def begin_episode(self, number: int) -> None:
        """Episode 1, 2, ... is about to start: clear traces, set rates."""

    def choose(self, phi: Array) -> int:
        """The action for a view: 0 (left), 1 (right) or 2 (forward). phi: its features, shape (n,), each in [0, 1].

        Called once for every view, the last too, but not while the reflex drives.
        """

    def learn(
        self, phi: Array, action: int, reward: float, phi_next: Array, next_action: int, terminal: bool, at_wall: bool
    ) -> Learnt | None:
        """Learn from one step: in the view `phi`, `action` was driven, for this reward, and led to `phi_next`.

        action, next_action: what was and will be driven, chosen or by the reflex. terminal: `phi_next` is home, and the
        episode ends (`next_action` is not driven); one that is cut at `max_steps` is not terminal. at_wall: the step
        was stopped by an obstacle, or a turn away from it. Returns what the records are to say of it, or None. Raises
        `sarsa.Diverged` when the weights leave the finite numbers: the run ends there, and is recorded as such.
        """


AgentFactory = Callable[[Settings, np.random.Generator], Agent]


class SarsaAgent:
    """Sarsa(lambda_t) with the dynamic exploration policy: what Fig. 2 does between two images.

    lambda_rule: a function, or a name, in place of the settings' rule and its options. learner: makes another learner
    than `LinearSarsa`, of what that takes. For another schedule of step size and exploration, derive from it and
    override `rates`.
    """

    def __init__(
        self,
        settings: Settings,
        rng: np.random.Generator,
        lambda_rule: AnyRule | None = None,
        learner: Callable[..., LinearSarsa] = LinearSarsa,
    ) -> None:
        self.settings, self.rng = settings, rng
        self.epsilon, self.temperature = settings.epsilon0, settings.tau0
        spec = lambda_spec(settings.lambda_rule if lambda_rule is None else lambda_rule)
        self.learner = learner(
            settings.n_features,
            3,
            step_size=settings.alpha0,
            discount=settings.discount,
            lambda_rule=Overwritten(spec.rule) if settings.overwrite_features else spec.rule,
            initial_weight=settings.theta0,
            clip=spec.clip,
            on_zero=spec.on_zero,
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
    ) -> Learnt:
        """One update of `LinearSarsa`; at a wall, only if the settings say so."""
        if at_wall and not self.settings.learn_at_walls:
            return Learnt()
        delta = self.learner.learn(phi, action, reward, phi_next, next_action, terminal)
        return Learnt(delta, self.learner.lambda_, self.learner.clipped, self.learner.change)


class RandomAgent:
    """Every action with the same probability, nothing learnt: the reference."""

    def __init__(self, settings: Settings, rng: np.random.Generator) -> None:
        self.rng = rng

    def begin_episode(self, number: int) -> None:
        """Nothing to prepare."""

    def choose(self, phi: Array) -> int:
        """Draw an action."""
        return int(self.rng.integers(3))

    def learn(self, *_: Any) -> Learnt:
        """Nothing to learn."""
        return Learnt()


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


AGENTS: dict[str, AgentFactory] = {"sarsa": SarsaAgent, "random": RandomAgent, "climb": ClimbingAgent}
"""Those that settings know by name: their `controller`."""


def register(name: str, factory: AgentFactory) -> None:
    """Let settings know a further agent by name. Processes know it too if they import the file that calls this."""
    AGENTS[name] = factory
    CONTROLLERS.append(name)


@dataclass(frozen=True)
class Overwritten:
    """A rule as Fig. 2's last lines feed it: phi_t is overwritten before it is kept, so that phi_(t-1) is phi_t."""

    rule: LambdaRule

    def __call__(self, **step: Any) -> float:
        return self.rule(**{**step, "phi_prev": step["phi"]})

    def __str__(self) -> str:
        return name_of(self.rule)


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
        if learnt is not None and not isinstance(learnt, Learnt):
            returned = f"{type(agent).__name__} returned {shown(learnt)}"
            raise UserError(f"agent: learn of {returned}; it must return homing_lib.agent.Learnt(...) or None")
        steps.append((*info["pose"], action, reward, info["similarity"], *(learnt or Learnt()), at_wall))
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
    lambda_rule: AnyRule | None = None,
    after_episode: Callable[[int], object] = lambda number: None,
    afterwards: Callable[[HomingEnv, Any], object] = lambda env, agent: None,
    *,
    agent: AgentFactory | None = None,
    surveys: Callable[..., list[HomeModel]] = surveys,
    episodes: Callable[..., Episodes] = run_episodes,
) -> Run:
    """The whole experiment, fixed to the bit by settings and seed.

    agent: makes another `Agent` than the settings' `controller`; whether it uses their alpha0, lambda_rule, ... is then
    up to it. lambda_rule: a function of one's own, or a name, in place of the settings' rule. The run records neither.
    after_episode is called with 1, 2, ..., for progress; afterwards with the world and the trained agent, before both
    are gone (not if the run diverged). surveys, episodes: the functions that do the work; `study.engine` passes its
    own, compiled.
    """
    seed = seed_of("seed", seed)
    survey_seed, agent_seed, world_seed = np.random.SeedSequence(seed).spawn(3)
    driver = _driver(settings, np.random.default_rng(agent_seed), lambda_rule, agent)
    with HomingEnv(settings, observation="features", survey_seed=survey_seed) as env:
        env.surveyed(surveys)
        env.reset(seed=int(world_seed.generate_state(1)[0]))
        result = Run(settings, seed, *episodes(env, driver, settings.episodes, after_episode))
        if not result.diverged:
            afterwards(env, driver)
    return result


def _driver(
    settings: Settings, rng: np.random.Generator, lambda_rule: AnyRule | None, factory: AgentFactory | None
) -> Agent:
    """Who drives. Raises UserError, in one line, for a rule that would not be used, and for what makes no `Agent`."""
    if lambda_rule is not None:
        if factory is not None:
            raise UserError("lambda_rule: an agent that is passed in has its own; pass one of the two")
        if settings.controller != "sarsa":
            raise UserError(f"lambda_rule: controller = {settings.controller!r} has no use for one; 'sarsa' has")
        factory = partial(SarsaAgent, lambda_rule=lambda_rule)
    factory = AGENTS[settings.controller] if factory is None else factory
    _require_call("agent", factory, "settings", "rng")
    driver = factory(settings, rng)
    for name in ("begin_episode", "choose", "learn"):
        takes = [parameter for parameter in signature(getattr(Agent, name)).parameters if parameter != "self"]
        _require_call(f"agent: {name} of {type(driver).__name__}", getattr(driver, name, None), *takes)
    return driver


def _require_call(what: str, function: Any, *takes: str) -> None:
    """Raises UserError, which says what, unless a function takes as many arguments."""
    if wrong := misfit(function, *takes):
        call = f"{shown(function)} must be callable with ({', '.join(takes)})"
        raise UserError(f"{what}: {call}: {wrong}; `homing_lib.agent.Agent` says what an agent is")
