"""The paper's figure 3: stationary and dynamic deflection of the stretched boom."""

import math
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from emir_analysis.report import new_figure
from emir_plant import core
from emir_plant.boom import boom_modes, rigid_arm_joints, section_model
from emir_plant.parameters import Geometry, Machine
from emir_plant.plant import REST_PRESSURE, Plant

Array = NDArray[np.float64]

FORTY_FIVE = math.radians(45.0)  # paper, Fig. 3
STEP_SIZE = 0.64  # of the valve, makes the boom swing
SWING, PERIOD = 5.0, 5e-3  # s
EXAGGERATION = 10.0  # of deflections in the picture


@dataclass(frozen=True)
class Deflections:
    """Deflection off the line of the first section, m, up positive, joint to TCP.

    along: (sections + 1,) m, distance from the joint. static: (sections + 1,) at rest with the
    piston held. lowest, highest: (sections + 1,) where the TCP is bent most while lifting.
    """

    along: Array
    static: Array
    lowest: Array
    highest: Array


def deflections(machine: Machine) -> Deflections:
    """Return the boom's deflections at 45 deg: at rest, and swinging after a step of the valve."""
    plant = Plant(machine)
    state = plant.initial(FORTY_FIVE, REST_PRESSURE)
    rest, shown = state, []
    for _ in range(round(SWING / PERIOD)):
        state, truth = plant.step(state, STEP_SIZE, PERIOD)
        shown.append((truth.tcp_deflection, truth.angle, state))
    static = static_shape(machine.geometry)

    def shape(angle: float, state: Array) -> Array:
        slope = math.cos(angle)
        swinging = _bending(plant, state) - _bending(plant, rest) * slope / math.cos(FORTY_FIVE)
        return static * slope + swinging

    lowest, highest = min(shown, key=lambda s: s[0]), max(shown, key=lambda s: s[0])
    return Deflections(
        along=np.linspace(0.0, machine.geometry.boom_length, static.size),
        static=static * math.cos(FORTY_FIVE),
        lowest=shape(*lowest[1:]),
        highest=shape(*highest[1:]),
    )


def static_shape(geometry: Geometry) -> Array:
    """Return the sag of the horizontal boom, (sections + 1,) m, the first section held."""
    model = section_model(geometry)
    rotation = np.zeros_like(model.weight)
    rotation[1:] = np.linalg.solve(model.stiffness[1:, 1:], -model.weight[1:])
    return _line(rigid_arm_joints(geometry) @ rotation, geometry)


def _bending(plant: Plant, state: Array) -> Array:
    """Return the deflection, (sections + 1,) m, in the boom's modes of a state."""
    geometry = plant.machine.geometry
    shapes = boom_modes(geometry).shapes
    coordinates = state[core.MODES : core.MODES + shapes.shape[1]]
    return _line((shapes - shapes[0]) @ coordinates, geometry)


def _line(rotations: Array, geometry: Geometry) -> Array:
    return np.concatenate(([0.0], np.cumsum(geometry.section_length * rotations)))


def picture(found: Deflections) -> Figure:
    """Return the boom at 45 deg, straight and bent (Fig. 3), and the deflections along it."""
    figure = new_figure(5.0)
    boom, along = figure.subplots(1, 2)
    along_x, along_z = math.cos(FORTY_FIVE), math.sin(FORTY_FIVE)
    lines = {
        "straight": (0.0 * found.along, "0.5", "--"),
        "at rest": (found.static, "C0", "-"),
        "swinging, lowest": (found.lowest, "C3", ":"),
        "swinging, highest": (found.highest, "C2", ":"),
    }
    for name, (deflection, colour, style) in lines.items():
        off = EXAGGERATION * deflection
        x, z = found.along * along_x - off * along_z, found.along * along_z + off * along_x
        boom.plot(x, z, color=colour, ls=style, label=name)
        tip = f"{name}: TCP {deflection[-1] * 1e2:+.1f} cm"
        along.plot(found.along, deflection * 1e2, color=colour, ls=style, label=tip)
    boom.set(xlabel="x / m", ylabel="z / m", aspect="equal")
    boom.set_title(f"45 deg, deflection drawn {EXAGGERATION:g} times too large")
    along.set(xlabel="distance from joint 1 / m", ylabel="deflection / cm")
    along.set_title(f"at rest, and after a step to y2 = {STEP_SIZE:g}")
    for axes in (boom, along):
        axes.grid(visible=True, alpha=0.3)
        axes.legend(frameon=False, fontsize="small")
    return figure
