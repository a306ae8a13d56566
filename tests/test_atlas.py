"""An atlas says what the arena says, is the same bytes however its building went, and is never silently a wrong one."""

import hashlib
import os
import shutil
import signal
import subprocess
import sys
from dataclasses import replace
from math import hypot, sqrt
from pathlib import Path
from time import sleep

import numpy as np
import psutil
import pytest

pytest.importorskip("pybullet", reason="needs PyBullet")  # to build one; tests/test_without_pybullet.py does without

from homing_lib import atlas
from homing_lib.agent import run
from homing_lib.arena import Arena
from homing_lib.atlas import Lattice, open_atlas
from homing_lib.environment import HomingEnv, free_pose, survey
from homing_lib.rooms import PAPER, ROOMS, Pose
from homing_lib.settings import Settings
from homing_lib.storage import npz_bytes, read_arrays

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


def said(errors: str) -> list[str]:
    """Lines on standard error that are no progress bar's."""
    return [line for line in errors.replace("\r", "\n").splitlines() if line.strip() and "%|" not in line]


def parts(folder: Path) -> list[Path]:
    return list(folder.glob("paper-*/[!.]*.npz"))


def wait_for_parts(folder: Path, count: int, building: subprocess.Popen[str]) -> None:
    while len(parts(folder)) < count and building.poll() is None:
        sleep(0.005)


def opened(folder: Path, settings: Settings = SETTINGS, room=PAPER, workers: int = 1) -> atlas.Atlas:
    """As a new process would open it."""
    atlas._opened.clear()
    return open_atlas(room, settings, folder, workers=workers)


def hashes(folder: Path) -> dict[str, str]:
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in folder.glob("*.npz")}


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory) -> Path:
    """A folder with the coarse atlas of the paper's room, and nothing else."""
    folder = tmp_path_factory.mktemp("coarse")
    opened(folder)
    return folder


@pytest.fixture(scope="module")
def fine(tmp_path_factory) -> atlas.Atlas:
    """An atlas as fine as the default in space, of almost no pixels."""
    settings = SETTINGS.with_changes(image_size=8, atlas_spacing_m=0.02, atlas_heading_deg=180)
    return opened(tmp_path_factory.mktemp("fine"), settings, workers=2)


@pytest.fixture
def stored(undisturbed, tmp_path) -> Path:
    """A copy of the coarse atlas, to be harmed."""
    (original,) = undisturbed.glob("*.npz")
    path = tmp_path / original.name
    path.write_bytes(original.read_bytes())
    return path


def lattice_poses(looked_up: atlas.Atlas, room):
    lattice = Lattice(room, SETTINGS)
    for i, j in np.ndindex(lattice.nx, lattice.ny):
        x, y, _ = lattice.pose(i, j, 0)
        if 0 < x < room.size[0] and 0 < y < room.size[1] and looked_up.clearance(x, y) > 0:
            yield from (lattice.pose(i, j, k) for k in range(lattice.headings))


# What it says


@pytest.mark.parametrize("image_size", [16, 15, 24])
def test_at_every_lattice_pose_views_and_sensors_are_the_arenas_to_the_bit(tmp_path, image_size):
    settings = SETTINGS.with_changes(image_size=image_size)
    looked_up = opened(tmp_path, settings)
    with Arena(PAPER, settings) as world:
        poses = list(lattice_poses(looked_up, PAPER))[::3]
        assert len(poses) > 100
        for pose in poses:
            assert np.array_equal(looked_up.histogram(pose), world.histogram(pose))
            assert np.array_equal(looked_up.infrared(pose), world.infrared(pose))
            assert looked_up.clearance(pose.x, pose.y) == pytest.approx(world.clearance(pose.x, pose.y), abs=1e-9)


@pytest.mark.parametrize("room", ROOMS.values(), ids=ROOMS)
@pytest.mark.parametrize("spacing", [0.02, 0.03, 0.1])
def test_home_is_a_lattice_pose_to_the_bit(room, spacing):
    lattice = Lattice(room, Settings(atlas_spacing_m=spacing))
    poses = [lattice.pose(i, j, 0) for i, j in np.ndindex(lattice.nx, lattice.ny)]
    assert room.home in poses


def test_the_lattice_covers_the_room():
    lattice = Lattice(PAPER, SETTINGS)
    for i, j, corner in ((0, 0, (0, 0)), (lattice.nx - 1, lattice.ny - 1, PAPER.size)):
        x, y, _ = lattice.pose(i, j, 0)
        assert abs(x - corner[0]) < lattice.spacing
        assert abs(y - corner[1]) < lattice.spacing
    assert lattice.pose(0, 0, 0).x <= 0
    assert lattice.pose(lattice.nx - 1, 0, 0).x >= PAPER.size[0]


def test_the_snapshot_taken_by_the_camera_is_recognised_without_any_difference(undisturbed):
    looked_up = opened(undisturbed)
    with Arena(PAPER, SETTINGS) as world:
        model = survey(world, SETTINGS, PAPER.home, np.random.default_rng(0))
    assert np.array_equal(model.features(looked_up.histogram(PAPER.home)), np.ones(SETTINGS.n_features))


def test_a_view_off_the_lattice_is_that_of_the_nearest_lattice_pose(undisturbed):
    looked_up = opened(undisturbed)
    for x, y, heading in ((0.04, -0.04, 0.5), (-0.04, 0.04, -0.5), (0, 0, 2 * np.pi)):
        near = Pose(PAPER.home.x + x, PAPER.home.y + y, PAPER.home.heading + heading)
        assert np.array_equal(looked_up.histogram(near), looked_up.histogram(PAPER.home))
    turned = PAPER.home._replace(heading=PAPER.home.heading - 0.55)
    fifth = PAPER.home._replace(heading=PAPER.home.heading + 5 * np.pi / 3)
    assert np.array_equal(looked_up.histogram(turned), looked_up.histogram(fifth))


@pytest.mark.parametrize("spacing", [0.1, 0.02])
def test_clearance_errs_by_no_more_than_half_a_cells_diagonal(undisturbed, fine, spacing):
    # A clearance changes by no more than the distance moved, and the mean distance to a cell's corners is at most that.
    looked_up, rng = fine if spacing == 0.02 else opened(undisturbed), np.random.default_rng(0)
    bound = spacing / sqrt(2) + 1e-3  # Bullet's own accuracy
    with Arena(PAPER, SETTINGS) as world:
        for _ in range(500):
            x, y, _ = free_pose(world, PAPER, rng)
            assert abs(looked_up.clearance(x, y) - world.clearance(x, y)) <= bound


@pytest.mark.parametrize("spacing", [0.1, 0.02])
def test_wherever_a_robot_can_get_there_is_a_view(undisturbed, fine, spacing):
    looked_up = fine if spacing == 0.02 else opened(undisturbed)
    settings = SETTINGS.with_changes(survey_steps=20_000, forward_m=0.2, turn_advance_m=0.2, wheel_slip=0.5)
    survey(looked_up, settings, PAPER.home, np.random.default_rng(0))


def test_outside_the_room_everything_is_in_the_way(undisturbed):
    looked_up = opened(undisturbed)
    for x, y in ((-0.2, 0.5), (0.5, -0.2), (1.4, 0.5), (0.5, 1.3), (-9, -9), (np.nan, 0.5)):
        assert looked_up.clearance(x, y) < 0


def test_inside_an_obstacle_there_is_no_view_and_the_error_says_where(fine):
    with pytest.raises(ValueError, match=r"pose \(1.110, 0.500\).*cannot stand there"):
        fine.histogram(Pose(1.11, 0.50, 0.0))  # the television


def test_a_seed_fixes_a_run_with_an_atlas_to_the_bit(undisturbed, monkeypatch):
    monkeypatch.setattr(atlas, "FOLDER", undisturbed)
    once, again = run(SETTINGS, 3), run(SETTINGS, 3)
    assert len(once.steps) > 50
    assert once.steps.tobytes() == again.steps.tobytes()
    assert once.steps.tobytes() != run(SETTINGS, 4).steps.tobytes()


def test_similarity_along_an_episode_follows_the_cameras(undisturbed, monkeypatch):
    # At the lattice pose nearest to each step's.
    monkeypatch.setattr(atlas, "FOLDER", undisturbed)
    lattice = Lattice(PAPER, SETTINGS)
    with HomingEnv(SETTINGS, observation="features") as env, Arena(PAPER, SETTINGS) as world:
        _, info = env.reset(seed=0)
        for action in (2, 0, 2, 1, 0, 2):
            x, y, heading = info["pose"]
            k = round((heading - PAPER.home.heading) / (2 * np.pi) * lattice.headings)
            i, j = round((x - lattice.x0) / lattice.spacing), round((y - lattice.y0) / lattice.spacing)
            nearest = lattice.pose(i, j, k)
            assert hypot(nearest.x - x, nearest.y - y) <= lattice.spacing / sqrt(2)
            assert info["similarity"] == pytest.approx(env.model.features(world.histogram(nearest)).mean(), abs=1e-12)
            *_, info = env.step(action)


# Building


def test_one_worker_and_two_write_the_same_bytes(undisturbed, tmp_path):
    opened(tmp_path, workers=2)
    assert hashes(tmp_path) == hashes(undisturbed)


def test_killing_its_building_anywhere_and_starting_again_gives_the_same_bytes(undisturbed, tmp_path):
    for moment in (0, 1, 3, 5):  # parts done, of five: then they are joined
        building = start(tmp_path)
        wait_for_parts(tmp_path, moment, building)
        building.kill()  # if it has not ended by now; its workers live on for a moment
        building.wait()
    opened(tmp_path)
    assert hashes(tmp_path) == hashes(undisturbed)


def test_nothing_but_the_atlas_is_left_of_its_building(undisturbed):
    assert {path.suffix for path in undisturbed.iterdir()} == {".npz", ".lock"}


def test_a_finished_part_is_kept_and_a_damaged_one_named_and_made_again(undisturbed, tmp_path, capsys):
    building = start(tmp_path)
    wait_for_parts(tmp_path, 2, building)
    os.killpg(building.pid, signal.SIGKILL)
    building.communicate()
    damaged, *_ = kept = sorted(parts(tmp_path))
    ages = {part: part.stat().st_mtime_ns for part in kept}
    damaged.write_bytes(damaged.read_bytes()[:-9])
    rendered = []
    with pytest.MonkeyPatch.context() as patch:
        render = atlas._render_block
        patch.setattr(atlas, "_render_block", lambda part, *rest: (rendered.append(part), render(part, *rest)))
        patch.setattr(atlas, "digest", lambda *_: damaged.parent.name.removeprefix("paper-"))  # of the code, unpatched
        opened(tmp_path)
    assert damaged in rendered
    assert not {part for part in ages if part != damaged} & set(rendered)
    assert f"{damaged}: damaged file" in capsys.readouterr().err
    assert hashes(tmp_path) == hashes(undisturbed)


def test_two_processes_that_build_at_once_both_succeed(undisturbed, tmp_path):
    both = [start(tmp_path), start(tmp_path)]
    output, errors = zip(*(building.communicate() for building in both), strict=True)
    assert [building.returncode for building in both] == [0, 0], errors
    assert output[0] == output[1]
    assert hashes(tmp_path) == hashes(undisturbed)
    assert sum("another process is building" in error for error in errors) <= 1


def test_ctrl_c_is_one_line_and_building_goes_on_from_there(undisturbed, tmp_path):
    building = start(tmp_path)
    wait_for_parts(tmp_path, 1, building)
    os.killpg(building.pid, signal.SIGINT)  # as a terminal sends it: to workers too
    _, errors = building.communicate()
    assert building.returncode == 130
    assert said(errors) == ["homing: interrupted; what was finished is kept; the same command resumes from there"]
    assert parts(tmp_path)
    opened(tmp_path)
    assert hashes(tmp_path) == hashes(undisturbed)


def test_a_full_disk_is_one_line(tmp_path):
    building = start(tmp_path, "import resource\nresource.setrlimit(resource.RLIMIT_FSIZE, (100, 100))\n" + PROGRAM)
    _, errors = building.communicate()
    assert building.returncode == 1
    assert [line.startswith("homing: ") for line in said(errors)] == [True], errors


# Damaged and outdated atlases


@pytest.mark.parametrize("harm", ["truncated", "one byte", "emptied"])
def test_a_damaged_atlas_is_named_and_built_anew(stored, undisturbed, harm, capsys):
    content = bytearray(stored.read_bytes())
    if harm == "truncated":
        content = content[: len(content) // 2]
    elif harm == "one byte":
        content[len(content) // 2] ^= 1
    else:
        content = bytearray()
    stored.write_bytes(content)
    opened(stored.parent)
    (line,) = said(capsys.readouterr().err)
    assert line.startswith(f"homing: {stored}: damaged file") and line.endswith("it is built anew")
    assert hashes(stored.parent) == hashes(undisturbed)


def test_wherever_a_bit_is_flipped_an_atlas_is_refused_or_the_same(stored):
    content, sound = stored.read_bytes(), atlas._read(stored)
    assert sound is not None
    directory = content.rindex(b"clearance_m.npyPK") - 300  # what zip itself does not check lies near the end
    for place in (*range(directory, len(content)), *range(0, directory, 997)):
        harmed = bytearray(content)
        harmed[place] ^= 1 << place % 8
        stored.write_bytes(harmed)
        arrays = atlas._read(stored)
        assert arrays is None or all(np.array_equal(arrays[name], sound[name]) for name in sound)


def test_a_sound_atlas_is_loaded_without_a_word(stored, capsys, monkeypatch):
    monkeypatch.setattr(atlas, "_build", None)
    opened(stored.parent)
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("outdated_by", ["room", "code"])
def test_an_outdated_atlas_is_replaced(stored, outdated_by, monkeypatch):
    room = PAPER
    if outdated_by == "room":
        room = replace(PAPER, texture_seed=1)
    else:
        source = atlas.inspect.getsource
        monkeypatch.setattr(atlas, "_source", lambda part: source(part) + "# changed")
    before = opened(stored.parent)
    changed = opened(stored.parent, SETTINGS, room)
    assert not stored.exists()
    assert len(hashes(stored.parent)) == 1
    same = np.array_equal(changed.histogram(PAPER.home), before.histogram(PAPER.home))
    assert same == (outdated_by == "code")


def test_an_atlas_of_other_settings_is_kept_beside_it(stored):
    before = stored.read_bytes()
    opened(stored.parent, SETTINGS.with_changes(field_of_view_deg=60))
    assert stored.read_bytes() == before
    assert len(hashes(stored.parent)) == 2


def test_the_name_depends_on_every_setting_that_rendering_asks_for(tmp_path):
    class Listening:
        asked: set[str] = set()  # noqa: RUF012

        def __getattr__(self, name):
            self.asked.add(name)
            return getattr(SETTINGS, name)

    atlas._render_block(tmp_path / "0000.npz", range(3, 4), PAPER, Listening())
    assert Listening.asked == set(SETTINGS.of_scope("view", "lattice"))


def test_the_name_depends_on_nothing_that_only_learning_asks_for():
    assert atlas.digest(PAPER, SETTINGS) == atlas.digest(PAPER, SETTINGS.with_changes(alpha0=0.5, max_steps=7))


def test_an_atlas_of_altered_values_or_of_another_name_is_not_taken_for_what_was_written(stored, undisturbed, capsys):
    sound, (about, arrays) = hashes(undisturbed), read_arrays(stored)
    arrays["clearance_m"] = arrays["clearance_m"][::-1]
    stored.write_bytes(npz_bytes(about, arrays))
    assert atlas._read(stored) is None
    renamed = stored.with_name("paper-00000000-00000000-00000000.npz")
    shutil.copy(next(undisturbed.glob("*.npz")), renamed)
    assert atlas._read(renamed) is None
    renamed.unlink()
    opened(stored.parent)
    assert hashes(stored.parent) == sound


def test_who_builds_an_atlas_goes_with_the_parent_within_ten_seconds(tmp_path):
    building = start(tmp_path)
    wait_for_parts(tmp_path, 1, building)
    workers = psutil.Process(building.pid).children(recursive=True)
    os.kill(building.pid, signal.SIGKILL)
    building.wait()
    assert workers
    _, alive = psutil.wait_procs(workers, timeout=10)
    assert not alive
