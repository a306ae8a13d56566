"""One table of what this project reaches and costs: `rows()` of every module in this folder.

rows() yields (name, value, unit, bound): bound is the largest value allowed, or None.
"""

import importlib
from pathlib import Path

for path in sorted(Path(__file__).parent.glob("[!_]*.py")):
    for name, value, unit, bound in importlib.import_module(f"{__package__}.{path.stem}").rows():
        limit = "" if bound is None else f"  (at most {bound:g})"
        mark = "  OVER" if bound is not None and value > bound else ""
        print(f"{name:<82} {value:>10.4g} {unit:<10}{limit}{mark}", flush=True)
