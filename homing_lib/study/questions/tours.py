"""Several homes, which the paper names as its next work: a snapshot and a linear network for each, in one room.

A *tour* visits three homes, each once. A *leg* seeks one of them: its snapshot makes the features and its network
drives and learns, as for a single home. It ends at home, or is cut at 2,000 steps; the next begins where the robot
stands. Who is sought next, a *prioritisation* says. The robot is never told where it is. That the networks do not
interfere is by construction: a step changes the weights of one.
"""

from collections.abc import Callable, Iterator, Sequence
from math import radians
from typing import Any, NamedTuple

import numpy as np

from homing_lib.agent import AGENTS, STEP_COLUMNS
from homing_lib.environment import HomingEnv
from homing_lib.errors import UserError, shown
from homing_lib.features import Array, similarity
from homing_lib.sarsa import Diverged
from homing_lib.settings import Settings
from homing_lib.study import engine
from homing_lib.study.bootstrap import iqm
from homing_lib.study.findings import (
    OF_A_QUESTION,
    Comparison,
    Judged,
    compare_steps,
    compare_to_limit,
    estimate,
    exact,
    question,
    verdict_of,
)
from homing_lib.study.measures import fewest_steps
from homing_lib.study.questions import varying
from homing_lib.study.questions.drives import after
from homing_lib.study.questions.home import is_right
from homing_lib.study.robots import driver
from homing_lib.study.runs import Columns
from homing_lib.study.studies import HEADLINE_SEEDS, ROOM_ROBOTS, labelled, rows, study

HOMES = {
    "paper": [(0.85, 0.50, 0.0), (0.13, 0.88, radians(130)), (1.03, 0.14, radians(-30))],
    "workshop": [(0.97, 0.97, radians(45)), (1.23, 0.33, radians(-105)), (0.17, 1.11, radians(115))],
}
"""Poses of the snapshots, the room's own home first. Chosen among some hundred, on seeds 0 to 7, as those at which a
robot that acts at random ends at the home that is meant, and not at another place that looks like it."""

TOURS, LATE = 25, 5
"""A robot learns in 25 tours; judged are the last five. Who does not learn drives six, of which the first, from the
room's start, is left out."""

AFTER = (5, 10, 20)
"""After how many tours with a plan the networks are frozen; so they drive three tours from the room's start."""

# --- Who is sought next -----------------------------------------------------------------------------------------------

RATES = np.array([1.0, 2.0, 3.0])
"""How fast each home's need grows, per step."""

Prioritisation = Callable[[HomingEnv, Sequence[int], Array], int]
"""Which of the homes that are left in this tour is sought. needs: of every home; 0 when the robot is fed there."""


def plan(env: HomingEnv, left: Sequence[int], needs: Array) -> int:
    """A fixed order."""
    return left[0]


def battery(env: HomingEnv, left: Sequence[int], needs: Array) -> int:
    """The home whose need is largest."""
    return max(left, key=lambda home: needs[home])


def nearest(env: HomingEnv, left: Sequence[int], needs: Array) -> int:
    """The home that looks nearest: whose snapshot the view now resembles most."""
    engine.surveyed(env)
    view = env.world.histogram(env.robot.pose)
    return max(left, key=lambda home: similarity(env.models[home].features(view)))  # type: ignore[union-attr]


PRIORITIES: dict[str, Prioritisation] = {"plan": plan, "battery": battery, "nearest": nearest}

# --- Tours ------------------------------------------------------------------------------------------------------------


class Leg(NamedTuple):
    """A leg; one in which the weights left the finite numbers has no path, and counts as `max_steps`."""

    goal: int  # which home was sought
    path: Array  # shape (T, len(STEP_COLUMNS))
    steps: int
    home: bool  # whether it was reached


def begin(settings: Settings, seed: int, *, apart: bool = False) -> tuple[HomingEnv, list[Any]]:
    """A world with the room's homes, the robot at its start, and an agent for each home; all fixed by the seed.

    apart: each home is surveyed by a drive of its own, where else one drive serves all.
    """
    survey_seed, agent_seed, world_seed = np.random.SeedSequence(seed).spawn(3)
    if settings.room not in HOMES:
        raise UserError(f"room {shown(settings.room)}: homes for a tour are known of {', '.join(HOMES)}")
    homes = HOMES[settings.room]
    env = HomingEnv(settings, observation="features", homes=homes, survey_seed=survey_seed)
    if apart:
        seeds = np.random.SeedSequence([seed, 8]).spawn(len(homes))
        env.models = [
            engine.surveyed(HomingEnv(settings, observation="features", home=home, survey_seed=its_own))
            for home, its_own in zip(homes, seeds, strict=True)
        ]
    env.np_random = np.random.default_rng(world_seed)
    env.robot.place(env.room.start)
    return env, [AGENTS[settings.controller](settings, np.random.default_rng(one)) for one in agent_seed.spawn(3)]


def touring(env: HomingEnv, agents: Sequence[Any], next_of: Prioritisation, tours: int) -> Iterator[list[Leg]]:
    """Tours, one after the other, from where the robot stands. agents: who drives, by the home that is sought."""
    needs, here = np.zeros(len(agents)), -1
    for number in range(1, tours + 1):
        left, legs = [*range(len(agents))], []
        while left:
            goal = next_of(env, [home for home in left if home != here], needs)
            left.remove(goal)
            env.seek(goal)
            agents[goal].begin_episode(number)
            try:
                path, home = engine.run_episode(env, agents[goal], {"start": "here"})
                legs.append(Leg(goal, path, len(path), home))
            except Diverged:
                legs.append(Leg(goal, np.empty((0, len(STEP_COLUMNS))), env.settings.max_steps, False))
            here = goal if legs[-1].home else -1
            needs += RATES * legs[-1].steps
            needs[goal] *= not legs[-1].home
        yield legs


def summed_up(env: HomingEnv, legs: Sequence[Leg]) -> tuple[float, ...]:
    """A tour in numbers: its steps, whether it was finished, the share of its legs that ended at the home that was
    meant (`home.is_right`), and the goals in order, a digit each.
    """
    right = sum(leg.home and is_right(leg.path[-1, :3], env.homes[leg.goal]) for leg in legs)
    goals = int("".join(str(leg.goal) for leg in legs))
    return sum(leg.steps for leg in legs), all(leg.home for leg in legs), right / len(legs), goals


NAMES = ("priority", "frozen", "tour", "steps", "finished", "right", "goals")


def toured(settings: Settings, seed: int) -> Columns:
    """One row per tour: `priority`, its place in PRIORITIES; `frozen`, after how many tours the networks were, 0 while
    they learn on (frozen with a plan alone); `tour`, 1, 2, ...; `steps`, `finished`, `right` and `goals` of
    `summed_up`.
    """
    seen: list[tuple[float, ...]] = []
    for priority, next_of in enumerate(PRIORITIES.values()):
        env, agents = begin(settings, seed)
        saved: dict[int, list[Array]] = {}
        for number, legs in enumerate(touring(env, agents, next_of, settings.episodes), 1):
            seen.append((priority, 0, number, *summed_up(env, legs)))
            if settings.controller == "sarsa" and next_of is plan and number in AFTER:
                saved[number] = [agent.learner.weights.copy() for agent in agents]
        for number, weights in saved.items():
            env, agents = begin(settings, seed)
            both = zip(agents, weights, strict=True)
            frozen = [driver("frozen", agent, after(number), its, agent.rng) for agent, its in both]
            seen += [(priority, number, 1, *summed_up(env, legs)) for legs in touring(env, frozen, plan, 3)]
    return dict(zip(NAMES, np.array(seen, dtype=float).T, strict=True))


def toured_apart(settings: Settings, seed: int) -> Columns:
    """What `toured` has (`priority`, `frozen`, `tour`, `steps`, `finished`, `right`, `goals`) of tours with a plan and
    learning on, when each home was surveyed by a drive of its own.
    """
    env, agents = begin(settings, seed, apart=True)
    every = enumerate(touring(env, agents, plan, settings.episodes), 1)
    seen = [(0, 0, number, *summed_up(env, legs)) for number, legs in every]
    return dict(zip(NAMES, np.array(seen, dtype=float).T, strict=True))


def legs_between(settings: Settings, seed: int) -> Columns:
    """The least `steps` from the room's start (`whence` = 3) and from each home to each other, the `goal`."""
    env, seen = begin(settings, seed)[0], []
    engine.surveyed(env)
    for goal in range(3):
        env.seek(goal)
        whence = {**dict(enumerate(env.homes)), 3: env.room.start}
        seen += [(one, goal, fewest_steps(env, pose, walls=True)) for one, pose in whence.items() if one != goal]
    return dict(zip(("whence", "goal", "steps"), np.array(seen, dtype=float).T, strict=True))


# --- Studies ----------------------------------------------------------------------------------------------------------


def conditions(room: str) -> dict[str, Settings]:
    """Who drives, by name: form 2 with the defaults; standard Sarsa(lambda), all weights updated, with the fixed lambda
    and the step size that were chosen in this room for one home; and who does not learn.
    """
    return {
        "form2": after(TOURS, room=room),
        "standard": after(TOURS, varying.standard(room)),
        "climb": after(LATE + 1, room=room, controller="climb"),
        "random": after(LATE + 1, room=room, controller="random"),
    }


IN_PAPER = study(
    "tours",
    "Tours of three homes in the paper's room, by three prioritisations: learning on, frozen, climb and random. By "
    "the spread on seeds 0 to 11, these robots tell a ratio of 1.12 to the climb's steps (k = 6).",
    lambda: labelled(conditions("paper").values()),
    ROOM_ROBOTS,
    toured,
    needs=[varying.CHOICE.second],
)

IN_WORKSHOP = study(
    "tours-workshop",
    "The same in the workshop.",
    lambda: labelled(conditions("workshop").values()),
    ROOM_ROBOTS[:200],
    toured,
    needs=[varying.CHOICE.second],
)

APART = study(
    "tours-apart",
    "The same with a plan and form 2, each home surveyed by a drive of its own: what does one survey for all cost?",
    {"form 2": after(TOURS)},
    ROOM_ROBOTS[:200],
    toured_apart,
)

SHORTEST = study(
    "tours-shortest",
    "The least number of steps from each home to each other, walls and reflex included.",
    labelled(after(TOURS, room=room) for room in HOMES),
    HEADLINE_SEEDS[:3],
    legs_between,
)

# --- What was found ---------------------------------------------------------------------------------------------------


def of_tours(table: Any, like: Settings, priority: int, name: str = "steps") -> Array:
    """A column of the tours of robots that were not frozen, shape (robots, tours), seeds in order."""
    here = rows(table, like, priority=priority, frozen=0).sort_values(["seed", "tour"])
    return np.asarray(here[name].to_numpy(float).reshape(here.seed.nunique(), -1))


def shortest_tours(goals: Array, legs: Any) -> Array:
    """The least steps of tours, each after the one before. goals: of `of_tours`, shape (robots, tours); legs: rows of
    the table of `SHORTEST`. Returns shape (robots, tours - 1).
    """
    least = np.full((4, 3), np.nan)
    for (whence, goal), steps in legs.groupby(["whence", "goal"]).steps.mean().items():
        least[int(whence), int(goal)] = steps
    for goal in range(3):  # sought again at once, after a leg that failed: the robot is anywhere
        least[goal, goal] = np.nanmean(least[:, goal])
    one, two, three = (goals.astype(int) // place % 10 for place in (100, 10, 1))
    return least[three[:, :-1], one[:, 1:]] + (least[one, two] + least[two, three])[:, 1:]


JUDGED = 2 * len(PRIORITIES)
FINISHED = 0.99
BACKWARDS = (21, 210, 102)  # goals in the order 0 2 1, wherever it begins: the plan the other way round


def compared(room: str, table: Any, legs: Any) -> dict[str, Comparison]:
    """Tours in a room: the last five of who learns, all but the first of who does not, by prioritisation and by who."""
    every = conditions(room)
    judged = JUDGED if room == "paper" else 0
    found: dict[str, Comparison] = {}
    for priority, name in enumerate(PRIORITIES):
        taken = {who: of_tours(table, like, priority) for who, like in every.items()}
        steps = {who: its[:, -LATE:].mean(axis=1) for who, its in taken.items()}
        for who, ours in steps.items():
            key, k = f"{room}.{name}.{who}", judged if who == "form2" else 0
            finished, right, goals = (of_tours(table, every[who], priority, what) for what in NAMES[-3:])
            share = finished[:, -LATE:].mean(axis=1)
            found[f"{key}.steps"] = estimate(ours)
            found[f"{key}.finished"] = compare_to_limit(share, FINISHED, comparisons=k) if k else estimate(share)
            found[f"{key}.right"] = estimate(right[:, -LATE:].mean(axis=1))
            found[f"{key}.backwards"] = estimate(np.isin(goals[:, -LATE:], BACKWARDS).mean(axis=1))
            found[f"{key}.of shortest"] = compare_steps(ours, shortest_tours(goals, legs)[:, -LATE:].mean(axis=1))
            if who in ("form2", "standard"):
                total = taken[who][:, : TOURS - LATE].sum(axis=1)
                found[f"{key}.of climb"] = compare_steps(ours, steps["climb"], comparisons=k)
                found[f"{key}.of climb.typical"] = compare_steps(ours, steps["climb"], iqm)
                found[f"{key}.of climb.total"] = compare_steps(total, steps["climb"] * (TOURS - LATE))
                found[f"{key}.of tours 6 to 10"] = compare_steps(ours, taken[who][:, LATE : 2 * LATE].mean(axis=1))
        found[f"{room}.{name}.standard.of form2"] = compare_steps(steps["standard"], steps["form2"])
    for who in ("form2", "standard"):
        on = of_tours(table, every[who], 0)
        random = of_tours(table, every["random"], 0)[:, -LATE:].mean(axis=1)
        for number in AFTER:
            tried = rows(table, every[who], frozen=number).groupby("seed")
            key = f"{room}.{who}.frozen {number}"
            found |= {f"{key}.{name}": estimate(tried[name].mean()) for name in ("steps", "finished", "right")}
            found[f"{key}.of learning on"] = compare_steps(
                tried.steps.mean(), on[:, number : number + LATE].mean(axis=1)
            )
            found[f"{key}.of random"] = compare_steps(tried.steps.mean(), random)
    return found


def verdict_on(found: dict[str, Comparison]) -> str:
    """What the judged comparisons make together, by the predicate below."""
    supporting, contradicting = ("above", "fewer"), ("below", "the same", "more")
    pairs = [[found[f"paper.{name}.form2.{what}"].verdict for what in ("finished", "of climb")] for name in PRIORITIES]
    words = [verdict_of(pair, supporting, contradicting, OF_A_QUESTION) for pair in pairs]
    if len({*words}) == 1:
        return words[0]
    return f"with {words.count('yes')} of {len(words)} prioritisations" if "yes" in words else "undecided"


@question(
    "tours",
    "Several homes: does a robot with a network for each finish its tours, and sooner than the climb?",
    """Form 2 with the defaults, in the paper's room, learning on, after twenty tours of three homes (the next five
    count). With a prioritisation it is so, if at least 99 % of the tours are finished, each home within 2,000
    steps, and a tour takes fewer steps than the climb's under the same prioritisation; it is not, if fewer are
    finished, or a tour takes as many steps or more; else it is undecided (k = 6: finished and steps, with a
    plan, with a battery, and with the goal that looks nearest). The verdict: yes, no or undecided, if it is one
    of these with all three; else the verdict counts those with which it is so, or is undecided, if there is
    none. Beside it: standard Sarsa, the workshop, random actions, the shortest tour, frozen networks, all steps
    of the first twenty tours, and surveys of their own.""",
    IN_PAPER,
    IN_WORKSHOP,
    APART,
    SHORTEST,
    order=10,
)
def tours(paper: Any, workshop: Any, apart: Any, shortest: Any) -> Judged:
    found = compared("paper", paper, rows(shortest, room="paper"))
    found |= compared("workshop", workshop, rows(shortest, room="workshop"))
    form_2 = conditions("paper")["form2"]
    own = of_tours(apart, form_2, 0)
    shared = of_tours(paper, form_2, 0)[: len(own)]
    found["own surveys.of shared"] = compare_steps(own[:, -LATE:].mean(axis=1), shared[:, -LATE:].mean(axis=1))
    found["own surveys.of shared.total"] = compare_steps(*(its[:, : TOURS - LATE].sum(axis=1) for its in (own, shared)))
    found["saved"] = exact((len(HOMES["paper"]) - 1) * form_2.survey_steps)
    found["saved.tours"] = exact(found["saved"].value / found["paper.plan.form2.steps"].value)
    return verdict_on(found), found
