"""The demonstration: one HTML file that plays the random walk and the robot in a browser, from disk and offline.

`homing demo` puts it together from notebooks/demo/: page.html, page.css and the scripts, and what
they need of the library: DATA, which is settings, room, colours and verdicts; the room's textures; the compact atlas.
"""

import json
from base64 import b64encode
from typing import Any

import matplotlib
import numpy as np

from homing_lib.atlas import COMPACT
from homing_lib.publish import style
from homing_lib.rooms import PAPER, Room, Texture
from homing_lib.settings import Settings
from homing_lib.storage import ROOT, present, write_bytes
from homing_lib.study import findings
from homing_lib.study.walk import EPISODES, RACE_SIZES
from homing_lib.surfaces import Image, paint

SOURCES = ROOT / "notebooks" / "demo"
PAGE = ROOT / "notebooks" / "executed" / "demo.html"

CORE = ("random.js", "learner.js", "world.js", "agent.js", "own.js", "compare.js", "camera.js")
"""The model in JavaScript, in the order in which it is read; it needs no browser."""

VIEW = ("draw.js", "state.js", "play.js", "walk.js", "robot.js", "room.js", "curves.js", "page.js")
"""What is shown of it, and how it is controlled."""

SHOWN = {"walk": ("C1", "conjugate"), "robot": ("drives", "varying", "worth", "C8", "C9")}
"""The claims and questions that a view is about."""

SIDE = 128  # texels along a texture's side, every second one: an average would have no grain


def scripts(names: tuple[str, ...] = CORE) -> str:
    """These scripts as one."""
    return "\n".join(source(name) for name in names)


def source(name: str) -> str:
    """The text of a file of the page."""
    return present(SOURCES / name).read_text(encoding="utf-8")


def build() -> str:
    """The whole page."""
    room, textures = room_data(PAPER)
    data = {
        "settings": Settings(images="compact").model_dump(mode="json"),
        "room": room,
        "side": SIDE,
        "cividis": [
            matplotlib.colors.to_hex(colour) for colour in matplotlib.colormaps["cividis"](np.arange(0, 256, 4))
        ],
        "stepSizes": RACE_SIZES,
        "firstWalks": EPISODES,
        "claims": {view: [judged(name) for name in names] for view, names in SHOWN.items()},
    }
    parts = {
        "/* page.css */": palette() + source("page.css"),
        "// DATA": f"const DATA = {json.dumps(data, sort_keys=True)};",
        "// scripts": scripts(CORE + VIEW),
        "<!-- textures -->": b64encode(np.stack(textures).tobytes()).decode(),
        "<!-- atlas -->": b64encode(COMPACT.read_bytes()).decode(),
    }
    page = source("page.html")
    for mark, content in parts.items():
        page = page.replace(mark, content)
    return page


def judged(name: str) -> dict[str, str]:
    """A claim or question with its verdict, as the page says it, and what stands beside that."""
    found = findings.finding(name)
    by = "The paper says: " if found.question.is_claim else ""
    beside = ""
    if name == "drives":  # one comparison that is undecided makes its verdict sound as if the rooms differed
        together = [one.verdict for one in found.comparisons.values() if one.judged]
        fewer = f"{together.count('fewer')} of {len(together)} comparisons"
        beside = f" (with both it takes fewer steps than with one of them in {fewer})"
    return {"claim": f"{by}{found.question.text}", "verdict": found.verdict, "beside": beside}


def palette() -> str:
    """The colours of the figures, as custom properties of CSS."""
    names = ("BLUE", "ORANGE", "GREEN", "SKY", "GREY", "INK")
    colours = "".join(f"--{name.lower()}: {getattr(style, name)}; " for name in names)
    return f":root {{ {colours}--pink: {style.PINK}; }}\n"


def room_data(room: Room) -> tuple[dict[str, Any], list[Image]]:
    """A room as the page's camera reads it, and the textures that it counts, each SIDE x SIDE x 3."""
    textures: list[Image] = []

    def painted(texture: Texture, name: str) -> int:
        textures.append(paint(texture, room.texture_seed, name)[::2, ::2])
        return len(textures) - 1

    def thing(item: Any) -> dict[str, Any]:
        texture = painted(item.texture, item.name)
        front = getattr(item, "front", None)
        shape = {name: value for name, value in vars(item).items() if name not in ("texture", "front")}
        faces = {"texture": texture, "front": painted(front, item.name) if front else texture}
        return shape | faces | {"kind": type(item).__name__}

    def picture(number: int, item: Any) -> dict[str, Any]:
        return {**vars(item), "texture": painted(item.texture, f"picture {number}"), "rgb": item.texture.rgb}

    described = {
        "size": room.size,
        "wallHeight": room.wall_height,
        "floor": painted(room.floor, "floor"),
        "walls": {name: painted(texture, f"{name} wall") for name, texture in room.walls.items()},
        "colours": {name: texture.rgb for name, texture in room.walls.items()},
        "objects": [thing(item) for item in room.objects],
        "pictures": [picture(number, item) for number, item in enumerate(room.pictures, start=1)],
    }
    return described, textures


def write() -> None:
    """Write the page. The same sources and data give the same bytes."""
    write_bytes(PAGE, build().encode())
