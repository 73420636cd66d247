"""A recording as the diagnosis uses it: all sensors on one time grid, the command held between."""

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from emir_analysis.errors import InputError
from emir_analysis.signals import Array, Recording, Signal, SignalMap, load
from emir_plant import linkage
from emir_plant.parameters import Machine
from emir_plant.record import record

COMMAND = "valve_command"
ANGLE = "joint_angle"
OUTPUTS = {  # what a free run is compared with, in this order, and its unit
    "piston_stroke": "m",
    "pressure_lifting": "Pa",
    "pressure_lowering": "Pa",
    "tip_deflection_angle": "rad",
}
NEEDED = {COMMAND: "1", ANGLE: "rad"} | OUTPUTS

COMMAND_STEP = 1e-3  # s, the grid on which the held command is kept
SHORTEST = 10.0  # s: some periods of the slow mode, and a third to hold back
LARGEST_GAP = 0.2  # s without a sample: the slow mode is still followed by interpolation
REST = 0.2  # s at the start from which the initial pressure is averaged
SHORTEST_REST = 0.1  # s
LEAST_MOTION = 20  # resolver steps of travel below which nothing can be told from a recording


@dataclass(frozen=True)
class Experiment:
    """One recording on a common time grid, from rest.

    period: s, between samples. commands: (k,) y2 every COMMAND_STEP. angle: (n,) rad.
    outputs: (n, 4) in the order of OUTPUTS, SI units. rest: samples at rest at the start.
    """

    name: str
    period: float
    commands: Array
    angle: Array
    outputs: Array
    rest: int

    @property
    def time(self) -> Array:
        """Time of the samples, (n,) s."""
        return self.period * np.arange(self.angle.size, dtype=np.float64)

    @property
    def every(self) -> int:
        """Steps of the command grid between two samples."""
        return round(self.period / COMMAND_STEP)

    def head(self, share: float) -> "Experiment":
        """Return the first part of the recording."""
        samples = int(share * (self.angle.size - 1)) + 1
        return replace(
            self,
            commands=self.commands[: (samples - 1) * self.every],
            angle=self.angle[:samples],
            outputs=self.outputs[:samples],
        )

    def start(self) -> tuple[float, float]:
        """Return angle, rad, and p_S, Pa, at rest: the means of the first samples."""
        return float(self.angle[: self.rest].mean()), float(self.outputs[: self.rest, 2].mean())


def open_experiment(path: Path, signal_map: SignalMap, machine: Machine) -> Experiment:
    """Load a recording for the diagnosis.

    Raises InputError for a missing signal, another unit, gaps, a recording that is too short,
    does not start at rest or never moves; the message says what to record instead.
    """
    for name, unit in NEEDED.items():
        if name not in signal_map:
            raise InputError(f"the signal map has no {name}, which the diagnosis needs")
        if signal_map[name][2] != unit:
            raise InputError(f"the signal map has {name} in {signal_map[name][2]}, expected {unit}")
    recording = load(path, {name: signal_map[name] for name in NEEDED})
    return experiment(str(path), recording, machine)


def experiment(name: str, recording: Recording, machine: Machine) -> Experiment:
    """Bring a recording's signals on one grid. Raises InputError as `open_experiment`."""
    sensors = [recording[signal] for signal in (ANGLE, *OUTPUTS)]
    for signal in sensors:
        _check_sampling(name, signal)
    begin = max(signal.time[0] for signal in sensors)
    end = min(signal.time[-1] for signal in sensors)
    if end - begin < SHORTEST:
        raise InputError(
            f"{name}: {max(end - begin, 0.0):.1f} s that all signals share;"
            f" record at least {SHORTEST:.0f} s"
        )
    every = max(1, round(float(np.median(np.diff(sensors[0].time))) / COMMAND_STEP))
    period = every * COMMAND_STEP
    # one microsecond of slack against stamps that were rounded
    time = begin + np.arange(int((end - begin + 1e-6) / period) + 1) * period
    angle, *outputs = (np.interp(time, signal.time, signal.value) for signal in sensors)
    commands = _held(recording[COMMAND], begin, every * (time.size - 1))
    rest = _rest(name, commands, period, machine)
    _check_motion(name, angle, machine)
    return Experiment(name, period, commands, angle, np.stack(outputs, axis=1), rest)


def noise(machine: Machine) -> Array:
    """Return the standard deviations of the outputs' sensors, (4,), SI units.

    The stroke comes from the resolver: a step's uniform error, mapped to the stroke at the
    angle of 45 deg.
    """
    sensors = machine.sensors
    step = sensors.resolver_span / 2**sensors.resolver_bits
    arm = linkage.lever_arm(np.pi / 4.0, record(machine)[0])
    return np.array(
        [
            arm * step / math.sqrt(12.0),
            sensors.pressure_noise,
            sensors.pressure_noise,
            sensors.deflection_noise,
        ]
    )


def _held(command: Signal, begin: float, count: int) -> Array:
    """Return the command on its grid, each message held until the next."""
    time = begin + np.arange(count) * COMMAND_STEP
    latest = np.searchsorted(command.time, time + 1e-6, side="right") - 1
    return np.clip(command.value[np.maximum(latest, 0)], -1.0, 1.0)


def _check_sampling(name: str, signal: Signal) -> None:
    gaps = np.diff(signal.time)
    widest = int(np.argmax(gaps))
    if gaps[widest] > LARGEST_GAP:
        raise InputError(
            f"{name}: {signal.name} has a gap of {gaps[widest]:.2f} s"
            f" at {signal.time[widest]:.2f} s; record without gaps"
        )


def _rest(name: str, commands: Array, period: float, machine: Machine) -> int:
    moving = np.flatnonzero(np.abs(commands) > machine.valve.dead_zone)
    if moving.size == 0:
        raise InputError(f"{name}: the valve command never leaves the dead zone; nothing moves")
    rest = moving[0] * COMMAND_STEP
    if rest < SHORTEST_REST:
        raise InputError(f"{name}: starts moving at {rest:.2f} s; record a second at rest before")
    return max(1, int(min(rest, REST) / period))


def _check_motion(name: str, angle: Array, machine: Machine) -> None:
    step = machine.sensors.resolver_span / 2**machine.sensors.resolver_bits
    if np.ptp(angle) < LEAST_MOTION * step:
        raise InputError(
            f"{name}: never moves (the angle stays within {np.ptp(angle):.2g} rad);"
            " record moves up and down over some degrees"
        )
