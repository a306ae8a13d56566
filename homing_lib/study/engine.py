"""Runs for whoever needs many: compiled where that can be, else in Python, and the same to the bit either way.

`run` and `run_episode` do what those of `agent` do. Compiled are runs on an atlas, the compact one too, of the agents
of `agent` and `robots`, with accumulating traces and a lambda rule that is fixed, drawn beforehand (`beforehand`), or a
function that `compiling` can compile. All else runs in Python, as does, once more, each run in which something goes
wrong, so that Python says what. Weights, traces, rates and generators are left as Python leaves them; not so the
robot's reflex and what the learner shows of its last step. `after_episode` is called when all episodes are over.
"""

from collections.abc import Callable, Iterable, Sequence
from contextlib import closing, suppress
from copy import deepcopy
from functools import partial
from typing import Any

import numpy as np
from joblib import Parallel, delayed
from tqdm.auto import tqdm

from homing_lib import agent as in_python
from homing_lib import lambdas
from homing_lib.agent import ClimbingAgent, Episodes, Overwritten, RandomAgent, Run, SarsaAgent
from homing_lib.atlas import Atlas
from homing_lib.environment import CONSTANT_COST, HomingEnv
from homing_lib.features import Array, HomeModel
from homing_lib.lambdas import Fixed, LambdaRule
from homing_lib.robot import FRONT_SENSORS, Robot
from homing_lib.rooms import Pose
from homing_lib.sarsa import LinearSarsa
from homing_lib.settings import Settings
from homing_lib.study import methods  # noqa: F401, so that settings know them by name
from homing_lib.study.compiling import ForPython, compiled_rule, load
from homing_lib.study.robots import ClimbGuidedAgent, FrozenAgent, RestoredAgent
from homing_lib.survey import surveys
from homing_lib.thresholds import stopping_thresholds

ROWS = 50_000  # steps that one call of the compiled code makes, unless an episode may take more
_MOST_LAMBDAS = 10_000_000  # that are drawn beforehand
_NONE = np.empty(0)


# --- Runs and episodes ------------------------------------------------------------------------------------------------


def run(settings: Settings, seed: int, lambda_rule: LambdaRule | None = None, **how: Any) -> Run:
    """`agent.run`, with all that it takes; some ten times as fast where it is compiled."""
    if settings.images != "camera" and load() is not None:
        with suppress(ForPython):
            return in_python.run(settings, seed, lambda_rule, surveys=_surveys, episodes=_episodes, **how)
    return in_python.run(settings, seed, lambda_rule, **how)


def run_episode(env: Any, agent: Any, options: dict[str, Any] | None = None) -> tuple[Array, bool]:
    """`agent.run_episode`, as fast."""
    on_atlas = type(env) is HomingEnv and isinstance(env.world, Atlas) and not env.closed
    if on_atlas and {*(options or {})} <= {"start"} and load() is not None:
        with suppress(ForPython):
            surveyed(env)
            steps, _, reached, _ = _drive(env, agent, [_rates(agent)], env.start_of(options))
            return steps, bool(reached[0])
    return in_python.run_episode(env, agent, options)


def side_by_side(function: Callable[[int], Any], seeds: Sequence[int], rules: Iterable[LambdaRule]) -> list[Any]:
    """What a function that makes runs with these rules returns for each seed, in order, with progress.

    On a thread per core where all rules compile, since compiled code leaves Python free; else one after the other.
    """
    rules = list(rules)
    compiled = load() is not None and all(map(compiles, rules)) and not any(map(_draws, rules))
    threads = Parallel(-1 if compiled else 1, prefer="threads", return_as="generator")
    with closing(threads(map(delayed(function), seeds))) as results:  # so that Ctrl-C stops them all
        return list(tqdm(results, desc="seeds", unit="seed", total=len(seeds)))


def compiles(lambda_rule: LambdaRule) -> bool:
    """Whether runs with this rule can be compiled on this machine."""
    try:
        return load() is not None and _rule(_unwrapped(lambda_rule), 0) is not None
    except ForPython:
        return False


# --- Driving ----------------------------------------------------------------------------------------------------------


def _wander(world: Any, settings: Settings, home: Pose, rng: np.random.Generator) -> Array:
    """`survey.wander` on an atlas."""
    compiled, seen = load(), np.empty(settings.survey_steps, np.int64)
    if not compiled.wander(_world(world), _body(world, settings, home), tuple(home), rng, seen):
        raise ForPython
    views: Array = world.views[seen].astype(np.float64)
    views /= world.pixels
    return views


_surveys = partial(surveys, wander=_wander)


def surveyed(env: HomingEnv) -> HomeModel:
    """`env.surveyed`, as fast."""
    return env.surveyed(_surveys if load() is not None and isinstance(env.world, Atlas) else None)


def _episodes(env: HomingEnv, agent: Any, count: int, after_episode: Callable[[int], object]) -> Episodes:
    """`agent.run_episodes`."""
    sarsa = _sarsa(agent) if type(agent) in _LEARN else None
    schedule = [sarsa.rates(number) if sarsa else _rates(agent) for number in range(1, count + 1)]
    steps, lengths, reached, diverged = _drive(env, agent, schedule, env.start)
    if sarsa:
        sarsa.learner.step_size, sarsa.epsilon, sarsa.temperature = schedule[(diverged or count) - 1]
    for number in range(1, len(lengths) + 1):
        after_episode(number)
    return steps, lengths, reached, diverged


def _drive(env: HomingEnv, agent: Any, schedule: list[Any], start: Any) -> Episodes:
    """Episodes, one for each row of the schedule, from a start: a pose, or "uniform". Raises ForPython, and leaves
    everything as it was, where Python has to drive them.
    """
    compiled, s, count = load(), env.settings, len(schedule)
    given, rule, rng = _agent(env, agent, count)
    generators, arrays = (rng, env.np_random), (given.weights, given.trace)
    states, copies = [one.bit_generator.state for one in generators], [one.copy() for one in arrays]
    atlas: Any = env.world
    world, body, task = _world(atlas, env.views), _body(atlas, s, env.home), _task(env)
    starts = np.full((1, 3), np.nan) if start == "uniform" else np.array([start])
    lengths, reached = np.zeros(count, np.int64), np.zeros(count, np.bool_)
    progress, blocks, rows = np.zeros(4, np.int64), [], np.array(schedule, dtype=float)
    columns, ended = len(in_python.STEP_COLUMNS), compiled.DONE
    while ended == compiled.DONE and progress[0] < count:
        block = np.empty((max(min(ROWS, (count - progress[0]) * s.max_steps), s.max_steps), columns))
        progress[1] = 0
        driven = progress[0]
        ended = compiled.episodes(
            world, body, task, given, rule, starts, rows, rng, env.np_random, block, lengths, reached, progress
        )
        blocks.append(block[: lengths[driven : progress[0]].sum()].copy())
    done, diverged = progress[0], ended == compiled.DIVERGED
    if ended == compiled.REPEAT or (diverged and count == 1):  # of one episode Python says it, by an error
        for generator, state in zip(generators, states, strict=True):
            generator.bit_generator.state = state
        for array, copy in zip(arrays, copies, strict=True):
            array[:] = copy
        raise ForPython
    sarsa = _sarsa(agent)
    if given.learns and sarsa:
        sarsa.learner.steps += int(progress[3])
        if _draws(drawn := _unwrapped(sarsa.learner.lambda_rule)):
            drawn.beforehand(int(progress[2]))
    steps = np.concatenate(blocks)
    if len(steps):  # of which there are none where the first episode diverged
        env.robot.place(Pose(*steps[-1, :3].tolist()))
    return steps, lengths[:done], reached[:done], int(done + 1 if diverged else 0)


# --- What the compiled code is given ----------------------------------------------------------------------------------

_GIVEN: dict[Atlas, dict[str, Any]] = {}


def _world(atlas: Atlas, views: Any = None) -> Any:
    compiled = load()
    if atlas not in _GIVEN:
        _GIVEN[atlas] = {
            "views": np.require(atlas.views, np.result_type(atlas.views, np.uint16), ("C", "W")),
            "front_m": atlas.readings[:, FRONT_SENSORS].min(axis=1),
            "position": np.require(atlas.position, np.int64, ("C", "W")),
            "clearance_m": np.require(atlas.clearance_m, np.float64, ("C", "W")),
            **{name: getattr(atlas, name) for name in ("x0", "y0", "heading0", "per_metre", "per_radian", "headings")},
        }
    start, centre = (getattr(views, name, _NONE).astype(np.int32) for name in ("start", "centre"))
    return compiled.World(**_GIVEN[atlas], values=getattr(views, "values", _NONE), start=start, centre=centre)


def _body(world: Any, settings: Settings, home: Pose) -> Any:
    compiled, robot = load(), Robot(world, settings, home)
    commands, turns = np.array(robot.commands_m, dtype=float), np.array(robot.turns_m, dtype=float)
    return compiled.Body(commands, turns, float(robot.wheel_base_m), float(robot.slip), float(robot.clear_way_m))


def _task(env: HomingEnv) -> Any:
    compiled, s = load(), env.settings
    psi = stopping_thresholds(s.multiplier, s.band)
    return compiled.Task(
        psi_upper=psi.upper,
        psi_lower=psi.lower,
        constant_cost=CONSTANT_COST if s.step_cost == "constant" else 0.0,
        approach_reward=s.approach_reward,
        wall_penalty=float(s.wall_penalty),
        reward_scale=float(s.reward_scale),
        terminal_bonus=float(s.terminal_bonus),
        max_steps=int(s.max_steps),
        width=float(env.room.size[0]),
        depth=float(env.room.size[1]),
    )


_LEARN = (SarsaAgent, RestoredAgent)
_WITH_SARSA = (*_LEARN, FrozenAgent, ClimbGuidedAgent)
_OWN = {"begin_episode", "choose", "learn"}  # an agent or a learner that has one itself is not what its class says


def _sarsa(agent: Any) -> SarsaAgent | None:
    """The SarsaAgent that an agent is, or has."""
    inner = getattr(agent, "agent", agent)
    return inner if type(inner) is SarsaAgent else None


def _rates(agent: Any) -> tuple[float, float, float]:
    """Step size, epsilon and tau of the episode that an agent has begun."""
    sarsa = _sarsa(agent)
    return (sarsa.learner.step_size, sarsa.epsilon, sarsa.temperature) if sarsa else (0.0, 0.0, 0.0)


def _agent(env: HomingEnv, agent: Any, episodes: int) -> tuple[Any, Any, np.random.Generator]:
    """An agent as the compiled code takes it, its rule and its generator. Raises ForPython for one of another kind."""
    compiled, kind, n = load(), type(agent), env.settings.n_features
    if kind in (RandomAgent, ClimbingAgent) and not _OWN & vars(agent).keys():
        chooser = compiled.CLIMB if kind is ClimbingAgent else compiled.RANDOM
        return compiled.Agent(chooser, np.zeros((3, n))), compiled.no_rule, agent.rng
    sarsa = _sarsa(agent)
    if not sarsa or kind not in _WITH_SARSA or type(sarsa.learner) is not LinearSarsa:
        raise ForPython
    learner = sarsa.learner
    of_itself = {*vars(sarsa), *vars(learner), *(vars(agent) if kind is not RestoredAgent else ())}
    if _OWN & of_itself or {learner.weights.shape, learner.trace.shape} != {(3, n)}:
        raise ForPython
    given = compiled.Agent(compiled.POLICY, learner.weights, compiled.MIXTURES.index(sarsa.settings.mixture))
    if kind is ClimbGuidedAgent:
        return given._replace(chooser=compiled.GUIDED, climbing=float(agent.share)), compiled.no_rule, agent.rng
    if kind is FrozenAgent:
        chooser = compiled.GREEDY if agent.greedy else compiled.POLICY
        return given._replace(chooser=chooser), compiled.no_rule, sarsa.rng
    if learner.traces != "accumulating":
        raise ForPython
    rule, of_rule = _rule(_unwrapped(learner.lambda_rule), episodes * env.settings.max_steps)
    given = given._replace(
        **of_rule,
        learns=True,
        trace=learner.trace,
        discount=float(learner.discount),
        clip=bool(learner.clip),
        on_zero=float(learner.on_zero),
        overwrites=isinstance(learner.lambda_rule, Overwritten),
        all_weights=learner.update_mode == "all",
        bootstraps=bool(learner.bootstrap_terminal),
        learns_at_walls=sarsa.settings.learn_at_walls,
    )
    if kind is RestoredAgent:
        given = given._replace(begins_with=agent.begins_with)
    return given, rule, sarsa.rng


def _rule(rule: Any, most: int) -> tuple[Any, dict[str, Any]]:
    """A rule as the compiled code takes it, and what `compiled.Agent` is told of it. most: how often it may be asked.
    Raises ForPython if it cannot be compiled.
    """
    if isinstance(rule, Fixed):
        return load().no_rule, {"lambdas": np.array([rule.value])}
    if _draws(rule):
        if most > _MOST_LAMBDAS:
            raise ForPython
        # Of a copy, since fewer may be needed; those are drawn from the rule itself when it is known how many.
        return load().no_rule, {"lambdas": deepcopy(rule).beforehand(most), "rule_is_ours": False}
    function = compiled_rule(rule)
    # Those of `lambdas` raise where their ratio is undefined, and for no other reason.
    ours = rule in lambdas.RULES.values() and rule.__module__ == lambdas.__name__
    return function, {"rule_is_ours": ours}


def _unwrapped(rule: Any) -> Any:
    """The rule itself, also where features are overwritten."""
    return rule.rule if isinstance(rule, Overwritten) else rule


def _draws(rule: Any) -> bool:
    """Whether a rule draws its lambdas, from a generator of its own."""
    return hasattr(rule, "beforehand")
