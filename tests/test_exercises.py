"""Each exercise that is checked is blank, and its folded solution is proven; wrong answers are refused."""

import ast
import re
from functools import cache, partial

import nbformat
import numpy as np
import pytest

from homing_lib.agent import Learnt
from homing_lib.features import HomeModel
from homing_lib.publish.notebooks import NOTEBOOKS
from homing_lib.settings import Settings
from homing_lib.study import runs, studies, walk
from homing_lib.teach import exercises
from homing_lib.teach.checks import Check
from homing_lib.thresholds import stopping_thresholds

LATE = np.r_[np.full(40, 30.0), 300, 300, 500]


@cache
def cells(name):
    return {cell.id: cell for cell in nbformat.read(NOTEBOOKS / f"{name}.ipynb", as_version=4).cells}


CHECKED = [
    (path.stem, cell.removeprefix("exercise-"))
    for path in sorted(NOTEBOOKS.glob("[0-9]*.ipynb"))
    for cell in cells(path.stem)
    if re.fullmatch(r"exercise-\d", cell) and cells(path.stem)[cell].cell_type == "code"
]


def names(notebook):
    """What a notebook has made before its exercises, as far as they need it: all that it imports, and some arrays."""
    rng = np.random.default_rng(1)
    known = dict(pi=np.pi, rng=rng, default=Settings(), late=LATE, similarity=exercises.similarity)
    known |= dict(away=rng.uniform(0, 1, 200), views=rng.normal(0.5, 0.5, (200, 21)), psi=stopping_thresholds(12))
    known["home_model"] = HomeModel(np.full((1, 21), 0.5), np.ones((1, 21)))
    for cell in cells(notebook).values():
        for node in ast.parse(cell.source).body if cell.cell_type == "code" else ():
            if isinstance(node, ast.Import | ast.ImportFrom):
                exec(ast.unparse(node), known)
    if notebook.startswith("06"):
        known["searched"] = searched()
    return known


@cache
def searched():
    return runs.load_table(studies.CALIBRATION)


def blocks(notebook, number):
    return re.findall(r"```python\n(.*?)\n```", cells(notebook)[f"solution-{number}"].source, re.S)


@pytest.fixture(autouse=True)
def short_races(monkeypatch):
    sizes = {"choose": range(2), "judge": range(1000, 1010), "step_sizes": (0.2, 0.4, 0.6)}
    monkeypatch.setattr(walk, "race", partial(walk.race, **sizes))


@pytest.mark.parametrize(("notebook", "number"), CHECKED)
def test_an_exercise_is_blank_in_the_source_and_its_solution_is_proven(notebook, number, capsys):
    known, answer = names(notebook), cells(notebook)[f"exercise-{number}"].source
    exec(answer, known)
    title, verdict = capsys.readouterr().out.split(": ")
    assert title.startswith(f"{int(notebook[:2])}.{number} · ")
    assert verdict.startswith("blank.")
    solution = "\n".join(blocks(notebook, number))
    solution = re.match(r".*?^exercises\..*?$", solution, re.S | re.M)[0]
    exec(solution, known)
    assert ": proven. " in capsys.readouterr().out.splitlines()[-1]
    assert solution.splitlines()[-1] == answer.splitlines()[-1]


def test_every_check_is_asked_by_the_exercise_that_it_is_named_after():
    checks = {one.title.split(" ")[0] for one in vars(exercises).values() if isinstance(one, Check)}
    assert checks == {f"{int(name[:2])}.{number}" for name, number in CHECKED}
    assert not [name for name, _ in CHECKED if "```python" in cells(name)["exercises"].source]


def sarsa(self, phi, action, reward, phi_next, next_action, terminal, at_wall, mask=False, moves=None):
    """Exercise 3.3 with another look ahead, or other weights that move."""
    ahead = 0 if terminal and mask else np.dot(self.probabilities(phi_next), self.theta @ phi_next)
    ahead = ahead if mask or moves else self.theta[next_action] @ phi_next
    delta = reward + self.settings.discount * ahead - self.theta[action] @ phi
    self.theta[moves or action] += self.settings.alpha0 * self.rate * delta * phi
    return Learnt(delta)


@pytest.mark.parametrize("wrong", [{}, {"mask": True}, {"moves": slice(None)}])
def test_another_look_ahead_or_other_weights_are_no_expected_sarsa(wrong):
    assert exercises.expected_sarsa.judge(partial(sarsa, **wrong)).verdict == "wrong"


def left(shares, chance=True):
    robots, places = shares.mean(axis=1), shares.mean(axis=0)
    residuals = shares - robots[:, None] - places + shares.mean()
    noise = chance * (residuals**2).sum() / ((len(robots) - 1) * (len(places) - 1))
    return np.sqrt(np.maximum([robots.var(ddof=1) - noise / len(places), places.var(ddof=1) - noise / len(robots)], 0))


def learn(sign=1, mask=True, learns=True):
    """Exercise 8.1 with something the wrong way."""

    def learn(value, pay, masked):
        value, phi = value.copy(), np.arange(6.0)
        for here, there in [(0, 1), (1, 2), (2, 1), (1, 2), (2, 3), (3, 4), (4, 5)] * 200 * learns:
            end = there == 5 and masked
            paid = sign * ((0 if end and mask else phi[there]) - phi[here])
            value[here] += 0.1 * (pay * paid + (0 if end else value[there]) - value[here])
        return value

    return learn


def lagging(lag, shared=False):
    """Exercise 7.1, so many steps late; shared: one rule for all who ask for one."""

    def make():
        kept = [0.0] * lag

        def rule(**step):
            kept.append(exercises.fletcher_reeves(**step))
            return kept.pop(0)

        return rule

    rule = make()
    return (lambda: rule) if shared else make


SPREAD = (
    HomeModel(np.zeros((1, 3)), np.ones((1, 3))),
    [np.full(3, x) for x in (0.0, 0.42, 0.44, 2.0)],
    np.array([1.0, 2, 3, 4]),
    stopping_thresholds(12),
)

WRONG = [
    (exercises.rearranged, lambda image: image),
    (exercises.rearranged, lambda image: 255 - image),
    (exercises.both_empty, lambda one, other: np.mean((one == 0) | (other == 0))),
    (exercises.both_empty, lambda one, other: np.mean(other == 0)),
    (exercises.multipliers, {"first": 1 / np.pi**2 / 0.0025, "second": 1 / np.pi**2 / 0.0025}),
    *[(exercises.farthest, distance, *SPREAD) for distance in (4.0, 3.0, 1.5, 0.1)],
    (exercises.late_steps, lambda run: run.lengths[-5:].mean()),
    (exercises.late_steps, lambda run: np.r_[run.lengths, [200] * 8][4:8].mean()),
    (exercises.share_in_band, lambda nrb, psi: np.mean((psi.lower <= nrb) & (nrb <= psi.upper))),
    (exercises.share_in_band, lambda nrb, psi: np.mean((psi.lower < nrb) & (nrb < psi.upper))),
    (exercises.on_orthogonal_features, lambda delta, delta_prev, discount: delta / delta_prev),
    (exercises.on_orthogonal_features, lambda delta, delta_prev, discount: -delta / delta_prev / discount),
    *[(exercises.widest_spacing, lambda step, share=share: share * step) for share in (1, 0.71, 0.7, 0, -0.7071)],
    *[(exercises.flattery, share) for share in (0.9, 35.9)],
    (exercises.cost, lambda steps: 1 / steps),
    (exercises.cost, lambda steps: 1 + sum(1 / t for t in range(1, steps + 1))),
    *[(exercises.late_by_one, rule) for rule in (lagging(0), lagging(2), lagging(1, shared=True))],
    *[(exercises.shaping, learn(**wrong)) for wrong in ({"sign": -1}, {"mask": False}, {"learns": False})],
    *[(exercises.slowest, robots, LATE) for robots in (0, 2, 4)],
    (exercises.beyond_chance, lambda shares: left(shares, chance=False)),
    (exercises.beyond_chance, lambda shares: left(shares)[::-1]),
    (exercises.beyond_chance, lambda shares: (np.nan, np.nan)),
]
"""A check, and answers that are wrong."""


@pytest.mark.parametrize("case", WRONG, ids=lambda case: case[0].title[:3])
def test_what_is_wrong_is_refused(case):
    check, *answers = case
    assert check.judge(*answers).verdict == "wrong"


def test_the_candidate_is_judged_by_the_median_and_compared_with_the_mean():
    late = searched()[searched().episode > 10]
    each = late.steps.fillna(2000).groupby(late.condition.astype(str))
    best = each.median().idxmin()
    verdict, remark = exercises.by_median.judge(best, searched())[1:]
    assert verdict == "proven"
    assert ("also" in remark) == (best == each.mean().idxmin())
    assert exercises.by_median.judge(each.median().idxmax(), searched()).verdict == "wrong"


@pytest.mark.parametrize(
    ("rule", "verdict", "what"),
    [
        (lambda *, delta, delta_prev, **_: 0.8 if delta * delta_prev >= 0 else 0.4, "proven", "smaller"),
        (lambda **_: 0.8, "proven", "1.00 [1.00, 1.00] times that of λ = 0.8: the same."),
        (lambda *, delta, delta_prev, **_: abs(delta / delta_prev), "behind", "larger"),
    ],
)
def test_a_rule_that_loses_is_behind_and_the_same_counts(rule, verdict, what):
    outcome = exercises.as_good_as_a_constant.judge(rule)
    assert outcome.verdict == verdict
    assert what in outcome.message


@pytest.mark.parametrize("notebook", sorted({notebook for notebook, _ in CHECKED}))
def test_no_cell_draws_from_a_generator_of_another_which_would_give_other_numbers_when_it_is_run_again(notebook):
    elsewhere = set()
    for cell in cells(notebook).values():
        nodes = [*ast.walk(ast.parse(cell.source))] if cell.cell_type == "code" else []
        assigned = [node for node in nodes if isinstance(node, ast.Assign) and isinstance(node.value, ast.Call)]
        made = {ast.unparse(node.targets[0]) for node in assigned if "default_rng" in ast.unparse(node.value.func)}
        assert not (elsewhere - made) & {node.id for node in nodes if isinstance(node, ast.Name)}
        elsewhere |= made
