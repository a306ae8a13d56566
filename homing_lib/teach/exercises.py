"""The checks of the exercises in the notebooks, by notebook and exercise: "4.2" is notebook 4, exercise 2.

What a check is and says: `checks`. The solutions stand folded beneath the exercises, so a check gives no hints: it says
whether the answer holds, or what must.
"""

from collections.abc import Callable, Mapping, Sequence
from types import SimpleNamespace
from typing import Any, get_args

import numpy as np
from scipy.integrate import quad
from scipy.stats import gamma

from homing_lib import thresholds
from homing_lib.agent import STEP_COLUMNS, Run
from homing_lib.features import Array, HomeModel, similarity
from homing_lib.lambdas import RULES, LambdaRule, fletcher_reeves
from homing_lib.policy import softmax
from homing_lib.sarsa import td_error
from homing_lib.settings import Settings
from homing_lib.study import walk
from homing_lib.study.bootstrap import iqm
from homing_lib.study.measures import WINDOW
from homing_lib.study.runs import episode_matrix
from homing_lib.study.theorem import Form
from homing_lib.teach.checks import SEED, Behind, alike, check, complete, must
from homing_lib.thresholds import Thresholds, stopping_thresholds

# --- 1: the world and its features -----------------------------------------------------------------------------------


@check("1.1 · another image")
def rearranged(other: Any) -> None:
    """The two images have the same histogram, so similarity 1, and differ in most pixels.

    other: of an image, shape (side, side, 3), another.
    """
    rng = np.random.default_rng(SEED)
    for side in (16, 17, 32):
        image = rng.integers(0, 256, (side, side, 3), dtype=np.uint8)
        made = np.asarray(other(image.copy()))
        must(made.shape == image.shape and (made != image).any(axis=2).mean() > 0.5)
        must(alike(np.sort(made.reshape(-1, 3), axis=0), np.sort(image.reshape(-1, 3), axis=0)))


@check("1.2 · the floor of the similarity")
def both_empty(share: Any) -> None:
    """Where no other bins agree, similarity is the share of the bins that are empty in both views: that is its floor.

    share: of two histograms, shape (bins,) each, a number.
    """
    rng = np.random.default_rng(SEED)
    for _ in range(10):
        one, other = rng.integers(1, 5, 42) / 10, rng.integers(5, 9, 42) / 10
        empty = rng.random((2, 42)) < 0.4
        one[empty[0]], other[empty[1]] = 0, 0
        must(alike(share(one, other), similarity(HomeModel(other[None], np.full((1, 42), 1e-6)).features(one))))


# --- 2: the thresholds -----------------------------------------------------------------------------------------------


@check("2.1 · multipliers")
def multipliers(answer: Mapping[str, Any]) -> None:
    """Put back into its form, each multiplier gives the threshold of .95 that was asked for.

    answer: the multipliers of the "first" and the "second" form.
    """
    complete(answer, ("first", "second"))
    for name, form in {"first": thresholds.linear, "second": thresholds.square_root}.items():
        given = form(answer[name])
        must(alike(given, 0.95, 1e-6), f"{name}: this multiplier gives ψ = {given:.4f}.")


@check("2.2 · how badly it errs")
def farthest(distance: float, model: HomeModel, views: Sequence[Array], away: Array, psi: Thresholds) -> None:
    """No view that passes for home was seen from farther away, and one was seen from there.

    distance: in metres; model: of home; views, away: histograms, and metres from home.
    """
    nrb = np.array([similarity(model.features(view)) for view in views])
    must(alike(distance, away[nrb >= psi.upper].max()))


# --- 3 and 4: homing, a lambda that varies ----------------------------------------------------------------------------


@check("3.1 · a run in one number")
def late_steps(late: Callable[[Run], float]) -> None:
    """It is the mean number of steps over the last five planned episodes; those that a lost run never reached count as
    the cap.

    late: a run to that number.
    """
    rng = np.random.default_rng(SEED)
    settings = Settings(images="compact", episodes=8, max_steps=200)
    for finished in (8, 8, 6, 1):
        lengths, lost = rng.integers(20, 200, finished), 0 if finished == 8 else finished + 1
        run = Run(settings, 0, np.zeros((lengths.sum(), len(STEP_COLUMNS))), lengths, np.ones(finished, bool), lost)
        right = episode_matrix([run])[0, -WINDOW:].mean()
        example = f"Episodes of {lengths.tolist()} steps, of 8 planned and cut at 200, give {right:g}."
        must(alike(late(run), right), example)


@check("3.2 · steps in the band")
def share_in_band(share: Callable[[Array, Thresholds], float]) -> None:
    """It is the share of the steps that end at the lower threshold or above, and below the upper, which is home.

    share: similarities, shape (steps,), and the two thresholds to a number.
    """
    rng, psi = np.random.default_rng(SEED), stopping_thresholds(Settings().multiplier)
    for _ in range(5):
        nrb = np.r_[rng.uniform(2 * psi.lower - psi.upper, 2 * psi.upper - psi.lower, 30), psi.lower, psi.upper]
        must(alike(share(nrb.copy(), psi), ((nrb >= psi.lower) & (nrb < psi.upper)).mean()))


@check("3.3 · expected Sarsa")
def expected_sarsa(learn: Any) -> None:
    """Its TD error looks ahead to the mean value of the next view under its policy, and moves the weights of the action
    taken along the view.

    learn: as `Agent.learn`, of a learner with `settings`, `rate`, `theta`, shape (3, n), and `probabilities`.
    """
    rng, settings, rate = np.random.default_rng(SEED), Settings(discount=0.9), 0.5
    for action in range(3):
        theta, (phi, phi_next) = rng.normal(size=(3, settings.n_features)), rng.random((2, settings.n_features))

        def probabilities(view: Array, theta: Array = theta) -> list[float]:
            return softmax((theta @ view).tolist(), 5.0)

        learner = SimpleNamespace(settings=settings, rate=rate, theta=theta.copy(), probabilities=probabilities)
        learnt = learn(learner, phi, action, -0.5, phi_next, 0, action == 2, False)
        ahead = np.dot(probabilities(phi_next), theta @ phi_next)
        delta = td_error(theta[action] @ phi, -0.5, settings.discount, ahead)
        theta[action] += settings.alpha0 * rate * delta * phi
        must(alike(learnt.delta, delta) and alike(learner.theta, theta))


@check("4.1 · features without overlap")
def on_orthogonal_features(ratio: Callable[[float, float, float], float]) -> None:
    """It is the λ of all three forms where features are orthogonal, of length 1 and never seen twice.

    ratio: (delta, delta_prev, discount) to a number.
    """
    rng, (earlier, phi_prev, phi) = np.random.default_rng(SEED), np.eye(3)
    features = {"phi": phi, "phi_prev": phi_prev, "trace_prev": phi_prev + 0.5 * earlier}
    for form in get_args(Form):
        (delta, delta_prev), discount = rng.normal(size=2), rng.uniform(0.5, 0.95)
        right = RULES[form](delta=delta, delta_prev=delta_prev, discount=discount, **features)
        must(alike(ratio(delta, delta_prev, discount), right))


@check("4.2 · a rule against λ = 0.8")
def as_good_as_a_constant(rule: LambdaRule) -> str:
    """At its best step size, and on walks that did not choose it, the rule is better than λ = 0.8 or comparable."""
    ratio = walk.race({"λ = 0.8": "fixed:0.8", "yours": rule}).verdicts["yours"]
    word = {"more": "larger", "fewer": "smaller"}.get(ratio.verdict, ratio.verdict)
    result = f"Its error is {ratio:.2f} times that of λ = 0.8: {word}."
    if ratio.verdict not in ("fewer", "the same"):
        raise Behind(result)
    return result


# --- 5 and 6: the atlas, the calibration -----------------------------------------------------------------------------


@check("5.2 · a node and a step")
def widest_spacing(spacing: Any) -> None:
    """At this spacing, or below, every free step leads to another node, whatever the heading; above it, some do not.

    spacing: of the length of a step, the greatest such spacing of a square lattice, in the same unit.
    """
    for step in (0.01, 0.035, 1.0):
        diagonal = np.sqrt(2) * spacing(step)  # of the cell of a node: the longest step that can stay within it
        must(alike(diagonal / step, 1, 1e-3))


@check("6.1 · by the median")
def by_median(candidate: Any, searched: Any) -> str:
    """No candidate has a smaller median of the steps of its late episodes.

    candidate: a label; searched: the table of the search.
    """
    late = searched[searched.episode > 10]
    steps = late.steps.fillna(Settings().max_steps).groupby(late.condition.astype(str))
    medians, best_by_mean = steps.median(), steps.mean().idxmin()
    must(medians[candidate] == medians.min())
    return f"It is {'also' if candidate == best_by_mean else 'not'} the best by the mean."


@check("6.2 · the luck of the best")
def flattery(share: Any) -> None:
    """The least of 160 means of ten is, on average, what the order statistics of the gamma distribution say.

    share: of the true mean, what the best of 160 equal candidates seems to take.
    """
    least = quad(lambda x: gamma.sf(x, 10, scale=0.1) ** 160, 0, 5)[0]
    must(abs(share / least - 1) < 0.02)


@check("6.3 · a cost of 1/t")
def cost(of: Any) -> str:
    """Each further step costs 1/t more, and the first costs 1.

    of: the number of steps of an episode to its cost, greater than 0.
    """
    for steps in (1, 2, 3, 40, 2000):
        must(alike(of(steps) - (of(steps - 1) if steps > 1 else 0), 1 / steps))
    return f"2000 steps cost {of(2000) / of(40):.2f} times as much as 40."


# --- 7, 8 and 9: what in lambda matters, reward and parts, worth ------------------------------------------------------


@check("7.1 · a step late")
def late_by_one(make: Any) -> None:
    """At each step the rule gives form 2's λ of the step before, and 0 where there was none.

    make: makes a rule.
    """
    rng = np.random.default_rng(SEED)
    for rule in (make(), make()):
        right = 0.0
        for _ in range(8):
            (delta, delta_prev), arrays = rng.normal(size=2), rng.normal(size=(3, 5))
            step = dict(zip(("phi", "phi_prev", "trace_prev"), arrays, strict=True), delta=delta, delta_prev=delta_prev)
            must(alike(rule(**step, discount=0.9), right))
            right = fletcher_reeves(**step, discount=0.9)


@check("8.1 · paid or begun")
def shaping(learn: Any) -> None:
    """Starting at Φ, and starting at 0 and being paid for Φ's rise, end Φ apart: they learn the same.

    learn: (value, pay, masked) to the values learnt; value: shape (6,); pay: the weight of the payment, 0 or 1.
    """
    phi = np.arange(6.0)
    for masked in (True, False):
        begun, paid = (
            np.array(learn(start, pay, masked), dtype=float) for start, pay in ((phi.copy(), 0), (np.zeros(6), 1))
        )
        unlearnt = alike(begun, phi) or (masked and np.abs(begun[:5]).max() > 0.5)  # where nothing is paid
        must(not unlearnt and alike(begun, phi + paid))


@check("9.1 · those that got lost")
def slowest(robots: Any, late: Array) -> None:
    """Without so many of the slowest robots the mean is within a tenth of the interquartile mean; without fewer, not.

    robots: how many; late: steps of each robot.
    """
    ordered, typical = np.sort(late), float(iqm(late)[0])
    near = [abs(ordered[: len(late) - out].mean() / typical - 1) <= 0.1 for out in range(len(late))]
    must(robots == near.index(True))


@check("9.2 · beyond chance")
def beyond_chance(left: Any) -> None:
    """What is left is how much robots differ and how much places differ, without what tosses of a coin would show
    anyway.

    left: a table of shares, shape (robots, places), to two standard deviations, of the robots and of the places.
    """
    rng = np.random.default_rng(SEED)
    for right in ((0.0, 0.15), (0.15, 0.0), (0.1, 0.15)):
        answers = np.array([left(trials(rng, *right)) for _ in range(200)], dtype=float)
        must(answers.shape == (200, 2) and np.all(np.abs((answers**2).mean(axis=0) - np.square(right)) < 0.003))


def trials(rng: np.random.Generator, of_robots: float, of_places: float) -> Array:
    """Success, 0 or 1, of 20 robots at 30 places; both differ by so much, as standard deviations."""
    robots, places = of_robots * rng.standard_normal(20), of_places * rng.standard_normal(30)
    return rng.binomial(1, np.clip(0.5 + robots[:, None] + places, 0, 1)).astype(float)
