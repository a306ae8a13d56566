"""Other learners, one a file, behind the protocol of `homing_lib.agent.Agent`: what came after the paper, and before.

Importing this lets settings know them by name: `Settings(controller="true-online")`. A file holds one learner with its
formula, its source and what a step of it costs; it imports the model alone. In the model there is none of them.
"""

from homing_lib.study.methods import simple  # noqa: F401
