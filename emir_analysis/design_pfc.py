"""From the machine to a predictive controller: linearize, reduce, design."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from emir_common.parameter_tree import with_values
from emir_common.quantity import ParameterError, check_ranges, quantity
from emir_control import design
from emir_control.force_loop import ForceLoopParameters
from emir_control.internal_model import InternalModel
from emir_control.pfc import PfcParameters
from emir_control.pfc_file import STROKE, TIP_ANGLE
from emir_control.prefilter import valve_command
from emir_control.schedule import Schedule
from emir_msgs_py.topics import CONTROL_PERIOD
from emir_plant import core, linkage, operating_point
from emir_plant.effects import linkage_error
from emir_plant.linearize import linearize
from emir_plant.parameters import Machine
from emir_plant.plant import Plant, SimulationError

Array = NDArray[np.float64]

DAMPED = ForceLoopParameters()
OUTPUTS = {"pfc": STROKE, "pfc_tip": TIP_ANGLE}  # by controller
ORDERS = {STROKE: 6, TIP_ANGLE: 8}  # paper 3.3
RESOLVER_STEP = {STROKE: 1e-3, TIP_ANGLE: 1.5e-3}  # m, rad: 12 bits of a turn


@dataclass(frozen=True, kw_only=True)
class OperatingPoint:
    """Where the machine is linearized: in slow steady motion.

    At rest the valve is in its dead zone and no command would move anything.
    """

    angle: float = quantity("rad", -0.5, 1.6, "boom angle", default=math.pi / 4)
    payload: float = quantity("kg", 0.0, 3000.0, "at the TCP", default=0.0)
    velocity: float = quantity("m/s", -0.2, 0.2, "of the piston, not 0", default=0.01)

    def __post_init__(self) -> None:
        check_ranges(self)
        if self.velocity == 0.0:
            raise ParameterError("velocity = 0 m/s: the machine has to move")


@dataclass(frozen=True, kw_only=True)
class DesignTask:
    """What is wanted. order: of the internal model, before an observer's one more state.

    observer: standard deviation of the unknown input's change from sample to sample, m/s; 0:
    an independent model. tuning: other fields of PfcParameters.
    """

    controller: str = "pfc"
    order: int = 6
    point: OperatingPoint = field(default_factory=OperatingPoint)
    observer: float = 0.0
    tuning: dict[str, object] = field(default_factory=dict)


def steady_motion(plant: Plant, point: OperatingPoint) -> tuple[Array, float]:
    """Return state and valve command of a steady motion through a point.

    Raises SimulationError where the machine has no such motion.
    """
    return operating_point.at_velocity(plant, point.angle, point.velocity)


def velocity_model(
    machine: Machine,
    point: OperatingPoint,
    output: str,
    force_loop: ForceLoopParameters = DAMPED,
) -> InternalModel:
    """Return the sampled model from velocity command to `stroke`, m, or `tip_angle`, rad.

    The machine about the point, valve held over a control period, the force loop closed. Raises
    SimulationError as `steady_motion`.
    """
    plant = Plant(with_values(machine, {"geometry.payload": point.payload}))
    state, command = steady_motion(plant, point)
    linear = linearize(plant, state, command)
    rows = dict(zip(core.Truth._fields, linear.C, strict=True))
    n = len(linear.A)
    held = expm(CONTROL_PERIOD * np.block([[linear.A, linear.B], [np.zeros((1, n + 1))]]))
    valve = InternalModel(held[:n, :n], held[:n, n], rows[output], CONTROL_PERIOD)
    ends = 0.99 * point.velocity, 1.01 * point.velocity
    low, high = (valve_command(v, force_loop.prefilter) for v in ends)
    return design.with_force_loop(
        valve, rows["force"], (high - low) / (ends[1] - ends[0]), force_loop
    )


def design_pfc(machine: Machine, task: DesignTask) -> PfcParameters:
    """Return the controller's parameters: the machine's model, reduced, and the tuning.

    Raises SimulationError or ParameterError for a task that cannot be met.
    """
    output = OUTPUTS[task.controller]
    return designed(design.reduced(velocity_model(machine, task.point, output), task.order), task)


def designed(model: InternalModel, task: DesignTask) -> PfcParameters:
    """Return the controller's parameters with an internal model of whatever origin."""
    output = OUTPUTS[task.controller]
    if task.observer > 0.0:
        noise = design.Noise(task.observer, RESOLVER_STEP[output] / math.sqrt(12.0))
        model = design.with_observer(model, noise)
    return PfcParameters(model=model, **task.tuning)  # type: ignore[arg-type] # checked there


def scheduled(
    machine: Machine, task: DesignTask, angles: Sequence[float], payloads: Sequence[float]
) -> PfcParameters:
    """Return a design whose models follow posture, rad, and payload, kg; both rising.

    Where the machine has no slow motion with a payload, or one for which its pump is short, the
    model of the next steeper posture stands in: short of pressure the flow yields to the load,
    which damps as nothing damps once the pressure is there. Raises SimulationError where the
    steepest has none.
    """
    models: list[tuple[InternalModel, ...]] = []
    for payload in payloads:
        row: list[InternalModel] = []
        for angle in reversed(angles):
            point = replace(task.point, angle=angle, payload=payload)
            try:
                short = bool(row) and pump_is_short(machine, point)
                found = None if short else design_pfc(machine, replace(task, point=point)).model
            except SimulationError:
                if not row:
                    raise
                found = None
            row.insert(0, found or row[0])
        models.append(tuple(row))
    p = Plant(machine).record[0]
    strokes = linkage.strokes(np.asarray(angles), p)
    forces = np.array([[_static_force(machine, a, load) for a in angles] for load in payloads])
    schedule = Schedule(strokes, np.array(payloads), forces, tuple(models))
    return replace(design_pfc(machine, task), schedule=schedule)


def pump_is_short(machine: Machine, point: OperatingPoint) -> bool:
    """Return whether a steady motion leaves the pressure balance less than it holds over the edge.

    Raises SimulationError as `steady_motion`.
    """
    plant = Plant(with_values(machine, {"geometry.payload": point.payload}))
    shown, lines = plant.outputs(steady_motion(plant, point)[0]), machine.resistances
    into = shown.flow_lifting, shown.pressure_lifting
    if point.velocity < 0.0:
        into = shown.flow_lowering, shown.pressure_lowering
    lost = (lines.k_pump_line + lines.k_block_in) * into[0] ** 2
    return machine.supply.p0 - lost - into[1] < machine.valve.balance_pressure


def _static_force(machine: Machine, angle: float, payload: float) -> float:
    """Return the force, N, on which the boom rests at an angle, rad; whether the pump gives it."""
    p = Plant(with_values(machine, {"geometry.payload": payload})).record[0]
    torque = p["mode_weight"][0] * math.cos(angle) / p["mode_joint"][0]
    return float(torque / linkage_error.lever_arm(angle, p))
