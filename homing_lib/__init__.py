"""A robot that learns to find a home it cannot see: the model of Altahhan (2014), its world and its study."""

import sys

try:
    import gymnasium
except KeyboardInterrupt:  # of the command, which loads this first
    sys.exit(130)

# By name, so that the simulator is loaded when the first environment is made, and not for the mathematics alone.
gymnasium.register("homing/UTurn-v0", entry_point="homing_lib.environment:HomingEnv")
