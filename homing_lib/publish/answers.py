"""What the studies say in a sentence each: does a varying lambda matter, and is learning worth it?

That it learns is told by the headline (`report.conclusion`). Every word of judgement is a verdict of `claims`; ratios
are of interquartile means, in the paper's room.
"""

from collections.abc import Mapping
from functools import cache
from typing import Any

from homing_lib.rooms import ROOMS
from homing_lib.study import mechanism, opponents
from homing_lib.study.claims import Comparison, Verdict, compare, judge
from homing_lib.study.probes import CLIMBING
from homing_lib.study.runs import episodes_of, load_table

_PAPER = "paper"


@cache
def varying_lambda() -> str:
    """Is form 2 better than the best fixed lambda, what of it matters, and in how many rooms? Q1-Q4 and Q7."""
    tables = [load_table(one) for one in (mechanism.MECHANISM, mechanism.MECHANISM_DRAWN)]
    of_rooms = [load_table(one) for one in (mechanism.ROOMS_RULES, mechanism.ROOMS_DRAWN)]
    best = against_the_best_fixed().typical
    drawn = mechanism.timing(*tables)["i.i.d."].typical
    gate, opposite = (
        mechanism.against(tables[0], rules)[rules[0]].typical for rules in (mechanism.SAME_SIGN, mechanism.SAME_SIZE)
    )
    in_rooms = [one.word for one in mechanism.by_room("i.i.d.", *tables, *of_rooms).values()]
    aspects = {"its timing": judge("Q1").verdict, "its sign": judge("Q3").verdict, "its size": judge("Q2").verdict}
    return (
        f"A varying λ is {_BETTER[judge('Q4').verdict]} than the best fixed one ({best:.2f} of its late steps), and of "
        f"what makes it vary {matters(aspects)}: it takes {drawn:.2f} of the steps with λ drawn at random from its own "
        f"(better in {in_rooms.count('better')} of {len(ROOMS)} rooms, worse in {in_rooms.count('worse')}), {gate:.2f} "
        f"of those of a gate with its sign alone, and {opposite:.2f} of those of the opposite gate."
    )


@cache
def worth() -> str:
    """Is the robot that has learnt ahead of a climb up the similarity, and from which episode on? Q20-Q22."""
    of, all_episodes = load_table(opponents.OPPONENTS), load_table(opponents.WORTH)
    usual, anywhere = (against_the_climb(of, usual=usual).typical for usual in (True, False))
    ours, theirs = (episodes_of(all_episodes, f"{_PAPER}, {who}, room") for who in ("sarsa", "climb"))
    since, last = opponents.paid_back(ours, theirs).value, ours.shape[1]
    return (
        "Against a walk up the similarity, which learns nothing, the robot that has learnt is "
        f"{_AHEAD[judge('Q20').verdict]} from the usual start and {_AHEAD[judge('Q21').verdict]} from everywhere (in "
        f"the paper's room {usual:.2f} and {anywhere:.2f} of its steps); all episodes counted, learning "
        f"{_PAYS[judge('Q22').verdict].format(last=last)} "
        f"({f'ahead from episode {since:.0f}' if since <= last else f'not ahead by episode {last}'} in the paper's "
        "room)."
    )


_BETTER: dict[Verdict, str] = {"yes": "better", "no": "no better", "not shown": "not shown to be better"}
_AHEAD: dict[Verdict, str] = {
    "yes": "ahead",
    "partly": "ahead in some rooms",
    "no": "not ahead",
    "not shown": "not shown to be ahead",
}
_PAYS: dict[Verdict, str] = {
    "yes": "pays for itself in every room",
    "partly": "pays for itself within {last} episodes, though not everywhere within the paper's twenty",
    "no": "does not pay for itself",
}


def matters(aspects: Mapping[str, Verdict]) -> str:
    """What matters, what does in part, what does not, and what is not shown to. aspects: a verdict each."""
    told = []
    for verdict, (one, several) in {
        "yes": ("matters", "matter"),
        "partly": ("matters in part", "matter in part"),
        "no": ("does not matter", "do not matter"),
        "not shown": ("is not shown to matter", "are not shown to matter"),
    }.items():
        if of := [aspect for aspect, found in aspects.items() if found == verdict]:
            told.append(f"{listed(of)} {one if len(of) == 1 else several}")
    return listed(told)


def listed(parts: list[str]) -> str:
    """ "a", "a and b", "a, b and c"."""
    return " and ".join(filter(None, (", ".join(parts[:-1]), parts[-1])))


@cache
def against_the_best_fixed() -> Comparison:
    """Late steps of form 2 as a multiple of those of the best fixed lambda, as Q4 judges them."""
    return mechanism.best_fixed(load_table(mechanism.MECHANISM), "taken")


def against_the_climb(of: Any, *, usual: bool) -> Comparison:
    """Steps after the published training as a multiple of the climb's, as Q20 and Q21 judge them."""
    ours, theirs = (
        opponents.per_run(opponents.trials(of, f"{_PAPER}, {who}", usual=usual)) for who in ("after 20", "climb")
    )
    return compare(ours, theirs, family=len(opponents.ROOMS))


DRIVERS = {
    "random actions": ("random", 0.0),
    "a climb up the similarity": ("climb", 0.0),
    "learnt, 5 episodes": ("after 5", 0.0),
    "learnt, 10 episodes": ("after 10", 0.0),
    "learnt, 20 episodes": ("after 20", 0.0),
    "the declared extension": ("extension", CLIMBING),
}


def beside_the_headline() -> list[tuple[str, ...]]:
    """Who drives; for each room, mean steps from the usual start and from everywhere, and who of these gets home."""
    of, nearest = load_table(opponents.OPPONENTS), load_table(opponents.NEAREST)
    rows = []
    for label, (who, share) in DRIVERS.items():
        cells = [label]
        for room in opponents.ROOMS:
            usual, anywhere = (opponents.trials(of, f"{room}, {who}", share, one) for one in (True, False))
            home = opponents.per_run(anywhere, "reached").mean()
            cells += [f"{opponents.per_run(one).mean():.0f}" for one in (usual, anywhere)] + [f"{home:.0%}"]
        rows.append(tuple(cells))
    steps = nearest.groupby(["condition", "usual"], observed=True).steps.mean()
    shortest = [f"{steps[room, usual]:.0f}" if usual >= 0 else "" for room in opponents.ROOMS for usual in (1, 0, -1)]
    return [*rows, ("the shortest way", *shortest)]
