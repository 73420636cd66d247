"""The machine replayed: recorded valve commands in, sensors and truth against the recorded ones."""

import math
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from emir_analysis.errors import InputError
from emir_analysis.node_controls import plant_signals
from emir_analysis.stamped import FieldComparison, by_stamp, compared
from emir_common.parameter_tree import declared, with_values
from emir_common.quantity import ParameterError
from emir_msgs_py.topics import PLANT_PERIOD, PLANT_PERIOD_NS, PLANT_TOPICS, VALVE_COMMAND
from emir_plant.plant import Plant, SimulationError
from emir_plant.sensors import measure
from emir_plant.sheet import joint1, load_sheet

NODE = "plant_node"
START = ("initial_angle", "initial_pressure_lowering")
FILE = "machine_file"


def replay_plant(
    bag: Path, recorded: Mapping[str, Any], changed: Mapping[str, Any]
) -> list[FieldComparison]:
    """Simulate the recorded machine under the recorded valve commands.

    recorded: parameters of the recorded plant node by dotted name, over which those that are
    changed prevail. Raises InputError for a recording without the machine's parameters or topics or
    not in lock step, ParameterError for a parameter that does not exist or is out of range.
    """
    check_recorded(bag, recorded, START)
    values = {**recorded, **changed}
    machine = load_sheet(Path(str(values[FILE]))).machine if values.get(FILE) else joint1()
    known = declared(machine)
    for name in changed:
        if name not in known and name not in {*START, FILE}:
            raise ParameterError(f"plant: {name}: there is no such parameter")
    try:
        machine = with_values(machine, {k: v for k, v in values.items() if k in known})
    except ParameterError as error:
        raise ParameterError(f"plant: {error}") from None
    outputs = by_stamp(bag, PLANT_TOPICS, PLANT_PERIOD_NS)
    commands = {
        stamp: signals["valve_command"]
        for stamp, signals in by_stamp(bag, (VALVE_COMMAND,), PLANT_PERIOD_NS).items()
    }
    check_start(bag, outputs, commands)
    start = [number(name, values[name]) for name in START]
    try:
        return compared(PLANT_TOPICS, _rows(Plant(machine), start, commands, outputs))
    except SimulationError as error:
        raise ParameterError(f"plant: {error}") from None


def check_recorded(bag: Path, values: Mapping[str, Any], needed: Collection[str]) -> None:
    """Raise InputError where the recording does not say how the machine was set up."""
    if not values.keys() >= set(needed):
        raise InputError(f"{bag}: holds no parameters of {NODE}: not recorded by emir run?")


def check_start(bag: Path, outputs: Collection[int], commands: Collection[int]) -> None:
    """Raise InputError where the recording, by its stamps, does not begin at the start."""
    if 0 not in outputs or 0 not in commands:
        raise InputError(f"{bag}: nothing at t = 0 s: not recorded in lock step?")


def number(name: str, value: Any) -> float:
    """Return a parameter of how the machine starts; raises ParameterError for no number."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ParameterError(f"plant: {name} = {value!r}: not a number")
    return float(value)


def finite(command: float) -> float:
    """Return the command that the machine obeys: what is not a number shuts the valve."""
    return command if math.isfinite(command) else 0.0


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
        rows.append((outputs[stamp], plant_signals(measure(plant, truth, tick, state), truth)))
        command = finite(commands.get(stamp, command))
        state, truth = plant.step(state, command, PLANT_PERIOD)
    return rows
