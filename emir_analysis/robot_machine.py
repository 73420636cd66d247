"""The simulated robot by the signals of its topics, and the closed loop about it without ROS."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from emir_analysis.control_protocols import NodeControl, Signals
from emir_analysis.robot_controls import pose_signals
from emir_msgs_py.robot_topics import (
    ROBOT_VALVE_COMMAND,
    TCP_DEFLECTION,
    TRUE_QUANTITIES,
    of_joints,
)
from emir_msgs_py.topics import CONTROL_PERIOD, PLANT_PERIOD, PLANT_PERIOD_NS, TICKS
from emir_plant.robot.plant import RobotPlant, RobotTruth
from emir_plant.robot.sensors import RobotMeasurement, measure

Array = NDArray[np.float64]


def commands(signals: Signals) -> Array:
    """Return the six valve commands, base first."""
    return np.array([signals[name] for name in ROBOT_VALVE_COMMAND.fields])


def sensor_signals(plant: RobotPlant, truth: RobotTruth, tick: int) -> Signals:
    """Return every signal that the plant publishes at a plant period."""
    reading = measure(plant, truth, tick)
    signals: Signals = {}
    for quantity in RobotMeasurement._fields:
        values = getattr(reading, quantity).tolist()
        signals |= zip(of_joints(quantity), values, strict=True)
    for quantity in TRUE_QUANTITIES:
        values = getattr(truth, quantity).tolist()
        signals |= zip(of_joints(f"true_{quantity}"), values, strict=True)
    signals["supply_pressure"] = truth.supply_pressure
    bent = (*truth.deflection.tolist(), *truth.deflection_rotation.tolist())
    signals |= zip(TCP_DEFLECTION.fields, bent, strict=True)
    turn = pin.Quaternion(truth.axes).coeffs()
    return signals | pose_signals("tcp", truth.position, math.copysign(1.0, turn[3]) * turn)


@dataclass(frozen=True)
class RobotLoop:
    """The robot and the controls about it, each given the signals of those before it."""

    plant: RobotPlant
    controls: Sequence[NodeControl]

    def run(self, joints: Array, pressure_lowering: float, duration: float) -> dict[str, Array]:
        """Run from rest at the joints' angles, (6,) rad, for a duration, s.

        Returns every signal of the topic table by name, as `ClosedLoop.run`.
        """
        state = self.plant.initial(joints, pressure_lowering)
        truth = self.plant.outputs(state)
        states: list[Any] = [None] * len(self.controls)
        rows: dict[str, list[float]] = {}
        signals: Signals = {}  # those of the controllers last till the next
        last = round(duration / CONTROL_PERIOD) * TICKS
        for tick in range(last + 1):
            new = sensor_signals(self.plant, truth, tick)
            for k, control in enumerate(self.controls):
                period = control.outputs[0].period_ns
                if tick * PLANT_PERIOD_NS % period == 0:
                    states[k], outputs = control.step(states[k], signals | new, period * 1e-9)
                    new |= outputs
            signals |= new
            for name, value in new.items():
                rows.setdefault(name, []).append(value)
            if tick < last:
                state, truth = self.plant.step(state, commands(signals), PLANT_PERIOD)
        return {name: np.array(values) for name, values in rows.items()}
