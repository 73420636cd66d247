"""What makes a recording useless for a diagnosis, each said in one line with the remedy."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from emir_analysis.errors import InputError
from emir_analysis.signals import Array, Signal
from emir_plant.parameters import Machine

LARGEST_GAP = 0.2  # s without a sample: the slow mode is still followed by interpolation
ROUNDING = 1e-6  # s, of stamps
LONGEST_HELD = 0.5  # s without a command that is published regularly, valve open ...
MUCH_LONGER = 10.0  # ... and times the usual gap, that of ...
USUAL = 0.95  # of all
FROZEN = 1.0  # s that a sensor with noise shows the same number
DEAD = 10.0  # s that it shows its last one while the boom moves upwards and downwards
OFTEN = 0.05  # share of readings that repeat the one before, where steps are coarse
CLIPPED = 0.01  # share of readings that are the sensor's last
STUCK = 20.0  # s that a sensor shows nothing but its noise ...
QUIET = 1.3  # ... times what is stated of that
TRAVEL = 0.1  # of the whole travel, which the boom makes upwards and downwards in that time
NEGATIVE = -0.05  # of the pump's pressure; an absolute one is above 0, but for a bias
FAR_OFF = 20.0  # times its noise: no noise of a sensor is as large
NOISY = ("pressure_lifting", "pressure_lowering", "tip_deflection_angle")  # sensors
LEAST_MOTION = 20  # resolver steps of travel below which nothing can be told from a recording
AGAINST = 0.5  # of the whole travel, on balance, by which a boom moves against its command
AT_REST = 0.05  # of the whole travel: a boom that sinks through a leak before its first move
LEAST_PRESSURE = 1e-3  # of the pump's pressure; a chamber that stays below is not in Pa
LARGEST = {  # beyond which a signal is not in its unit, and the unit that it is likely in
    "valve_command": (1.001, "per cent"),
    "pressure_lifting": (1e9, "mPa"),
    "pressure_lowering": (1e9, "mPa"),
    "joint_angle": (2.0 * math.pi, "deg"),
    "tip_deflection_angle": (1.0, "mrad or deg"),
}


class Stamps(NamedTuple):
    """How the stamps of a signal deviate from those of a steady period, the median one."""

    scatter: float = 0.0  # s, of the gaps between them: the median
    lost: float = 0.0  # share of the samples that are not there


def check_sampling(name: str, signal: Signal) -> None:
    """Raise InputError where a signal has a gap, or comes too seldom at all."""
    gaps = np.diff(signal.time)
    usual = float(np.median(gaps))
    if usual > LARGEST_GAP + ROUNDING:
        raise InputError(
            f"{name}: {signal.name} comes every {usual:.3g} s; record at least"
            f" {1.0 / LARGEST_GAP:.0f} samples a second, or are its stamps in ms for s?"
        )
    widest = int(np.argmax(gaps))
    if gaps[widest] > LARGEST_GAP + ROUNDING:
        raise InputError(
            f"{name}: {signal.name} has a gap of {gaps[widest]:.2f} s"
            f" at {signal.time[widest]:.2f} s; record without gaps"
        )


def check_shared(name: str, sensors: Sequence[Signal]) -> None:
    """Raise InputError where one sensor has ended before another begins."""
    first = min(sensors, key=lambda signal: float(signal.time[-1]))
    last = max(sensors, key=lambda signal: float(signal.time[0]))
    if first.time[-1] < last.time[0]:
        raise InputError(
            f"{name}: {_from_to(first)} and {_from_to(last)} share no time; stamp all by one clock"
        )


def _from_to(signal: Signal) -> str:
    return f"{signal.name}, {signal.time[0]:.1f} ... {signal.time[-1]:.1f} s,"


def check_command(name: str, command: Signal, begin: float, end: float, machine: Machine) -> None:
    """Raise InputError where the command, held between its messages, is not what was given.

    From begin to end, s, of the sensors. A topic that repeats values is published regularly: it
    has lost messages where none come for long while the valve is open.
    """
    time, value = command.time, command.value
    if time[-1] < begin or time[0] > end:
        raise InputError(
            f"{name}: valve_command, {time[0]:.1f} ... {time[-1]:.1f} s, shares no time with the"
            f" sensors, {begin:.1f} ... {end:.1f} s; stamp all by one clock"
        )
    gaps = np.diff(np.append(time, max(end, time[-1])))
    usual = float(np.quantile(gaps, USUAL))
    open_ = np.abs(value) > machine.valve.dead_zone
    lost = open_ & (gaps > max(LONGEST_HELD, MUCH_LONGER * usual))
    if np.any(np.diff(value) == 0.0) and np.any(lost):
        first = int(np.argmax(lost))
        raise InputError(
            f"{name}: valve_command has a gap of {gaps[first]:.2f} s at {time[first]:.2f} s, where"
            " the valve is open; record without gaps"
        )


def check_readings(name: str, signal: Signal, time: Array, angle: Array, machine: Machine) -> None:
    """Raise InputError for a sensor that freezes or comes to its end.

    angle: (n,) rad at times, (n,) s.
    """
    moved = np.interp(signal.time, time, angle)
    _check_stuck(name, signal, moved, machine)
    for end in _ends(signal):
        if _is_clipped(signal, end, moved, machine):
            raise InputError(
                f"{name}: {signal.name} goes no further than {end:.4g} while the boom moves: there"
                " the sensor's range ends; record with one of a wider range, or leave it out of"
                " the signal map"
            )
    starts = np.flatnonzero(np.append(True, np.diff(signal.value) != 0.0))
    ends = np.append(starts[1:], signal.value.size) - 1
    for first, last in zip(starts.tolist(), ends.tolist(), strict=True):
        lasts = signal.time[last] - signal.time[first]
        if lasts > FROZEN and _is_frozen(signal, first, last, time, angle, machine):
            raise InputError(
                f"{name}: {signal.name} stays at {signal.value[first]:.4g} for {lasts:.1f} s from"
                f" {signal.time[first]:.2f} s while the boom moves; check the sensor and record"
                " again, or leave it out of the signal map"
            )


def _check_stuck(name: str, signal: Signal, angle: Array, machine: Machine) -> None:
    """Raise InputError where a sensor shows nothing but its noise while the boom moves both ways.

    In a steady move a pressure may show no more, and over a chamber that is empty for some time.
    angle: (n,) rad when the signal was measured.
    """
    noise = stated_noise(signal.name, machine)
    varied = np.std(signal.value) >= QUIET * noise
    count = int(STUCK / np.median(np.diff(signal.time)))
    for first in range(0, signal.value.size - count + 1, max(1, count // 10)):
        part = signal.value[first : first + count]
        far = _both_ways(angle[first : first + count]) > TRAVEL * np.ptp(angle)
        empty = varied and part.mean() < signal.value.min() + FAR_OFF * noise
        if far and not empty and np.std(part) < QUIET * noise:
            raise InputError(
                f"{name}: {signal.name} shows nothing but its noise about {part.mean():.4g} from"
                f" {signal.time[first]:.1f} s on while the boom moves; check the sensor and record"
                " again, or leave it out of the signal map"
            )


def stated_noise(name: str, machine: Machine) -> float:
    """Return the standard deviation that the data sheet states for a sensor, 0 for a resolver."""
    sensors = machine.sensors
    stated = (*sensors.pressure_noises, sensors.deflection_noise)
    return dict(zip(NOISY, stated, strict=True)).get(name, 0.0)


def _both_ways(angle: Array) -> float:
    """Return how far a boom moves upwards and downwards, rad: the lesser of the two."""
    up = np.max(angle - np.minimum.accumulate(angle))
    down = np.max(np.maximum.accumulate(angle) - angle)
    return float(min(up, down))


def _ends(signal: Signal) -> tuple[float, ...]:
    """Return the readings at which the sensor, not the machine, may have come to an end.

    A pressure's least is that of an empty chamber, an angle's are where the boom rests.
    """
    if signal.name not in NOISY:
        return ()
    highest, lowest = float(signal.value.max()), float(signal.value.min())
    return (highest,) if signal.name.startswith("pressure") else (highest, lowest)


def _is_clipped(signal: Signal, end: float, angle: Array, machine: Machine) -> bool:
    """Tell whether a signal with noise shows its last number again and again while the boom moves.

    angle: (n,) rad when the signal was measured.
    """
    at_end = signal.value == end
    others = np.diff(signal.value[~at_end])
    if others.size == 0 or np.mean(at_end) < CLIPPED or np.mean(others == 0.0) > OFTEN:
        return False
    bounds = np.flatnonzero(np.diff(at_end)) + 1
    stretches = zip(np.split(at_end, bounds), np.split(angle, bounds), strict=True)
    travel = sum(float(np.ptp(moved)) for inside, moved in stretches if inside[0])
    return travel > LEAST_MOTION * machine.sensors.resolver_step


def _is_frozen(  # noqa: PLR0913, PLR0917 (of one stretch of a recording)
    signal: Signal, first: int, last: int, time: Array, angle: Array, machine: Machine
) -> bool:
    """Tell whether a signal that shows one number from first to last ought to have moved.

    Noise moves each reading of a sensor but at its end, as over a chamber that is empty for some
    time, or where its steps are coarser than the noise: then others repeat, too. A resolver shows
    one step for as long as the boom rests, but does not jump then.
    """
    value = signal.value
    if signal.name not in NOISY:
        after = value[min(last + 1, value.size - 1)]
        return bool(abs(after - value[first]) > AT_REST * np.ptp(value))
    others = np.delete(np.diff(value), slice(first, last))
    if others.size == 0 or np.mean(others == 0.0) > OFTEN:
        return False
    during = angle[(time >= signal.time[first]) & (time <= signal.time[last])]
    if value[first] in {value.min(), value.max()}:
        for_long = signal.time[last] - signal.time[first] > DEAD
        return bool(for_long and _both_ways(during) > TRAVEL * np.ptp(angle))
    return bool(during.size and np.ptp(during) > LEAST_MOTION * machine.sensors.resolver_step)


def check_motion(name: str, angle: Array, machine: Machine) -> None:
    """Raise InputError where the boom never moves."""
    step = machine.sensors.resolver_step
    if np.ptp(angle) < LEAST_MOTION * step:
        raise InputError(
            f"{name}: never moves (the angle stays within {np.ptp(angle):.2g} rad);"
            " record moves up and down over some degrees"
        )


def check_direction(name: str, angle: Array, commands: Array, machine: Machine) -> None:
    """Raise InputError where the boom moves against the command: a sign is turned round.

    angle: (n,) rad; commands: (n,) at the same times.
    """
    opened = np.where(np.abs(commands) > machine.valve.dead_zone, np.sign(commands), 0.0)
    along = float(opened[:-1] @ np.diff(angle))
    if along < -AGAINST * np.ptp(angle):
        raise InputError(
            f"{name}: the boom moves against valve_command; the sign of that or of the boom's"
            " angle or stroke is turned round: all are positive upwards"
        )


def check_before_command(name: str, time: Array, angle: Array, first: float) -> None:
    """Raise InputError where the boom moves before the first command, at a time, s.

    A valve whose command is published when it changes has none before the first move.
    """
    before = angle[time < first]
    if before.size and np.ptp(before) > AT_REST * np.ptp(angle):
        raise InputError(
            f"{name}: moves before the first valve_command at {first:.2f} s; record the command"
            " from the start"
        )


def stamps(signal: Signal) -> Stamps:
    """Return how steadily a signal is sampled."""
    gaps = np.diff(signal.time)
    period = float(np.median(gaps))
    scatter = float(np.median(np.abs(gaps - period)))
    return Stamps(scatter, 1.0 - gaps.size * period / float(signal.time[-1] - signal.time[0]))


def check_values(name: str, shown: dict[str, Array], machine: Machine) -> None:
    """Raise InputError for a sensor that stands still or speaks another unit than it says."""
    geometry = machine.geometry
    longest = geometry.triangle_a + geometry.triangle_b  # the cylinder's triangle, stretched
    largest = LARGEST | {"piston_stroke": (longest, "mm or cm")}
    for signal, value in shown.items():
        if np.ptp(value) == 0.0:
            raise InputError(
                f"{name}: {signal} is constant at {value[0]:.4g} while the boom moves; check the"
                " sensor and record again, or leave it out of the signal map"
            )
        size = float(np.max(np.abs(value)))
        if signal in largest and size > largest[signal][0]:
            raise InputError(
                f"{name}: {signal} reaches {size:.4g}, more than a machine can; is it in"
                f" {largest[signal][1]}? It has to be recorded in the signal map's unit"
            )
        if signal.startswith("pressure") and np.median(value) < NEGATIVE * machine.supply.p0:
            raise InputError(
                f"{name}: {signal} is negative, {np.median(value):.4g} Pa in the middle; is its"
                " sign turned round? It has to be recorded in Pa, absolute"
            )
        if signal.startswith("pressure") and size < LEAST_PRESSURE * machine.supply.p0:
            raise InputError(
                f"{name}: {signal} stays below {size:.4g} Pa, no pressure that carries a boom; is"
                " it in bar, kPa, MPa or psi? It has to be recorded in Pa, absolute"
            )
