"""Every setting has its source, a range, and its part in the name of a run."""

import re
from math import degrees, inf, nan

import pytest

from homing_lib.errors import UserError
from homing_lib.settings import Settings
from tests.conftest import other_value

FIELDS = Settings.model_fields
ADDED = {name for name, field in FIELDS.items() if field.json_schema_extra["added"]}


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


def test_texts_from_a_command_line_are_read_as_numbers():
    assert Settings(alpha0="0.003", episodes="5") == Settings(alpha0=0.003, episodes=5)


# The digest, which names stored runs


@pytest.mark.parametrize("name", [name for name in FIELDS if name != "traces"])  # which has one value
def test_the_digest_changes_with_each_setting_and_back(name):
    changed = Settings().with_changes(**{name: other_value(name)})
    assert changed.digest != Settings().digest
    assert re.fullmatch("[0-9a-f]{12}", changed.digest)
    assert Settings.model_validate_json(changed.model_dump_json()) == changed
    back = changed.with_changes(**{name: FIELDS[name].default})
    assert (back, hash(back), back.digest) == (Settings(), hash(Settings()), Settings().digest)


def test_settings_that_were_added_later_are_written_only_where_they_are_not_the_default():
    assert Settings().digest == "425af15c1415"  # the name of every run stored before they were added
    assert Settings().model_dump().keys() == FIELDS.keys() - ADDED
    assert ADDED
    for name in ADDED:
        changed = Settings().with_changes(**{name: other_value(name)})
        assert changed.model_dump() == Settings().model_dump() | {name: other_value(name)}


def test_a_lambda_rule_is_kept_under_its_short_name_so_that_spellings_share_a_digest():
    assert Settings(lambda_rule="fixed:0.90").lambda_rule == "fixed:0.9"


def test_the_wheels_roll_what_turn_and_advance_ask_of_them():
    s = Settings(turn_deg=30, turn_advance_m=0.06, forward_m=0.05, wheel_base_m=0.06)
    left, right, forward = s.wheel_commands_m
    assert forward == (0.05, 0.05)
    assert right == left[::-1]
    assert sum(left) / 2 == pytest.approx(0.06)
    assert degrees((left[1] - left[0]) / 0.06) == pytest.approx(30)


# Refusals


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        ({"alpha0": -1}, "setting alpha0 = -1: .* 0.000000001"),
        ({"alpha0": "much"}, "setting alpha0 = 'much': .* number"),
        ({"alpha0": nan}, "setting alpha0 = nan: .* finite"),
        ({"wall_penalty": inf}, "setting wall_penalty = inf: .* finite"),
        ({"epsilon0": 6}, "setting epsilon0 = 6: .* less than or equal to 1"),
        ({"episodes": 2.5}, "setting episodes = 2.5: .* integer"),
        ({"episodes": "9" * 400}, "setting episodes = '9+\\.\\.\\."),
        ({"mixture": "both"}, "setting mixture = 'both': .*'normalised', 'literal' or 'epsilon-greedy'"),
        ({"traces": "replacing"}, "setting traces = 'replacing': .* 'accumulating'"),
        ({"lambda_rule": "steepest"}, "setting lambda_rule = 'steepest': .*; known: "),
        ({"lambda_rule": 0.5}, "setting lambda_rule = 0.5: .* fixed:<lambda>"),
        ({"room": "cellar"}, "room 'cellar': .* paper"),
        ({"alpha": 1}, "setting alpha: .* `homing settings`.*; did you mean alpha0"),
        ({"alpha0": -1, "alpha": 1}, "setting alpha0 = -1: .*; setting alpha: "),
        ({"clear_way_m": 0.06}, "settings: clear_way_m = 0.06: .* infrared_range_m = 0.05"),
        ({"band": 12}, "settings: band = 12: .* multiplier = 12"),
        ({"atlas_heading_deg": 7}, "settings: atlas_heading_deg = 7: must divide 360"),
    ],
)
def test_a_mistake_is_refused_in_one_short_line_that_names_the_setting_the_value_and_the_rule(changes, line):
    with pytest.raises(UserError, match=f"^{line}") as refusal:
        Settings().with_changes(**changes)
    assert "\n" not in str(refusal.value)
    assert len(str(refusal.value)) < 700
