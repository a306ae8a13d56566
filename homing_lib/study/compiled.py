"""What `environment`, `policy` and `sarsa` say, compiled: whole episodes on an atlas, some ten times as fast and the
same to the bit (`tests/test_engine.py`). There is the text; here, line by line, its translation.

All that is compiled stands here and in `compiled_world`, since the compiler's cache goes by the hash of both files.
Sums and products are made in the order in which Python and NumPy make them.
"""

from math import exp, isfinite, pi, sqrt
from typing import Any, NamedTuple

import numpy as np
from numba import cfunc, types

from homing_lib.study.compiled_world import KEPT, Body, World, act, clearance, compiled, inlined, look, nearest, wander

LARGEST = float(np.finfo(float).max)  # as in `policy`

DONE, DIVERGED, REPEAT = range(3)
"""How `episodes` ends: all that surely fits was driven; the weights left the finite numbers; Python has to say
what is wrong."""

POLICY, GREEDY, RANDOM, CLIMB, GUIDED = range(5)  # who chooses: eq. (22), its best action, agents that do not learn
MIXTURES = ("epsilon-greedy", "normalised", "literal")

_vector = types.Array(types.float64, 1, "C")
RULE = types.float64(types.float64, _vector, types.float64, _vector, _vector, types.float64)
"""A compiled rule: delta, phi, delta_prev, phi_prev, trace_prev, discount. Not finite: it has no ratio."""


@cfunc(RULE, cache=KEPT)
def no_rule(delta: Any, phi: Any, delta_prev: Any, phi_prev: Any, trace_prev: Any, discount: Any) -> Any:
    """Where lambdas are given."""
    return np.nan


class Task(NamedTuple):
    """When an episode ends and what it pays. width, depth: of the room, metres. constant_cost: 0, if it is 1/t."""

    psi_upper: float
    psi_lower: float
    constant_cost: float
    approach_reward: bool
    wall_penalty: float
    reward_scale: float
    terminal_bonus: float
    max_steps: int
    width: float
    depth: float


class Agent(NamedTuple):
    """Who drives, and what it learns with.

    chooser: POLICY, RANDOM, ...; mixture: place in MIXTURES; climbing: share of steps of `ClimbGuidedAgent`.
    weights, trace: shape (3, n), changed in place; begins_with: weights of each episode, or shape (0, 0): those that
    the one before left. lambdas: one for each time that a rule would be asked, of which the last stays; empty: ask it.
    """

    chooser: int
    weights: Any
    mixture: int = 0
    climbing: float = 0.0
    learns: bool = False
    trace: Any = np.empty((0, 0))
    begins_with: Any = np.empty((0, 0))
    lambdas: Any = np.empty(0)
    discount: float = 0.0
    clip: bool = True
    on_zero: float = 0.0
    rule_is_ours: bool = True
    overwrites: bool = False
    all_weights: bool = False
    bootstraps: bool = False
    learns_at_walls: bool = False


# --- Choosing where to begin, and actions -----------------------------------------------------------------------------


@compiled
def _free_pose(world: Any, task: Any, rng: Any) -> Any:
    while True:
        x, y = rng.uniform(0, task.width), rng.uniform(0, task.depth)
        if clearance(world, x, y) >= 0:
            return x, y, rng.uniform(-pi, pi)


@compiled
def _largest(values: Any) -> Any:
    """The place of the largest, the first of equals."""
    best = 0
    for k in range(1, 3):
        if values[k] > values[best]:
            best = k
    return best


@compiled
def _probabilities(values: Any, epsilon: Any, temperature: Any, mixture: Any, shares: Any) -> None:
    """Eq. (20)-(22)."""
    shares[:] = epsilon / 3
    shares[_largest(values)] += 1 - epsilon
    if mixture == 0:
        return
    divisor = np.sum(np.abs(values)) if mixture == 1 else np.sum(values)
    scaled = values / divisor if divisor != 0 else np.zeros(3)
    if mixture == 1:
        soft = np.exp((scaled - scaled.max()) / temperature)
        shares[:] = (soft / np.sum(soft) + shares) / 2
        return
    preferences = np.minimum(np.maximum(scaled / temperature, -LARGEST), LARGEST)
    top = max(0.0, preferences.max())
    shares[:] = np.exp(preferences - top) + shares * exp(-top)
    shares /= np.sum(shares)


@compiled
def _sample(shares: Any, rng: Any) -> Any:
    remaining = rng.random()
    for action in range(3):
        remaining -= shares[action]
        if remaining < 0:
            return action
    return 2


@inlined
def _choose(
    agent: Any, phi: Any, nrb: Any, before: Any, last: Any, rates: Any, rng: Any, values: Any, shares: Any
) -> Any:
    """An action. before, last: similarity and action of the step before, for who climbs; values: of `phi`, written."""
    if agent.chooser == RANDOM:
        return rng.integers(0, 3)
    if agent.chooser == CLIMB or (agent.chooser == GUIDED and rng.random() < agent.climbing):
        return (last + 1 + rng.integers(0, 2)) % 3 if nrb <= before else last
    for k in range(3):
        values[k] = np.dot(agent.weights[k], phi)
    if agent.chooser != POLICY:
        return _largest(values)
    _probabilities(values, rates[1], rates[2], agent.mixture, shares)
    return _sample(shares, rng)


# --- Episodes ---------------------------------------------------------------------------------------------------------


@compiled
def episodes(
    world: Any,
    body: Any,
    task: Any,
    agent: Any,
    rule: Any,
    starts: Any,
    schedule: Any,
    agent_rng: Any,
    world_rng: Any,
    steps: Any,
    lengths: Any,
    reached: Any,
    progress: Any,
) -> Any:
    """Drive the episodes from progress[0] on, as many as surely fit into `steps`. Returns DONE, DIVERGED or REPEAT.

    starts: poses, shape (episodes or 1, 3), NaN: drawn anew; schedule: step size, epsilon and temperature, shape
    (episodes, 3).

    Written: steps, shape (rows, 11), `agent.STEP_COLUMNS`; lengths, reached, shape (episodes,); progress: episodes that
    are finished, rows of `steps`, lambdas asked for, updates made.
    """
    actions, n = agent.weights.shape
    phi, phi_next = np.empty(n), np.empty(n)
    phi_sa, phi_prev = np.zeros(actions * n), np.zeros(actions * n)
    change, values, shares = np.empty(actions * n), np.empty(3), np.empty(3)
    theta, trace = agent.weights.reshape(-1), agent.trace.reshape(-1)
    while progress[0] < len(lengths):
        number, first = progress[0], progress[1]
        if first + task.max_steps > len(steps):
            return DONE
        rates = schedule[number]
        alpha = rates[0]
        # What a new episode forgets: traces, the step before; the weights, if it begins with others.
        if agent.learns:
            trace[:] = 0.0
        if agent.begins_with.size:
            agent.weights[:] = agent.begins_with
        delta_prev, has_before = 0.0, False
        place = starts[number % len(starts)]
        pose = (place[0], place[1], place[2])
        if not isfinite(place[0]):
            pose = _free_pose(world, task, world_rng)
        reflex, at = -1, nearest(world, pose[0], pose[1], pose[2])
        if at < 0:
            return REPEAT
        nrb = look(world, at, phi)
        action = _choose(agent, phi, nrb, np.inf, 0, rates, agent_rng, values, shares)
        last, seen = action, nrb
        for t in range(1, task.max_steps + 1):
            pose, at, action, reflex, at_wall = act(world, body, pose, reflex, action, world_rng)
            if at < 0:
                return REPEAT
            before = nrb
            nrb = look(world, at, phi_next)
            terminal = nrb >= task.psi_upper
            reward = -1 / t if task.constant_cost == 0 else -task.constant_cost
            if task.approach_reward and nrb >= task.psi_lower and before >= task.psi_lower:
                reward += 2 * nrb - before
            if at_wall:
                reward -= task.wall_penalty
            reward = task.reward_scale * reward + (task.terminal_bonus if terminal else 0.0)
            chose = reflex < 0
            if chose:
                next_action = _choose(agent, phi_next, nrb, seen, last, rates, agent_rng, values, shares)
                last, seen = next_action, nrb
            else:
                next_action = reflex
            delta, lambda_t, clipped, length = 0.0, 0.0, 0.0, 0.0  # what is recorded, where nothing is learnt
            if agent.learns and (agent.learns_at_walls or not at_wall):
                q = np.dot(agent.weights[action], phi)
                q_next = 0.0
                if not terminal or agent.bootstraps:
                    q_next = values[next_action] if chose else np.dot(agent.weights[next_action], phi_next)
                delta = reward + agent.discount * q_next - q  # eq. (1)
                phi_sa[:] = 0.0
                phi_sa[action * n : (action + 1) * n] = phi
                if has_before:  # eq. (7)
                    if agent.lambdas.size:
                        lambda_t = agent.lambdas[min(progress[2], agent.lambdas.size - 1)]
                    else:
                        earlier = phi_sa if agent.overwrites else phi_prev
                        lambda_t = rule(delta, phi_sa, delta_prev, earlier, trace, agent.discount)
                    progress[2] += 1
                    if not isfinite(lambda_t):
                        if not agent.rule_is_ours:
                            return REPEAT
                        lambda_t = agent.on_zero
                    if agent.clip and not 0 <= lambda_t <= 1:
                        lambda_t, clipped = 0.0 if lambda_t < 0 else 1.0, 1.0
                has_before, delta_prev = True, delta
                for i in range(actions * n):
                    trace[i] *= agent.discount * lambda_t  # eq. (17)
                trace_a = agent.trace[action]
                trace_a += phi
                moves, along = theta, trace
                if not agent.all_weights:
                    moves, along = agent.weights[action], trace_a
                changed = change[: len(moves)]
                for i in range(len(moves)):
                    changed[i] = alpha * delta * along[i]  # eq. (18)
                    moves[i] += changed[i]
                squares = np.dot(changed, changed)
                length = sqrt(squares)
                if not isfinite(squares):
                    if not np.isfinite(theta).all():
                        return DIVERGED
                    largest = np.abs(changed).max()
                    changed /= largest
                    length = largest * sqrt(np.dot(changed, changed))
                phi_sa, phi_prev = phi_prev, phi_sa
                progress[3] += 1
            row = steps[progress[1]]
            row[0], row[1], row[2] = pose
            row[3], row[4], row[5] = action, reward, nrb
            row[6], row[7], row[8], row[9], row[10] = delta, lambda_t, clipped, length, at_wall
            progress[1] += 1
            if terminal or t == task.max_steps:
                break
            phi, phi_next = phi_next, phi
            action = next_action
        lengths[number], reached[number] = progress[1] - first, terminal
        progress[0] += 1
    return DONE


def warm() -> None:
    """Compile all, or read it from the cache, for arrays of the types that come (but of images above 65,535 pixels)."""
    one, two, places = np.zeros(1), np.zeros((1, 1)), np.zeros(4, np.int64)
    short, at = np.zeros(3, np.int32), np.zeros((1, 1), np.int64)
    world = World(np.zeros((1, 3), np.uint16), one, at, two, 0.0, 0.0, 0.0, 1.0, 1.0, 1, one, short, short)
    body, task = Body(two, two, 1.0, 0.0, 0.0), Task(1.0, 1.0, 0.0, False, 0.0, 1.0, 0.0, 1, 1.0, 1.0)
    agent = Agent(POLICY, two, trace=two, begins_with=two, lambdas=one)
    rng = np.random.default_rng(0)
    wander(world, body, (0.0, 0.0, 0.0), rng, places[:0])
    numbers, flags = np.zeros(0, np.int64), np.zeros(0, np.bool_)
    episodes(world, body, task, agent, no_rule, two, two, rng, rng, two, numbers, flags, places)
