"""How fast the whole robot runs, beside MuJoCo and Pinocchio stepping the same chain.

    OMP_NUM_THREADS=1 python -m emir_analysis.robot_bench

prints simulated seconds per second on one core. The chain of the comparison is the 96 freedoms
without linkage parts and oil: MuJoCo and plain Pinocchio have neither.
"""

import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pinocchio as pin

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
EXPLICIT_STEP = 7e-5  # s, about the largest at which Runge-Kutta is stable on the cuts' dampers


def _rate(step: Callable[[], object], dt: float, seconds: float = 1.0) -> float:
    """Return simulated seconds per second of a step of dt, s: the best of several runs."""
    step()
    best, until = 0.0, time.perf_counter() + seconds
    while time.perf_counter() < until:
        begin = time.perf_counter()
        for _ in range(50):
            step()
        best = max(best, 50 * dt / (time.perf_counter() - begin))
    return best


def massless_parts(machine: Robot) -> Robot:
    """Return the robot with the mass of its linkages' parts in the arms."""
    names = ("barrel_mass", "piston_mass", "lever_mass", "thrust_bar_mass")
    return with_values(
        machine, {f"joint{n}.parts.{name}": 0.0 for n in range(1, 6) for name in names}
    )


def robot_rates() -> Iterator[tuple[str, float]]:
    """Yield what is measured and its rate: the whole robot with oil, all joints moving."""
    plant = RobotPlant(robot())
    start = plant.initial(POSTURE, 20e5)
    for milliseconds in (1, 4, 8, 32):
        dt = milliseconds * 1e-3
        yield (
            f"robot, {milliseconds} ms at a time, outputs included",
            _rate(_stepping(plant, start, dt), dt),
        )


def _stepping(plant: RobotPlant, start: Any, dt: float) -> Callable[[], None]:
    state = start

    def step() -> None:
        nonlocal state
        state, _ = plant.step(state, COMMANDS, dt)

    return step


def pinocchio_rate() -> float:
    """Return the rate of classical Runge-Kutta on Pinocchio's forward dynamics (ABA)."""
    mechanics = Mechanics(massless_parts(robot()))
    t = mechanics.topology
    data = t.model.createData()
    z, rate, _, _ = mechanics.expand(rest(mechanics, POSTURE).coordinates, np.zeros(96))
    load = np.zeros(t.model.nv)

    def stage() -> None:
        pin.aba(t.model, data, z, rate, load)

    return _rate(stage, EXPLICIT_STEP) / 4.0


def mujoco_rate(dt: float) -> float | None:
    """Return MuJoCo's rate at steps of dt, s, implicit integrator; None where it is missing."""
    try:
        import mujoco  # noqa: PLC0415 (only wanted here)
    except ModuleNotFoundError:
        return None
    machine = massless_parts(robot())
    model = mujoco.MjModel.from_xml_string(mjcf(machine, dt))
    data = mujoco.MjData(model)
    mechanics = Mechanics(machine)
    held = rest(mechanics, POSTURE)
    data.qpos[:] = held.coordinates
    data.qfrc_applied[mechanics.topology.joints] = held.torques

    def step() -> None:
        mujoco.mj_step(model, data)

    return _rate(step, dt)


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


def main() -> None:
    """Print the rates as they are measured."""
    for name, rate in robot_rates():
        print(f"{name:60s} {rate:8.1f}")
    print(f"{'chain, Pinocchio ABA, Runge-Kutta at 0.07 ms':60s} {pinocchio_rate():8.1f}")
    found = mujoco_rate(1e-3)
    shown = "not installed" if found is None else f"{found:8.1f}"
    print(f"{'chain, MuJoCo implicitfast at 1 ms':60s} {shown}")


if __name__ == "__main__":
    main()
