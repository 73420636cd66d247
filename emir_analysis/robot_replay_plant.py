"""The whole robot replayed: recorded valve commands in, sensors and truth against the recorded."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from emir_analysis.control_protocols import Signals
from emir_analysis.replay_plant import check_recorded, check_start, finite, number
from emir_analysis.robot_files import FILES, robot_of
from emir_analysis.robot_machine import commands, sensor_signals
from emir_analysis.robot_setup import Posture
from emir_analysis.stamped import FieldComparison, by_stamp, compared
from emir_common.parameter_tree import declared, with_values
from emir_common.quantity import ParameterError
from emir_msgs_py.robot_topics import ROBOT_PLANT_TOPICS, ROBOT_VALVE_COMMAND
from emir_msgs_py.topics import PLANT_PERIOD, PLANT_PERIOD_NS
from emir_plant.plant import SimulationError
from emir_plant.robot.plant import RobotPlant
from emir_plant.robot.reach import PostureError

MAIN = "main."  # joint 1's parameters have no such word in front of them in the graph
ANGLES = "initial_angles."
PRESSURE = "initial_pressure_lowering"

Array = NDArray[np.float64]
Rows = list[tuple[Signals, Signals]]


def replay_robot_plant(
    bag: Path, values: Mapping[str, Any], changed: Mapping[str, Any]
) -> list[FieldComparison]:
    """Simulate the recorded robot under the recorded valve commands.

    values: parameters of the recorded plant node by dotted name, over which those that are changed
    prevail. Raises as `replay_plant`.
    """
    check_recorded(bag, values, (PRESSURE,))
    given = {**values, **changed}
    machine = robot_of(given)
    paths = {path.removeprefix(MAIN): path for path in declared(machine)}
    start = {f"{ANGLES}{joint}" for joint in declared(Posture())}
    for name in changed:
        if name not in paths and name not in {*start, *FILES, PRESSURE}:
            raise ParameterError(f"plant: {name}: there is no such parameter")
    try:
        machine = with_values(machine, {paths[k]: v for k, v in given.items() if k in paths})
        angles = {k.removeprefix(ANGLES): v for k, v in given.items() if k in start}
        posture = with_values(Posture(), angles)
    except ParameterError as error:
        raise ParameterError(f"plant: {error}") from None
    pressure = number(PRESSURE, given[PRESSURE])
    outputs = by_stamp(bag, ROBOT_PLANT_TOPICS, PLANT_PERIOD_NS)
    orders = by_stamp(bag, (ROBOT_VALVE_COMMAND,), PLANT_PERIOD_NS)
    check_start(bag, outputs, orders)
    plant = RobotPlant(machine)
    try:
        state = plant.initial(posture.angles, pressure)
        return compared(ROBOT_PLANT_TOPICS, _rows(plant, state, orders, outputs))
    except (PostureError, SimulationError) as error:
        raise ParameterError(f"plant: {error}") from None


def _rows(
    plant: RobotPlant, state: Array, orders: dict[int, Signals], outputs: dict[int, Signals]
) -> Rows:
    """Return recorded and simulated signals of every plant period."""
    truth = plant.outputs(state)
    rows: Rows = []
    for tick in range(len(outputs)):
        stamp = tick * PLANT_PERIOD_NS
        if stamp not in outputs:
            break  # a gap: what follows has no known command
        rows.append((outputs[stamp], sensor_signals(plant, truth, tick)))
        if stamp not in orders:
            break  # the run's end
        valves = {name: finite(value) for name, value in orders[stamp].items()}
        state, truth = plant.step(state, commands(valves), PLANT_PERIOD)
    return rows
