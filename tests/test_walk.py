"""Rules are raced on the random walk of the textbooks, on walks that did not choose their step sizes."""

import numpy as np
import pytest

from homing_lib.lambdas import Fixed
from homing_lib.study import walk


def test_a_seed_fixes_ten_walks_from_the_middle_by_single_steps_to_beyond_an_end():
    assert walk.walks(3) == walk.walks(3) != walk.walks(4)
    assert len(walk.walks(3)) == walk.EPISODES
    for first, *inside, last in walk.walks(3):
        assert {*np.abs(np.diff([first, *inside, last]))} == {1}
        assert (first, last in (-1, 19)) == (9, True)
        assert all(0 <= state < 19 for state in inside)


def test_a_rule_may_be_a_function_or_a_name_with_its_guard():
    by_name = walk.learning("fixed:0.8", 3, 0.3)
    np.testing.assert_array_equal(walk.learning(Fixed(0.8), 3, 0.3), by_name)
    assert by_name[-1] < by_name[0] < np.sqrt(np.mean(walk.VALUES**2))  # of weights that are all 0
    np.testing.assert_array_equal(walk.learning(lambda **_: 5.0, 3, 0.05), walk.learning("fixed:1", 3, 0.05))
    guards = [walk.learning(f"fletcher-reeves:on_zero={guard}", 3, 0.3).mean() for guard in (0, 0.8)]
    assert guards[1] < guards[0]


def test_each_rule_is_judged_at_the_step_size_that_other_walks_chose(monkeypatch):
    errors = {
        "fixed:0.8": lambda seed, alpha: abs(alpha - 0.2) + 1 if seed < 100 else 4,
        "gate": lambda seed, alpha: abs(alpha - 0.6) + 1 if seed < 100 else 1 + alpha,  # .2 would be better here
        "inverse": lambda seed, alpha: 4.0,
    }
    monkeypatch.setattr(walk, "learning", lambda rule, seed, size: np.full(walk.EPISODES, errors[rule](seed, size)))
    race = walk.race({name: name for name in errors}, choose=range(3), judge=range(100, 105), step_sizes=(0.2, 0.6))
    assert race.step_size == {"fixed:0.8": 0.2, "gate": 0.6, "inverse": 0.2}
    assert race.tried["gate"].shape == (3, 2)
    np.testing.assert_allclose(race.errors["gate"], np.full(5, 1.6))
    assert race.verdicts["gate"].interval == pytest.approx((0.4, 0.4, 0.4))
    assert race.table({"fewer": "less"}).splitlines()[2:] == [
        "| fixed:0.8 | 0.2 | 4.000 | 1 |  |",
        "| gate | 0.6 | 1.600 | 0.40 [0.40, 0.40] | less |",
        "| inverse | 0.2 | 4.000 | 1.00 [1.00, 1.00] | the same |",
    ]
    assert str(race) == race.table({})


def test_a_fixed_lambda_on_the_walk_has_the_error_of_the_literature():
    for rule, alpha, published in (("fixed:0", 0.8, 0.3452), ("fixed:0.4", 0.6, 0.2803)):  # Sutton & Barto, fig. 12.6
        found = [walk.learning(rule, seed, alpha).mean() for seed in range(10)]
        assert np.mean(found) == pytest.approx(published, abs=4 * np.std(found) / np.sqrt(10))


def test_no_rule_of_the_race_would_rather_have_a_step_size_beyond_those_that_it_offers():
    rules = ["fixed:0", "fixed:0.8", *(f"fletcher-reeves:on_zero={guard}" for guard in (0, 0.8, 1))]
    beyond = 0.01, *walk.RACE_SIZES[::2], 1.2
    race = walk.race({rule: rule for rule in rules}, judge=[1000], step_sizes=beyond)
    assert {*race.step_size.values()} <= {*walk.RACE_SIZES}


def test_weights_that_diverge_are_a_great_error_and_no_gap_in_the_race():
    rules = {"λ = 0": "fixed:0", "grows": "fixed:1"}
    race = walk.race(rules, choose=range(2), judge=range(1000, 1003), step_sizes=(100.0,))
    assert (race.errors["grows"] == walk.ERROR_CAP).all()
    assert np.isfinite(race.verdicts["grows"].interval).all()


def test_what_is_no_rule_is_named_before_any_run(monkeypatch):
    monkeypatch.setattr(walk, "learning", None)
    for wrong in (lambda delta: 0, "fixed:2", "fletcher-reves"):
        with pytest.raises(TypeError, match=r"^mine: "):
            walk.race({"λ": "fixed:0", "mine": wrong})
