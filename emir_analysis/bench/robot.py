"""Speed of the whole robot, beside MuJoCo and Pinocchio stepping the same chain.

The chain of the comparison is the 96 freedoms without linkage parts and oil: MuJoCo and plain
Pinocchio have neither.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pinocchio as pin

from emir_analysis.bench.timing import Contender, Figure, rates
from emir_common.parameter_tree import with_values
from emir_plant.robot.dynamics import Mechanics
from emir_plant.robot.parameters import Robot
from emir_plant.robot.plant import RobotPlant
from emir_plant.robot.posture import rest
from emir_plant.robot.sheet import robot
from emir_plant.robot.stiffness import cut_damping, cut_stiffness

POSTURE = np.radians([0.0, 45.0, -17.0, 11.0, -11.0, 17.0])
COMMANDS = np.array([0.3, 0.5, -0.3, 0.4, 0.3, -0.3])
X, Y, Z = "1 0 0", "0 1 0", "0 0 1"
CUT_AXES = (*(("slide", axis) for axis in (X, Y, Z)), *(("hinge", axis) for axis in (Z, Y, X)))
LAP = 0.064  # s, of the robot in one timed run
EXPLICIT_STEP = 7e-5  # s, about the largest at which Runge-Kutta is stable on the cuts' dampers


def massless_parts(machine: Robot) -> Robot:
    """Return the robot with the mass of its linkages' parts in the arms."""
    names = ("barrel_mass", "piston_mass", "lever_mass", "thrust_bar_mass")
    return with_values(
        machine, {f"joint{n}.parts.{name}": 0.0 for n in range(1, 6) for name in names}
    )


def robot_figures(seconds: float) -> Iterator[tuple[str, list[Figure]]]:
    """Yield title and figures of the robot; seconds: about what each contender gets."""
    mechanics = Mechanics(massless_parts(robot()))
    found = [_robot(milliseconds * 1e-3) for milliseconds in (1, 2, 4, 8, 32)]
    found.append(_pinocchio(mechanics))
    mujoco = _mujoco(mechanics, 1e-3)
    figures = rates([*found, *([] if mujoco is None else [mujoco])], "s/s", seconds)
    if mujoco is None:
        figures.append(Figure("chain, MuJoCo", None, "s/s", note="MuJoCo is not installed"))
    yield "Robot, 96 freedoms, one core", figures


def _robot(dt: float) -> Contender:
    """Return the whole robot with oil, all joints moving, dt, s, at a time."""
    plant = RobotPlant(robot())
    state = start = plant.initial(POSTURE, 20e5)
    steps = round(LAP / dt)

    def run() -> None:
        nonlocal state
        state = start
        for _ in range(steps):
            state, _ = plant.step(state, COMMANDS, dt)

    return Contender(f"robot with oil, {dt * 1e3:g} ms at a time, outputs included", run, LAP)


def _pinocchio(mechanics: Mechanics) -> Contender:
    """Return classical Runge-Kutta on Pinocchio's forward dynamics (ABA)."""
    t = mechanics.topology
    data = t.model.createData()
    z, rate, _, _ = mechanics.expand(rest(mechanics, POSTURE).coordinates, np.zeros(96))
    load = np.zeros(t.model.nv)

    def run() -> None:
        for _ in range(4 * 10):
            pin.aba(t.model, data, z, rate, load)

    note = f"steps of {EXPLICIT_STEP * 1e3:g} ms, or its dampers diverge"
    return Contender("chain, Pinocchio ABA, Runge-Kutta 4", run, 10 * EXPLICIT_STEP, note)


def _mujoco(mechanics: Mechanics, dt: float) -> Contender | None:
    """Return MuJoCo at steps of dt, s, implicit integrator; None where it is missing."""
    try:
        import mujoco  # noqa: PLC0415 (only wanted here)
    except ModuleNotFoundError:
        return None
    model = mujoco.MjModel.from_xml_string(mjcf(mechanics.robot, dt))
    data = mujoco.MjData(model)
    held = rest(mechanics, POSTURE)
    data.qpos[:] = held.coordinates
    data.qfrc_applied[mechanics.topology.joints] = held.torques

    def run() -> None:
        for _ in range(10):
            mujoco.mj_step(model, data)

    return Contender(f"chain, MuJoCo implicitfast at {dt * 1e3:g} ms", run, 10 * dt)


def mjcf(machine: Robot, dt: float) -> str:
    """Return the chain of 96 freedoms without the linkages' parts as MuJoCo reads it."""
    model = Mechanics(machine).topology.model
    of = machine.arm, machine.main.geometry
    springs, dampers = np.diag(cut_stiffness(*of)), np.diag(cut_damping(*of))
    names = list(model.names)
    sections = range(1, of[1].sections_per_arm + 1)
    moving = ["base", *(f"arm{a}_section{s}" for a in range(1, 6) for s in sections)]
    bodies = []
    for name in moving:
        is_cut = f"{name}_shift" in names
        first = "base" if name == "base" else name.replace("arm", "joint")[:6]
        mover = names.index(f"{name}_rotation" if is_cut else first)
        place = model.jointPlacements[names.index(f"{name}_shift") if is_cut else mover]
        joints = f'<joint type="hinge" axis="{"0 0 1" if name == "base" else "0 -1 0"}"/>'
        if is_cut:
            joints = "".join(
                f'<joint type="{kind}" axis="{axis}" stiffness="{k}" damping="{d}"/>'
                for (kind, axis), k, d in zip(CUT_AXES, springs, dampers, strict=True)
            )
        bodies += [f'<body pos="{_text(place.translation)}">', joints]
        bodies.append(_inertial(model.inertias[mover]))
    closing = "</body>" * len(moving)
    option = f'<option timestep="{dt}" integrator="implicitfast" gravity="0 0 -9.81"/>'
    flags = '<compiler angle="radian" autolimits="false"/>'
    return f"<mujoco>{flags}{option}<worldbody>{''.join(bodies)}{closing}</worldbody></mujoco>"


def _inertial(inertia: Any) -> str:
    m = inertia.inertia
    entries = _text(np.array([m[0, 0], m[1, 1], m[2, 2], m[0, 1], m[0, 2], m[1, 2]]))
    centre = _text(inertia.lever)
    return f'<inertial pos="{centre}" mass="{inertia.mass!r}" fullinertia="{entries}"/>'


def _text(values: Any) -> str:
    return " ".join(repr(float(value)) for value in values)
