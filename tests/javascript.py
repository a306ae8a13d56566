"""A JavaScript engine in a wheel, which runs the demonstration's model without a browser."""

import gzip
import json
from typing import Any

import pytest

from homing_lib.atlas import COMPACT
from homing_lib.publish import demo

mini_racer = pytest.importorskip("py_mini_racer", reason="needs mini-racer, a JavaScript engine in a wheel")

HARNESS = """
function run(world, settings, seed) {
  const experiment = new Experiment(world, settings, seed);
  while (experiment.step());
  return experiment;
}
const NAMES = ["x", "y", "heading", "action", "reward", "similarity", "delta", "lambda", "clipped", "change", "atWall"];
const rows = (episodes) => episodes.map(({ steps }) => steps.map((step) => NAMES.map((name) => +step[name])));
"""


class Engine:
    """A JavaScript engine that has read the page's model, and its atlas as `world`."""

    def __init__(self) -> None:
        self._context = mini_racer.MiniRacer()
        self._context.eval(demo.scripts() + HARNESS)
        content = gzip.decompress(COMPACT.read_bytes())
        self._context.eval(f"const content = new ArrayBuffer({len(content)}); content")[:] = content
        self._context.eval("const world = new Atlas(new Uint8Array(content))")

    def close(self) -> None:
        self._context.close()

    def __call__(self, script: str, **given: Any) -> Any:
        """What a script returns, with these names in it."""
        names = "".join(f"const {name} = {json.dumps(value)};" for name, value in given.items())
        return json.loads(self._context.eval(f"JSON.stringify((() => {{ {names} {script} }})())"))
