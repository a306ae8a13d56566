"""What is wrong in the printed paper, or left open: where, what, how it is read here, and what proves it.

A proof is a name that resolves (`resolves`): a test, a study, or a derivation, which is then written out. Where a
reading was run, its effect is among the findings. Altahhan (2014); numbers of sections, equations and
figures are the paper's.
"""

from collections.abc import Callable, Iterable
from typing import NamedTuple

from homing_lib.storage import ROOT
from homing_lib.study import findings, studies


class Erratum(NamedTuple):
    """where and printed: what the paper has; wrong: why that cannot stand, or what it leaves open; reading: what is
    done here. proofs: "tests/test_x.py::test_y", "study NAME", or "derivation: ..." with the argument itself. seen:
    comparisons of the findings that show what a reading does, by their names: "printed.E3 form 1.of ours.total".
    """

    name: str
    where: str
    printed: str
    wrong: str
    reading: str
    proofs: tuple[str, ...]
    seen: tuple[str, ...] = ()

    def __str__(self) -> str:
        return (
            f"**{self.name}**, {self.where}: {self.printed}. {self.wrong}. *Here*: {self.reading}. "
            f"{effect(self)}*Proof*: {'; '.join(self.proofs)}."
        )


_READINGS = {
    "all but variance about the mean": "sigma^2 about zero",
    "all but plain epsilon-greedy": "mixture as printed, tau 1",
    "all but features kept": "features overwritten",
    "+ features kept": "alpha_0 of the table",
}
"""What rows of `printed` that undo one substitution are as readings of the print."""


def effect(of: Erratum) -> str:
    """What the readings that were run do to the total steps, in words; nothing if none was."""
    told = []
    for name in of.seen:
        question, _, comparison = name.partition(".")
        one = findings.finding(question)[comparison]
        label = comparison.removesuffix(".of ours.total").removeprefix(f"{of.name} ")
        label = _READINGS.get(label, label)
        told.append(f"{label}, {one:.2f}: {one.verdict}")
    return f"Total steps, as a multiple of ours: {'; '.join(told)}. " if told else ""


def resolves(proof: str) -> bool:
    """Whether a proof is there: the test in its file, the study on the list, the derivation written out."""
    kind, _, rest = proof.partition(" ")
    if kind == "derivation:":
        return len(rest.split()) > 5
    if kind == "study":
        return rest in {one.name for one in studies.in_order()}
    path, _, test = proof.partition("::")
    file = ROOT / path
    return file.exists() and f"\ndef {test}(" in file.read_text(encoding="utf-8")


def named(name: str) -> Erratum:
    """E1, E2, ... Raises KeyError."""
    return {one.name: one for one in ERRATA}[name]


def table(of: Iterable[Erratum]) -> str:
    """Errata as a table in Markdown."""
    head = "| | where | as printed, and why it cannot stand | here, and what it changes | proof |"
    rows = [
        f"| {one.name} | {one.where} | {one.printed}. {one.wrong}. | {one.reading}. {effect(one)}".rstrip()
        + f" | {'; '.join(map(_sentence, one.proofs))} |"
        for one in of
    ]
    return "\n".join([head, "|---" * 5 + "|", *rows])


def _sentence(proof: str) -> str:
    """A test's name is the sentence that it proves; other proofs as they stand."""
    path, _, test = proof.partition("::test_")
    return f"{test.replace('_', ' ')} ({path})" if test else proof


def _printed(*conditions: str) -> tuple[str, ...]:
    return tuple(f"printed.{condition}.of ours.total" for condition in conditions)


def _test(module: str) -> Callable[[str], str]:
    return lambda name: f"tests/test_{module}.py::test_{name}"


_oracles, _features, _policy, _sarsa = _test("oracles"), _test("features"), _test("policy"), _test("sarsa")
_agent, _errata, _thresholds, _lambdas = _test("agent"), _test("errata"), _test("thresholds"), _test("lambdas")

ERRATA = (
    Erratum(
        "E1",
        "eq. (3)",
        "the number stands at two equations, and the gradient of the value is taken by phi",
        "A gradient by the features is theta; the update needs the one by the weights, which is phi",
        "the gradient by theta",
        (_errata("the_gradient_of_the_value_is_phi_by_the_weights_and_theta_by_the_features"),),
    ),
    Erratum(
        "E2",
        "III.F, III.G",
        "lambda is said to be given in eq. (8)",
        "Eq. (8) is the features; the three forms of lambda are eq. (7)",
        "eq. (7)",
        ("derivation: eq. (8) defines phi_i and holds no lambda; of all equations only (7) holds three forms",),
    ),
    Erratum(
        "E3",
        "eq. (7), form 1",
        "without a minus sign",
        "With it, and only with it, the three forms coincide on a quadratic with exact line search, as they must",
        "with the minus; the printed sign is an option",
        (_oracles("on_a_quadratic_with_exact_line_search_the_three_forms_coincide_with_the_minus_and_only_so"),),
        _printed("E3 form 1", "E3 form 1, printed sign"),
    ),
    Erratum(
        "E4",
        "alpha_0",
        "1.25e-2 in Table I, 1.25e-3 in IV.A, and a formula for both",
        "The formula gives a third value, 1.25e-4; they are a factor of 100 apart",
        "1.25e-3, which calibration picked too; all three are run",
        (_errata("the_formula_for_alpha_0_gives_neither_of_the_values_beside_it"), "study printed"),
        _printed("+ features kept", "E4 alpha_0 of the formula"),
    ),
    Erratum(
        "E5",
        "Table I, epsilon_0",
        "0.3 EP, which is 6",
        "No probability: in all 20 episodes the best action would have a negative one; the row looks like that of ep_0",
        "0.3",
        (_errata("an_epsilon_0_of_6_gives_a_negative_probability_in_all_twenty_episodes"),),
        _printed("E5 epsilon_0 at its bound"),
    ),
    Erratum(
        "E6",
        "Table I, III.H",
        "psi_upper, psi_lower = .904, .908",
        "Swapped: eq. (19) gives .9081 to the upper one and .9040 to the lower",
        "as in eq. (19)",
        (_thresholds("the_published_multiplier_gives_the_upper_threshold_and_one_less_the_lower"),),
    ),
    Erratum(
        "E7",
        "IV, VI",
        "three (m = 1) snapshots, three views",
        "One, by Table I, the abstract and section III; three are the earlier model's",
        "m = 1; m = 3 is an option, and run",
        (
            "derivation: eq. (14) gives 258 features only for m = 1 and b = 3; m = 3 would give 774",
            "study claims-parts",
        ),
        ("C14.three snapshots",),
    ),
    Erratum(
        "E8",
        "Fig. 2",
        "n of about 3 x 256/b, so 256",
        "Eq. (14) gives 258 for b = 3",
        "258",
        (_features("bins_of_three_give_the_258_features_of_eq_14_and_three_snapshots_three_times_as_many"),),
    ),
    Erratum(
        "E9",
        "eqs. (8), (9), (12)",
        "a factor 1/T - 1, squares about zero, one variance per bin in (8) and one average in (12)",
        "The factor is negative; and a variance is taken about the mean, which makes another home",
        "1/(T - 1), about the mean, one for all bins; all four readings are run",
        (_features("the_four_readings_of_sigma_squared_are_those_worked_by_hand"), "study printed"),
        _printed("all but variance about the mean", "E9 sigma^2 per bin", "E9 sigma^2 per bin, about zero"),
    ),
    Erratum(
        "E10",
        "eq. (11)",
        "a sum over all n features that is H",
        "Only the bins of one channel sum to H, its number of pixels; all n to 3 H m",
        "H is the number of pixels, each channel scaled by itself",
        (_features("the_bins_of_each_channel_sum_to_one"),),
    ),
    Erratum(
        "E11",
        "eq. (12)",
        "H^2 sigma^2 in the denominator",
        "Right only if sigma^2 is that of scaled histograms; with that of eq. (9) every feature is 1, but for 1e-6",
        "scaled once",
        (_errata("a_variance_of_counts_that_is_scaled_again_makes_every_feature_one"),),
    ),
    Erratum(
        "E12",
        "Fig. 2, last lines",
        "phi_t is overwritten by phi_(t+1), and then kept as phi_(t-1)",
        "The two norms in form 2 are then the same, and it is the ratio of the errors alone",
        "phi_(t-1) is kept first",
        (_agent("with_features_overwritten_form_2_is_the_ratio_of_the_td_errors_in_a_whole_run"),),
        _printed("all but features kept"),
    ),
    Erratum(
        "E13",
        "eq. (7)",
        "no word of a previous error, or trace, of zero",
        "0/0 and x/0 are undefined, and the choice decides on some problems",
        "lambda = 0 there, the direction starts afresh; a parameter",
        (_lambdas("where_the_ratio_is_undefined_a_form_says_so"), "study printed"),
        _printed("E13 lambda 1 where undefined"),
    ),
    Erratum(
        "E14",
        "Fig. 6",
        "the caption speaks of form 1",
        "Fig. 2 and Table I have form 2; which one made the curves cannot be told",
        "form 2; all three forms are run",
        ("study varying", _errata("the_agent_of_the_default_settings_uses_form_2_and_form_1_gives_other_runs")),
    ),
    Erratum(
        "E15",
        "eq. (23)",
        "called exponential",
        "Hyperbolic: 1 in the first episode, .467 in the ninth, .269 in the twentieth",
        "used as printed",
        (_policy("the_decrease_rate_is_one_at_first_then_hyperbolic"),),
    ),
    Erratum(
        "E16",
        "III.I, Fig. 2",
        "tau has no value, and is never lowered",
        "The text says that it falls like epsilon",
        "it falls like epsilon; its value is declared",
        (_agent("step_size_epsilon_and_tau_fall_together_from_episode_to_episode_by_eq_23"),),
    ),
    Erratum(
        "E17",
        "eq. (20)",
        "values are divided by their sum",
        "Undefined where the sum is 0, and where it is negative the order of preference is reversed",
        "by the sum of magnitudes",
        (_policy("where_the_sum_is_negative_the_printed_formula_reverses_the_preference_and_the_guard_does_not"),),
    ),
    Erratum(
        "E18",
        "eqs. (20), (22)",
        "a softmax without its denominator is added to epsilon-greedy",
        "At tau = 1 the best of three like actions never gets more than 46 %; at tau = .03 epsilon has no effect",
        "eq. (21) alone, which calibration picked; both others are run",
        (
            _policy(
                "at_tau_one_the_printed_policy_gives_the_best_of_three_like_values_46_percent_without_any_exploration"
            ),
            _policy("at_tau_a_thirtieth_epsilon_has_no_effect_on_the_printed_policy"),
        ),
        _printed("all but plain epsilon-greedy", "E18 mixture as printed, tau .03", "E18 mixture normalised, tau .03"),
    ),
    Erratum(
        "E19",
        "Fig. 2",
        "no terminal case",
        "Home is valued like any view, some 230 at first; were it masked, reaching it would cost that much",
        "as printed; masking is an option",
        (_sarsa("the_last_step_takes_the_value_after_it_as_zero_unless_it_bootstraps_as_printed"),),
        _printed("E19 home masked"),
    ),
    Erratum(
        "E20",
        "eq. (18), Fig. 2",
        "only the weights of the action taken are updated",
        "Eq. (17) keeps traces for all of them; the standard is to update all, and only that is TD(lambda)",
        "as printed; all is an option",
        (
            _sarsa("the_printed_update_leaves_the_weights_of_the_other_actions_alone"),
            _sarsa("sarsa_that_updates_all_actions_equals_td_on_state_action_features"),
        ),
        _printed("E20 all actions updated"),
    ),
    Erratum(
        "E21",
        "eq. (16)",
        "2 NRB_t - NRB_(t-1) in every step that stays in the band between the thresholds",
        "With gamma = 1 it pays .9 a step to loiter before home and never to arrive",
        "as printed",
        (_errata("a_robot_that_loiters_in_the_band_earns_without_end"),),
    ),
    Erratum(
        "E22",
        "V.A, IV.A",
        "-1/t is to punish early steps more; the sum of rewards is called bounded",
        "The sum grows like ln T, without bound but slowly: an episode of 2000 steps costs less than twice one of 40",
        "as printed; a constant cost is an option, and run",
        (_errata("fifty_times_the_steps_cost_less_than_twice_as_much"),),
        ("C16.constant cost",),
    ),
    Erratum(
        "E23",
        "II.B",
        "lambda outside [0, 1] is reset to the boundary, since gamma lies there",
        "It does not follow, and the first reset ends the equivalence with conjugate gradient",
        "reset, and how often is reported",
        (
            _test("td")("conjugate_gradient_and_trace_agree_until_the_first_clip_and_the_clip_is_reported"),
            "study conjugate",
        ),
    ),
    Erratum(
        "E24",
        "III.H",
        "the thresholds are said to come from a von Mises or wrapped normal distribution",
        "Nothing is fitted: eq. (19) is a function of the multiplier alone, which was found by trial",
        "an empirical rule",
        (
            "derivation: a fit would depend on the similarities or headings to which it is fitted; eq. (19) holds "
            "neither a view nor an angle, and 1 - 1/(pi sqrt(12)) is the same in every room",
            _thresholds("both_printed_forms_are_those_worked_by_hand"),
        ),
    ),
    Erratum(
        "E25",
        "Fig. 2, eq. (23)",
        "the rate is lowered after an episode, by the number of that episode",
        "After the first it is (ep_0 + 1)/(ep_0 + 1): the second episode has the full rate too",
        "lowered before an episode, by its own number",
        (_errata("lowered_after_an_episode_by_its_number_the_rate_is_one_in_the_second_too"),),
    ),
    Erratum(
        "E26",
        "V.A",
        "learning goes on while the reactive behaviour drives",
        "A turn in place is credited as a driving turn, and what the robot will do next, like t in the cost 1/t, is "
        "not in the features: the task is not Markov in them",
        "so too",
        (
            _agent("each_update_credits_the_action_driven_and_looks_ahead_to_the_one_driven_next_reflex_or_not"),
            "derivation: two steps with the same view and action, one of them under the reflex or later in its "
            "episode, have other rewards and other views after them",
        ),
    ),
    Erratum(
        "E27",
        "V.A, the earlier model",
        "learning pauses at walls",
        "delta_(t-1), phi_(t-1) and the trace are then those of a step long past when it goes on",
        "as an option, without a remedy",
        (_errata("without_learning_at_walls_the_step_before_a_gap_is_what_lambda_sees_after_it"),),
    ),
    Erratum(
        "E28",
        "eq. (14)",
        "round(256/b) + 1 bins in a channel",
        "Unless 256/b is rounded down, the last one is empty, and its feature always 1",
        "as printed; b = 3 has no such bin",
        (_errata("unless_256_by_the_bin_size_is_rounded_down_the_last_bin_is_empty"),),
    ),
    Erratum(
        "E29",
        "Fig. 2",
        "the first action is set to 2, then drawn with epsilon_0 in every episode",
        "It can be only one of both; and epsilon is lowered for every action but this",
        "drawn, with the epsilon of its episode",
        (
            "derivation: the line that draws a_0 stands inside the loop over episodes, after the one that sets it, and "
            "names epsilon_0, while the loop over steps names epsilon, which the last line lowers",
        ),
    ),
)
"""E1 to E24 are the slips and gaps that a reader meets who rebuilds the model; those from E25 on were found since."""
