"""A cut of the hostile campaign; the whole: `python -m tests.hostile 1500 --seed N`."""

import os
import signal
import subprocess
import sys

import pytest

pytestmark = pytest.mark.skipif(os.name == "nt", reason="pipes, links and alarms are POSIX's")


def test_whatever_one_asks_for_or_harms_nothing_is_lost_and_every_refusal_is_one_line(tmp_path, capsys):
    from tests.hostile import torment

    came = torment(tmp_path, 150, seed=10, processes=1)
    told = capsys.readouterr().out
    assert (came["tracebacks"], came["hangs"], came["lost"]) == (0, 0, 0), told
    assert sum(came.values()) == 150
    assert min(came[name] for name in ("refused in one line", "repaired", "accepted")) > 10


def test_a_campaign_notices_what_is_lost_and_what_is_no_line(tmp_path, capsys, monkeypatch):
    from homing_lib.study import runs
    from tests import hostile

    monkeypatch.setattr(hostile, "SHARES", {"stored_file": 1})
    monkeypatch.setattr(runs, "_check", lambda *_: None)  # nothing is held against a manifest
    alter = hostile.Campaign._alter
    monkeypatch.setattr(hostile.Campaign, "harm", lambda self, path: path.suffix == ".npz" and alter(self, path))
    assert hostile.torment(tmp_path / "a", 20, seed=0, processes=0)["lost"] > 0
    monkeypatch.undo()
    monkeypatch.setattr(hostile, "SHARES", {"environment": 1})
    monkeypatch.setattr("homing_lib.environment.shown", lambda value: f"{value!r}\n")
    assert hostile.torment(tmp_path / "b", 30, seed=0, processes=0)["tracebacks"] > 0
    capsys.readouterr()


def test_what_a_campaign_starts_can_be_interrupted_from_a_shells_background_too():
    from tests.hostile import limited

    program = "import signal; print(signal.getsignal(signal.SIGINT) == signal.default_int_handler)"
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with limited():
            assert subprocess.check_output([sys.executable, "-c", program], text=True) == "True\n"
        assert signal.getsignal(signal.SIGINT) == signal.SIG_IGN
    finally:
        signal.signal(signal.SIGINT, before)
