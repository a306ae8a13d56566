"""Each slip of the printed paper has a proof, and a proof is something that is there."""

import re
from dataclasses import replace

import numpy as np
import pytest

from homing_lib.agent import STEP_COLUMNS, run
from homing_lib.environment import reward
from homing_lib.errors import UserError
from homing_lib.features import HomeModel, bins_per_channel, histogram
from homing_lib.lambdas import Fixed
from homing_lib.policy import decrease_rate, epsilon_greedy
from homing_lib.settings import Settings
from homing_lib.storage import ROOT
from homing_lib.study import errata, findings, studies
from homing_lib.study.errata import ERRATA
from homing_lib.study.findings import Comparison
from homing_lib.study.questions import printed
from homing_lib.td import LinearTD
from homing_lib.thresholds import stopping_thresholds

SHORT = Settings(images="compact", episodes=2, max_steps=300)


def resolves(proof):
    """Whether a proof is there: the test in its file, the study on the list, the derivation written out."""
    kind, _, rest = proof.partition(" ")
    if kind == "derivation:":
        return len(rest.split()) > 5
    if kind == "study":
        return rest in {one.name for one in studies.in_order()}
    path, _, test = proof.partition("::")
    return (ROOT / path).exists() and f"\ndef {test}(" in (ROOT / path).read_text(encoding="utf-8")


def test_every_erratum_says_all_and_every_proof_is_there():
    assert all(one.proofs and all([one.where, one.printed, one.wrong, one.reading, *one.proofs]) for one in ERRATA)
    assert [proof for one in ERRATA for proof in one.proofs if not resolves(proof)] == []
    absent = ("tests/test_errata.py::test_not", "tests/test_no.py::test_it", "study of no", "derivation: so", "hearsay")
    assert not any(map(resolves, absent))


def test_every_effect_is_among_the_findings_and_every_reading_that_was_run_is_the_effect_of_its_erratum():
    effects = {one.name: {*one.effects.values()} for one in ERRATA}
    every = set().union(*effects.values())
    for question, _, comparison in (name.partition(".") for name in every):
        assert findings.finding(question)[comparison].verdict
    assert {f"printed.{label}.of ours.total" in effects[label.split()[0]] for label in printed.READINGS} == {True}
    undone = [label for label, settings in printed.PRINTED.conditions.items() if settings in printed.UNDONE.values()]
    assert len(undone) == len(printed.UNDONE)
    assert {f"printed.{label}.of ours.total" for label in undone} <= every


def test_errata_are_numbered_without_a_gap_and_chosen_by_name():
    assert [one.name for one in errata.chosen()] == [f"E{number}" for number in range(1, len(ERRATA) + 1)]
    assert [one.name for one in errata.chosen(["E3", "E1"])] == ["E3", "E1"]
    with pytest.raises(UserError, match=rf"^'E99': no such erratum; there are E1 to E{len(ERRATA)}$"):
        errata.chosen(["E3", "E99"])


def test_an_effect_is_a_number_with_its_word(monkeypatch):
    found = {"a.total": Comparison(1.5, 1.2, 1.9, "more"), "b.total": Comparison(1, 1, 1, "the same")}
    monkeypatch.setattr(findings, "finding", lambda name: {"printed": found}[name])
    told = errata.effect(replace(ERRATA[2], effects={"form 1": "printed.a.total", "x": "printed.b.total"}))
    assert told.endswith(" ours: form 1, 1.50 [1.20, 1.90]: more; x, 1.00 [1.00, 1.00]: the same. ")
    assert errata.effect(ERRATA[0]) == ""


def test_an_erratum_is_a_paragraph_or_a_row_in_which_a_proof_is_a_sentence():
    proofs = ("tests/test_x.py::test_one_is_one", "study printed")
    text = {"where": "Fig. 0", "printed": "a", "wrong": "b", "reading": "c"}
    made = replace(ERRATA[0], name="E0", effects={}, proofs=proofs, **text)
    assert str(made) == f"**E0**, Fig. 0: a. b. *Here*: c. *Proof*: {'; '.join(proofs)}."
    row = "| E0 | Fig. 0 | a. b. | c. | one is one (tests/test_x.py); study printed |"
    assert errata.table([made]).splitlines()[-1] == row
    assert len(errata.table(ERRATA).splitlines()) == 2 + len(ERRATA)


ENTRY = '[E1]\nwhere = "eq. (3)"\nprinted = "a"\nwrong = "b"\nreading = "c"\nproofs = ["study printed"]\n'


@pytest.mark.parametrize(
    ("content", "what"),
    [
        ("[E1", "Expected ']'"),
        ("E1 = 3", "must be a mapping"),
        (ENTRY.replace("wrong", "wronk"), "'wronk'"),
        (ENTRY.replace('wrong = "b"', ""), "'wrong'"),
    ],
)
def test_a_damaged_or_incomplete_entry_is_one_line_with_the_remedy(content, what, tmp_path):
    file = tmp_path / "errata.toml"
    file.write_text(content, encoding="utf-8")
    with pytest.raises(UserError) as refusal:
        errata.read(file)
    line = str(refusal.value)
    assert line.startswith(f"{file}: ") and what in line and line.endswith("restore it with git") and "\n" not in line


# Proofs that stand nowhere else


def test_the_gradient_of_the_value_is_phi_by_the_weights_and_theta_by_the_features():
    """E1: V = theta^T phi, by differences, which are exact for what is linear."""
    learner = LinearTD(4, step_size=0.1, discount=1, lambda_rule=Fixed(0))
    phi, theta = np.random.default_rng(1).standard_normal((2, 4))
    learner.weights[:] = theta
    value, by_weights = learner.value(phi), []
    by_features = [learner.value(phi + unit) - value for unit in np.eye(4)]
    for unit in np.eye(4):
        learner.weights[:] = theta + unit
        by_weights.append(learner.value(phi) - value)
    assert by_weights == pytest.approx(list(phi))
    assert by_features == pytest.approx(list(theta))


def test_the_formula_for_alpha_0_gives_neither_of_the_values_beside_it():
    """E4."""
    printed = Settings.model_fields["alpha0"].json_schema_extra["printed"]
    table, text, formula = map(float, re.findall(r"\d\.\d+e-\d", printed))
    assert formula == pytest.approx(0.1 / (2 * Settings().episodes ** 2))
    assert formula not in (table, text)


def test_an_epsilon_0_of_6_gives_a_negative_probability_in_all_twenty_episodes():
    """E5: the share of the best of three, eq. (21)."""
    epsilons = [0.3 * 20 * decrease_rate(episode, 0.3 * 20) for episode in range(1, 21)]
    assert max(epsilon_greedy([1.0, 0.0, 0.0], epsilon)[0] for epsilon in epsilons) < 0


def test_a_variance_of_counts_that_is_scaled_again_makes_every_feature_one():
    """E11: counts of 64 x 64 pixels that differ from home's by up to five standard deviations."""
    pixels, sigma, home = 64**2, 30.0, np.full((1, 11), 0.5)
    view = home[0] + np.linspace(-5, 5, 11) * sigma / pixels
    of_counts = np.full((1, 11), sigma**2)
    assert HomeModel(home, of_counts / pixels**2).features(view).min() < 1e-5
    assert HomeModel(home, of_counts).features(view).min() > 1 - 1e-6


def test_the_agent_of_the_default_settings_uses_form_2_and_form_1_gives_other_runs():
    """E14."""
    assert Settings().lambda_rule == "fletcher-reeves"
    form_1, form_2 = (run(SHORT.with_changes(lambda_rule=rule), 1) for rule in ("hestenes-stiefel", "fletcher-reeves"))
    assert not np.array_equal(form_1.column("lambda")[:50], form_2.column("lambda")[:50])


def test_a_robot_that_loiters_in_the_band_earns_without_end():
    """E21: at psi_lower, step after step, from step 20 on; arriving ends it."""
    lower = stopping_thresholds(12).lower
    earned = [reward(t, lower, lower, lower, False, Settings()) for t in range(20, 2001)]
    assert min(earned) > 0.85
    assert sum(earned[:1000]) > 800
    outside = [reward(t, 0.9 * lower, lower, lower, False, Settings()) for t in range(20, 2001)]
    assert max(outside) < 0


def test_fifty_times_the_steps_cost_less_than_twice_as_much():
    """E22: the sum of 1/t is ln T + .577."""
    cost = -np.cumsum([reward(t, 0, 0, 0.9, False, Settings()) for t in range(1, 2001)])
    assert cost[1999] < 2 * cost[39]
    assert cost[1999] == pytest.approx(np.log(2000) + np.euler_gamma, abs=1e-3)
    constant = Settings(step_cost="constant")
    assert reward(1, 0, 0, 0.9, False, constant) == reward(2000, 0, 0, 0.9, False, constant)


def test_lowered_after_an_episode_by_its_number_the_rate_is_one_in_the_second_too():
    """E25: Fig. 2 to the letter, beside ours."""
    as_printed = [1.0]
    for episode in range(1, 20):
        as_printed.append(decrease_rate(episode, 6))
    assert as_printed[:2] == [1, 1]
    ours = Settings().step_size_rates
    assert ours[:2].tolist() == [1, 7 / 8]
    assert as_printed[1:] == pytest.approx(list(ours[:-1]))


def test_without_learning_at_walls_the_step_before_a_gap_is_what_lambda_sees_after_it():
    """E27: the error of the step before, as a rule sees it, is the last that was learnt from."""
    seen = []

    def watched(*, delta, delta_prev, **_):
        seen.append((delta, delta_prev))
        return 0.0

    result = run(SHORT.with_changes(learn_at_walls=False), 1, lambda_rule=watched)
    learnt = result.column("change") > 0
    steps = result.episode(1)
    in_first = learnt[: len(steps)]
    gaps = np.flatnonzero(~in_first[1:-1] & in_first[2:] & in_first.cumsum()[1:-1] > 0)
    assert gaps.size, "the robot never met a wall"
    delta = steps[in_first, STEP_COLUMNS.index("delta")]
    told = np.array(seen[: len(delta) - 1])
    np.testing.assert_array_equal(told[:, 1], delta[:-1])


@pytest.mark.parametrize(("bin_size", "empty"), [(3, False), (4, True), (6, True), (10, True), (12, False), (16, True)])
def test_unless_256_by_the_bin_size_is_rounded_down_the_last_bin_is_empty(bin_size, empty):
    """E28."""
    image = np.arange(256, dtype=np.uint8).reshape(16, 16, 1).repeat(3, axis=2)
    last = histogram(image, bin_size)[bins_per_channel(bin_size) - 1]
    assert (last == 0) == empty
