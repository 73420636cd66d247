"""How far any outer loop is from instability: its gain margin on the linearized machine.

The controller itself is asked, step by step, whatever it is made of; only the machine is linear.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from emir_analysis.control_protocols import Stepping
from emir_analysis.design_pfc import OperatingPoint, steady_motion, velocity_model
from emir_analysis.node_controls import situation
from emir_common.parameter_tree import with_values
from emir_control.internal_model import InternalModel
from emir_control.pfc import PREVIEW
from emir_control.trajectory import Reference
from emir_msgs_py.topics import CONTROL_PERIOD
from emir_plant.core import Truth
from emir_plant.linearize import linearize
from emir_plant.parameters import Machine
from emir_plant.plant import Plant
from emir_plant.sensors import Measurement

Array = NDArray[np.float64]

PUSH = 1e-3  # m/s, added to the command for a short while
PUSHED, WATCHED = 10, 400  # control periods
AT_REST = 1e-8  # m
GROWN = 5e-3  # m, a dozen times what the push moves the piston
WIDEST = 16.0  # factor within which, up and down, the margin is looked for
HALVINGS = 8  # of the logarithm of that range: the margin is found to 1 %


@dataclass(frozen=True)
class LinearMachine:
    """The machine behind its force loop, about a steady motion.

    model: from velocity command to stroke. truth: (len(Truth), model.order), what else its state
    means. at: the truth about which it is linear.
    """

    model: InternalModel
    truth: Array
    at: Truth

    def measured(self, state: Array) -> Measurement:
        """Return what sensors without noise would show."""
        shown = Truth._make(np.add(self.at, self.truth @ state).tolist())
        return Measurement(
            shown.angle,
            shown.stroke,
            shown.pressure_lifting,
            shown.pressure_lowering,
            shown.force,
            shown.tip_angle - shown.angle,
        )


def linear_machine(machine: Machine, point: OperatingPoint) -> LinearMachine:
    """Return the machine about a point. Raises SimulationError where it has no such motion."""
    plant = Plant(with_values(machine, {"geometry.payload": point.payload}))
    state, command = steady_motion(plant, point)
    outputs = linearize(plant, state, command).C
    model = velocity_model(machine, point, "stroke")
    behind = model.order - outputs.shape[1]  # the force loop's own states
    return LinearMachine(model, np.pad(outputs, ((0, 0), (0, behind))), plant.outputs(state))


def gain_margin(linear: LinearMachine, outer: Stepping) -> float:
    """Return the factor on the machine's gain from which on a push does not die out any more.

    Below 1 the loop is unstable; 1/WIDEST and WIDEST stand for beyond that. Not a number for a
    controller that commands the valve itself, without the force loop.
    """
    begin = situation(
        Reference(linear.at.stroke, 0.0),
        (linear.at.stroke,) * PREVIEW,
        linear.measured(np.zeros(linear.model.order)),
    )
    if "velocity_command" not in outer.step(None, begin, CONTROL_PERIOD)[1]:
        return math.nan
    low, high = -math.log(WIDEST), math.log(WIDEST)
    if dies_out(linear, outer, WIDEST):
        return WIDEST
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        if dies_out(linear, outer, math.exp(middle)):
            low = middle
        else:
            high = middle
    return math.exp(0.5 * (low + high))


def dies_out(linear: LinearMachine, outer: Stepping, factor: float) -> bool:
    """Return whether the loop comes to rest again after a push, with that factor on the gain."""
    at, x, state = linear.at, np.zeros(linear.model.order), None
    moved = np.empty(WATCHED)
    reference, preview = Reference(at.stroke, 0.0), (at.stroke,) * PREVIEW
    for k in range(WATCHED):
        moved[k] = linear.model.C @ x
        if abs(moved[k]) > GROWN:  # on its way to where the command's limits hold it
            return False
        now = situation(reference, preview, linear.measured(x))
        signals: dict[str, Any]
        state, signals = outer.step(state, now, CONTROL_PERIOD)
        push = PUSH if k < PUSHED else 0.0
        x = linear.model.next(x, factor * (signals["velocity_command"] + push))
    middle, end = moved[WATCHED // 4 : WATCHED // 2], moved[-WATCHED // 4 :]
    return float(np.std(end)) < max(float(np.std(middle)), AT_REST)
