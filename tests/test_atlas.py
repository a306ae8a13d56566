"""An atlas says what the arena says, is the same bytes however it was built, and is never silently a wrong one."""

import hashlib
import os
import shutil
import signal
import subprocess
import sys
from dataclasses import replace
from math import sqrt
from pathlib import Path
from time import sleep

import numpy as np
import psutil
import pytest

pytest.importorskip("pybullet", reason="needs PyBullet")  # to build one; tests/test_without_pybullet.py does without

from homing_lib import atlas
from homing_lib.arena import Arena
from homing_lib.atlas import Lattice, open_atlas, read_stored
from homing_lib.rooms import PAPER, ROOMS, Pose
from homing_lib.settings import Settings
from homing_lib.storage import npz_bytes, read_arrays
from homing_lib.survey import free_pose, survey

ROOT = Path(__file__).parent.parent

COARSE = dict(
    images="atlas", image_size=16, atlas_spacing_m=0.1, atlas_heading_deg=60, survey_steps=50, episodes=2, max_steps=60
)
SETTINGS = Settings(**COARSE)

PROGRAM = f"""
import sys
from pathlib import Path
from homing_lib import atlas
from homing_lib.publish.cli import main
atlas.FOLDER = Path(sys.argv[1])
sys.exit(main(["run", *(word for name, value in {COARSE}.items() for word in ("--set", f"{{name}}={{value}}"))]))
"""
"""`homing run` with a coarse atlas, stored in the folder that the argument names."""


def start(folder: Path, program: str = PROGRAM) -> subprocess.Popen[str]:
    """A building in a process of its own, and its group."""
    command = [sys.executable, "-c", program, str(folder)]
    pipe = subprocess.PIPE
    return subprocess.Popen(command, cwd=ROOT, stdout=pipe, stderr=pipe, text=True, start_new_session=True)


def started(folder: Path) -> subprocess.Popen[str]:
    """The same, and its workers are at work."""
    building = start(folder)
    while len(psutil.Process(building.pid).children(recursive=True)) < 2 and building.poll() is None:
        sleep(0.01)
    return building


def said(errors: str) -> list[str]:
    """Lines on standard error that are no progress bar's."""
    return [line for line in errors.replace("\r", "\n").splitlines() if line.strip() and "%|" not in line]


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


def test_one_worker_and_two_write_the_same_bytes_and_nothing_else(coarse, tmp_path):
    open_atlas(PAPER, SETTINGS, tmp_path, workers=2)
    assert hashes(tmp_path) == hashes(coarse)
    assert {path.suffix for path in tmp_path.iterdir()} == {".npz", ".lock"}


def test_two_processes_that_build_at_once_both_succeed(coarse, tmp_path):
    both = [start(tmp_path), start(tmp_path)]
    output, errors = zip(*(building.communicate() for building in both), strict=True)
    assert [building.returncode for building in both] == [0, 0], errors
    assert output[0] == output[1]
    assert hashes(tmp_path) == hashes(coarse)


def test_ctrl_c_is_one_line_and_the_same_command_builds_it_then(coarse, tmp_path):
    building = started(tmp_path)
    os.killpg(building.pid, signal.SIGINT)  # as a terminal sends it: to workers too
    _, errors = building.communicate()
    assert building.returncode == 130
    assert [line.startswith("homing: interrupted") for line in said(errors)] == [True], errors
    assert not hashes(tmp_path)
    again = start(tmp_path)
    again.communicate()
    assert again.returncode == 0
    assert hashes(tmp_path) == hashes(coarse)


def test_who_builds_an_atlas_goes_with_the_parent_within_ten_seconds_and_leaves_no_lock(coarse, tmp_path):
    building = started(tmp_path)
    workers = psutil.Process(building.pid).children(recursive=True)
    building.kill()
    building.wait()
    assert workers
    _, alive = psutil.wait_procs(workers, timeout=10)
    assert not alive
    open_atlas(PAPER, SETTINGS, tmp_path, workers=1)
    assert hashes(tmp_path) == hashes(coarse)


def test_a_full_disk_is_one_line(tmp_path):
    building = start(tmp_path, "import resource\nresource.setrlimit(resource.RLIMIT_FSIZE, (100, 100))\n" + PROGRAM)
    _, errors = building.communicate()
    assert building.returncode == 1
    assert [line.startswith("homing: ") for line in said(errors)] == [True], errors


# Damaged and outdated atlases


@pytest.mark.parametrize("harm", ["truncated", "one byte", "emptied", "altered", "renamed"])
def test_a_damaged_atlas_is_named_and_built_anew(stored, coarse, harm, capsys):
    content = bytearray(stored.read_bytes())
    if harm == "truncated":
        content = content[: len(content) // 2]
    elif harm == "one byte":
        content[len(content) // 2] ^= 1
    elif harm == "emptied":
        content = bytearray()
    else:
        about, arrays = read_arrays(stored)
        if harm == "altered":
            arrays["clearance_m"] = arrays["clearance_m"][::-1]
        else:
            about["name"] = "paper-00000000-00000000-00000000"
        content = bytearray(npz_bytes(about, arrays))
    stored.write_bytes(content)
    open_atlas(PAPER, SETTINGS, stored.parent, workers=1)
    (line,) = said(capsys.readouterr().err)
    assert line.startswith(f"homing: {stored}: damaged file") and line.endswith("built anew")
    assert hashes(stored.parent) == hashes(coarse)


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
    if outdated_by == "code":
        monkeypatch.setattr(
            atlas, "INFRARED_ANGLES_DEG", list(atlas.INFRARED_ANGLES_DEG)
        )  # the same, written otherwise
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
