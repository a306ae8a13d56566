"""Without PyBullet, which exists for Linux on x86-64 alone, everything runs but the camera; that is one line."""

import subprocess
import sys

import numpy as np
import pytest

from homing_lib import atlas
from homing_lib.agent import run
from homing_lib.atlas import COMPACT, Lattice, open_compact, read_compact
from homing_lib.environment import HomingEnv
from homing_lib.errors import UserError
from homing_lib.publish import compact
from homing_lib.rooms import PAPER
from homing_lib.settings import Settings
from homing_lib.storage import ROOT
from tests.conftest import needs_camera

SETTINGS = Settings(images="compact", episodes=2)

WITHOUT = "import sys\nsys.modules['pybullet'] = None\n"
"""As where it is not installed."""


def python(program: str) -> str:
    """What a new process says on its output."""
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


# Without PyBullet


def test_importing_the_library_loads_no_simulator():
    modules = [
        ".".join(path.relative_to(ROOT).with_suffix("").parts)
        for path in ROOT.glob("homing_lib/**/*.py")
        if path.stem not in ("arena", "__main__")
    ]
    assert "homing_lib.study.measures" in modules
    program = f"import importlib, sys\nfor name in {modules}: importlib.import_module(name)\nprint(*sys.modules)"
    loaded = python(program).split()
    assert set(modules) - {name for name in modules if name.endswith("__init__")} <= set(loaded)
    assert not {"pybullet", "homing_lib.arena"} & set(loaded)


def test_ten_robots_learn_on_the_compact_atlas_without_pybullet_as_they_do_with_it():
    program = """
from homing_lib.agent import run
from homing_lib.settings import Settings
for seed in range(10):
    result = run(Settings(images="compact"), seed)
    print(seed, result.reached.sum(), *result.lengths)
"""
    here = python(program)
    assert python(WITHOUT + program) == here
    reached = [int(line.split()[1]) for line in here.splitlines()]
    assert len(reached) == 10
    assert min(reached) >= 15  # of 20 episodes


REMEDY = ("PyBullet", "pip install pybullet", 'choose images="compact"', 'observation="features"')
REFUSED = {
    "run": ("main(['run'])", REMEDY),
    "environment": ("report(lambda: HomingEnv())", REMEDY),
    "atlas": ("report(lambda: open_atlas(PAPER, Settings(images='atlas'), Path('nowhere')))", REMEDY),
    "rendering": ("env.reset(); report(env.render)", REMEDY[:2]),  # for which the rest of it has no use
    "film": ("main(['film'])", REMEDY[:2]),  # of which none could be made on the compact atlas
    "verify": ("main(['verify'])", REMEDY[:2]),
}


@pytest.mark.parametrize("what", REFUSED)
def test_without_pybullet_the_camera_is_refused_in_one_line_with_the_remedy(what):
    attempt, words = REFUSED[what]
    program = f"""
from pathlib import Path
from homing_lib.publish.cli import main
from homing_lib.atlas import open_atlas
from homing_lib.environment import HomingEnv
from homing_lib.errors import UserError
from homing_lib.rooms import PAPER
from homing_lib.settings import Settings
def report(attempt):
    try:
        attempt()
    except UserError as error:
        print("homing:", error, file=sys.stderr)
env = HomingEnv(images="compact", observation="features", render_mode="rgb_array")
sys.stderr = sys.stdout
{attempt}
"""
    (line,) = python(WITHOUT + program).splitlines()
    assert line.startswith("homing: ")
    assert [word for word in REMEDY if word in line] == [*words]


@needs_camera
def test_an_atlas_that_was_built_elsewhere_is_looked_up_without_pybullet(tmp_path):
    program = f"""
from pathlib import Path
from homing_lib import atlas
from homing_lib.rooms import PAPER
from homing_lib.settings import Settings
settings = Settings(images="atlas", image_size=8, atlas_spacing_m=0.1, atlas_heading_deg=90)
print(atlas.open_atlas(PAPER, settings, Path("{tmp_path.as_posix()}"), workers=1).histogram(PAPER.home).sum())
"""
    # The name of an atlas holds the packages that made it: none, where there is none.
    unpacked = "import importlib.metadata\nimportlib.metadata.distributions = lambda **_: iter(())\n"
    once = python(program)
    assert python(WITHOUT + unpacked + program) == once


# The compact atlas


def test_the_compact_atlas_is_small_and_says_what_it_holds():
    header, looked_up = read_compact(COMPACT)
    assert COMPACT.stat().st_size < 4e6
    settings = Settings(**header["settings"])
    lattice = Lattice(PAPER, settings)
    assert settings == compact.SETTINGS.with_changes(images="camera")
    assert (header["x0"], header["y0"]) == lattice.pose(0, 0, 0)[:2]
    assert looked_up.clearance_m.shape == (lattice.nx, lattice.ny)
    free = (looked_up.clearance_m >= -header["margin_m"]).sum()
    assert looked_up.infrared_m.shape == (free, lattice.headings, 8)
    assert looked_up.counts.shape == (free, lattice.headings, settings.n_features)
    pixels = looked_up.counts.reshape(free, lattice.headings, 3, -1).sum(axis=3)
    assert (pixels == settings.image_size**2).all()


def test_the_compact_atlas_is_what_the_camera_sees_to_the_bit(arena):
    looked_up, lattice = open_compact(PAPER, SETTINGS), Lattice(PAPER, compact.SETTINGS)
    rng = np.random.default_rng(0)
    for i, j, k in rng.integers((lattice.nx - 1, lattice.ny - 1, lattice.headings), size=(150, 3)):
        pose = lattice.pose(int(i), int(j), int(k))
        assert looked_up.clearance_m[i, j] == arena.clearance(*pose[:2])
        assert np.array_equal(looked_up.histogram(pose), arena.histogram(pose))
        assert np.array_equal(looked_up.infrared(pose), arena.infrared(pose))


def test_written_again_it_is_the_same_to_the_byte_and_a_run_on_it_is_one_on_the_atlas_it_was_made_from(
    arena, tmp_path, monkeypatch
):
    few = dict(image_size=16, atlas_spacing_m=0.1, atlas_heading_deg=60, survey_steps=50, max_steps=60)
    settings, on_atlas = (SETTINGS.with_changes(images=images, **few) for images in ("compact", "atlas"))
    monkeypatch.setattr(atlas, "FOLDER", tmp_path)
    once, again = tmp_path / "once.atlas", tmp_path / "again.atlas"
    for path in (once, again):
        compact.write(path, on_atlas)
    assert once.read_bytes() == again.read_bytes()
    monkeypatch.setattr(atlas, "COMPACT", once)
    assert run(settings, 3).steps.tobytes() == run(on_atlas, 3).steps.tobytes()


@pytest.mark.parametrize(
    ("changes", "held"),
    [
        ({"bin_size": 4}, "bin_size = 3, not 4"),
        ({"light": 0.97}, "light = 1.0, not 0.97"),
        ({"room": "attic"}, "room = paper, not attic"),
        ({"atlas_spacing_m": 0.03}, "atlas_spacing_m = 0.04, not 0.03"),
        ({"atlas_spacing_m": 0.04, "atlas_heading_deg": 20}, None),
    ],
)
def test_the_compact_atlas_stands_in_for_no_other(changes, held):
    if held is None:
        HomingEnv(SETTINGS, observation="features", **changes).close()
        return
    with pytest.raises(UserError) as refusal:
        HomingEnv(SETTINGS, observation="features", **changes)
    line = str(refusal.value)
    assert held in line and 'images="atlas"' in line and "\n" not in line


@pytest.mark.parametrize("kind", ["missing", "damaged", "outdated"])
def test_a_compact_atlas_that_is_not_there_not_whole_or_not_of_this_room_is_one_line(kind, tmp_path, monkeypatch):
    path = tmp_path / "compact.atlas"
    if kind != "missing":
        path.write_bytes(COMPACT.read_bytes()[: -9 if kind == "damaged" else None])
    if kind == "outdated":
        monkeypatch.setattr(atlas, "hashed", lambda room: "otherwise")
    monkeypatch.setattr(atlas, "COMPACT", path)
    with pytest.raises(UserError) as refusal:
        HomingEnv(SETTINGS, observation="features")
    assert str(refusal.value).startswith(f"{path}: {kind} file")
    assert "\n" not in str(refusal.value)
