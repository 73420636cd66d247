"""The residual of each balance of the model, from measured signals, in integral form.

Over a window the measured change of a quantity is compared with the integral of its modelled
rate (see `measured_state`), so that no noisy or quantised signal is differentiated twice:

force            missing force on the piston, N, from the second integral of the boom's turning
lifting_chamber  missing flow into the lifting chamber, m^3/s, from the integral of dp_H/dt
lowering_chamber the same of the lowering chamber
linkage          measured stroke minus the linkage's stroke at the measured angle, m
bending          measured minus modelled tip deflection under the measured force, rad
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.signal import savgol_filter

from emir_analysis.diagnosis.experiment import COMMAND_STEP, Experiment
from emir_analysis.diagnosis.free_run import ANGLE, free_runs
from emir_analysis.diagnosis.measured_state import Rates, follow
from emir_analysis.signals import Array
from emir_plant import linkage
from emir_plant.parameters import Machine
from emir_plant.plant import Plant, SimulationError
from emir_plant.sensors import resolver

BALANCES = {
    "force": "N",
    "lifting_chamber": "m^3/s",
    "lowering_chamber": "m^3/s",
    "linkage": "m",
    "bending": "rad",
}

SMOOTHING = 0.25  # s, of the angle from which velocity and lever arm are read: a quarter bend
FLOW_WINDOW = 0.5  # s: the stroke's quantisation then weighs less than 1 % of the nominal flow
FORCE_WINDOW = 1.0  # s: below the slow mode's period, above which a force would average out
STEP = 0.25  # s, from one window to the next
SUBSTEP = 2e-3  # s, of the states that no sensor shows: a tenth of the spool's period and less


@dataclass(frozen=True)
class Residuals:
    """time: (w,) s, middle of the windows. value: (w, 5) in the order of BALANCES, SI units."""

    time: Array
    value: Array


class Balances:
    """The balances of one experiment, for any machine.

    geometry: the machine whose linkage, areas and boom (all without tolerance) turn rates into
    forces and flows; the units of a residual do so not depend on what is being fitted.
    """

    def __init__(self, experiment: Experiment, geometry: Machine) -> None:
        self._experiment = experiment
        period = experiment.period
        samples = 2 * round(SMOOTHING / period / 2.0) + 1
        self._angle = savgol_filter(experiment.angle, samples, 2)
        rate = savgol_filter(experiment.angle, samples, 2, deriv=1, delta=period)
        self._measured = np.column_stack([experiment.outputs[:, 1:3], self._angle, rate])
        p = Plant(geometry).record[0]
        arm = np.array([linkage.lever_arm(a, p) for a in self._angle])
        stroke = np.array([linkage.stroke(a, p) for a in experiment.angle])
        self._off_linkage = experiment.outputs[:, 0] - stroke
        self._flow_per_rate = np.column_stack(
            [
                (p["volume_lifting_0"] + p["area_lifting"] * stroke) / p["beta"],
                (p["volume_lowering_0"] - p["area_lowering"] * stroke) / p["beta"],
            ]
        )
        # a force F turns the boom as a rigid body by phi_0^2 r F, phi_0 the rigid mode's shape
        self._force_per_turning = 1.0 / (p["mode_joint"][0] ** 2 * arm)
        self.velocity = arm * rate
        self.force = (
            experiment.outputs[:, 1] * p["area_lifting"]
            - experiment.outputs[:, 2] * p["area_lowering"]
        )
        self._flow = _Window(FLOW_WINDOW, FORCE_WINDOW, period, degree=1)
        self._turn = _Window(FORCE_WINDOW, FORCE_WINDOW, period, degree=2)
        self._mean = _Window(FLOW_WINDOW, FORCE_WINDOW, period, degree=0)

    @property
    def time(self) -> Array:
        """Middle of the windows, (w,) s."""
        return self._mean(self._experiment.time)

    def average(self, signal: Array) -> Array:
        """Return a signal's mean over each window, (w,)."""
        return self._mean(signal)

    def residuals(self, machines: Sequence[Machine]) -> Array:
        """Return what is missing in each balance, (m, w, 5), SI units.

        NaN for a machine that cannot rest at the recording's start.
        """
        experiment = self._experiment
        plants = [Plant(machine) for machine in machines]
        angle, pressure = experiment.start()
        result = np.full((len(plants), self.time.size, len(BALANCES)), np.nan)
        for k, rates in self._rates(plants, angle, pressure):
            result[k] = self._missing(rates)
        return result

    def _rates(
        self, plants: Sequence[Plant], angle: float, pressure: float
    ) -> list[tuple[int, Rates]]:
        starts = {}
        for k, plant in enumerate(plants):
            try:
                starts[k] = plant.initial(angle, pressure)
            except SimulationError:
                continue
        if not starts:
            return []
        records = np.concatenate([plants[k].record for k in starts])
        every = self._experiment.every
        stride = max(
            n for n in range(1, every + 1) if every % n == 0 and n * COMMAND_STEP <= SUBSTEP
        )
        followed = follow(
            np.array(list(starts.values())),
            self._experiment.commands[::stride],
            COMMAND_STEP * stride,
            self._measured,
            records,
        )
        return [(k, Rates(*columns)) for k, columns in zip(starts, followed, strict=True)]

    def _missing(self, rates: Rates) -> Array:
        experiment = self._experiment
        period = experiment.period
        lifting = experiment.outputs[:, 1] - _integral(rates.pressure_lifting, period)
        lowering = experiment.outputs[:, 2] - _integral(rates.pressure_lowering, period)
        turning = experiment.angle - rates.bending
        turning = turning - _integral(_integral(rates.turning, period), period)
        return np.column_stack(
            [
                self._turn(turning) * self._mean(self._force_per_turning),
                self._flow(lifting) * self._mean(self._flow_per_rate[:, 0]),
                self._flow(lowering) * self._mean(self._flow_per_rate[:, 1]),
                self._mean(self._off_linkage),
                self._mean(experiment.outputs[:, 3] - rates.deflection),
            ]
        )


class _Window:
    """The highest coefficient of a polynomial fitted to a signal in moving windows.

    degree 0: mean; 1: rate; 2: acceleration. Windows of every length (s) share their middles:
    `longest` is the length that decides where they can stand.
    """

    def __init__(self, length: float, longest: float, period: float, degree: int) -> None:
        self._size = round(length / period)
        self._first = (round(longest / period) - self._size) // 2
        self._span = round(longest / period)
        self._every = max(1, round(STEP / period))
        powers = np.vander(np.arange(self._size) * period, degree + 1, increasing=True)
        factorial = (1.0, 1.0, 2.0)[degree]
        self._weights = np.linalg.pinv(powers)[degree] * factorial

    def __call__(self, signal: Array) -> Array:
        count = signal.size - self._span + 1
        views = sliding_window_view(signal[self._first :], self._size)[:count]
        return np.asarray(views[:: self._every] @ self._weights)


def _integral(rate: Array, period: float) -> Array:
    total = np.zeros_like(rate)
    np.cumsum(0.5 * period * (rate[1:] + rate[:-1]), out=total[1:])
    return total


def noise_floor(experiment: Experiment, machine: Machine) -> Array:
    """Return the RMS, (5,), that the sensors alone leave in each balance.

    Found by simulating the machine under the recorded command, reading it through the sensors'
    noise and quantisation, and computing its balances with its own parameters.
    """
    ideal = free_runs([machine], experiment, [experiment.start()])[0]
    residuals = Balances(sensed(experiment, machine, ideal), machine).residuals([machine])[0]
    return np.asarray(np.sqrt(np.mean(np.square(residuals), axis=0)))


def sensed(experiment: Experiment, machine: Machine, ideal: Array, seed: int = 0) -> Experiment:
    """Return the experiment as the machine's sensors show ideal readings, (n, 5) as SHOWN."""
    sensors = machine.sensors
    p = Plant(machine).record[0]
    angle = np.array(
        [resolver(a, sensors.resolver_bits, sensors.resolver_span) for a in ideal[:, ANGLE]]
    )
    noise = np.random.default_rng(seed).standard_normal((len(angle), 3))
    scale = (sensors.pressure_noise, sensors.pressure_noise, sensors.deflection_noise)
    shown = np.column_stack(
        [np.array([linkage.stroke(a, p) for a in angle]), ideal[:, 2:] + noise * scale]
    )
    return Experiment(
        experiment.name, experiment.period, experiment.commands, angle, shown, experiment.rest
    )
