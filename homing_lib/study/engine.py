"""The one door for whoever runs many robots: compiled where that can be, in Python where not; the results are the same.

`run` and `run_episode` are those of `agent`. Compiled are runs on an atlas, the compact one too, of the agents of
`agent` and `robots` with accumulating traces and a lambda rule that numba can compile. In Python run: the camera;
other traces and agents; rules that are objects or keep a state, or that use what differs between NumPy and numba; and
once more each run in which something goes wrong, so that Python says what.
"""

import builtins
import dis
import hashlib
import importlib
import inspect
import math
import operator
import os
import sys
import threading
import warnings
from collections.abc import Callable, Hashable, Iterable, Sequence
from copy import deepcopy
from functools import cache, partial
from pathlib import Path
from tempfile import TemporaryFile
from types import CellType, CodeType, FunctionType, ModuleType
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
import platformdirs
from scipy.linalg.blas import ddot
from tqdm import tqdm
from tqdm.contrib.concurrent import thread_map

from homing_lib import agent as in_python
from homing_lib.agent import ClimbingAgent, Episodes, Overwritten, RandomAgent, Run, SarsaAgent
from homing_lib.atlas import Atlas
from homing_lib.environment import CONSTANT_COST, HomingEnv, survey
from homing_lib.features import Array
from homing_lib.lambdas import RULES, Derived, Fixed, LambdaRule
from homing_lib.robot import FRONT_SENSORS, Robot
from homing_lib.rooms import Pose
from homing_lib.sarsa import LinearSarsa
from homing_lib.settings import Settings
from homing_lib.storage import MARK, ROOT
from homing_lib.study.robots import ClimbGuidedAgent, FrozenAgent, Kidnapped, RestoredAgent
from homing_lib.thresholds import stopping_thresholds

_ROWS = 50_000  # steps that one call of the compiled code makes, unless an episode may take more
_MOST_LAMBDAS = 10_000_000  # that are drawn beforehand
_NEVER = np.array([-1.0, 0.0, 0.0, 0.0])
_COLUMNS = len(in_python.STEP_COLUMNS)


class ForPython(Exception):
    """Not for the compiled code: it is no such run, or something goes wrong in it, and Python has to say what."""


# --- The door ---------------------------------------------------------------------------------------------------------


def run(settings: Settings, seed: int, lambda_rule: LambdaRule | None = None, **how: Any) -> Run:
    """`agent.run`, with all that it takes, some ten times as fast where it can be compiled."""
    try:
        if lambda_rule is None or _agrees(lambda_rule, settings, seed):
            return run_compiled(settings, seed, lambda_rule, **how)
    except ForPython:
        pass
    return in_python.run(settings, seed, lambda_rule, **how)


def run_compiled(settings: Settings, seed: int, lambda_rule: LambdaRule | None = None, **how: Any) -> Run:
    """The same, or ForPython."""
    if settings.images == "camera" or _load() is None:
        raise ForPython
    return in_python.run(settings, seed, lambda_rule, survey=_survey, episodes=_episodes, **how)


_AGREES: dict[Any, bool] = {}


def _agrees(rule: LambdaRule, settings: Settings, seed: int) -> bool:
    """Whether a rule of one's own computes the same compiled: its first run is made twice. Raises ForPython."""
    if not isinstance(rule, FunctionType) or rule in RULES.values():
        return True
    key = _key(rule)
    with _lock:
        if key not in _AGREES:
            compiled, told = run_compiled(settings, seed, rule), in_python.run(settings, seed, rule)
            _AGREES[key] = compiled.steps.tobytes() == told.steps.tobytes()
    return _AGREES[key]


def run_episode(env: Any, agent: Any, options: dict[str, Any] | None = None) -> tuple[Array, bool]:
    """`agent.run_episode`, likewise. The world is left as it was, not where the episode ends."""
    kidnapper = env if type(env) is Kidnapped else None
    world = kidnapper.home_env if kidnapper else env
    if _load() is None or type(world) is not HomingEnv or not isinstance(world.world, Atlas):
        return in_python.run_episode(env, agent, options)
    start = world.start_pose(options["start"]) if options else world.start
    world.surveyed(_survey)
    carried = np.array([kidnapper.after, *kidnapper.pose], dtype=float) if kidnapper else _NEVER
    sarsa, rates = _sarsa(agent), (0.0, 0.0, 0.0)
    if sarsa:
        rates = sarsa.learner.step_size, sarsa.epsilon, sarsa.temperature
    before = _state(world, agent)
    try:
        steps, _, reached, diverged = _driven(world, agent, [rates], start, carried)
        if not diverged:
            return steps, bool(reached[0])
    except ForPython:
        pass
    _restore(before)
    return in_python.run_episode(env, agent, options)


def side_by_side(function: Callable[[int], Any], seeds: Sequence[int], rules: Iterable[LambdaRule]) -> list[Any]:
    """What a function says of each seed, with progress; it makes runs with these rules. On a thread per core where all
    of them can be compiled, for then it computes outside of Python most of the time; else one after the other.
    """
    threads = os.cpu_count() if all(map(compiles, rules)) else 1
    found: list[Any] = thread_map(function, seeds, max_workers=threads, desc="seeds", unit="seed", tqdm_class=tqdm)
    return found


def compiles(lambda_rule: LambdaRule) -> bool:
    """Whether runs with this rule can be compiled on this machine."""
    try:
        return _load() is not None and _rule(lambda_rule, 0) is not None
    except ForPython:
        return False


def _sarsa(agent: Any) -> SarsaAgent | None:
    """Who learns, or has learnt, if it is one who is known here."""
    inner = getattr(agent, "agent", agent)
    return inner if type(inner) is SarsaAgent else None


def _state(world: HomingEnv, agent: Any) -> list[tuple[Any, Any]]:
    """All that an episode changes, and how it is now."""
    sarsa, rule = _sarsa(agent), _plain_rule(agent)
    generators = [getattr(one, name, None) for one, name in ((world, "np_random"), (agent, "rng"), (sarsa, "rng"))]
    arrays = [sarsa.learner.weights, sarsa.learner.trace] if sarsa else []
    found = [(one, one.bit_generator.state) for one in generators if one] + [(one, one.copy()) for one in arrays]
    return found + ([(rule, deepcopy(vars(rule)))] if hasattr(rule, "beforehand") else [])


def _restore(before: list[tuple[Any, Any]]) -> None:
    for one, state in before:
        if isinstance(one, np.ndarray):
            one[:] = state
        elif isinstance(one, np.random.Generator):
            one.bit_generator.state = state
        else:
            vars(one).update(state)


# --- What the compiled code is given ----------------------------------------------------------------------------------


def _wander(world: Any, settings: Settings, home: Pose, rng: np.random.Generator) -> Array:
    """`environment.wander` on an atlas."""
    compiled, seen = _load(), np.empty(settings.survey_steps, np.int64)
    if not compiled.wander(_world(world), _body(world, settings, home), tuple(home), rng, seen):
        raise ForPython
    views: Array = world.views[seen].astype(np.float64)
    views /= world.pixels
    return views


_survey = partial(survey, wander=_wander)


def _episodes(env: HomingEnv, agent: Any, count: int, after_episode: Callable[[int], object]) -> Episodes:
    """`agent.run_episodes`."""
    sarsa = _sarsa(agent)
    schedule = [sarsa.rates(number) if sarsa else (0.0, 0.0, 0.0) for number in range(1, count + 1)]
    steps, lengths, reached, diverged = _driven(env, agent, schedule, env.start, _NEVER)
    if sarsa:
        sarsa.learner.step_size, sarsa.epsilon, sarsa.temperature = schedule[(diverged or count) - 1]
    for number in range(1, len(lengths) + 1):
        after_episode(number)
    return steps, lengths, reached, diverged


def _driven(env: HomingEnv, agent: Any, schedule: list[Any], start: Any, carried: Array) -> Episodes:
    """Episodes, one for each row of the schedule, from a start (a pose, or "uniform"). Raises ForPython."""
    compiled, s, count = _load(), env.settings, len(schedule)
    given, rule, rng = _agent(env, agent, count)
    atlas: Any = env.world
    world, body, task = _world(atlas, env.views), _body(atlas, s, env.home), _task(env)
    starts = np.full((1, 3), np.nan) if start == "uniform" else np.array([start])
    lengths, reached = np.zeros(count, np.int64), np.zeros(count, np.bool_)
    progress, blocks, rows = np.zeros(3, np.int64), [], np.array(schedule)
    ended = compiled.DONE
    while ended == compiled.DONE and progress[0] < count:
        block = np.empty((max(min(_ROWS, (count - progress[0]) * s.max_steps), s.max_steps), _COLUMNS))
        progress[1] = 0
        driven = progress[0]
        ended = compiled.episodes(
            world, body, task, given, rule, starts, carried, rows, rng, env.np_random, block, lengths, reached, progress
        )
        blocks.append(block[: lengths[driven : progress[0]].sum()].copy())
    if ended == compiled.REPEAT:
        raise ForPython
    if beforehand := getattr(_plain_rule(agent), "beforehand", None):
        beforehand(int(progress[2]))
    done = progress[0]
    return np.concatenate(blocks), lengths[:done], reached[:done], int(done + 1 if ended == compiled.DIVERGED else 0)


_LATTICES: WeakKeyDictionary[Atlas, dict[str, Any]] = WeakKeyDictionary()


def _world(atlas: Atlas, views: Any = None) -> Any:
    compiled = _load()
    if atlas not in _LATTICES:
        lattice = atlas.lattice
        infrared = atlas.infrared_m.reshape(len(atlas.views), -1)
        _LATTICES[atlas] = {
            "views": np.require(atlas.views, np.result_type(atlas.views, np.uint16), ("C", "W")),
            "front_m": infrared[:, FRONT_SENSORS].min(axis=1),
            "position": np.require(atlas.position, np.int64, ("C", "W")),
            "clearance_m": np.require(atlas.clearance_m, np.float64, ("C", "W")),
            **{"x0": float(lattice.x0), "y0": float(lattice.y0), "heading0": float(lattice.home.heading)},
            **{"per_metre": 1 / lattice.spacing, "per_radian": lattice.headings / (2 * math.pi)},
            "headings": int(lattice.headings),
        }
    start, centre = (getattr(views, name, _NEVER[:0]).astype(np.int32) for name in ("start", "centre"))
    return compiled.World(**_LATTICES[atlas], values=getattr(views, "values", _NEVER), start=start, centre=centre)


def _body(world: Any, settings: Settings, home: Pose) -> Any:
    compiled, robot = _load(), Robot(world, settings, home)
    commands, turns = np.array(robot.commands_m, dtype=float), np.array(robot.turns_m, dtype=float)
    return compiled.Body(commands, turns, float(robot.wheel_base_m), float(robot.slip), float(robot.clear_way_m))


def _task(env: HomingEnv) -> Any:
    compiled, s = _load(), env.settings
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


_KNOWN = (SarsaAgent, FrozenAgent, RestoredAgent, ClimbGuidedAgent)


def _agent(env: HomingEnv, agent: Any, episodes: int) -> tuple[Any, Any, np.random.Generator]:
    """Who drives, its rule and its generator. Raises ForPython for an agent that is not known here."""
    compiled, kind = _load(), type(agent)
    nobody = np.empty((0, 0))
    given: dict[str, Any] = {"chooser": compiled.RANDOM, "mixture": 0, "climbing": 0.0, "learns": False}
    given |= {"weights": np.zeros((3, env.settings.n_features)), "trace": nobody, "begins_with": nobody}
    given |= {"lambdas": _NEVER[:0], "discount": 0.0, "clip": True, "on_zero": 0.0, "rule_is_ours": True}
    given |= dict.fromkeys(("overwrites", "all_weights", "bootstraps", "learns_at_walls"), False)
    if kind in (RandomAgent, ClimbingAgent):
        given["chooser"] = compiled.CLIMB if kind is ClimbingAgent else compiled.RANDOM
        return compiled.Agent(**given), compiled.no_rule, agent.rng
    sarsa = _sarsa(agent)
    if not sarsa or kind not in _KNOWN or type(sarsa.learner) is not LinearSarsa:
        raise ForPython
    learner, rng, rule = sarsa.learner, sarsa.rng, compiled.no_rule
    given |= {"chooser": compiled.POLICY, "weights": learner.weights}
    given["mixture"] = compiled.MIXTURES.index(sarsa.settings.mixture)
    if kind is ClimbGuidedAgent:
        given |= {"chooser": compiled.GUIDED, "climbing": float(agent.share)}
        rng = agent.rng
    elif kind is FrozenAgent:
        given["chooser"] = compiled.GREEDY if agent.greedy else compiled.POLICY
    else:
        if learner.traces != "accumulating":
            raise ForPython
        found = _rule(learner.lambda_rule, episodes * env.settings.max_steps)
        rule, given["lambdas"], given["rule_is_ours"], given["overwrites"] = found
        given |= {"learns": True, "trace": learner.trace, "discount": float(learner.discount)}
        given |= {"clip": bool(learner.clip), "on_zero": float(learner.on_zero)}
        given |= {"all_weights": learner.updates == "all", "bootstraps": bool(learner.bootstrap_terminal)}
        given["learns_at_walls"] = sarsa.settings.learn_at_walls
        if kind is RestoredAgent:
            given["begins_with"] = agent.begins_with
    return compiled.Agent(**given), rule, rng


# --- Lambda rules -----------------------------------------------------------------------------------------------------


class _Rule(NamedTuple):
    function: Any  # compiled, as `compiled.RULE` says
    lambdas: Array  # or what it would return, of which the last stays
    is_ours: bool  # it has no ratio only where it says so
    overwrites: bool


def _plain_rule(agent: Any) -> Any:
    """The rule by which an agent learns, if it does; as it is, also where features are overwritten."""
    sarsa = _sarsa(agent)
    rule = sarsa.learner.lambda_rule if sarsa and type(agent) in (SarsaAgent, RestoredAgent) else None
    return rule.rule if isinstance(rule, Overwritten) else rule


def _rule(rule: LambdaRule, most: int) -> _Rule:
    """A rule for the compiled code. most: as often it may be asked. Raises ForPython where it cannot be compiled."""
    compiled = _load()
    overwrites = isinstance(rule, Overwritten)
    if isinstance(rule, Overwritten):
        rule = rule.rule
    if isinstance(rule, Fixed):
        return _Rule(compiled.no_rule, np.array([rule.value]), True, overwrites)
    if hasattr(rule, "beforehand"):
        if most > _MOST_LAMBDAS:
            raise ForPython
        # Of a copy, since fewer may be needed; those are drawn from the rule itself when it is known how many.
        return _Rule(compiled.no_rule, deepcopy(rule).beforehand(most), True, overwrites)
    return _Rule(_function(rule), _NEVER[:0], any(rule is one for one in RULES.values()), overwrites)


_FUNCTIONS: dict[Any, Any] = {}  # compiled rules, or None for those that cannot be, by all that they depend on
_lock = threading.RLock()
_ADAPTER = """
def adapter(delta, phi, delta_prev, phi_prev, trace_prev, discount):
    try:
        return 1.0 * {call}
    except Exception:
        return nan
"""


def _function(rule: Any) -> Any:
    """A rule compiled, to be called as `compiled.RULE` says. Where it raises, it returns NaN."""
    key = _key(rule)
    with _lock:
        if key not in _FUNCTIONS:
            try:
                _FUNCTIONS[key] = _adapted(rule)
            except Exception:  # numba raises what it likes
                _FUNCTIONS[key] = None
    if _FUNCTIONS[key] is None:
        raise ForPython
    return _FUNCTIONS[key]


def _key(rule: Any) -> Any:
    try:
        return _content(rule)
    except _Uncompilable:
        raise ForPython from None


class _Uncompilable(Exception):
    """Numba cannot compile it, or would compute something else than Python."""


def _adapted(rule: Any) -> Any:
    from numba import cfunc, njit

    compiled, changes = _load(), []
    while isinstance(rule, Derived):
        changes.append(rule.change)
        rule = rule.rule
    parameters = inspect.signature(rule).parameters.values()
    takes = [one.name for one in parameters if one.kind not in (one.VAR_KEYWORD, one.VAR_POSITIONAL)]
    known = {"delta", "phi", "delta_prev", "phi_prev", "trace_prev", "discount"}
    names: dict[str, Any] = {"nan": math.nan, "rule": njit(_positional(rule))}
    defaults = {one.name: one.default for one in parameters if one.name not in known and one.name in takes}
    names |= {f"default_{name}": _frozen(value) for name, value in defaults.items()}
    call = f"rule({', '.join(name if name in known else f'default_{name}' for name in takes)})"
    for number, change in enumerate(reversed(changes)):
        names[f"change{number}"] = _frozen(change)
        call = f"change{number}({call})"
    exec(_ADAPTER.format(call=call), names)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return cfunc(compiled.RULE)(names["adapter"])


_BUILTINS = (abs, min, max, float, int, bool, len, range)
_ERRORS = ("ArithmeticError", "ZeroDivisionError", "OverflowError", "ValueError", "Exception")
_UNLIKE = (
    "random",
    "pow",
    "power",
    "exp",
    "log",
)  # their numbers differ, by chance or in the last bit, as those of ** do
_ODD = inspect.CO_VARARGS | inspect.CO_GENERATOR | inspect.CO_COROUTINE | inspect.CO_ASYNC_GENERATOR


@cache
def _names(code: CodeType) -> tuple[str, ...]:
    """What a function looks for outside itself. Raises _Uncompilable for what it should not do."""
    count = code.co_argcount + code.co_kwonlyargcount
    keywords = code.co_varnames[count : count + 1] if code.co_flags & inspect.CO_VARKEYWORDS else ()
    if code.co_flags & _ODD or any(isinstance(one, CodeType) for one in code.co_consts):
        raise _Uncompilable
    for step in dis.get_instructions(code):
        names = step.argval if isinstance(step.argval, tuple) else (step.argval,)
        if any(name in (*keywords, *_UNLIKE) for name in names) or step.opname in ("STORE_GLOBAL", "STORE_DEREF"):
            raise _Uncompilable
        if step.argrepr in ("**", "**="):
            raise _Uncompilable
    return tuple({step.argval: 0 for step in dis.get_instructions(code) if step.opname == "LOAD_GLOBAL"})


def _outside(function: FunctionType) -> dict[str, Any]:
    """What it finds there, by name. Raises _Uncompilable for what it should not use."""
    found = {}
    for name in _names(function.__code__):
        value = function.__globals__.get(name, getattr(builtins, name, None))
        if name not in function.__globals__ and name not in _ERRORS and value not in _BUILTINS:
            raise _Uncompilable
        if name not in _ERRORS:
            found[name] = value
    return found


def _content(value: Any) -> Any:
    """All that a function, or what one finds outside itself, depends on, hashable. Raises _Uncompilable."""
    if isinstance(value, Derived):
        return "derived", _content(value.rule), _content(value.change)
    if isinstance(value, FunctionType):
        outside = tuple((name, _content(one)) for name, one in _outside(value).items())
        cells = tuple(_content(cell.cell_contents) for cell in value.__closure__ or ())
        return value.__code__, repr((value.__defaults__, value.__kwdefaults__)), outside, cells
    if isinstance(value, bool | int | float | np.number):
        return type(value), repr(value)
    known = value in (math, np, operator, ddot, *_BUILTINS) if isinstance(value, Hashable) else False
    if known or isinstance(value, np.ufunc) or getattr(value, "__module__", "") in ("math", "numpy", "_operator"):
        return id(value)
    raise _Uncompilable


def _frozen(value: Any) -> Any:
    """What numba takes in its place: functions compiled, all else as it is."""
    from numba import njit

    if value in (ddot, float):
        return njit((lambda x, y: np.dot(x, y)) if value is ddot else (lambda x: 1.0 * x))  # float(True) is not known
    return njit(_positional(value)) if isinstance(value, FunctionType) else value


def _positional(function: FunctionType) -> FunctionType:
    """The function with its keywords as positions, and without **_; what it finds outside itself is frozen."""
    code = function.__code__
    outside = {name: _frozen(value) for name, value in _outside(function).items()}
    cells = tuple(CellType(_frozen(cell.cell_contents)) for cell in function.__closure__ or ())
    count = code.co_argcount + code.co_kwonlyargcount
    flags = code.co_flags & ~inspect.CO_VARKEYWORDS
    flat = code.replace(co_argcount=count, co_kwonlyargcount=0, co_posonlyargcount=0, co_flags=flags)
    defaults = None if code.co_kwonlyargcount else function.__defaults__
    return FunctionType(flat, outside, function.__name__, defaults, cells or None)


# --- The compiled code itself -----------------------------------------------------------------------------------------


def _load() -> Any:
    """The module `compiled`, or None where there can be none, of which a word is said once."""
    with _lock:
        return _loaded()


@cache
def _loaded() -> ModuleType | None:
    slower = "runs take ten times as long; their results are the same"
    try:
        import numba
    except Exception as error:  # a broken one raises what it likes
        _say(f"numba cannot be loaded ({_short(error)}): {slower}")
        return None
    config: Any = numba.config
    name, own = "homing_lib.study.compiled", config.CACHE_DIR
    key = hashlib.sha256(Path(__file__).with_name("compiled.py").read_bytes()).hexdigest()[:16]
    checkout = [ROOT / ".build"] if (ROOT / MARK).exists() else []
    problem: Exception | None = None
    for place in (*checkout, platformdirs.user_cache_path("homing"), None):
        config.CACHE_DIR = str(place / "numba" / key) if place else ""
        sys.modules.pop(name, None)
        try:
            if place:  # tried here, since numba would choose another place without a word
                Path(config.CACHE_DIR).mkdir(parents=True, exist_ok=True)
                TemporaryFile(dir=config.CACHE_DIR).close()
            compiled = importlib.import_module(name)
            compiled.warm()
        except Exception as error:
            problem = error
            continue
        finally:
            config.CACHE_DIR = own
        if place is None:
            _say(
                f"compiled code can be kept nowhere ({_short(problem)}): it is compiled anew each time, in ten seconds"
            )
        return compiled
    _say(f"the engine cannot be compiled ({_short(problem)}): {slower}")
    return None


_SAID = "HOMING_ENGINE_SAID"


def _say(line: str) -> None:
    """Once, and not again by the processes that this one starts."""
    if _SAID not in os.environ:
        os.environ[_SAID] = "1"
        tqdm.write(f"homing: {line}", file=sys.stderr)


def _short(error: Exception | None) -> str:
    return " ".join(str(error).split())[:120] or type(error).__name__
