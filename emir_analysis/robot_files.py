"""Which robot it is, by the parameters that name its sheets."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from emir_plant.robot.parameters import Robot
from emir_plant.robot.sheet import robot

FILES = ("robot_file", "machine_file")  # the parameters; empty: EMIR's own


def robot_of(values: Mapping[str, Any]) -> Robot:
    """Return the robot of a node's parameters by name, FILES among them.

    Raises ParameterError, naming file and key.
    """
    own, main = (Path(str(values[name])) if values.get(name) else None for name in FILES)
    return robot(own, main)
