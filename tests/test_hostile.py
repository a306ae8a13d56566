"""Whatever is asked for or harmed: it is refused in one line that names it, repaired, or as it was; nothing is lost."""

import json
import math
import os
from collections.abc import Callable
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from homing_lib import agent, atlas
from homing_lib.errors import UserError
from homing_lib.settings import Settings
from homing_lib.study import findings, measures, runs
from homing_lib.study.runs import Study
from homing_lib.study.sweep import sweep

pytestmark = pytest.mark.skipif(os.name == "nt", reason="pipes and links are POSIX's")

QUICK = {"images": "compact", "episodes": 1, "survey_steps": 20, "max_steps": 5}
CONDITIONS = {name: Settings(**QUICK, controller=name) for name in ("sarsa", "random")}
TABLE = Study("table", "To be harmed.", CONDITIONS, range(2), measures.curve)
WHOLE = Study("whole", "To be harmed.", CONDITIONS, range(2))


def is_a_line(text: str, *words: str) -> bool:
    """A refusal that a user can read, with these words."""
    return text.isprintable() and 0 < len(text) < 1000 and all(word in text for word in words)


# --- Files -----------------------------------------------------------------------------------------------------------


def instead(make: Callable[[Path], object]) -> Callable[[Path], object]:
    return lambda path: (path.unlink(), make(path))


def rewritten(change: Callable[[bytes], bytes]) -> Callable[[Path], object]:
    return lambda path: path.write_bytes(change(path.read_bytes()))


def flipped(content: bytes, share: float) -> bytes:
    """The content with one bit flipped, so far into it."""
    at = int(share * len(content))
    return content[:at] + bytes([content[at] ^ 1]) + content[at + 1 :]


HARM: dict[str, Callable[[Path], object]] = {
    "empty": rewritten(lambda _: b""),
    "halved": rewritten(lambda content: content[: len(content) // 2]),
    "longer": rewritten(lambda content: content + b"\0"),
    "a list": rewritten(lambda _: b"[]"),
    "deep": rewritten(lambda _: b"[" * 100_000),
    "not utf-8": rewritten(lambda content: b"\xff\xfe" + content),
    "flipped early": rewritten(lambda content: flipped(content, 0.1)),
    "flipped in the middle": rewritten(lambda content: flipped(content, 0.5)),
    "flipped late": rewritten(lambda content: flipped(content, 0.95)),
    "a folder": instead(Path.mkdir),
    "a pipe": instead(os.mkfifo),
    "a dangling link": instead(lambda path: path.symlink_to(path.parent / "nothing")),
    "missing": Path.unlink,
}


@pytest.fixture
def data(tmp_path, monkeypatch) -> Path:
    """The folder of the data of two small studies, stored."""
    monkeypatch.setattr(runs, "DATA", tmp_path / "data")
    monkeypatch.setattr(runs, "SCRATCH", tmp_path / "scratch")
    for study in (TABLE, WHOLE):
        sweep(study, workers=1)
    return tmp_path / "data"


def loaded(study: Study) -> list:
    """What is stored of a study, comparable."""
    if study.measure:
        table = runs.load_table(study)
        return [list(table), table.astype(object).where(table.notna(), None).to_numpy().tolist()]
    results = [run for several in runs.load_study(study).values() for run in several]
    return [(run.settings, run.seed, run.diverged, run.steps.tolist(), run.lengths.tolist()) for run in results]


@pytest.mark.parametrize("harm", HARM)
@pytest.mark.parametrize("file", ["table.parquet", "table.json", "whole.json", "whole/*-0.npz"])
def test_a_harmed_file_is_refused_or_read_as_it_was_and_the_remedy_mends_it(harm, file, data):
    study = TABLE if "table" in file else WHOLE
    (path, *_), sound = data.glob(file), loaded(study)
    before = {one: one.read_bytes() for one in data.rglob("*") if one.is_file() and one != path}
    HARM[harm](path)
    try:
        assert loaded(study) == sound
    except UserError as error:
        assert is_a_line(str(error), str(data))
    for _ in range(3):
        try:
            sweep(study, workers=1)
            break
        except UserError as error:
            named = Path(str(error).partition(": ")[0])  # to be deleted, or moved away
            assert is_a_line(str(error))
            assert data in named.parents
            named.rmdir() if named.is_dir() else named.unlink()
    assert loaded(study) == sound
    assert all(one.read_bytes() == content for one, content in before.items() if one.suffix != ".json")


@pytest.mark.parametrize("harm", HARM)
def test_harmed_findings_are_refused_or_read_as_they_were(harm, tmp_path, monkeypatch):
    sound = findings.stored()
    path = tmp_path / "findings.json"
    path.write_bytes(findings.FILE.read_bytes())
    monkeypatch.setattr(findings, "FILE", path)
    HARM[harm](path)
    findings.stored.cache_clear()
    try:
        assert findings.stored() == sound
    except UserError as error:
        assert is_a_line(str(error), str(path))
    finally:
        findings.stored.cache_clear()


@pytest.mark.parametrize("harm", HARM)
def test_a_harmed_compact_atlas_is_refused_or_read_as_it_was(harm, tmp_path):
    path = tmp_path / "compact.atlas"
    path.write_bytes(atlas.COMPACT.read_bytes())
    HARM[harm](path)
    try:
        _, views = atlas.read_compact(path)
    except UserError as error:
        assert is_a_line(str(error), str(path))
    else:
        assert np.array_equal(views.counts, atlas.read_compact(atlas.COMPACT)[1].counts)


# --- Settings --------------------------------------------------------------------------------------------------------

NUMBERS = (0, 1, -1, 2, 0.5, 1e-3, 5e-324, 1e-160, 1e158, 1e307, -1e307, math.inf, -math.inf, math.nan, 10**9, 10**400)
TEXTS = ("0", "-1", "1e999", "nan", "inf", "0x10", "1_0", "9" * 5000, "٣", " 1 ", "1,5", "", "\x00", "a\nb", "\x1b[31m")
OBJECTS = (None, True, [], {}, (), b"\xff", "\ud800", "x" * 10_000, object(), 1j, len, range(3))
ARRAYS = (np.int64(3), np.float64(0.5), np.bool_(True), np.arange(3), np.array([1]), np.array(1))


def values_for(name: str) -> list:
    """Values at and beyond the bounds of a setting, its choices, and anything."""
    field = Settings.model_fields[name]
    bounds = [getattr(one, kind) for one in field.metadata for kind in ("gt", "ge", "lt", "le") if hasattr(one, kind)]
    near = [bound * factor + offset for bound in bounds for factor in (1, 1.001, 0.999, -1) for offset in (0, 1, -1)]
    return [*near, *get_args(field.annotation), f"{field.default}", *NUMBERS, *TEXTS, *OBJECTS, *ARRAYS]


@pytest.mark.parametrize("name", Settings.model_fields)
def test_whatever_a_setting_is_given_it_is_refused_by_its_name_or_stored_and_run_to_numbers(name):
    for value in values_for(name):
        try:
            settings = Settings(**QUICK | {name: value})
        except UserError as error:
            assert is_a_line(str(error), name), value
            continue
        assert Settings(**json.loads(settings.model_dump_json())) == settings
        few = {
            limit: min(getattr(settings, limit), QUICK[limit]) for limit in ("episodes", "survey_steps", "max_steps")
        }
        try:
            result = agent.run(settings.with_changes(images="compact", **few), 0)
        except UserError as error:
            assert is_a_line(str(error)), value
        else:
            assert result.diverged or np.isfinite(result.steps).all(), value
