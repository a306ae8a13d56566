"""Other learners, one a file, behind the protocol of `homing_lib.agent.Agent`: what came after the paper, and before.

Importing this lets settings know them by name: `Settings(controller="true-online")`. A file holds one learner with its
formula, its source and what a step of it costs; it imports the model alone. In the model there is none of them.

All but the actor-critic choose as `SarsaAgent` does, epsilon-greedily; all begin at theta_0, with rates that fall by
eq. (23), and value home like any view, unless a file says otherwise. What follows a colon in a name is a number that
the method needs beside the step size and lambda. A new file is found by itself.
"""

from importlib import import_module
from pathlib import Path

for _file in sorted(Path(__file__).parent.glob("[a-z]*.py")):
    import_module(f"{__package__}.{_file.stem}")
