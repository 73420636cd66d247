"""A recording as the diagnosis uses it: all sensors on one time grid, the command held between."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from pathlib import Path

import numpy as np

from emir_analysis.diagnosis.command_grid import as_given
from emir_analysis.diagnosis.recording_checks import (
    ROUNDING,
    Stamps,
    check_before_command,
    check_command,
    check_direction,
    check_motion,
    check_readings,
    check_sampling,
    check_shared,
    check_values,
    stamps,
)
from emir_analysis.diagnosis.sampling import Sampling, grid_period, sampling, steps
from emir_analysis.diagnosis.steady_stamps import steadied, steadied_told
from emir_analysis.diagnosis.wild_readings import tamed
from emir_analysis.errors import InputError
from emir_analysis.root_mean_square import rms
from emir_analysis.signals import Array, Recording, Signal, SignalMap, load
from emir_plant import linkage
from emir_plant.parameters import Machine
from emir_plant.record import record

COMMAND = "valve_command"
ANGLE = "joint_angle"
STROKE = "piston_stroke"
PRESSURE_LIFTING = "pressure_lifting"
PRESSURE_LOWERING = "pressure_lowering"
OUTPUTS = {  # what a free run is compared with, in this order, and its unit
    STROKE: "m",
    PRESSURE_LIFTING: "Pa",
    PRESSURE_LOWERING: "Pa",
    "tip_deflection_angle": "rad",
}
SIGNALS = {COMMAND: "1", ANGLE: "rad"} | OUTPUTS

COMMAND_STEP = 1e-3  # s, the grid on which the held command is kept, or near it
SHARES = 2  # digits of the shares of such a step: stamps are rounded to microseconds
SUBSTEP = 2e-3  # s, of coarse integration: a tenth of the spool's period and less
SHORTEST = 10.0  # s: some periods of the slow mode, and a third to hold back
REST = 0.2  # s at the start from which the initial pressure is averaged
SHORTEST_REST = 0.1  # s
NAME_CUTOFF = 0.85  # of two names, in which they are probably the same (difflib)
OWN_STROKE = 2.0  # times the resolver's error, by which a stroke that it does not show differs


@dataclass(frozen=True)
class Experiment:
    """One recording on a common time grid, from rest.

    period: s, between samples. commands: (k,) y2 every `step`. angle: (n,) rad.
    outputs: (n, 4) in the order of OUTPUTS, SI units, NaN where there is no sensor. rest: samples
    at rest at the start. measured: names of the signals that sensors show; of angle and stroke
    the one that none shows is computed from the other. own_stroke: the stroke is the piston's,
    not what the stated linkage makes of the angle. stamps: the least steady of each kind among the
    sensors. mended: a line for what was mended in them, as wild readings left out. sampling: when
    angle and outputs were read. later: (l,) the commands behind the last sample that a run needs
    for the readings on both its sides.
    """

    name: str
    period: float
    commands: Array
    angle: Array
    outputs: Array
    rest: int
    measured: frozenset[str] = frozenset({ANGLE, *OUTPUTS})
    own_stroke: bool = False
    stamps: Stamps = Stamps()
    mended: tuple[str, ...] = ()
    sampling: Sampling = Sampling()
    later: Array = field(default_factory=lambda: np.zeros(0))

    @property
    def time(self) -> Array:
        """Time of the samples, (n,) s."""
        return self.period * np.arange(self.angle.size, dtype=np.float64)

    @property
    def weights(self) -> Array:
        """What each output's error counts in a fit, (n, 4): n readings that stay the same as one.

        A resolver in one and the same step errs by the same part of it all the time.
        """
        changed = np.diff(self.outputs, axis=0, prepend=np.nan) != 0.0
        since = np.cumsum(changed, axis=0) - 1
        alike = [np.bincount(column)[column] for column in since.T]
        return np.asarray(1.0 / np.sqrt(np.column_stack(alike)))

    @property
    def every(self) -> int:
        """Steps of the command grid between two samples."""
        return steps(self.period, COMMAND_STEP)

    @property
    def step(self) -> float:
        """Of the command grid, s: COMMAND_STEP where sensors are read every whole such step."""
        return self.period / self.every

    @property
    def every_row(self) -> int:
        """Steps of the command grid between two rows of a run from which the sensors read."""
        return self.every // self.sampling.rows_between(self.every, self.step)

    def stride(self, longest: float) -> int:
        """Return the most steps of the command grid, within `longest`, s, that divide a row."""
        fitting = (n for n in range(1, self.every_row + 1) if self.every_row % n == 0)
        return max(n for n in fitting if n == 1 or n * self.step <= longest)

    def mean_commands(self, longest: float) -> tuple[Array, float]:
        """Return the mean command over each of equal steps, (m,), and their length, s.

        A sample's period is as few of them as leave none longer than `longest`, s.
        """
        steps = math.ceil((self.period - ROUNDING) / longest)
        step = self.period / steps
        integral = np.append(0.0, np.cumsum(self.commands)) * self.step
        time = step * np.arange(self.commands.size // self.every * steps + 1)
        reached = np.interp(time, self.step * np.arange(integral.size), integral)
        return np.diff(reached) / step, step

    def head(self, share: float) -> "Experiment":
        """Return the first part of the recording."""
        return self.until(share * self.period * (self.angle.size - 1))

    def until(self, time: float) -> "Experiment":
        """Return the recording up to a time, s."""
        samples = min(int(time / self.period + 1e-6) + 1, self.angle.size)
        further = self.sampling.further((samples - 1) * self.period, self.period)
        count = (samples - 1) * self.every
        given = np.concatenate([self.commands, self.later])
        return replace(
            self,
            commands=given[:count],
            angle=self.angle[:samples],
            outputs=self.outputs[:samples],
            later=given[count : count + further * self.every],
        )

    def showing(self, angle: Array, outputs: Array) -> "Experiment":
        """Return the recording with other readings of the same sensors."""
        outputs = np.where(np.isnan(self.outputs[0]), np.nan, outputs)
        return replace(self, angle=angle, outputs=outputs)

    def under(self, commands: Array) -> "Experiment":
        """Return a run from the same rest under other commands, (k,), without readings."""
        samples = commands.size // self.every + 1
        return replace(
            self,
            commands=commands[: (samples - 1) * self.every],
            angle=np.full(samples, self.angle[: self.rest].mean()),
            outputs=np.tile(self.outputs[: self.rest].mean(axis=0), (samples, 1)),
            sampling=Sampling(),
            later=np.zeros(0),
        )

    def start(self) -> tuple[float, float]:
        """Return angle, rad, and p_S, Pa, at rest when the recording starts.

        The first reading, since a leak may let the boom sink by many steps of a fine resolver
        before its first move. p_S is NaN where no sensor shows it.
        """
        return float(self.angle[0]), self.pressure_at_rest(PRESSURE_LOWERING)

    def pressure_at_rest(self, name: str) -> float:
        """Return a pressure, Pa, when the recording starts; NaN where no sensor shows it.

        Where a line through the first samples begins: a leak moves it by several times its noise.
        """
        pressure = self.outputs[: self.rest, list(OUTPUTS).index(name)]
        later = self.time[: self.rest] - self.time[: self.rest].mean()
        slope = later @ pressure / max(later @ later, self.period**2)
        return float(pressure.mean() + slope * later[0])


def open_experiment(path: Path, signal_map: SignalMap, machine: Machine) -> Experiment:
    """Load a recording for the diagnosis.

    A sensor that the signal map leaves out is done without. Raises InputError as
    `check_signal_map`, and for gaps, a recording that is too short, does not start at rest or
    never moves; the message says what to record instead.
    """
    check_signal_map(signal_map)
    mapped = {name: signal_map[name] for name in SIGNALS if name in signal_map}
    return experiment(str(path), load(path, mapped), machine)


def check_signal_map(signal_map: SignalMap) -> None:
    """Raise InputError for a missing command, a missing angle and stroke, another unit.

    And for a name that is nearly that of a signal which the map has not.
    """
    if COMMAND not in signal_map:
        raise InputError(f"the signal map has no {COMMAND}, without which nothing can be told")
    if not {ANGLE, STROKE} & set(signal_map):
        raise InputError(f"the signal map has neither {ANGLE} nor {STROKE}; one is needed")
    for name in signal_map:
        near = get_close_matches(name, SIGNALS, n=1, cutoff=NAME_CUTOFF)
        if name not in SIGNALS and near and near[0] not in signal_map:
            raise InputError(f"the signal map has {name}; is {near[0]} meant?")
    for name, unit in SIGNALS.items():
        if name in signal_map and signal_map[name][2] != unit:
            raise InputError(f"the signal map has {name} in {signal_map[name][2]}, expected {unit}")


def experiment(name: str, recording: Recording, machine: Machine) -> Experiment:
    """Bring a recording's signals on one grid. Raises InputError as `open_experiment`."""
    sensors, mended = _sensors(name, recording, machine)
    check_shared(name, list(sensors.values()))
    begin, end = _shared_span(name, list(sensors.values()))
    check_command(name, recording[COMMAND], begin, end, machine)
    period = grid_period(next(iter(sensors.values())).time, begin, COMMAND_STEP)
    every = steps(period, COMMAND_STEP)
    # one microsecond of slack against stamps that were rounded
    time = begin + np.arange(int((end - begin + 1e-6) / period) + 1) * period
    shown = {n: np.interp(time, signal.time, signal.value) for n, signal in sensors.items()}
    period_stated = machine.sensors.command_period
    command = as_given(name, recording[COMMAND], list(sensors.values()), period_stated)
    read = _sampling(sensors, time, begin)
    count = every * (time.size - 1)
    further = every * read.further(time[-1] - begin, period)
    given = _held(command, begin, count + further, period / every)
    commands, later = given[:count], given[count:]
    rest = _rest(name, commands, period, machine)
    measured = frozenset(shown)
    angle = shown[ANGLE] if ANGLE in shown else _angles(shown[STROKE], machine)
    if STROKE not in shown:
        shown[STROKE] = _strokes(angle, machine)
    # one of the two may be that of a sensor that stands still
    moved = max((angle, _angles(shown[STROKE], machine)), key=np.ptp)
    check_motion(name, moved, machine)
    check_before_command(name, time - begin, angle, recording[COMMAND].time[0] - begin)
    check_values(name, shown | {COMMAND: recording[COMMAND].value}, machine)
    for signal in sensors.values():
        check_readings(name, signal, time, angle, machine)
    check_direction(name, angle, np.append(commands, 0.0)[::every], machine)
    unknown = np.full(time.size, np.nan)
    outputs = np.stack([shown.get(output, unknown) for output in OUTPUTS], axis=1)
    own_stroke = {ANGLE, STROKE} <= measured and _has_own_sensor(shown[STROKE], angle, machine)
    least_steady = Stamps(*np.max([stamps(signal) for signal in sensors.values()], axis=0))
    return Experiment(
        name,
        period,
        commands,
        angle,
        outputs,
        rest,
        measured,
        own_stroke,
        least_steady,
        tuple(mended),
        read,
        later,
    )


def _sensors(
    name: str, recording: Recording, machine: Machine
) -> tuple[dict[str, Signal], list[str]]:
    """Return what the sensors show, wild readings and late stamps mended, and a line of each.

    Raises InputError for a sensor with a gap or with many wild readings.
    """
    sensors = {n: recording[n] for n in (ANGLE, *OUTPUTS) if n in recording.signals}
    for signal in sensors.values():
        check_sampling(name, signal)
    tame = {n: tamed(name, signal, machine) for n, signal in sensors.items()}
    sensors = {n: signal for n, (signal, _) in tame.items()}
    steady = steadied(sensors)
    mended = [told for _, told in tame.values() if told] + steadied_told(name, sensors, steady)
    return sensors | steady, mended


def _sampling(sensors: Mapping[str, Signal], time: Array, begin: float) -> Sampling:
    """Return when angle and outputs were read; what has no sensor counts as on the grid."""
    computed = {ANGLE: STROKE, STROKE: ANGLE}  # from the other, where it has no sensor
    shown_by = [n if n in sensors else computed.get(n) for n in (ANGLE, *OUTPUTS)]
    read_at = [time if n is None else sensors[n].time for n in shown_by]
    return sampling([times - begin for times in read_at], time - begin)


def _shared_span(name: str, signals: Sequence[Signal]) -> tuple[np.float64, np.float64]:
    """Return from when to when, s, there are all signals. Raises InputError if that is short."""
    begin = max(signal.time[0] for signal in signals)
    end = min(signal.time[-1] for signal in signals)
    if end - begin < SHORTEST:
        raise InputError(
            f"{name}: {max(end - begin, 0.0):.1f} s that all signals share;"
            f" record at least {SHORTEST:.0f} s"
        )
    return begin, end


def _has_own_sensor(stroke: Array, angle: Array, machine: Machine) -> bool:
    """Tell whether a stroke, (n,) m, is not just the measured angle, (n,) rad, converted."""
    apart = rms(stroke - _strokes(angle, machine))
    return machine.sensors.own_stroke == 1 or bool(apart > OWN_STROKE * noise(machine)[0])


def _angles(stroke: Array, machine: Machine) -> Array:
    """Return the boom angles, (n,) rad, of strokes, (n,) m."""
    angle = np.linspace(0.0, math.pi, 2000) - machine.geometry.triangle_gamma0
    return np.asarray(np.interp(stroke, _strokes(angle, machine), angle))


def _strokes(angle: Array, machine: Machine) -> Array:
    """Return the strokes, (n,) m, at boom angles, (n,) rad."""
    p = record(machine)[0]
    return np.asarray(linkage.strokes(angle, p))


def samples_at_rest(experiment: Experiment, machine: Machine) -> int:
    """Return how many samples come before the first move."""
    moving = np.flatnonzero(np.abs(experiment.commands) > machine.valve.dead_zone)
    return int(moving[0]) // experiment.every


def noise(machine: Machine) -> Array:
    """Return the standard deviations of the outputs' sensors, (4,), SI units.

    The stroke comes from the resolver: a step's uniform error, mapped to the stroke at the
    angle of 45 deg.
    """
    sensors = machine.sensors
    step = sensors.resolver_step
    arm = linkage.lever_arm(np.pi / 4.0, record(machine)[0])
    return np.array(
        [
            arm * step / math.sqrt(12.0),
            *sensors.pressure_noises,
            sensors.deflection_noise,
        ]
    )


def _held(command: Signal, begin: float, count: int, grid: float) -> Array:
    """Return the command on a grid, s, each message held until the next; 0 before the first.

    In a step within which a message comes the mean, so that none acts earlier or later.
    """
    edges = begin + np.arange(count + 1) * grid
    latest = np.searchsorted(command.time, edges[:-1] + ROUNDING, side="right") - 1
    held = np.where(latest < 0, 0.0, command.value[np.maximum(latest, 0)])
    step = np.searchsorted(edges, command.time - ROUNDING) - 1
    within = (step >= 0) & (step < count)
    left = 1.0 - (command.time - edges[step]) / grid
    change = np.round(left, SHARES) * np.diff(command.value, prepend=0.0)
    np.add.at(held, step[within], change[within])
    return np.asarray(np.clip(held, -1.0, 1.0))


def _rest(name: str, commands: Array, period: float, machine: Machine) -> int:
    moving = np.flatnonzero(np.abs(commands) > machine.valve.dead_zone)
    if moving.size == 0:
        raise InputError(
            f"{name}: the valve command never leaves the dead zone; record moves up and down"
        )
    rest = moving[0] * period / steps(period, COMMAND_STEP)
    if rest < SHORTEST_REST:
        raise InputError(f"{name}: starts moving at {rest:.2f} s; record a second at rest before")
    return max(1, int(min(rest, REST) / period))
