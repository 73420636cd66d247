"""The sensors of the paper: 12-bit joint resolver, pressure transducers, strain gauge.

The stroke is computed from the resolver by the stated linkage, whatever the linkage is as built,
unless it has a sensor of its own; the force is computed from the measured pressures.
"""

import math
from typing import Any, NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from emir_plant import core, linkage
from emir_plant.core import Array, Truth
from emir_plant.effects import sensor_delay
from emir_plant.jit import compiled
from emir_plant.noise import generator
from emir_plant.parameters import Machine
from emir_plant.plant import Plant


class Measurement(NamedTuple):
    """One reading of all sensors; SI units."""

    angle: float  # resolver, rad
    stroke: float  # computed from the resolver or measured, m
    pressure_lifting: float  # Pa, absolute
    pressure_lowering: float  # Pa, absolute
    force: float  # p_H A_H - p_S A_S of the measured pressures, N (9)
    deflection: float  # alpha_6 - alpha_1 by strain gauges, rad


class Readings(NamedTuple):
    """What the sensors show along a run before noise and quantisation, each (n,), SI units.

    Fields as in Measurement.
    """

    angle: Array
    stroke: Array
    pressure_lifting: Array
    pressure_lowering: Array
    force: Array
    deflection: Array


# each sensor's field in the effects of sensors, and where the state holds what makes it late
_LATE = {
    "angle": core.LATE_ANGLE,
    "pressure_lifting": core.LATE_P_H,
    "pressure_lowering": core.LATE_P_S,
    "deflection": core.LATE_DEFLECTION,
    "stroke": core.LATE_STROKE,
}


def resolver(angle: float, step: float) -> float:
    """Return the angle, rad, rounded to the nearest of a resolver's steps, rad."""
    return math.floor(angle / step + 0.5) * step


def measure(plant: Plant, truth: Truth, sample: int, state: Array | None = None) -> Measurement:
    """Return what the sensors show of the truth at a sample.

    The noise depends on the seed and the sample's number alone, so that a run can be repeated
    from any point. state: the plant's, which holds what makes sensors late. Raises ValueError
    where one is (effect `sensor_delay`) and no state is given.
    """
    machine = plant.machine
    sensors, cylinder = machine.sensors, machine.cylinder
    noise = generator(sensors.seed, sample).standard_normal(3).tolist()
    true = {
        "angle": truth.angle,
        "pressure_lifting": truth.pressure_lifting,
        "pressure_lowering": truth.pressure_lowering,
        "deflection": truth.tip_angle - truth.angle,
        "stroke": truth.stroke,
    }
    late = machine.effects.sensor_delay
    for name, index in _LATE.items():
        delay = getattr(late, name)
        if delay > 0.0:
            if state is None:
                raise ValueError(f"effects.sensor_delay.{name}: the plant's state is needed")
            lagging = float(state[index])
            true[name] = sensor_delay.shown(true[name], lagging, delay, late.dead_share)
    shown = {name: _distorted(value, name, machine) for name, value in true.items()}
    angle = resolver(shown["angle"], sensors.resolver_step)
    noise_lifting, noise_lowering = sensors.pressure_noises
    lifting = shown["pressure_lifting"] + noise_lifting * noise[0]
    lowering = shown["pressure_lowering"] + noise_lowering * noise[1]
    return Measurement(
        angle=angle,
        stroke=shown["stroke"] if sensors.own_stroke else _stroke(angle, plant.record),
        pressure_lifting=lifting,
        pressure_lowering=lowering,
        force=lifting * cylinder.area_lifting - lowering * cylinder.area_lowering,
        deflection=shown["deflection"] + sensors.deflection_noise * noise[2],
    )


def readings(plant: Plant, truth: Array, period: float) -> Readings:
    """Return what the plant's sensors show along a run, without noise and quantisation.

    truth: (n, len(Truth)), from a run that starts at rest. period: s, between its rows; a lag
    takes the signals as straight between them, dead time as a cubic spline.
    """
    machine, cylinder = plant.machine, plant.machine.cylinder
    columns = Truth(*truth.T)
    true: dict[str, Any] = {
        "angle": columns.angle,
        "pressure_lifting": columns.pressure_lifting,
        "pressure_lowering": columns.pressure_lowering,
        "deflection": columns.tip_angle - columns.angle,
        "stroke": columns.stroke,
    }
    shown = {
        name: _distorted(_late(signal, name, period, machine), name, machine)
        for name, signal in true.items()
    }
    lifting, lowering = shown["pressure_lifting"], shown["pressure_lowering"]
    if not machine.sensors.own_stroke:
        shown["stroke"] = linkage.strokes(shown["angle"], plant.record[0])
    with np.errstate(invalid="ignore"):  # a run out of all bounds
        force = lifting * cylinder.area_lifting - lowering * cylinder.area_lowering
    return Readings(force=force, **shown)


def _distorted(true: Any, name: str, machine: Machine) -> Any:
    """Return what a sensor of a gain and a bias shows of a number or an array."""
    gain, bias = machine.effects.sensor_gain, machine.effects.sensor_bias
    return true * (1.0 + getattr(gain, name)) + getattr(bias, name)


def undistorted(shown: float, name: str, machine: Machine) -> float:
    """Return what a sensor of a gain and a bias was given when it shows a value at rest."""
    gain, bias = machine.effects.sensor_gain, machine.effects.sensor_bias
    return float((shown - getattr(bias, name)) / (1.0 + getattr(gain, name)))


def _late(signal: Array, name: str, period: float, machine: Machine) -> Array:
    """Return a sensor's signal, (n,), behind its dead time and its lag."""
    late = machine.effects.sensor_delay
    delay = getattr(late, name)
    if delay == 0.0:
        return signal
    dead, lag = late.dead_share * delay, (1.0 - late.dead_share) * delay
    return _lagged(_delayed(signal, dead, period), lag, period)


def _delayed(signal: Array, dead: float, period: float) -> Array:
    """Return a signal, (n,), behind a dead time, s; before its start it was at rest."""
    if dead == 0.0:
        return signal
    time = np.arange(signal.size) * period
    shown = np.maximum(time - dead, 0.0)
    if not np.all(np.isfinite(signal)):  # a run out of all bounds: its beginning stays
        return np.asarray(np.interp(shown, time, signal))
    return np.asarray(scipy.interpolate.make_interp_spline(time, signal)(shown))


def _lagged(signal: Array, lag: float, period: float) -> Array:
    """Return a signal, (n,), behind a first-order lag, s, exactly for straight pieces."""
    if lag == 0.0:
        return signal
    ratio = period / lag
    decay = math.exp(-ratio)
    mean = -math.expm1(-ratio) / ratio  # of the decay over a period
    start = (mean - decay) * signal[0] + decay * signal[0]
    shown, _ = scipy.signal.lfilter([1.0 - mean, mean - decay], [1.0, -decay], signal, zi=[start])
    return np.asarray(shown)


@compiled
def _stroke(angle: float, parameters: NDArray[Any]) -> float:
    return linkage.stroke(angle, parameters[0])
