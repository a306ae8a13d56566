"""An atlas says what the arena says, is the same bytes however it was built, and is never silently a wrong one."""

import hashlib
import shutil
import subprocess
import sys
from dataclasses import replace
from math import sqrt
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("pybullet", reason="needs PyBullet")  # to build one; tests/test_without_pybullet.py does without

from homing_lib import atlas
from homing_lib.arena import Arena
from homing_lib.atlas import Lattice, open_atlas, read_stored
from homing_lib.rooms import PAPER, ROOMS, Pose
from homing_lib.settings import Settings
from homing_lib.storage import ROOT, npz_bytes, read_arrays
from homing_lib.survey import free_pose, survey
from tests.kills import lives, wait_for, workers_of

COARSE = dict(
    images="atlas", image_size=16, atlas_spacing_m=0.1, atlas_heading_deg=60, survey_steps=50, episodes=2, max_steps=60
)
SETTINGS = Settings(**COARSE)

PROGRAM = f"""
import sys
from pathlib import Path
from homing_lib.atlas import open_atlas
from homing_lib.rooms import PAPER
from homing_lib.settings import Settings
open_atlas(PAPER, Settings(**{COARSE}), Path(sys.argv[1]), workers=2)
"""


def start(folder: Path) -> subprocess.Popen[str]:
    """A process that builds the coarse atlas there."""
    return subprocess.Popen([sys.executable, "-c", PROGRAM, str(folder)], cwd=ROOT, stderr=subprocess.PIPE, text=True)


def hashes(folder: Path) -> dict[str, str]:
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in folder.glob("*.npz")}


@pytest.fixture(scope="module")
def coarse(tmp_path_factory) -> Path:
    """A folder with the coarse atlas of the paper's room, and nothing else."""
    folder = tmp_path_factory.mktemp("coarse")
    open_atlas(PAPER, SETTINGS, folder, workers=1)
    return folder


@pytest.fixture(scope="module")
def looked_up(coarse) -> atlas.Atlas:
    return open_atlas(PAPER, SETTINGS, coarse)


@pytest.fixture(scope="module")
def fine(tmp_path_factory) -> atlas.Atlas:
    """An atlas as fine as the default in space, of almost no pixels."""
    settings = SETTINGS.with_changes(image_size=8, atlas_spacing_m=0.02, atlas_heading_deg=180)
    return open_atlas(PAPER, settings, tmp_path_factory.mktemp("fine"), workers=2)


@pytest.fixture
def stored(coarse, tmp_path) -> Path:
    """A copy of the coarse atlas, to be harmed."""
    (original,) = coarse.glob("*.npz")
    return Path(shutil.copy(original, tmp_path / original.name))


# What it says


@pytest.mark.parametrize("image_size", [16, 15])
def test_at_every_lattice_pose_views_and_sensors_are_the_arenas_to_the_bit(tmp_path, image_size):
    settings = SETTINGS.with_changes(image_size=image_size)
    looked_up, lattice = open_atlas(PAPER, settings, tmp_path, workers=1), Lattice(PAPER, settings)
    with Arena(PAPER, settings) as world:
        places = [(i, j) for i, j in np.ndindex(lattice.nx, lattice.ny) if looked_up.clearance_m[i, j] > 0]
        assert len(places) > 50
        for i, j in places:
            pose = lattice.pose(i, j, (i + j) % lattice.headings)
            assert np.array_equal(looked_up.histogram(pose), world.histogram(pose))
            assert np.array_equal(looked_up.infrared(pose), world.infrared(pose))
            assert looked_up.clearance(pose.x, pose.y) == pytest.approx(world.clearance(pose.x, pose.y), abs=1e-9)
        model = survey(world, settings, PAPER.home, np.random.default_rng(0))
    np.testing.assert_array_equal(model.features(looked_up.histogram(PAPER.home)), np.ones(settings.n_features))


@pytest.mark.parametrize("room", ROOMS.values(), ids=ROOMS)
@pytest.mark.parametrize("spacing", [0.02, 0.03, 0.1])
def test_the_lattice_covers_the_room_and_home_is_one_of_its_poses_to_the_bit(room, spacing):
    lattice = Lattice(room, Settings(atlas_spacing_m=spacing))
    assert room.home in [lattice.pose(i, j, 0) for i, j in np.ndindex(lattice.nx, lattice.ny)]
    for i, j, corner in ((0, 0, (0, 0)), (lattice.nx - 1, lattice.ny - 1, room.size)):
        beyond = np.subtract(lattice.pose(i, j, 0)[:2], corner) * (1 if i else -1)
        assert ((beyond > -1e-9) & (beyond < spacing)).all()


def test_a_view_off_the_lattice_is_that_of_the_nearest_lattice_pose(looked_up):
    for x, y, heading in ((0.04, -0.04, 0.5), (-0.04, 0.04, -0.5), (0, 0, 2 * np.pi)):
        near = Pose(PAPER.home.x + x, PAPER.home.y + y, PAPER.home.heading + heading)
        assert np.array_equal(looked_up.histogram(near), looked_up.histogram(PAPER.home))
    turned = PAPER.home._replace(heading=PAPER.home.heading - 0.55)
    fifth = PAPER.home._replace(heading=PAPER.home.heading + 5 * np.pi / 3)
    assert np.array_equal(looked_up.histogram(turned), looked_up.histogram(fifth))


@pytest.mark.parametrize("spacing", [0.1, 0.02])
def test_clearance_errs_by_half_a_cells_diagonal_at_most_and_wherever_a_robot_gets_there_is_a_view(
    looked_up, fine, spacing
):
    # A clearance changes by no more than the distance moved, and the mean distance to a cell's corners is at most that.
    looked_up, rng = fine if spacing == 0.02 else looked_up, np.random.default_rng(0)
    bound = spacing / sqrt(2) + 1e-3  # Bullet's own accuracy
    with Arena(PAPER, SETTINGS) as world:
        for _ in range(500):
            x, y, _ = free_pose(world, PAPER, rng)
            assert abs(looked_up.clearance(x, y) - world.clearance(x, y)) <= bound
    settings = SETTINGS.with_changes(survey_steps=20_000, forward_m=0.2, turn_advance_m=0.2, wheel_slip=0.5)
    survey(looked_up, settings, PAPER.home, rng)


def test_outside_the_room_everything_is_in_the_way_and_inside_an_obstacle_is_no_view(looked_up, fine):
    for x, y in ((-0.2, 0.5), (0.5, -0.2), (1.4, 0.5), (0.5, 1.3), (-9, -9), (np.nan, 0.5)):
        assert looked_up.clearance(x, y) < 0
    with pytest.raises(ValueError, match=r"pose \(1.110, 0.500\)"):
        fine.histogram(Pose(1.11, 0.50, 0.0))  # the television


# Building


def test_two_processes_that_build_at_once_write_the_same_bytes_as_one_and_nothing_else(coarse, tmp_path):
    both = [start(tmp_path), start(tmp_path)]
    errors = [building.communicate()[1] for building in both]
    assert [building.returncode for building in both] == [0, 0], errors
    assert {path.suffix for path in tmp_path.iterdir()} == {".npz", ".lock"}
    assert hashes(tmp_path) == hashes(coarse)


def test_who_builds_an_atlas_goes_with_the_parent_within_ten_seconds_and_leaves_no_lock(coarse, tmp_path):
    building = start(tmp_path)
    wait_for(lambda: len(workers_of(building)) == 2)
    workers = workers_of(building)
    building.kill()
    building.wait()
    wait_for(lambda: not any(map(lives, workers)), seconds=10)
    open_atlas(PAPER, SETTINGS, tmp_path, workers=1)
    assert hashes(tmp_path) == hashes(coarse)


# Damaged and outdated atlases


@pytest.mark.parametrize("harm", ["emptied", "altered"])
def test_a_damaged_atlas_is_named_and_built_anew(stored, coarse, harm, capsys):
    content = bytearray(stored.read_bytes())
    content[len(content) // 2] ^= 1
    stored.write_bytes(b"" if harm == "emptied" else content)
    open_atlas(PAPER, SETTINGS, stored.parent, workers=1)
    (line,) = [one for one in capsys.readouterr().err.replace("\r", "\n").splitlines() if one.startswith("homing: ")]
    assert line.startswith(f"homing: {stored}: damaged file") and line.endswith("built anew")
    assert hashes(stored.parent) == hashes(coarse)


def test_an_atlas_under_another_name_is_not_taken_for_what_was_written_under_it(stored):
    assert read_stored(stored) is not None
    assert read_stored(stored.rename(stored.with_name("paper-00000000-00000000-00000000.npz"))) is None


def test_an_atlas_that_lacks_an_array_is_not_taken(stored):
    about, arrays = read_arrays(stored)
    del arrays["infrared_m"]
    stored.write_bytes(npz_bytes(about, arrays))
    assert read_stored(stored) is None


def test_wherever_a_bit_is_flipped_an_atlas_is_refused_or_the_same(stored):
    content, sound = stored.read_bytes(), read_stored(stored)
    assert sound is not None
    directory = content.rindex(b"clearance_m.npyPK") - 300  # what zip itself does not check lies near the end
    for place in (*range(directory, len(content)), *range(0, directory, 997)):
        harmed = bytearray(content)
        harmed[place] ^= 1 << place % 8
        stored.write_bytes(harmed)
        arrays = read_stored(stored)
        assert arrays is None or all(np.array_equal(arrays[name], sound[name]) for name in sound)


def test_a_sound_atlas_is_loaded_without_a_word_and_not_built(stored, capsys, monkeypatch):
    monkeypatch.setattr("joblib.Parallel", None)
    open_atlas(PAPER, SETTINGS, stored.parent)
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("outdated_by", ["room", "code"])
def test_an_outdated_atlas_is_replaced_and_one_of_other_settings_kept(stored, outdated_by, monkeypatch):
    room = PAPER if outdated_by == "code" else replace(PAPER, texture_seed=1)
    if outdated_by == "code":  # the same, written otherwise
        monkeypatch.setattr(atlas, "INFRARED_ANGLES_DEG", list(atlas.INFRARED_ANGLES_DEG))
        monkeypatch.setattr(atlas, "digest", atlas.digest.__wrapped__)  # which a process works out once
    before = open_atlas(PAPER, SETTINGS, stored.parent) if outdated_by == "room" else None
    changed = open_atlas(room, SETTINGS, stored.parent, workers=1)
    assert not stored.exists()
    assert before is None or not np.array_equal(changed.histogram(PAPER.home), before.histogram(PAPER.home))
    open_atlas(room, SETTINGS.with_changes(field_of_view_deg=60), stored.parent, workers=1)
    assert len(hashes(stored.parent)) == 2


def test_the_name_depends_on_every_setting_that_rendering_asks_for_and_on_none_that_only_learning_does():
    class Listening:
        asked: set[str] = set()  # noqa: RUF012

        def __getattr__(self, name):
            self.asked.add(name)
            return getattr(SETTINGS, name)

    atlas.render(3, PAPER, Listening())
    assert Listening.asked == set(SETTINGS.of_scope("view", "lattice"))
    assert atlas.digest(PAPER, SETTINGS) == atlas.digest(PAPER, SETTINGS.with_changes(alpha0=0.5, max_steps=7))
    assert atlas.digest(PAPER, SETTINGS) != atlas.digest(PAPER, SETTINGS.with_changes(light=0.5))
