"""The machine replayed: recorded valve commands in, sensors and truth against the recorded ones."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from emir_analysis import bags
from emir_analysis.errors import InputError
from emir_analysis.info import PARAMETERS
from emir_analysis.stamped import FieldComparison, by_stamp, compared
from emir_common.parameter_tree import declared, with_values
from emir_common.quantity import ParameterError
from emir_msgs_py.topics import PLANT_PERIOD_NS, TOPICS, TRUTH, VALVE_COMMAND
from emir_plant.plant import Plant
from emir_plant.sensors import measure
from emir_plant.sheet import joint1

NODE = "plant_node"
OUTPUTS = tuple(topic for topic in TOPICS if topic.publisher == NODE)
START = ("initial_angle", "initial_pressure_lowering")


def replay_plant(bag: Path, changed: Mapping[str, Any]) -> list[FieldComparison]:
    """Simulate the recorded machine under the recorded valve commands.

    changed: parameters by dotted name, over the recorded ones. Raises InputError for a recording
    without the machine's parameters or topics or not in lock step, ParameterError for a parameter
    that does not exist or is out of range.
    """
    values = {**recorded_parameters(bag), **changed}
    machine = joint1()
    known = declared(machine)
    for name in changed:
        if name not in known and name not in START:
            raise ParameterError(f"plant: {name}: there is no such parameter")
    try:
        machine = with_values(machine, {k: v for k, v in values.items() if k in known})
    except ParameterError as error:
        raise ParameterError(f"plant: {error}") from None
    outputs = by_stamp(bag, OUTPUTS, PLANT_PERIOD_NS)
    commands = {
        stamp: signals["valve_command"]
        for stamp, signals in by_stamp(bag, (VALVE_COMMAND,), PLANT_PERIOD_NS).items()
    }
    if 0 not in outputs or 0 not in commands:
        raise InputError(f"{bag}: nothing at t = 0 s: not recorded in lock step?")
    start = [float(values[name]) for name in START]
    return compared(OUTPUTS, _rows(Plant(machine), start, commands, outputs))


def recorded_parameters(bag: Path) -> dict[str, Any]:
    """Return the parameters of the recorded plant node. Raises InputError without them."""
    about = bags.metadata(bag).get(PARAMETERS, {})
    if NODE not in about:
        raise InputError(f"{bag}: holds no parameters of {NODE}: not recorded by emir run?")
    values: dict[str, Any] = json.loads(about[NODE])
    return values


def _rows(
    plant: Plant,
    start: list[float],
    commands: dict[int, float],
    outputs: dict[int, dict[str, float]],
) -> list[tuple[dict[str, float], dict[str, float]]]:
    """Return recorded and simulated signals of every plant period."""
    state = plant.initial(*start)
    truth = plant.outputs(state)
    rows = []
    command = commands[0]
    for tick in range(len(outputs)):
        stamp = tick * PLANT_PERIOD_NS
        if stamp not in outputs:
            break  # a gap: what follows has no known command
        reading = measure(plant, truth, tick, state)
        signals = reading._asdict() | dict(zip(TRUTH.fields, np.asarray(truth), strict=True))
        rows.append((outputs[stamp], {name: float(value) for name, value in signals.items()}))
        command = commands.get(stamp, command)
        state, truth = plant.step(state, command, PLANT_PERIOD_NS * 1e-9)
    return rows
