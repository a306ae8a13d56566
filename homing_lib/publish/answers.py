"""What the studies say in a sentence each: does a varying lambda matter, is learning worth it, and the like.

That it learns is told by the headline (`report.conclusion`). Every word of judgement is a verdict of `claims`; ratios
are of interquartile means, in the paper's room.
"""

from collections.abc import Mapping
from functools import cache
from typing import Any

from homing_lib.study import mechanism, opponents
from homing_lib.study.claims import Comparison, Verdict, compare, judge
from homing_lib.study.probes import CLIMBING
from homing_lib.study.runs import load_table

_PAPER = "paper"


@cache
def varying_lambda(*, numbers: bool = True) -> str:
    """Is form 2 better than the best fixed lambda, what of it matters, and in how many rooms? Q1-Q4 and Q7."""
    aspects = {"its timing": judge("Q1").verdict, "its sign": judge("Q3").verdict, "its size": judge("Q2").verdict}
    better = f"A varying λ is {_BETTER[judge('Q4').verdict]} than the best fixed one"
    if not numbers:
        return f"{better}, and of what makes it vary {matters(aspects)}."
    tables = [load_table(one) for one in (mechanism.MECHANISM, mechanism.MECHANISM_DRAWN)]
    of_rooms = [load_table(one) for one in (mechanism.ROOMS_RULES, mechanism.ROOMS_DRAWN)]
    best = against_the_best_fixed().typical
    drawn = mechanism.timing(*tables)["i.i.d."].typical
    gate, opposite = (
        mechanism.against(tables[0], rules)[rules[0]].typical for rules in (mechanism.SAME_SIGN, mechanism.SAME_SIZE)
    )
    in_rooms = [one.word for one in mechanism.by_room("i.i.d.", *tables, *of_rooms).values()]
    return (
        f"{better} ({best:.2f} of its late steps), and of what makes it vary {matters(aspects)}: it takes "
        f"{drawn:.2f} of the steps with λ drawn at random from its own (better in {in_rooms.count('better')} of "
        f"{len(in_rooms)} rooms, worse in {in_rooms.count('worse')}), {gate:.2f} of those of a gate with its sign "
        f"alone, and {opposite:.2f} of those of the opposite gate."
    )


@cache
def sign_elsewhere() -> str:
    """In which rooms is form 2 better than the opposite gate? Judged as Q7 judges the i.i.d. draws."""
    names = mechanism.MECHANISM, mechanism.MECHANISM_DRAWN, mechanism.ROOMS_RULES, mechanism.ROOMS_DRAWN
    found = mechanism.by_room("opposite gate", *map(load_table, names))
    return f"{[one.word for one in found.values()].count('better')} of {len(found)} rooms"


@cache
def worth(*, numbers: bool = True) -> str:
    """Is the robot that has learnt ahead of a climb up the similarity, and from which episode on? Q20-Q22."""
    of, all_episodes = load_table(opponents.OPPONENTS), load_table(opponents.WORTH)
    usual, anywhere = (against_the_climb(of, usual=usual) for usual in (True, False))
    paid, last = opponents.paid_in_rooms(all_episodes, "room"), opponents.EPISODES
    since = paid[_PAPER].value
    ahead = f"ahead from episode {since:.0f}" if since <= last else f"not ahead by episode {last}"
    pays = _PAYS[judge("Q22").verdict].format(
        last=last, paid=sum(one.high <= last for one in paid.values()), rooms=len(paid)
    )
    steps, when = "", ""
    if numbers:
        steps = (
            f" (in the paper's room {usual.typical:.2f} of its steps, {usual.word}, and {anywhere.typical:.2f}, "
            f"{anywhere.word})"
        )
        when = f" ({ahead} in the paper's room)"
    return (
        "Against a walk up the similarity, which learns nothing, the robot that has learnt is "
        f"{_AHEAD[judge('Q20').verdict]} from the usual start and {_AHEAD[judge('Q21').verdict]} from everywhere"
        f"{steps}; all episodes counted, learning {pays}{when}."
    )


_BETTER: dict[Verdict, str] = {"yes": "better", "no": "no better", "not shown": "not shown to be better"}
_AHEAD: dict[Verdict, str] = {
    "yes": "ahead",
    "partly": "ahead in some rooms",
    "no": "not ahead",
    "not shown": "not shown to be ahead",
}
_PAYS: dict[Verdict, str] = {
    "yes": "pays for itself within the paper's twenty in every room",
    "partly": "pays for itself within {last} episodes in {paid} of {rooms} rooms, though not in all of them within the "
    "paper's twenty, as far as is shown",
    "no": "does not pay for itself within {last} episodes",
    "not shown": "is not shown to pay for itself within {last} episodes",
}


FOUND: dict[str, dict[Verdict, str]] = {
    "Q5": {
        "yes": "It is fast: over all twenty episodes form 2 takes fewer steps than the best fixed λ, and than fixed 0.",
        "partly": "It is fast in part: over all twenty episodes form 2 is shown to take fewer steps than one of the "
        "two, the best fixed λ and fixed 0.",
        "no": "It is not fast: over all twenty episodes form 2 takes no fewer steps than the best fixed λ, nor than "
        "fixed 0.",
        "not shown": "The runs do not show whether it is fast: whether over all twenty episodes form 2 takes fewer "
        "steps than the best fixed λ, and than fixed 0.",
    },
    "Q6": {
        "yes": "All of this is confirmed where the weights of all actions are updated, as is standard.",
        "partly": "Some of this is confirmed where the weights of all actions are updated, as is standard.",
        "no": "Nothing of this is confirmed where the weights of all actions are updated, as is standard, and some of "
        "it is contradicted.",
        "not shown": "Nothing of this is confirmed where the weights of all actions are updated, as is standard, nor "
        "is anything contradicted.",
    },
    "Q8": {
        "yes": "One of the measured properties of the rooms orders them as the effect does.",
        "not shown": "None of the measured properties of the rooms goes with the effect more than chance allows.",
    },
    "Q9": {
        "yes": "The camera confirms what the atlas decides.",
        "partly": "The camera confirms some of what the atlas decides.",
        "no": "The camera contradicts the atlas.",
        "not shown": "The camera decides nothing of what the atlas decides.",
    },
    "Q10": {
        "yes": "The reward matters: at zero, negated or constant, it changes the late steps.",
        "partly": "The reward matters in part: of zero, negated and constant ones, some change the late steps; of the "
        "others that is not shown.",
        "no": "The reward does not matter: at zero, negated or constant, it leaves the late steps comparable.",
        "not shown": "The runs do not show whether the reward matters: of zero, negated and constant ones, none is "
        "shown to change the late steps, nor are all shown to leave them comparable.",
    },
    "Q11": {
        "yes": "The initial value carries the learning: with it and without any reward the robot learns, and with the "
        "reward and without it the robot does worse.",
        "partly": "The initial value carries the learning in part: of two signs of it, learning without any reward and "
        "doing worse without the value, one is there.",
        "no": "The initial value does not carry the learning.",
        "not shown": "The runs do not show whether the initial value carries the learning.",
    },
    "Q12": {
        "yes": "The robot loiters in the band between the thresholds, where it is paid for being.",
        "partly": "The robot loiters in the band between the thresholds, where it is paid for being, if the band is "
        "wider than printed; if it is as printed, that is not shown.",
        "no": "The robot does not loiter in the band between the thresholds, though it is paid for being there.",
        "not shown": "The runs do not show whether the robot loiters in the band between the thresholds, where it is "
        "paid for being.",
    },
    "Q13": {
        "yes": "The bootstrapped home is a reward that the robot pays itself: masking it costs steps, and a bonus of "
        "its size makes up for them.",
        "partly": "Is the bootstrapped home a reward that the robot pays itself? Of two signs of it, that masking home "
        "costs steps and that a bonus of its size makes up for them, one is there.",
        "no": "The bootstrapped home is no reward that the robot pays itself.",
        "not shown": "The runs do not show whether the bootstrapped home is a reward that the robot pays itself.",
    },
    "Q14": {
        "yes": "It learns, at each printed alpha_0 and at either temperature.",
        "partly": "It learns at some of the printed alpha_0 and temperatures; at the others that is not shown.",
        "no": "It does not learn, whichever printed alpha_0 and temperature it has.",
        "not shown": "It is not shown to learn, whichever printed alpha_0 and temperature it has; nor is it shown not "
        "to.",
    },
    "Q23": {
        "yes": "That is reached in every room.",
        "partly": "That is reached in some of the rooms, and not shown to be in the others.",
        "no": "That is not reached.",
        "not shown": "That is not shown to be reached in any room.",
    },
    "Q24": {
        "yes": "It takes that learning: robots of the published training that climb as often take more steps.",
        "partly": "In some of the rooms it takes that learning: there, robots of the published training that climb as "
        "often take more steps.",
        "no": "It does not take that learning: robots of the published training that climb as often take no more "
        "steps.",
        "not shown": "It is not shown to take that learning: in no room do robots of the published training that climb "
        "as often take more steps, as far as the runs tell.",
    },
    "Q25": {
        "yes": "In every room the published robot gets lost beside and behind its home.",
        "partly": "In some of the rooms the published robot gets lost beside and behind its home.",
        "no": "The published robot does not get lost beside and behind its home more than elsewhere.",
        "not shown": "The published robot is not shown to get lost beside and behind its home more than elsewhere.",
    },
    "Q26": {
        "yes": "It is the walls that hold a lost robot.",
        "partly": "In some of the rooms it is the walls that hold a lost robot.",
        "no": "It is not the walls that hold a lost robot.",
        "not shown": "It is not shown to be the walls that hold a lost robot.",
    },
    "Q30": {
        "yes": "On the random walk of the textbooks form 2 is better than the best fixed λ.",
        "no": "On the random walk of the textbooks form 2 is no better than the best fixed λ.",
        "not shown": "On the random walk of the textbooks form 2 is not shown to be better than the best fixed λ.",
    },
}
"""What the report's text says of a question, by its verdict."""


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
