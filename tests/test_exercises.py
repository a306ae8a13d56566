"""Each exercise that is checked is blank, has a folded solution that passes its check, and hints for what is wrong."""

import ast
import re
from functools import cache, partial

import nbformat
import numpy as np
import pytest

from homing_lib.features import HomeModel
from homing_lib.publish.notebooks import NOTEBOOKS
from homing_lib.settings import Settings
from homing_lib.study import measures, runs, studies, walk
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
        known["searched"] = runs.load_table(studies.CALIBRATION)
    return known


def blocks(notebook, number):
    return re.findall(r"```python\n(.*?)\n```", cells(notebook)[f"solution-{number}"].source, re.S)


@pytest.mark.parametrize(("notebook", "number"), CHECKED)
def test_an_exercise_is_blank_in_the_source_and_its_solution_is_proven(notebook, number, capsys):
    known, answer = names(notebook), cells(notebook)[f"exercise-{number}"].source
    exec(answer, known)
    assert re.fullmatch(
        rf"{int(notebook[:2])}\.{number} · .*: blank\. Nothing is checked yet\.\n", capsys.readouterr().out
    )
    solution = "\n".join(blocks(notebook, number))
    solution = re.match(r".*?^exercises\..*?$", solution, re.S | re.M)[0]
    exec(solution, known)
    assert ": proven. " in capsys.readouterr().out.splitlines()[-1]
    assert solution.splitlines()[-1] == answer.splitlines()[-1]


def test_every_check_is_asked_by_the_exercise_that_it_is_named_after():
    checks = {one.title.split(" ")[0] for one in vars(exercises).values() if isinstance(one, Check)}
    assert checks == {f"{int(name[:2])}.{number}" for name, number in CHECKED}
    assert not [name for name, _ in CHECKED if "```python" in cells(name)["exercises"].source]


def left(shares, chance=True):
    robots, places = shares.mean(axis=1), shares.mean(axis=0)
    noise = ((shares - robots[:, None] - places + shares.mean()) ** 2).sum() * chance
    noise /= (len(robots) - 1) * (len(places) - 1)
    return np.sqrt(np.maximum([robots.var(ddof=1) - noise / len(places), places.var(ddof=1) - noise / len(robots)], 0))


def learn(sign=1, mask=True, own=False, learns=True):
    """Exercise 8.1 with something the wrong way."""

    def learn(value, pay, masked):
        value, phi = value if own else value.copy(), np.arange(6.0)
        for here, there in [(0, 1), (1, 2), (2, 1), (1, 2), (2, 3), (3, 4), (4, 5)] * 200 * learns:
            end = there == 5 and masked
            paid = sign * ((0 if end and mask else phi[there]) - phi[here])
            value[here] += 0.1 * (pay * paid + (0 if end else value[there]) - value[here])
        return value

    return learn


def lagging(lag):
    def make():
        kept = [0.0] * lag

        def rule(**step):
            kept.append(exercises.fletcher_reeves(**step))
            return kept.pop(0)

        return rule

    return make


def one_for_all(make):
    rule = make()
    return lambda: rule


SPREAD = (
    HomeModel(np.zeros((1, 3)), np.ones((1, 3))),
    [np.full(3, x) for x in (0.0, 0.42, 0.44, 2.0)],
    np.array([1.0, 2, 3, 4]),
    stopping_thresholds(12),
)

WRONG = [
    (exercises.rearranged, (lambda image: image,), "where they were"),
    (exercises.rearranged, (lambda image: 255 - image,), "another colour"),
    (exercises.rearranged, (lambda image: image[::2],), "became one of shape"),
    (exercises.both_empty, (lambda one, other: np.mean((one == 0) | (other == 0)),), "in one of the two"),
    (exercises.both_empty, (lambda one, other: np.mean(one == 0),), "in the first view"),
    (exercises.both_empty, (lambda one, other: np.mean(other == 0),), "in the second view"),
    (exercises.both_empty, (lambda one, other: np.sum((one == 0) & (other == 0)),), "That is how many"),
    (exercises.multipliers, ({"first": 1 / np.pi**2 / 0.0025, "second": 1 / np.pi / 0.0025},), "of the other form"),
    (exercises.multipliers, ({"first": 1 / np.pi**0.5 / 0.05, "second": 1},), "square what stands"),
    (exercises.multipliers, ({"first": 1 / np.pi / 0.95**2, "second": 1},), "it is 1 - ψ"),
    (exercises.multipliers, ({"first": 1 / np.pi / 0.0025, "second": 12},), "second: this multiplier gives"),
    (exercises.multipliers, ({"first": 1 / np.pi / 0.0025},), "second form is missing"),
    (exercises.farthest, (4.0, *SPREAD), "whether they pass"),
    (exercises.farthest, (3.0, *SPREAD), "the lower threshold"),
    (exercises.farthest, (1.5, *SPREAD), "distance. How badly"),
    (exercises.farthest, (0.1, *SPREAD), "No accepted pose"),
    (exercises.widest_spacing, (lambda step: step,), "the diagonal of its cell"),
    (exercises.widest_spacing, (lambda step: 2**0.5 * step,), "within its cell"),
    (exercises.widest_spacing, (lambda step: step / 2,), "so are some farther apart"),
    (exercises.flattery, (0.9,), "Not within 2 %"),
    (exercises.flattery, (35.9,), "in per cent"),
    (exercises.flattery, (1 / 1600,), "least single run of all"),
    (exercises.flattery, (1 / 160,), "160 single runs"),
    (exercises.flattery, (1,), "the true mean"),
    (exercises.late_by_one, (lagging(0),), "not a step late"),
    (exercises.late_by_one, (lagging(2),), "two steps late"),
    (exercises.late_by_one, (one_for_all(lagging(1)),), "the next one gave"),
    (exercises.late_by_one, (lambda: lambda **_: 0.5,), "other lambdas"),
    (exercises.shaping, (learn(sign=-1),), "wrong sign"),
    (exercises.shaping, (learn(mask=False),), "not Φ apart"),
    (exercises.shaping, (learn(own=True),), "begin with a copy"),
    (exercises.shaping, (learn(learns=False),), "nothing is learnt"),
    (exercises.cost, (lambda steps: 1 / steps,), "the last step alone"),
    (exercises.cost, (lambda steps: -sum(1 / t for t in range(1, steps + 1)),), "greater than 0"),
    (exercises.cost, (lambda steps: steps,), "Step 2 adds 1.0000"),
    (exercises.slowest, (1, LATE), "leave out more"),
    (exercises.slowest, (5, LATE), "Fewer would do"),
    (exercises.slowest, (43, LATE), "How many of the 43"),
    (exercises.beyond_chance, (lambda shares: left(shares, chance=False),), "Chance is still in it"),
    (exercises.beyond_chance, (lambda shares: left(shares)[::-1],), "wrong way round"),
    (exercises.beyond_chance, (lambda shares: left(shares) ** 2,), "Those are variances"),
    (exercises.beyond_chance, (lambda shares: (0.5, 0.5),), "it finds another"),
    (exercises.beyond_chance, (lambda shares: 0.5,), "two numbers"),
]


@pytest.mark.parametrize(("check", "answers", "hint"), WRONG)
def test_what_is_wrong_gets_its_hint(check, answers, hint):
    outcome = check.judge(*answers)
    assert outcome.verdict == "wrong"
    assert hint in outcome.told


def test_what_is_wrong_about_a_stored_table_gets_its_hint():
    searched = names("06-calibration")["searched"]
    late = searched[searched.episode > 10]
    by_mean = late.steps.fillna(2000).groupby(late.condition.astype(str)).mean()
    assert exercises.by_median.judge(by_mean.idxmax(), searched).verdict == "wrong"
    assert "no candidate" in exercises.by_median.judge("the third", searched).told


RIGHT_AND_WRONG = [
    (exercises.late_steps, lambda run: measures.episode_matrix([run])[0, -5:].mean(), "proven"),
    (exercises.late_steps, lambda run: run.lengths[-5:].mean(), "makes it look good"),
    (exercises.late_steps, lambda run: run.lengths[:5].mean(), "first five episodes"),
    (exercises.late_steps, lambda run: run.lengths.mean(), "all episodes"),
    (exercises.late_steps, lambda run: run.lengths[-4:].mean(), "the last four"),
    (exercises.late_steps, lambda run: run.lengths[-5:].sum(), "the sum, not the mean"),
    (exercises.late_steps, lambda run: 0.0, "of 8 planned, give"),
    (exercises.share_in_band, lambda nrb, psi: np.mean((psi.lower <= nrb) & (nrb < psi.upper)), "proven"),
    (exercises.share_in_band, lambda nrb, psi: np.sum((psi.lower <= nrb) & (nrb < psi.upper)), "not their share"),
    (exercises.share_in_band, lambda nrb, psi: np.mean(psi.lower <= nrb), "the upper threshold?"),
    (exercises.share_in_band, lambda nrb, psi: np.mean(nrb < psi.upper), "the lower threshold?"),
    (exercises.share_in_band, lambda nrb, psi: np.mean((psi.lower <= nrb) & (nrb <= psi.upper)), "the robot is home"),
    (exercises.share_in_band, lambda nrb, psi: np.mean((psi.lower < nrb) & (nrb < psi.upper)), "that step counts"),
    (exercises.share_in_band, lambda nrb, psi: 0.5, "count."),
    (exercises.on_orthogonal_features, lambda delta, delta_prev, discount: delta / delta_prev / discount, "proven"),
    (exercises.on_orthogonal_features, lambda delta, delta_prev, discount: delta / delta_prev, "γ is missing"),
    (
        exercises.on_orthogonal_features,
        lambda delta, delta_prev, discount: discount * delta / delta_prev,
        "denominator",
    ),
    (
        exercises.on_orthogonal_features,
        lambda delta, delta_prev, discount: delta_prev / delta / discount,
        "upside down",
    ),
    (exercises.on_orthogonal_features, lambda delta, delta_prev, discount: (delta / delta_prev) ** 2, "That is β"),
    (exercises.on_orthogonal_features, lambda delta, delta_prev, discount: -delta / delta_prev / discount, "sign"),
    (exercises.on_orthogonal_features, lambda delta, delta_prev, discount: 1.0, "With errors"),
]


@pytest.mark.parametrize(("check", "answer", "told"), RIGHT_AND_WRONG)
def test_an_exercise_proves_the_right_answer_and_names_each_usual_mistake(check, answer, told):
    outcome = check.judge(answer)
    assert outcome.verdict == ("proven" if told == "proven" else "wrong")
    assert told in f"{outcome.verdict} {outcome.told}"


@pytest.mark.parametrize(
    ("rule", "told"),
    [
        (lambda *, delta, delta_prev, **_: 0.8 if delta * delta_prev >= 0 else 0.4, "fewer"),
        (lambda **_: 0.8, "1.00 [1.00, 1.00] of that of λ = 0.8: the same."),
        (lambda *, delta, delta_prev, **_: 0.9 if delta * delta_prev > 0 else 0.0, "it forgets the whole trace"),
        (lambda *, delta, delta_prev, **_: abs(delta / delta_prev), "it divides by zero, and λ is 0"),
        (lambda **_: 1, "it keeps the whole trace"),
        (lambda **_: 0.2, "it keeps 0.2"),
    ],
)
def test_a_rule_that_loses_hears_what_it_does_where_nothing_is_learnt_yet_and_a_tie_counts(rule, told, monkeypatch):
    sizes = {"choose": range(2), "judge": range(1000, 1010), "step_sizes": (0.2, 0.4, 0.6)}
    monkeypatch.setattr(walk, "race", partial(walk.race, **sizes))
    outcome = exercises.as_good_as_a_constant.judge(rule)
    assert outcome.verdict == ("wrong" if ", it " in outcome.told else "proven")
    assert told in outcome.told
