import re
from math import degrees, inf, nan
from typing import get_args

import pytest
from pydantic import ValidationError

from homing_lib.errors import UserError
from homing_lib.settings import Settings
from homing_lib.study import runs, studies

FIELDS = Settings.model_fields

OTHER = {
    "lambda_rule": "fixed:0.5",
    "room": "attic",
    "atlas_heading_deg": 20,
    "snapshots": 3,
    "clear_way_m": 0.01,
}
"""A value other than the default, where one more, one step further or the other choice will not do."""


def other(name):
    field = FIELDS[name]
    if name in OTHER:
        return OTHER[name]
    if isinstance(field.default, bool):
        return not field.default
    if choices := get_args(field.annotation):
        return next(choice for choice in choices if choice != field.default)
    return field.default + 1 if isinstance(field.default, int) else field.default * 0.9 or 0.01


@pytest.mark.parametrize("name", FIELDS)
def test_each_setting_says_first_where_its_value_is_from(name):
    source = r"Eq\. \(\d+\)|Table I\b|Fig\. 2\b|Section [IV]+\b|[IV]+\.[A-I]:|Declared[:,]|V\.A"
    assert re.match(source, FIELDS[name].description)
    assert "printed" in FIELDS[name].json_schema_extra


def test_the_settings_of_table_1_are_the_printed_ones():
    s = Settings()
    assert (s.episodes, s.discount, s.snapshots, s.bin_size, s.multiplier) == (20, 1, 1, 3, 12)
    assert s.alpha0 in (1.25e-2, 1.25e-3, 1.25e-4)  # all three are printed
    assert s.first_episode == pytest.approx(6)


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        ({"alpha0": -1}, "setting alpha0 = -1: Input should be greater than or equal to 0.000000001"),
        ({"alpha0": "much"}, "setting alpha0 = 'much': Input should be a valid number"),
        ({"alpha0": nan}, "setting alpha0 = nan: Input should be a finite number"),
        ({"wall_penalty": inf}, "setting wall_penalty = inf: Input should be a finite number"),
        ({"epsilon0": 6}, "setting epsilon0 = 6: Input should be less than or equal to 1"),
        ({"episodes": 2.5}, "setting episodes = 2.5: Input should be a valid integer"),
        ({"mixture": "both"}, "setting mixture = 'both': Input should be 'normalised', 'literal' or 'epsilon-greedy'"),
        (
            {"lambda_rule": "steepest"},
            "setting lambda_rule = 'steepest': unknown lambda rule 'steepest'; known: ",
        ),
        (
            {"lambda_rule": 0.5},
            "setting lambda_rule = 0.5: settings name their rule: 'fixed:0.5', or any of fixed:<lambda>, ",
        ),
        ({"lambda_rule": "fixed:2"}, "setting lambda_rule = 'fixed:2': lambda must lie in [0, 1], got 2.0"),
        ({"lambda_rule": "fixed:much"}, "setting lambda_rule = 'fixed:much': could not convert"),
        ({"alpha": 1}, "setting alpha: there is none of this name; `homing settings` lists them"),
        ({"clear_way_m": 0.06}, "settings: clear_way_m = 0.06: must not exceed infrared_range_m = 0.05"),
        ({"band": 12}, "settings: band = 12: must be less than multiplier = 12"),
        ({"atlas_heading_deg": 7}, "settings: atlas_heading_deg = 7: must divide 360"),
    ],
)
def test_a_mistake_is_refused_in_one_line_that_names_the_setting_the_value_and_the_rule(changes, line):
    with pytest.raises(UserError, match="^" + re.escape(line)) as refusal:
        Settings().with_changes(**changes)
    assert "\n" not in str(refusal.value)


def test_two_mistakes_are_refused_in_one_line_too():
    with pytest.raises(UserError, match=r"^setting alpha0 = -1: .*; setting alpha: ") as refusal:
        Settings(alpha0=-1, alpha=1)
    assert "\n" not in str(refusal.value)


def test_texts_from_a_command_line_are_read_as_numbers():
    assert Settings(alpha0="0.003", episodes="5", traces="dutch") == Settings(alpha0=0.003, episodes=5, traces="dutch")


def test_settings_cannot_be_changed_in_place():
    with pytest.raises(ValidationError, match="frozen"):
        Settings().alpha0 = 1


@pytest.mark.parametrize("name", FIELDS)
def test_the_digest_changes_with_each_setting(name):
    changed = Settings().with_changes(**{name: other(name)})
    assert getattr(changed, name) != FIELDS[name].default
    assert changed.digest != Settings().digest
    assert re.fullmatch("[0-9a-f]{12}", changed.digest)


ADDED = {"reward_scale", "terminal_bonus", "band", "start"}


def test_settings_that_were_added_later_are_written_only_where_they_are_not_the_default():
    assert Settings().digest == "425af15c1415"  # the name of every run stored before they were added
    assert Settings().model_dump().keys() == FIELDS.keys() - ADDED
    for name in ADDED:
        changed = Settings().with_changes(**{name: other(name)})
        assert changed.model_dump() == Settings().model_dump() | {name: other(name)}
        assert Settings(**changed.model_dump()) == changed
        assert Settings.model_validate_json(changed.model_dump_json()) == changed
        assert changed.with_changes(alpha0=1).with_changes(**{name: FIELDS[name].default}) == Settings(alpha0=1)


def test_a_change_back_gives_equal_settings_and_the_same_digest():
    back = Settings().with_changes(alpha0=1).with_changes(alpha0=FIELDS["alpha0"].default)
    assert back == Settings()
    assert hash(back) == hash(Settings())
    assert back.digest == Settings().digest


def test_a_lambda_rule_is_kept_under_its_short_name_so_that_spellings_share_a_digest():
    assert Settings(lambda_rule="fixed:0.90").lambda_rule == "fixed:0.9"
    assert Settings(lambda_rule="fixed:0.90").digest == Settings(lambda_rule="fixed:0.9").digest


def test_the_wheels_roll_what_turn_and_advance_ask_of_them():
    s = Settings(turn_deg=30, turn_advance_m=0.06, forward_m=0.05, wheel_base_m=0.06)
    left, right, forward = s.wheel_commands_m
    assert forward == (0.05, 0.05)
    assert right == left[::-1]
    assert sum(left) / 2 == pytest.approx(0.06)
    assert degrees((left[1] - left[0]) / 0.06) == pytest.approx(30)


@pytest.mark.parametrize(
    "changes",
    [
        {"first_episode_share": 1e307},
        {"alpha0": 5e-324},
        {"tau0": 5e-324},
        {"survey_steps": 10**9},
        {"episodes": "9" * 400},
        {"variance_floor_pixels": 1e158},
        {"variance_floor_pixels": 1e-160},
        {"turn_deg": 0.001},
        {"multiplier": 1.01},
        {"room": "cellar"},
    ],
)
def test_what_would_break_later_or_means_nothing_is_refused_at_once_and_shortly(changes):
    with pytest.raises(UserError) as refusal:
        Settings(**changes)
    assert "\n" not in str(refusal.value)
    assert len(str(refusal.value)) < 300


def test_no_bound_refuses_what_a_study_has_stored():
    for study in studies.in_order():
        stored = runs.read_manifest(study)
        for values in stored.get("conditions", {}).values():
            changes = {name: value for name, value in values.items() if name != "digest"}
            assert Settings(**changes).digest == values.get("digest", Settings(**changes).digest)
