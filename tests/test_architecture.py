"""The wings of the library: `teach` knows `publish`, that the study, and the study the model; nothing looks up."""

import ast
from pathlib import Path

import pytest

import homing_lib

HOUSE = Path(homing_lib.__file__).parent
FLOOR = {"": 0, "study": 1, "publish": 2, "teach": 3}
DOOR = "__main__.py"
"""Opens to all wings, and nothing knows it."""


def floor(module: str) -> int:
    """Of homing_lib.study.runs: 1."""
    wing = module.split(".")[1:2]
    return FLOOR.get(wing[0], 0) if wing else 0


def imported(code: str) -> set[str]:
    """Everything of the library that some code imports, also inside functions."""
    names = set()
    for node in ast.walk(ast.parse(code)):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            names |= {f"{node.module}.{alias.name}" for alias in node.names} | {node.module}
    return {name for name in names if name.startswith("homing_lib")}


@pytest.mark.parametrize("source", sorted(HOUSE.rglob("*.py")), ids=lambda path: path.relative_to(HOUSE).as_posix())
def test_imports_point_downwards_only_and_not_through_the_door(source):
    names = imported(source.read_text(encoding="utf-8"))
    here = source.relative_to(HOUSE)
    own = FLOOR[here.parts[0] if len(here.parts) > 1 else ""] if here.name != DOOR else 4
    assert [name for name in names if floor(name) > own or "__main__" in name] == []
