"""The checks of the exercises in the notebooks, by notebook and exercise: "4.2" is notebook 4, exercise 2.

What a check is and says: `checks`.
"""

from collections.abc import Callable, Mapping, Sequence
from math import pi, sqrt
from typing import Any, get_args

import numpy as np
from scipy.integrate import quad
from scipy.stats import gamma

from homing_lib import thresholds
from homing_lib.agent import STEP_COLUMNS, Run
from homing_lib.features import Array, HomeModel, similarity
from homing_lib.lambdas import RULES, LambdaRule, fletcher_reeves
from homing_lib.settings import Settings
from homing_lib.study import walk
from homing_lib.study.bootstrap import iqm
from homing_lib.study.measures import WINDOW
from homing_lib.study.runs import episode_matrix
from homing_lib.study.theorem import Form
from homing_lib.td import LinearTD
from homing_lib.teach.checks import SEED, Wrong, alike, check, expect, hint
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
        found = np.asarray(other(image.copy()))
        if found.shape != image.shape:
            raise Wrong(f"An image of shape {image.shape} became one of shape {found.shape}.")
        if (found != image).any(axis=2).mean() <= 0.5:
            raise Wrong("Most pixels are where they were.")
        if not alike(np.sort(found.reshape(-1, 3), axis=0), np.sort(image.reshape(-1, 3), axis=0)):
            raise Wrong("Some pixels have another colour now, and are counted in another bin. May they move instead?")


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
        mistakes = {
            "That counts bins that are empty in one of the two; those differ.": (empty[0] | empty[1]).mean(),
            "That counts the bins that are empty in the first view, whatever the second has.": empty[0].mean(),
            "That counts the bins that are empty in the second view, whatever the first has.": empty[1].mean(),
            "That is how many; the share is of all bins.": float((empty[0] & empty[1]).sum()),
        }
        floor = similarity(HomeModel(other[None], np.full((1, 42), 1e-6)).features(one))
        expect(
            share(one, other), floor, mistakes, "Another share. Which bins give the feature 1 whatever the variance?"
        )


# --- 2: the thresholds -----------------------------------------------------------------------------------------------


@check("2.1 · multipliers")
def multipliers(found: Mapping[str, Any], psi: float = 0.95) -> None:
    """Put back into its form, each multiplier gives the threshold that was asked for.

    found: "first" and "second", the multipliers; psi: the threshold.
    """
    for name, form, inner in (("first", thresholds.linear, pi), ("second", thresholds.square_root, pi**2)):
        if name not in found:
            raise Wrong(f"The {name} form is missing.")
        if found[name] <= 0:
            raise Wrong(f"{name}: a multiplier is greater than 0.")
        mistakes = {
            f"{name}: that is the multiplier of the other form.": 1 / ((pi**3 / inner) * (1 - psi) ** 2),
            f"{name}: square what stands under the root.": 1 / (sqrt(inner) * (1 - psi)),
            f"{name}: it is 1 - ψ that the fraction gives.": 1 / (inner * psi**2),
        }
        if not alike(given := form(found[name]), psi, 1e-6):
            raise Wrong(hint(found[name], mistakes, f"{name}: this multiplier gives ψ = {given:.4f}.", 1e-3))


@check("2.2 · how badly it errs")
def farthest(found: float, model: HomeModel, views: Sequence[Array], away: Array, psi: Thresholds) -> None:
    """No view that passes for home was seen from farther away, and one was seen from there.

    found: metres; model: of home; views, away: histograms, and metres from home.
    """
    nrb = np.array([similarity(model.features(view)) for view in views])
    passing = away[nrb >= psi.upper]
    mistakes = {
        "That is the farthest of all poses, whether they pass or not.": away.max(),
        "Those pass the lower threshold; an episode ends at the upper one.": away[nrb >= psi.lower].max(),
        "That is a middle distance. How badly can the rule err?": np.median(passing),
        "That is a mean distance. How badly can the rule err?": passing.mean(),
    }
    expect(found, passing.max(), mistakes, "No accepted pose is the farthest at that distance (in metres).")


# --- 3 and 4: homing, a lambda that varies ----------------------------------------------------------------------------


@check("3.1 · a run in one number")
def late_steps(late: Callable[[Run], float]) -> None:
    """It is the mean steps of the last five episodes planned; those that a lost run did not reach count as the cap.

    late: a run to that number.
    """
    rng = np.random.default_rng(31)
    settings = Settings(images="compact", episodes=8, max_steps=200)
    for finished in (8, 8, 6, 1):
        lengths, lost = rng.integers(20, 200, finished), 0 if finished == 8 else finished + 1
        run = Run(settings, 0, np.zeros((lengths.sum(), len(STEP_COLUMNS))), lengths, np.ones(finished, bool), lost)
        steps = episode_matrix([run])[0]
        mistakes = {
            "A run whose weights are lost ends early. Left out, what it did not finish makes it look good.": (
                lengths[-WINDOW:].mean()
            ),
            "Those are its first five episodes, in which it has hardly learnt.": steps[:WINDOW].mean(),
            "Those are all episodes, the first ones too, in which it has hardly learnt.": steps.mean(),
            "That is the sum, not the mean.": steps[-WINDOW:].sum(),
            "Those are the last four: of an array, [-5:] are the last five.": steps[-WINDOW + 1 :].mean(),
        }
        told = f"Episodes of {lengths.tolist()} steps, of {settings.episodes} planned, give {steps[-WINDOW:].mean():g}."
        expect(late(run), steps[-WINDOW:].mean(), mistakes, told)


@check("3.2 · steps in the band")
def share_in_band(share: Callable[[Array, Thresholds], float]) -> None:
    """It is the share of the steps that end at the lower threshold or above, and below the upper, which is home.

    share: similarities, shape (steps,), and the two thresholds to a number.
    """
    rng, psi = np.random.default_rng(32), stopping_thresholds(Settings().multiplier)
    for _ in range(5):
        nrb = np.r_[rng.uniform(2 * psi.lower - psi.upper, 2 * psi.upper - psi.lower, 30), psi.lower, psi.upper]
        inside = (nrb >= psi.lower) & (nrb < psi.upper)
        mistakes = {
            "That is how many steps, not their share of all.": inside.sum(),
            "Steps that end at home count, too: what about the upper threshold?": (nrb >= psi.lower).mean(),
            "Steps far from home count, too: what about the lower threshold?": (nrb < psi.upper).mean(),
            "At the upper threshold the robot is home.": ((nrb >= psi.lower) & (nrb <= psi.upper)).mean(),
            "At the lower threshold the reward begins: that step counts.": (
                (nrb > psi.lower) & (nrb < psi.upper)
            ).mean(),
        }
        expect(share(nrb.copy(), psi), inside.mean(), mistakes, f"Of these steps {inside.sum()} in {len(nrb)} count.")


@check("4.1 · features without overlap")
def on_orthogonal_features(ratio: Callable[[float, float, float], float]) -> None:
    """It is the λ of all three forms where features are orthogonal, of length 1 and never seen twice.

    ratio: (delta, delta_prev, discount) to a number.
    """
    rng, new = np.random.default_rng(41), np.eye(9)
    for form in get_args(Form):
        discount, before = rng.uniform(0.5, 0.95), 0.0
        learner = LinearTD(9, step_size=0.1, discount=discount, lambda_rule=RULES[form], clip=False)
        for t in range(8):
            delta = learner.update(new[t], rng.normal(), new[t + 1])
            if t:
                of, told = delta / before, f"With errors {before:.3f}, then {delta:.3f}, and γ = {discount:.3f}"
                mistakes = {
                    "γ is missing: it stands in the denominator of (7).": of,
                    "γ stands in the denominator, not before the ratio.": discount * of,
                    "That is the ratio upside down: above is the error of now.": 1 / (discount * of),
                    "That is β. λ is β times the error before over that of now, and over γ.": of**2,
                    "The sign is wrong: in form 1, Δg holds minus the g of before.": -of / discount,
                }
                expect(
                    ratio(delta, before, discount), learner.lambda_, mistakes, f"{told}, λ is {learner.lambda_:.3f}."
                )
            before = delta


@check("4.2 · a rule against λ = 0.8")
def as_good_as_a_constant(rule: LambdaRule) -> str:
    """At its best step size, and on walks that did not choose it, the rule is better than λ = 0.8 or comparable."""
    found = walk.race({"λ = 0.8": "fixed:0.8", "yours": rule}).verdicts["yours"]
    told = f"Its error is {found:.2f} of that of λ = 0.8: {found.verdict}."
    if found.verdict not in ("fewer", "the same"):
        raise Wrong(f"{told} {_at_rest(rule)}")
    return told


def _at_rest(rule: LambdaRule) -> str:
    """What a rule does where nothing is learnt yet: a hint for one that loses."""
    before, now = np.eye(2)
    try:
        kept = rule(delta=0.0, phi=now, delta_prev=0.0, phi_prev=before, trace_prev=before, discount=1.0)
    except ArithmeticError:
        does = "divides by zero, and λ is 0"
    else:
        does = "forgets the whole trace" if kept <= 0 else "keeps the whole trace" if kept >= 1 else f"keeps {kept:g}"
    return f"Where both errors are 0, as at most steps of the first episodes, it {does}."


# --- 5 and 6: the atlas, the calibration -----------------------------------------------------------------------------


@check("5.2 · a node and a step")
def widest_spacing(spacing: Any) -> None:
    """At this spacing, or below, every free step leads to another node, whatever the heading; above it, some do not.

    spacing: of the length of a step, the greatest such spacing of a square lattice, in the same unit.
    """
    corner = np.full(2, -0.5 + 1e-9)
    angles = np.linspace(0, 2 * pi, 73)
    for step in (0.01, 0.035, 1.0):
        found = float(spacing(step))

        def stays(spacing: float, step: float = step) -> bool:
            """Whether a step from the corner of a cell can end in it."""
            ends = corner + step / spacing * np.stack([np.cos(angles), np.sin(angles)], axis=1)
            return bool((np.abs(ends) <= 0.5).all(axis=1).any())

        if not found > 0:
            raise Wrong("A spacing is greater than 0.")
        if stays(found * 0.999):
            along = "along the diagonal of its cell" if alike(found, step) else "within its cell"
            raise Wrong(f"With nodes {found:g} apart, a step of {step:g} can end {along}, at the same node.")
        if not stays(found * 1.001):
            raise Wrong(f"Nodes {found:g} apart are safe, but so are some farther apart, for a step of {step:g}.")


@check("6.1 · by the median")
def by_median(candidate: Any, searched: Any) -> str:
    """No candidate has a smaller median of the steps of its late episodes.

    candidate: a label; searched: the table of the search.
    """
    late = searched[searched.episode > 10]
    steps = late.steps.fillna(Settings().max_steps)
    medians = steps.groupby(late.condition.astype(str)).median()
    means = steps.groupby(late.condition.astype(str)).mean()
    if candidate not in medians.index:
        raise Wrong("There is no candidate of this name: the search's column `condition` has them.")
    if medians[candidate] > medians.min():
        if candidate == means.idxmin():
            raise Wrong("That is the best by the mean.")
        raise Wrong(f"Its median is {medians[candidate]:g}; others have less. Do lost episodes count as the cap?")
    same = "also" if candidate == means.idxmin() else "not"
    return f"It is {same} the best by the mean."


@check("6.2 · the luck of the best")
def flattery(share: Any) -> None:
    """The least of 160 means of ten is, on average, what the order statistics of the gamma distribution say.

    share: of the true mean, what the best of 160 equal candidates seems to take.
    """
    least = quad(lambda x: gamma.sf(x, 10, scale=0.1) ** 160, 0, 5)[0]
    mistakes = {
        "That is in steps, or in per cent: what share of the true mean is it?": 100 * least,
        "That is the least single run of all; a candidate is judged by the mean of its ten.": 1 / 1600,
        "That is the least of 160 single runs; a candidate is judged by the mean of its ten.": 1 / 160,
        "That is the true mean. What does the best seem to take?": 1.0,
        "That is by how much it is flattered: what share does it seem to take?": 1 - least,
    }
    if not abs(share / least - 1) < 0.02:
        told = next((told for told, value in mistakes.items() if abs(share / value - 1) < 0.05), None)
        raise Wrong(told or "Not within 2 %. Repeat it often enough, and take the mean of what the best seems to take.")


# --- 7: what in lambda matters ---------------------------------------------------------------------------------------


@check("7.1 · a step late")
def late_by_one(make: Any) -> None:
    """At each step the rule gives form 2's λ of the step before, and 0 where there was none.

    make: makes a rule.
    """
    rng = np.random.default_rng(SEED)
    for rule in (make(), make()):
        said, right = [], [0.0, 0.0]
        for _ in range(8):
            (delta, delta_prev), arrays = rng.normal(size=2), rng.normal(size=(3, 5))
            step = dict(zip(("phi", "phi_prev", "trace_prev"), arrays, strict=True), delta=delta, delta_prev=delta_prev)
            said.append(float(rule(**step, discount=0.9)))
            right.append(fletcher_reeves(**step, discount=0.9))
        mistakes: dict[str, Any] = {
            "That is form 2 as it is, not a step late.": right[2:],
            "That is two steps late.": right[:8],
            "That is form 2's λ cut to [0, 1]; the learner does this, after the rule.": np.clip(right[1:-1], 0, 1),
        }
        if said[0] and alike(said[1:], right[2:-1]):
            raise Wrong("What one rule kept the next one gave: each rule keeps its own.")
        expect(
            said, right[1:-1], mistakes, "It gives other lambdas, or in another order. Keep one, give the one before."
        )


# --- 8: reward and parts ---------------------------------------------------------------------------------------------


@check("8.1 · paid or begun")
def shaping(learn: Any) -> None:
    """Starting at Φ, and starting at 0 and being paid for Φ's rise, end Φ apart: they learn the same.

    learn: (value, pay, masked) to the values learnt; value: shape (6,); pay: the weight of the payment, 0 or 1.
    """
    phi = np.arange(6.0)
    for masked in (True, False):
        given = phi.copy()
        first = np.array(learn(given, 0, masked), dtype=float)
        if not alike(given, phi):
            raise Wrong("It writes into the values that it was given; begin with a copy.")
        paid = np.array(learn(np.zeros(6), 1, masked), dtype=float)
        told = "masked" if masked else "bootstrapped"
        if alike(first, phi):
            raise Wrong(f"{told}: starting at Φ, nothing is learnt.")
        if alike(first, phi - paid):
            raise Wrong(f"{told}: the payment has the wrong sign: it is γΦ' - Φ.")
        if not alike(first, phi + paid):
            raise Wrong(
                f"{told}: they are not Φ apart. At home, is Φ' left out where the value of home is, and only there?"
            )
        if masked and np.abs(first[:5]).max() > 0.5:
            raise Wrong("masked: where nothing is paid the values go to 0; here they do not.")


@check("6.3 · a cost of 1/t")
def cost(of: Any) -> str:
    """Each further step costs 1/t more, and the first costs 1.

    of: the number of steps of an episode to its cost, greater than 0.
    """
    for steps in (1, 2, 3, 40, 2000):
        found, before = (of(t) if t else 0.0 for t in (steps, steps - 1))
        mistakes = {
            "That is the cost of the last step alone.": 1 / steps - (1 / (steps - 1) if steps > 1 else 0),
            "The cost is greater than 0; it is the reward that is not.": -1 / steps,
        }
        otherwise = f"Step {steps} adds {found - before:.4f}, not 1/{steps}."
        if steps == 1 or alike(found - before, 1 / steps):
            expect(found - before, 1 / steps, mistakes, otherwise)
        elif alike(found, 1 / steps):
            raise Wrong(next(iter(mistakes)))
        else:
            raise Wrong(otherwise)
    return f"2000 steps cost {of(2000) / of(40):.2f} times as much as 40."


# --- 9: worth -----------------------------------------------------------------------------------------------


@check("9.1 · those that got lost")
def slowest(robots: Any, late: Array) -> None:
    """Without so many of the slowest robots the mean is within a tenth of the interquartile mean; without fewer, not.

    robots: how many; late: steps of each robot.
    """
    ordered = np.sort(late)
    if int(robots) != robots or not 0 <= robots < len(late):
        raise Wrong(f"How many of the {len(late)} robots?")

    def near(left_out: int) -> bool:
        return bool(abs(ordered[: len(late) - left_out].mean() / float(iqm(late)[0]) - 1) <= 0.1)

    if not near(int(robots)):
        raise Wrong(
            "The mean is still farther off: leave out more, the slowest first, and compare with the IQM of all."
        )
    if robots and near(int(robots) - 1):
        raise Wrong("Fewer would do.")


@check("9.2 · beyond chance")
def beyond_chance(left: Any) -> None:
    """What is left is how much the robots differ, and the places, and not what a coin would have done anyway.

    left: a table of shares, shape (robots, places), to two standard deviations, of the robots and of the places.
    """
    rng = np.random.default_rng(SEED)
    for true in ((0.0, 0.15), (0.15, 0.0), (0.1, 0.15)):
        tables = [_trials(rng, *true) for _ in range(200)]
        found = np.array([left(table) for table in tables], dtype=float)
        if found.shape != (200, 2):
            raise Wrong("It is to give two numbers: for the robots and for the places.")
        squares = (found**2).mean(axis=0)
        raw = np.array([[table.mean(axis=1).var(ddof=1), table.mean(axis=0).var(ddof=1)] for table in tables]).mean(
            axis=0
        )
        right = np.square(true)
        if np.all(np.abs(squares - right) < 0.003):
            continue
        if np.all(np.abs(squares[::-1] - right) < 0.003):
            raise Wrong("The robots' number and the places' are the wrong way round.")
        if np.all(np.abs(squares - raw) < 0.001):
            raise Wrong(
                "Chance is still in it: robots that are all alike would differ, too. How much, by the residuals?"
            )
        if np.all(np.abs(found.mean(axis=0) - right) < 0.003):
            raise Wrong("Those are variances; a standard deviation is the root.")
        raise Wrong(
            "Of tables in which it is known, it finds another. Take from the variance of the means that of chance."
        )


def _trials(rng: np.random.Generator, of_robots: float, of_places: float) -> Array:
    """Success, 0 or 1, of 20 robots at 30 places; both differ by so much, as standard deviations."""
    robots, places = of_robots * rng.standard_normal(20), of_places * rng.standard_normal(30)
    return rng.binomial(1, np.clip(0.5 + robots[:, None] + places, 0, 1)).astype(float)
