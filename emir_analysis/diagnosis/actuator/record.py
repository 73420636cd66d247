"""A recording of an actuator as its diagnosis uses it: opening and pressure on one time grid."""

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from emir_analysis.diagnosis.wild_readings import MOST, described, stick_out, told_of
from emir_analysis.errors import InputError
from emir_analysis.signals import Array, Signal, SignalMap, load

OPENING, PRESSURE = "valve_opening", "oil_pressure"
FEWEST = 200  # samples: some periods of the slow mode, and blocks to leave out
LARGEST_GAP = 1.5  # sampling periods
AT_REST = 8  # samples from which on a machine may be seen to rest
STEADY = 2.0  # times the noise: the most that a pressure at rest varies
BEGINNING = 5  # samples, over which it shows whether a machine moves already
SURELY = 8.0  # times the noise: a change that two readings at rest do not have
SAME_PERIOD = 1e-3  # relative, within which two recordings are sampled alike
NOT_OF_ORDER_ONE = 50.0  # times one, or less by as much: effects have other sizes then
SMALLEST_MOTION = 1e-9  # spread of a signal, relative to its size, below which it is constant


@dataclass(frozen=True)
class ActuatorRecord:
    """One recording. opening, pressure: (n,). period: between samples, in the stamps' unit.

    begin: stamp of the first sample. unit: of the pressure. left_out: a line where single wild
    readings of the pressure were left out.
    """

    name: str
    begin: float
    period: float
    opening: Array
    pressure: Array
    unit: str
    left_out: str = ""

    @property
    def time(self) -> Array:
        """Return the stamps of the samples, (n,)."""
        return self.begin + self.period * np.arange(self.opening.size, dtype=np.float64)

    @property
    def start(self) -> float:
        """Return the pressure at the first sample: of a machine at rest, until it is moved.

        One sample's noise would swing on in a free run that is hardly damped.
        """
        moved = np.abs(self.opening - self.opening[0]) > SMALLEST_MOTION * np.ptp(self.opening)
        still = self.pressure[: np.argmax(moved)]
        if still.size >= AT_REST and np.std(still) <= STEADY * noise_of(still):
            return float(np.mean(still))
        return float(self.pressure[0])

    def begins_moving(self, gain: float, noise: float) -> bool:
        """Tell whether the machine moves already when the recording begins.

        Over the first samples its pressure then changes by more than what the valve lets in and
        the noise make. gain: of the valve. noise: of the pressure.
        """
        changed = np.abs(self.pressure[1:BEGINNING] - self.pressure[0])
        let_in = abs(gain) * self.period * np.cumsum(np.abs(self.opening[:BEGINNING]))
        return bool(np.any(changed > SURELY * noise + let_in[1:]))

    def follows(self, earlier: "ActuatorRecord") -> bool:
        """Return whether this recording goes on where another has ended."""
        gap = self.begin - (earlier.begin + earlier.period * earlier.opening.size)
        same = abs(self.period - earlier.period) < 1e-6 * self.period
        return same and abs(gap) < 0.5 * self.period

    def in_samples(self, period: float) -> "ActuatorRecord":
        """Return the recording with stamps that count samples, which came every period."""
        return replace(self, begin=self.begin / period, period=self.period / period)

    def behind(self, earlier: "ActuatorRecord") -> "ActuatorRecord":
        """Return the earlier recording and this one as one."""
        return replace(
            earlier,
            opening=np.concatenate([earlier.opening, self.opening]),
            pressure=np.concatenate([earlier.pressure, self.pressure]),
        )


def open_record(path: Path, signal_map: SignalMap) -> ActuatorRecord:
    """Load a recording of valve opening and oil pressure.

    Raises InputError for a missing signal, another unit, gaps, a recording that is too short or
    in which the valve or the pressure never moves; the message says what to record instead.
    """
    for name in (OPENING, PRESSURE):
        if name not in signal_map:
            raise InputError(f"the signal map has no {name}, which an actuator's diagnosis needs")
    if signal_map[OPENING][2] != "1":
        raise InputError(f"the signal map has {OPENING} in {signal_map[OPENING][2]}, expected 1")
    recording = load(path, {name: signal_map[name] for name in (OPENING, PRESSURE)})
    opening, pressure = recording[OPENING], recording[PRESSURE]
    period = float(np.median(np.diff(pressure.time)))
    for signal in (opening, pressure):
        _check(path, signal, period)
    begin = max(opening.time[0], pressure.time[0])
    count = int((min(opening.time[-1], pressure.time[-1]) - begin) / period + 1e-6) + 1
    if count < FEWEST:
        raise InputError(
            f"{path}: {max(count, 0)} samples that both signals share; record at least {FEWEST}"
        )
    time = begin + period * np.arange(count)
    record = ActuatorRecord(
        str(path),
        recording.start_ns * 1e-9 + begin,
        period,
        np.interp(time, opening.time, opening.value),
        np.interp(time, pressure.time, pressure.value),
        pressure.unit,
    )
    _check_scale(path, OPENING, float(np.abs(record.opening).max()))
    _check_scale(path, PRESSURE, float(np.std(record.pressure)))
    return _tamed(record)


def _tamed(record: ActuatorRecord) -> ActuatorRecord:
    """Return a recording with a few pressures that stick out made up from those beside them."""
    shown, wild = record.pressure, stick_out(record.pressure, noise_of(record.pressure))
    lost, first = int(np.count_nonzero(wild)), int(np.argmax(wild))
    if not 0 < lost <= MOST * wild.size:
        return record
    alone = described(shown, first, first + 1, f"at {record.time[first]:.6g}")
    told = told_of(record.name, PRESSURE, lost, wild.size, alone)
    pressure = np.interp(record.time, record.time[~wild], shown[~wild])
    return replace(record, pressure=pressure, left_out=told)


def open_judge(path: Path, signal_map: SignalMap, record: ActuatorRecord) -> ActuatorRecord:
    """Load a recording to judge on. Raises InputError as `open_record`, and for another period.

    A linear model of samples, which is shown beside, knows no other.
    """
    judge = open_record(path, signal_map)
    if abs(judge.period / record.period - 1.0) > SAME_PERIOD:
        raise InputError(
            f"{path}: a sample every {judge.period:.4g}, {record.name} one every"
            f" {record.period:.4g}; record both alike"
        )
    return judge


def _check_scale(path: Path, name: str, size: float) -> None:
    """Raise InputError where a signal is not scaled as the effects' sizes are."""
    if not 1.0 / NOT_OF_ORDER_ONE <= size <= NOT_OF_ORDER_ONE:
        by = f"{10.0 ** round(math.log10(size)):g}"
        then = f"divide it, the data sheet's valve.gain and sensor.pressure_noise by {by}"
        if name == OPENING:
            then = f"divide it by {by} and multiply the data sheet's valve.gain by that"
        raise InputError(
            f"{path}: {name} is of the size {size:.3g}; effects are looked for in signals of the"
            f" order of one: {then}"
        )


def noise_of(pressure: Array) -> float:
    """Return the white noise in a smooth signal, from the median of its third differences.

    At least the error of the steps in which it is recorded.
    """
    third = np.diff(pressure, 3)
    step = np.min(np.diff(np.unique(pressure)), initial=np.ptp(pressure))
    return float(max(np.median(np.abs(third)) / (0.6745 * np.sqrt(20.0)), step / np.sqrt(12.0)))


def _check(path: Path, signal: Signal, period: float) -> None:
    gaps = np.diff(signal.time)
    widest = int(np.argmax(gaps))
    if gaps[widest] > LARGEST_GAP * period:
        raise InputError(
            f"{path}: {signal.name} has a gap of {gaps[widest]:.3g} at {signal.time[widest]:.3f},"
            f" sampled every {period:.3g}; record without gaps"
        )
    if np.ptp(signal.value) <= SMALLEST_MOTION * np.abs(signal.value).max():
        raise InputError(
            f"{path}: {signal.name} is constant ({signal.value[0]:g});"
            " record the valve opened both ways, several times"
        )
