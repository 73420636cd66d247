"""The machine that was found, as a parameter file of the plant node."""

import dataclasses
from pathlib import Path
from typing import Any

import yaml

from emir_analysis.outputs import write_text
from emir_plant.parameters import Machine
from emir_plant.unnamed import UNNAMED


def write_model(file: Path, machine: Machine, recording: str) -> None:
    """Write a machine as ROS 2 parameters of the plant node, effects included.

    `emir run --params`, `ros2 run ... --params-file` and `emir design --from` read it. Raises
    InputError when the file cannot be written.
    """
    groups = {name: _plain(group) for name, group in vars(machine).items() if name != "effects"}
    for name in UNNAMED:
        if not getattr(machine, name).over:
            del groups[name]
    effects = {
        name: _plain(effect) for name, effect in vars(machine.effects).items() if effect.is_on
    }
    content = {"/**/plant_node": {"ros__parameters": groups | {"effects": effects}}}
    if not effects:
        del content["/**/plant_node"]["ros__parameters"]["effects"]
    head = f"# The machine as found by emir diagnose from {recording}. SI units.\n"
    write_text(file, head + yaml.safe_dump(content, sort_keys=False))


def _plain(group: Any) -> dict[str, float]:
    return dict(dataclasses.asdict(group))
