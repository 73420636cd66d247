"""The sensors of the whole robot: a resolver on each joint, a transducer in each chamber.

As those of joint 1 (`emir_plant.sensors`): the same bits, span and noise for all six joints.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from emir_plant.noise import generator
from emir_plant.robot import linkage
from emir_plant.robot.actuators import ACTUATORS
from emir_plant.robot.plant import RobotPlant, RobotTruth

Array = NDArray[np.float64]


class RobotMeasurement(NamedTuple):
    """One reading of all sensors, (6,) each, base first; SI units."""

    angle: Array  # resolvers, rad
    stroke: Array  # computed from the resolvers, m; the base's is its angle
    force: Array  # p_H A_H - p_S A_S of the measured pressures, N; N m on the base (9)
    pressure_lifting: Array  # Pa, absolute
    pressure_lowering: Array  # Pa, absolute


def measure(plant: RobotPlant, truth: RobotTruth, sample: int) -> RobotMeasurement:
    """Return what the sensors show of the truth at a sample.

    The noise depends on the seed and the sample's number alone.
    """
    sensors, drives = plant.robot.main.sensors, plant.tables.drives
    noise = generator(sensors.seed, sample).standard_normal((2, ACTUATORS))
    step = sensors.resolver_step
    angle = np.floor(truth.angle / step + 0.5) * step
    strokes = [
        linkage.stroke(a, p) for a, p in zip(angle[1:], plant.mechanics.linkages, strict=True)
    ]
    lifting = truth.pressure_lifting + sensors.pressure_noise * noise[0]
    lowering = truth.pressure_lowering + sensors.pressure_noise * noise[1]
    return RobotMeasurement(
        angle=angle,
        stroke=np.array([angle[0], *strokes]),
        force=lifting * drives["area_lifting"] - lowering * drives["area_lowering"],
        pressure_lifting=lifting,
        pressure_lowering=lowering,
    )
