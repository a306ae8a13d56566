"""The demonstration's page reads rules as they are typed, draws what the camera sees, is one file, and can be read."""

import itertools
import re

import numpy as np
import pytest

from homing_lib.publish import demo
from homing_lib.rooms import PAPER, Pose
from homing_lib.settings import Settings

STYLE = demo.palette() + demo.source("page.css")


# --- Rules by their text ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "spec"),
    [
        ("gate", ["gate", 0, True, 0]),
        ("gate:opposite:on_zero=0.5", ["gate:opposite", 0.5, True, 1]),
        ("fixed:0.9:unclipped", ["fixed:0.9", 0, False, 0.9]),
        ("own:on_zero=1:unclipped:2 if delta > 0 else 0", ["own", 1, False, 2]),
    ],
)
def test_a_rule_is_written_as_in_the_settings_and_ones_own_after_its_options(engine, text, spec):
    script = "const { name, onZero, clip, rule } = lambdaSpec(text); return [name, onZero, clip, rule(step)];"
    assert engine(script, text=text, step={"delta": 1, "deltaPrev": -1}) == spec


@pytest.mark.parametrize(
    ("text", "word"),
    {
        "magic": "magic",
        "fixed:2": "0, 1",
        "gate:magic": "gate:magic",
        "gate:on_zero=7": "on_zero",
        "own:": "Type",
        "own:dlta / delta_prev": "mean delta?",
        "own:lambda_prev * 2": "λ is what you compute",
        "own:delta = 1": "==",
        "own:delta ^ 2": "**",
        "own:0,5": "0.5",
        "own:abs(0,5)": "0.5",
        "own:np.clip(delta, 0, 1)": "There are delta",
        "own:phi.dot(phi)": "dot(phi, phi_prev)",
        "own:delta > 0 ? 1 : 0": "if condition else",
        "own:(delta": "“)” is missing",
        "own:delta delta_prev": "operator",
        "own:1 if delta > 0": "else b",
        "own:1 and": "missing",
        "own:* 2": "missing before “*”",
        "own:phi": "dot(phi, phi)",
        "own:phi·1": "vector",
        "own:dot(phi, delta)": "two vectors",
        "own:max(1)": "at least 2",
        "own:constructor": "constructor",
        "own:alert(1)": "“alert” is not known. There are",
    }.items(),
)
def test_what_is_no_rule_is_refused_with_the_remedy(engine, text, word):
    script = "try { lambdaSpec(text); return null; } catch (error) { return error.message; }"
    assert word in engine(script, text=text)


def test_a_rule_that_always_divides_by_zero_is_told_from_one_that_may(engine):
    texts = ["1 / 0", "log(-1)", "delta / delta_prev", "1 / (delta + delta_prev)"]
    never = engine("return texts.map((text) => neverDefined(ownRule(text)));", texts=texts)
    assert never == [True, True, False, False]


# --- The file --------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def built() -> str:
    return demo.build()


def test_the_page_is_one_small_file_that_asks_nobody(built):
    assert len(built.encode()) <= 6_000_000
    for reaches_out in ("http:", "https:", "fetch(", "XMLHttpRequest", "import(", "WebSocket", "@import", "eval("):
        assert reaches_out not in re.sub(r'id="(atlas|textures)">[^<]*', "", built)
    assert not re.search("// scripts|// DATA|<!-- (atlas|textures)", built)


def test_the_page_that_is_kept_is_what_its_sources_make(built):
    """Textures aside: their last bits are the processor's."""
    kept, built = (re.sub(r'id="textures">[^<]*', "", text) for text in (demo.PAGE.read_text(encoding="utf-8"), built))
    assert kept == built, "make demo"


def test_the_drawing_shows_what_the_camera_sees(engine, arena):
    room, textures = demo.room_data(PAPER)
    poses = (PAPER.home, PAPER.start, Pose(0.6, 0.3, 1.2), Pose(0.5, 0.7, 2.5))
    drawn = engine(
        """const camera = new Camera(room, Uint8Array.from(texels), side, settings);
           return poses.map((pose) => [...camera.picture(pose, 64)]);""",
        room=room,
        texels=np.stack(textures).ravel().tolist(),
        side=demo.SIDE,
        settings=Settings().model_dump(mode="json"),
        poses=[pose._asdict() for pose in poses],
    )
    for pose, pixels in zip(poses, drawn, strict=True):
        seen, drawing = arena.image(pose)[:, :, :3], np.reshape(pixels, (64, 64, 4))[:, :, :3]
        assert np.corrcoef(seen.ravel(), drawing.ravel())[0, 1] > 0.85


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_every_text_stands_out_from_its_ground(theme):
    light, dark = (dict(re.findall(r"--([\w-]+): ([^;]+);", css)) for css in STYLE.split(':root[data-theme="dark"]'))
    colours = light | dark if theme == "dark" else light

    def luminance(name: str) -> float:
        if reference := re.fullmatch(r"var\(--(.*)\)", colours[name]):
            return luminance(reference[1])
        channels = [int(colours[name][k : k + 2], 16) / 255 for k in (1, 3, 5)]
        return float(np.dot([0.2126, 0.7152, 0.0722], [((c + 0.055) / 1.055) ** 2.4 for c in channels]))

    texts = ("ink", "soft", "link", "error", *(name for name in colours if name.endswith("-text")))
    for text, ground in [*itertools.product(texts, ("paper", "ground")), ("on-accent", "accent")]:
        a, b = sorted(map(luminance, (text, ground)), reverse=True)
        assert (a + 0.05) / (b + 0.05) >= 4.5, (text, ground)
