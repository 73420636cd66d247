"""The residual of each balance of the model, from measured signals, in integral form.

Over a window the measured change of a quantity is compared with the integral of its modelled
rate (see `measured_state`), so that no noisy or quantised signal is differentiated twice:

force            missing force on the piston, N, from the second integral of the boom's turning
lifting_chamber  missing flow into the lifting chamber, m^3/s, from the integral of dp_H/dt
lowering_chamber the same of the lowering chamber
linkage          measured stroke minus the piston's stroke at the measured angle, m
bending          measured minus modelled tip deflection under the measured force, rad
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.signal import savgol_filter

from emir_analysis.diagnosis.experiment import (
    ANGLE,
    COMMAND,
    OUTPUTS,
    STROKE,
    SUBSTEP,
    Experiment,
)
from emir_analysis.diagnosis.free_run import ANGLE_COLUMN, STROKE_COLUMN, free_runs
from emir_analysis.diagnosis.measured_state import Modelled, follow
from emir_analysis.diagnosis.noise_colour import coloured, colours
from emir_analysis.signals import Array
from emir_plant import linkage
from emir_plant.effects import Effects, terms
from emir_plant.measured_step import longest_step
from emir_plant.parameters import Machine
from emir_plant.plant import Plant, SimulationError
from emir_plant.sensors import resolver

H, S, DEFLECTION = "pressure_lifting", "pressure_lowering", "tip_deflection_angle"


class Balance(NamedTuple):
    """What a residual is measured in and which signals it takes.

    Beside the command and the boom's motion, which angle or stroke shows.
    """

    unit: str
    signals: frozenset[str]


BALANCES = {
    "force": Balance("N", frozenset({H, S})),
    "lifting_chamber": Balance("m^3/s", frozenset({H})),
    "lowering_chamber": Balance("m^3/s", frozenset({S})),
    "linkage": Balance("m", frozenset({ANGLE, STROKE})),
    "bending": Balance("rad", frozenset({H, S, DEFLECTION})),
}
FORCE, LINKAGE = (list(BALANCES).index(name) for name in ("force", "linkage"))

READ, SMOOTHED = 0, 4  # columns of the angle among a recording's undistorted signals
SMOOTHING = 0.25  # s, of the angle from which velocity and lever arm are read: a quarter bend
LAG_SMOOTHING = 0.05  # s, of pressures and deflection where a sensor's lag is undone
EMPTY = 5.0  # times its noise: a lower pressure does not tell whether the chamber runs empty
LOW = 3e5  # Pa, shown: so much an empty chamber may show, as far as a transducer's bias goes
QUIETER = 0.95  # share of the windows that a balance's level is taken from
FLOW_WINDOW = 0.5  # s: the stroke's quantisation then weighs less than 1 % of the nominal flow
FORCE_WINDOW = 1.0  # s: below the slow mode's period, above which a force would average out
WINDOW_STEP = 0.25  # s, from one window to the next
INTEGRATION_STEP = 5e-3  # s: errs by a twentieth of the noise or less; there are hundreds of passes
NOISE_DRAWN = 240.0  # s of the sensors' noise, about, from which the floor is found


def _by_velocity(records: Sequence[NDArray[Any]]) -> NDArray[Any]:
    """Return records of machines as one, (m,), whose dry friction all goes by the velocity.

    A resolver's step is as long as the way on which seals give, or longer.
    """
    result = np.concatenate(records, dtype=records[0].dtype)
    for name in result.dtype.names or ():
        if name.endswith("_presliding"):
            result[name] = 0.0
    return result


class Balances:
    """The balances of one experiment, for any machine.

    geometry: the machine whose linkage, areas and boom (all without tolerance) turn rates into
    forces and flows; the units of a residual do so not depend on what is being fitted.
    """

    def __init__(self, experiment: Experiment, geometry: Machine) -> None:
        self._experiment = experiment
        period = experiment.period
        # a signal without a sensor is kept at the tank's pressure; what needs it is not told
        shown = np.nan_to_num(experiment.outputs[:, 1:], nan=geometry.supply.pT)
        self._shown = np.column_stack([experiment.angle, shown])
        self._smooth_angle, self._rate = _smoothed(experiment.angle, SMOOTHING, period)
        self._rate_slope = np.gradient(self._rate, period)
        self._slopes = dict[str, Array]()  # of what sensors show, (n,) 1/s, as asked for
        p = Plant(geometry).record[0]
        self._areas = p["area_lifting"], p["area_lowering"]
        arm = linkage.lever_arms(self._smooth_angle, p)
        stroke = linkage.strokes(experiment.angle, p)
        self._stated_stroke = stroke
        self._flow_per_rate = np.column_stack(
            [
                (p["volume_lifting_0"] + p["area_lifting"] * stroke) / p["beta"],
                (p["volume_lowering_0"] - p["area_lowering"] * stroke) / p["beta"],
            ]
        )
        # a force F turns the boom as a rigid body by phi_0^2 r F, phi_0 the rigid mode's shape
        self._force_per_turning = 1.0 / (p["mode_joint"][0] ** 2 * arm)
        self.velocity = arm * self._rate
        self.force = shown[:, 0] * p["area_lifting"] - shown[:, 1] * p["area_lowering"]
        self._flow = _Window(FLOW_WINDOW, FORCE_WINDOW, period, degree=1)
        self._turn = _Window(FORCE_WINDOW, FORCE_WINDOW, period, degree=2)
        self._mean = _Window(FLOW_WINDOW, FORCE_WINDOW, period, degree=0)
        self._pressure_noises = geometry.sensors.pressure_noises
        low = shown[:, :2] < EMPTY * np.array(self._pressure_noises)
        self._filled = [self._mean(column.astype(float)) == 0.0 for column in low.T]
        self._low = [self._mean.least(column) < LOW for column in shown.T[:2]]

    @property
    def time(self) -> Array:
        """Middle of the windows, (w,) s."""
        return self._mean(self._experiment.time)

    def signals(self) -> dict[str, tuple[str, Array]]:
        """Return unit and mean over each window, (w,), of what a residual may depend on."""
        experiment = self._experiment
        command = np.append(experiment.commands, experiment.commands[-1])[:: experiment.every]
        found = {
            name: (unit, experiment.outputs[:, k])
            for k, (name, unit) in enumerate(OUTPUTS.items())
            if not np.isnan(experiment.outputs[0, k])
        }
        found["piston_velocity"] = ("m/s", self.velocity)
        if {H, S} <= experiment.measured:
            found["piston_force"] = ("N", self.force)
        found[COMMAND] = ("1", command)
        found["time"] = ("s", experiment.time)
        return {name: (unit, self._mean(signal)) for name, (unit, signal) in found.items()}

    def residuals(self, machines: Sequence[Machine], longest: float = INTEGRATION_STEP) -> Array:
        """Return what is missing in each balance, (m, w, 5), SI units.

        NaN for a machine that cannot rest at the recording's start. longest: step of integration,
        s; shorter where a machine asks for shorter ones.
        """
        plants = [Plant(machine) for machine in machines]
        true = np.array([self._undistorted(plant.machine) for plant in plants])
        result = np.full((len(plants), self.time.size, len(BALANCES)), np.nan)
        for k, modelled in self._modelled(plants, true, READ, longest):
            stroke = self._stroke(plants[k], true[k])
            off = self._true_stroke(plants[k].machine) - stroke
            result[k] = self._missing(modelled, true[k], off)
        return result

    def one_step(self, machine: Machine) -> Array:
        """Return measured minus modelled change of the outputs, (n - 1, 4), SI units, in a sample.

        Every term of the model takes the measured signals, the velocity as it is smoothed over
        both sides: what the model says of a step, not what it could foresee. What no sensor shows
        is followed as for the balances. The stroke goes on with the measured velocity, whatever
        the model.
        """
        result = np.full((self._experiment.angle.size - 1, len(OUTPUTS)), np.nan)
        true = self._undistorted(machine)
        for _, modelled in self._modelled([Plant(machine)], true[None], SMOOTHED, SUBSTEP):
            moved = self.velocity[:-1] * self._experiment.period
            result[:, 0] = np.diff(self._experiment.outputs[:, 0]) - moved
            result[:, 1] = np.diff(true[:, 1]) - np.diff(modelled.pressure_lifting)
            result[:, 2] = np.diff(true[:, 2]) - np.diff(modelled.pressure_lowering)
            result[:, 3] = (true[:, 3] - modelled.deflection)[1:]
        result[:, np.isnan(self._experiment.outputs[0])] = np.nan
        return result

    def _undistorted(self, machine: Machine) -> Array:
        """Return angle, p_H, p_S, deflection and the smoothed angle and rate, (n, 6).

        What they truly were if the sensors distort them as the machine's effects say.
        """
        effects = machine.effects
        angle = self._undelayed(effects, "angle", self._smooth_angle, self._rate)
        rate = self._undelayed(effects, "angle", self._rate, self._rate_slope)
        slopes = (self._rate, None, None, None)
        columns = [
            _unscaled(effects, name, self._undelayed(effects, name, shown, slope))
            for name, shown, slope in zip(
                ("angle", H, S, "deflection"), self._shown.T, slopes, strict=True
            )
        ]
        angle = _unscaled(effects, "angle", angle)
        return np.column_stack([*columns, angle, rate / (1.0 + effects.sensor_gain.angle)])

    def _undelayed(
        self, effects: Effects, sensor: str, signal: Array, slope: Array | None = None
    ) -> Array:
        """Return a sensor's signal, (n,), without its lag and dead time.

        slope: (n,) 1/s of it; of what the sensor shows, smoothed, when not given.
        """
        late = effects.sensor_delay
        dead = late.dead_share * getattr(late, sensor)
        lag = getattr(late, sensor) - dead
        if lag > 0.0:
            signal = signal + lag * (self._slope(sensor, signal) if slope is None else slope)
        if dead == 0.0:
            return signal
        time = self._experiment.time
        return np.asarray(np.interp(time + dead, time, signal))

    def _slope(self, sensor: str, shown: Array) -> Array:
        if sensor not in self._slopes:  # found when asked for, since few sensors lag
            self._slopes[sensor] = _smoothed(shown, LAG_SMOOTHING, self._experiment.period)[1]
        return self._slopes[sensor]

    def _modelled(
        self, plants: Sequence[Plant], true: Array, angle: int, longest: float
    ) -> list[tuple[int, Modelled]]:
        experiment = self._experiment
        starts = {}
        for k, plant in enumerate(plants):
            rest = true[k, : experiment.rest]
            try:
                starts[k] = plant.initial(
                    float(rest[:, 0].mean()), max(float(rest[:, 2].mean()), 0.0)
                )
            except SimulationError:
                continue
        if not starts:
            return []
        able = list(starts)
        records = _by_velocity([plants[k].record for k in able])
        commands, step = experiment.mean_commands(min(longest, longest_step(records)))
        followed = follow(
            np.array(list(starts.values())),
            commands,
            step,
            np.ascontiguousarray(true[able][:, :, [1, 2, SMOOTHED, 5, angle]]),
            records,
        )
        return [(k, Modelled(*columns)) for k, columns in zip(able, followed, strict=True)]

    def _stroke(self, plant: Plant, true: Array) -> Array:
        """Return the stroke that the machine has at the angle, (n,) m, as it is shown."""
        experiment = self._experiment
        if not plant.machine.sensors.own_stroke:
            return self._stated_stroke
        force = np.zeros(len(true))
        if {H, S} <= experiment.measured:
            force = true[:, 1] * self._areas[0] - true[:, 2] * self._areas[1]
        return np.asarray(terms.strokes(np.ascontiguousarray(true[:, 0]), force, plant.record[0]))

    def _true_stroke(self, machine: Machine) -> Array:
        """Return the stroke as shown, (n,) m, or as it truly was if its sensor distorts it."""
        shown = self._experiment.outputs[:, 0]
        if not machine.sensors.own_stroke:
            return shown
        effects = machine.effects
        undelayed = self._undelayed(effects, "stroke", shown)
        return _unscaled(effects, "stroke", undelayed)

    def _missing(self, modelled: Modelled, true: Array, off: Array) -> Array:
        """Return what is missing in each balance; off: stroke beyond the machine's, (n,) m."""
        period = self._experiment.period
        angle, lifting, lowering, deflection = true[:, :4].T
        lifting = lifting - modelled.pressure_lifting
        lowering = lowering - modelled.pressure_lowering
        turning = angle - modelled.bending
        turning = turning - _integral(modelled.turning, period)
        filled = [self._surely_filled(side, true[:, 1 + side]) for side in (0, 1)]
        return np.column_stack(
            [
                self._turn(turning) * self._mean(self._force_per_turning),
                self._flow(lifting) * self._mean(self._flow_per_rate[:, 0]) * filled[0],
                self._flow(lowering) * self._mean(self._flow_per_rate[:, 1]) * filled[1],
                self._mean(off),
                self._mean(deflection - modelled.deflection),
            ]
        )

    def _surely_filled(self, side: int, true: Array) -> Array:
        """Return in which windows, (w,), a chamber is filled, by what is shown and what is true.

        From one to none between two pressures, or a fit would have no slope over a bias.
        """
        filled, low = np.asarray(self._filled[side]), self._low[side]
        noise = self._pressure_noises[side]
        if not np.any(low):
            return filled
        share = np.clip(self._mean.least(true) / noise - EMPTY + 1.0, 0.0, 1.0)
        return np.asarray(np.where(low, share, 1.0) * filled)


def level(residual: Array) -> Array:
    """Return the RMS of each column, (w, b) -> (b,), over the quieter 95 % of the windows.

    In a few windows (a chamber at zero pressure, a logic block about to close) noise or a slight
    error of a parameter makes far more than elsewhere; they would decide alone.
    """
    squares = np.sort(residual**2, axis=0)
    return np.asarray(np.sqrt(np.mean(squares[: math.ceil(QUIETER * len(squares))], axis=0)))


def available(measured: frozenset[str]) -> NDArray[np.bool_]:
    """Tell which of BALANCES the measured signals allow, (5,)."""
    return np.array([balance.signals <= measured for balance in BALANCES.values()])


def _unscaled(effects: Effects, sensor: str, signal: Array) -> Array:
    """Return a sensor's signal, (n,), without its bias and gain."""
    bias = getattr(effects.sensor_bias, sensor)
    return np.asarray((signal - bias) / (1.0 + getattr(effects.sensor_gain, sensor)))


def _smoothed(signal: Array, length: float, period: float) -> tuple[Array, Array]:
    """Return a signal smoothed by parabolas over a length, s, and its rate."""
    samples = max(5, 2 * round(length / period / 2.0) + 1)
    rate = savgol_filter(signal, samples, 2, deriv=1, delta=period)
    return np.asarray(savgol_filter(signal, samples, 2)), np.asarray(rate)


class _Window:
    """The highest coefficient of a polynomial fitted to a signal in moving windows.

    degree 0: mean; 1: rate; 2: acceleration. Windows of every length (s) share their middles:
    `longest` is the length that decides where they can stand.
    """

    def __init__(self, length: float, longest: float, period: float, degree: int) -> None:
        self._size = round(length / period)
        self._first = (round(longest / period) - self._size) // 2
        self._span = round(longest / period)
        self._every = max(1, round(WINDOW_STEP / period))
        powers = np.vander(np.arange(self._size) * period, degree + 1, increasing=True)
        factorial = (1.0, 1.0, 2.0)[degree]
        self._weights = np.linalg.pinv(powers)[degree] * factorial

    def __call__(self, signal: Array) -> Array:
        with np.errstate(invalid="ignore", over="ignore"):  # of a machine that cannot be
            return np.asarray(self._views(signal) @ self._weights)

    def least(self, signal: Array) -> Array:
        """Return the least value in each window, (w,)."""
        return np.asarray(self._views(signal).min(axis=1))

    def _views(self, signal: Array) -> Array:
        count = signal.size - self._span + 1
        return sliding_window_view(signal[self._first :], self._size)[: count : self._every]


def _integral(rate: Array, period: float) -> Array:
    total = np.zeros_like(rate)
    np.cumsum(0.5 * period * (rate[1:] + rate[:-1]), out=total[1:])
    return total


def noise_floor(experiment: Experiment, machine: Machine, geometry: Machine) -> Array:
    """Return the residuals, (d, w, 5), that the sensors alone leave in each balance, in d draws.

    geometry: as for `Balances`.

    Found by simulating the machine under the recorded command, reading it through the sensors'
    noise and quantisation, and computing its balances with its own parameters. Of a short
    recording several times: a few windows are uncertain, and how much the resolver's steps make
    depends on where in a step the boom rests. Raises SimulationError where the machine cannot rest
    as the recording starts, or its run leaves every bound.
    """
    angle, pressure = experiment.start()
    pressure = machine.supply.pT if np.isnan(pressure) else pressure
    draws = max(1, round(NOISE_DRAWN / float(experiment.time[-1])))
    step = machine.sensors.resolver_step
    inside = step * ((np.arange(draws) + 0.5) / draws - 0.5)
    ideal = free_runs([machine] * draws, experiment, [(angle + off, pressure) for off in inside])
    if not np.all(np.isfinite(ideal)):
        raise SimulationError(
            f"{experiment.name}: the data sheet's machine cannot rest at"
            f" {math.degrees(angle):.1f} deg, where it starts, or its run leaves every bound"
        )
    colour = colours(experiment, machine)
    seen = [sensed(experiment, machine, run, seed, colour) for seed, run in enumerate(ideal)]
    return np.array([Balances(each, geometry).residuals([machine])[0] for each in seen])


def sensed(
    experiment: Experiment,
    machine: Machine,
    ideal: Array,
    seed: int = 0,
    colour: Array | None = None,
) -> Experiment:
    """Return the experiment as the machine's sensors show ideal readings, (n, 5) as SHOWN.

    colour: (4,) of their noise as `colours` tells it, white when not given.
    """
    sensors = machine.sensors
    p = Plant(machine).record[0]
    angle = np.array([resolver(a, sensors.resolver_step) for a in ideal[:, ANGLE_COLUMN]])
    noise = np.random.default_rng(seed).standard_normal((len(angle), 3))
    if colour is not None:
        noise = coloured(noise, colour[1:])
    scale = (*sensors.pressure_noises, sensors.deflection_noise)
    stroke = ideal[:, STROKE_COLUMN] if sensors.own_stroke else linkage.strokes(angle, p)
    shown = np.column_stack([stroke, ideal[:, 2:] + noise * scale])
    return experiment.showing(angle, shown)
