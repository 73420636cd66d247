"""Readings that jump away and back again, as of a loose contact: left out where they are few."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from emir_analysis.diagnosis.recording_checks import FAR_OFF, LARGEST_GAP, stated_noise
from emir_analysis.errors import InputError
from emir_analysis.signals import Array, Signal
from emir_plant.parameters import Machine

WILD = 0.5  # of nearly the whole range, by which no signal jumps away and back again ...
WILD_AT_ONCE = 0.25  # ... nor pressure and motion from one reading to one that soon follows
SOON = 0.02  # s
BACK = 2.0  # s, within which wild readings end
NEARLY_ALL = 0.99
AROUND = 4  # changes before and behind a single reading that sticks out, which are quieter ...
BEYOND_OTHERS = 4.0  # ... by this factor
BEYOND_NOISE = 10.0  # and how far, times the noise
MOST = 0.01  # of a signal's readings: more are no matter of a few


class Tame(NamedTuple):
    """A signal without wild readings, and the line that tells of them; none where it had none."""

    signal: Signal
    told: str


def tamed(name: str, signal: Signal, machine: Machine) -> Tame:
    """Return a signal without its wild readings.

    name: of the recording. Raises InputError where their lack leaves a gap that is too long, or
    they are more than MOST.
    """
    size = _size(signal, machine)
    noise = stated_noise(signal.name, machine)

    def found(shown: Signal) -> NDArray[np.bool_]:
        return _wild(shown, size) | _alone(shown, noise)

    kept, wild = signal, found(signal)
    if not np.any(wild):
        return Tame(signal, "")
    first = _described(signal, wild)
    while np.any(wild):
        kept = replace(kept, time=kept.time[~wild], value=kept.value[~wild])
        wild = found(kept)
    lost = signal.time.size - kept.time.size
    if lost > MOST * signal.time.size or _leaves_gap(signal, kept):
        raise InputError(
            f"{name}: {signal.name} {first}; check the sensor's wiring and record again"
        )
    return Tame(kept, told_of(name, signal.name, lost, signal.time.size, first))


def _size(signal: Signal, machine: Machine) -> float:
    """Return the change from one reading to the next beyond which it is a jump."""
    slow = np.median(np.diff(signal.time)) > SOON or signal.name == "tip_deflection_angle"
    whole = np.ptp(np.quantile(signal.value, [1.0 - NEARLY_ALL, NEARLY_ALL]))
    size = float((WILD if slow else WILD_AT_ONCE) * whole)
    size = max(size, FAR_OFF * stated_noise(signal.name, machine))
    return size if size > 0.0 else np.inf


def _wild(signal: Signal, size: float) -> NDArray[np.bool_]:
    """Tell which readings, (n,), lie between a jump and the next, if that leads back and soon."""
    aside, time = np.diff(signal.value), signal.time
    jumps = np.flatnonzero(np.abs(aside) > size)
    wild = np.zeros(time.size, dtype=np.bool_)
    k = 0
    while k + 1 < jumps.size:
        away, back = jumps[k], jumps[k + 1]
        paired = aside[away] * aside[back] < 0.0 and time[back] - time[away] < BACK
        if paired:
            wild[away + 1 : back + 1] = True
        k += 2 if paired else 1
    return wild


def _alone(signal: Signal, noise: float) -> NDArray[np.bool_]:
    """Tell which single readings, (n,), stick out; in fast sampling alone.

    In slow one a shock is as short. noise: of the sensor; where it has none, no reading does.
    """
    if noise == 0.0 or np.median(np.diff(signal.time)) > SOON:
        return np.zeros(signal.time.size, dtype=np.bool_)
    return stick_out(signal.value, noise)


def stick_out(shown: Array, noise: float) -> NDArray[np.bool_]:
    """Tell which single readings, (n,), stick out of quieter ones around, far beyond the noise."""
    result = np.zeros(shown.size, dtype=np.bool_)
    aside = np.diff(shown)
    if aside.size < 2 * AROUND + 2:
        return result
    away, back = aside[AROUND : -AROUND - 1], aside[AROUND + 1 : -AROUND]
    height = np.where(away * back < 0.0, np.minimum(np.abs(away), np.abs(back)), 0.0)
    windows = sliding_window_view(np.abs(aside), 2 * AROUND + 2)
    beside = np.maximum(windows[:, :AROUND].max(axis=1), windows[:, -AROUND:].max(axis=1))
    inside = slice(AROUND + 1, -AROUND - 1)
    result[inside] = (height > BEYOND_NOISE * noise) & (height > BEYOND_OTHERS * beside)
    return result


def _described(signal: Signal, wild: NDArray[np.bool_]) -> str:
    """Return where the first of the wild readings stand, and what is beside them."""
    time = signal.time
    first = int(np.argmax(wild))
    after = first + int(np.argmin(wild[first:]))
    when = "at" if after == first + 1 else f"from {time[first]:.3f} to"
    return described(signal.value, first, after, f"{when} {time[after - 1]:.3f} s")


def described(shown: Array, first: int, after: int, when: str) -> str:
    """Return what the readings, (n,), from first to before after show, and those beside them."""
    before = f"{shown[first - 1]:.4g} before and {shown[after]:.4g} after"
    return f"shows {shown[first]:.4g} {when} alone, {before}"


def told_of(name: str, signal: str, lost: int, count: int, first: str) -> str:
    """Return the line that tells of wild readings that were left out, the first as described."""
    return f"{name}: {lost} of {count} readings wild and left out: {signal} {first}"


def _leaves_gap(signal: Signal, kept: Signal) -> bool:
    """Tell whether a gap is longer than any that was there, and too long."""
    gaps: Array = np.diff(kept.time)
    return bool(np.max(gaps) > max(LARGEST_GAP, float(np.max(np.diff(signal.time)))))
