"""The sensors of the paper: 12-bit joint resolver, pressure transducers, strain gauge."""

import math
from typing import NamedTuple

import numpy as np

from emir_plant import linkage
from emir_plant.core import Truth
from emir_plant.plant import Plant


class Measurement(NamedTuple):
    """One reading of all sensors; SI units."""

    angle: float  # resolver, rad
    stroke: float  # computed from the resolver, m
    pressure_lifting: float  # Pa, absolute
    pressure_lowering: float  # Pa, absolute
    force: float  # p_H A_H - p_S A_S of the measured pressures, N (9)
    deflection: float  # alpha_6 - alpha_1 by strain gauges, rad


def resolver(angle: float, bits: int, span: float) -> float:
    """Return the angle, rad, rounded to the nearest of 2^bits steps of the span, rad."""
    step = span / 2.0**bits
    return math.floor(angle / step + 0.5) * step


def measure(plant: Plant, truth: Truth, sample: int) -> Measurement:
    """Return what the sensors show of the truth at a sample.

    The noise depends on the seed and the sample's number alone, so that a run can be repeated
    from any point.
    """
    sensors, cylinder = plant.machine.sensors, plant.machine.cylinder
    noise = np.random.default_rng((sensors.seed, sample)).standard_normal(3).tolist()
    angle = resolver(truth.angle, sensors.resolver_bits, sensors.resolver_span)
    lifting = truth.pressure_lifting + sensors.pressure_noise * noise[0]
    lowering = truth.pressure_lowering + sensors.pressure_noise * noise[1]
    return Measurement(
        angle=angle,
        stroke=linkage.stroke(angle, plant.record[0]),
        pressure_lifting=lifting,
        pressure_lowering=lowering,
        force=lifting * cylinder.area_lifting - lowering * cylinder.area_lowering,
        deflection=truth.tip_angle - truth.angle + sensors.deflection_noise * noise[2],
    )
