"""README.md: its code runs as it stands, and what it says of the runs is so."""

import re
import sys

import pytest

import homing_lib
from homing_lib.publish import report
from homing_lib.storage import ROOT

README = (ROOT / "README.md").read_text(encoding="utf-8")
SAMPLES = dict(
    zip(("LinearTD", "agent.run", "gymnasium.make"), re.findall(r"```python\n(.*?)```", README, re.S), strict=True)
)
LINKS = sorted(set(re.findall(r"\]\((?!https?:)([^)]+)\)", README)))


@pytest.mark.parametrize("shows", SAMPLES)
def test_each_sample_of_the_readme_runs_where_pybullet_cannot_be_loaded(shows, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "pybullet", None)
    monkeypatch.delitem(sys.modules, "homing_lib.arena", raising=False)
    monkeypatch.delattr(homing_lib, "arena", raising=False)
    assert shows in SAMPLES[shows]
    exec(SAMPLES[shows], {})
    assert "nan" not in capsys.readouterr().out


@pytest.mark.parametrize("path", LINKS)
def test_what_the_readme_links_is_there(path):
    assert (ROOT / path).exists()


def test_at_most_steps_lambda_is_reset_as_the_readme_says():
    says = "At most steps λ lies outside [0, 1] and is reset" in README
    assert says == (report.stored_headline().clipped > 0.5)
