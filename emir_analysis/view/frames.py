"""What the page shows at an instant, and a recording as a series of such frames."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from emir_analysis.run_signals import at, piston
from emir_analysis.signals import Recording

Array = NDArray[np.float64]

MOST_FRAMES = 100_000  # of a recording: 13 minutes of every sample, of an hour every fifth
TIP_SLOPE = 4.0 / 3.0  # of a cantilever under its own weight: tip's angle by deflection and length


class Frame(NamedTuple):
    """One instant. What is not known is nan."""

    time: float  # s
    angle: float  # alpha_1, rad
    tcp_deflection: float  # of the TCP across the boom, m, upwards
    stroke: float  # m
    reference_stroke: float  # m
    valve_command: float  # 1
    pressure_lifting: float  # Pa
    pressure_lowering: float  # Pa
    logic_block: float  # 1 open, 0 shut


def tcp_deflection(tip_angle: float | Array, length: float) -> float | Array:
    """Return the TCP's deflection, m, of a boom bent by a measured angle, rad, at its tip.

    By the shape of a uniform cantilever under its own weight: exact for the static bending.
    """
    return tip_angle * length / TIP_SLOPE


def shown_times(run: Recording, signal: str) -> Array:
    """Return the times of a signal's samples, s; of a long recording of some of them."""
    time = run[signal].time
    return time[:: 1 + time.size // MOST_FRAMES]


def frames(run: Recording, length: float) -> list[Frame]:
    """Return a frame for each sample of the machine, up to MOST_FRAMES. length: of the boom, m."""
    time = shown_times(run, "stroke")
    series = {
        "angle": _first(run, time, ("true_angle", "angle")),
        "tcp_deflection": _deflection(run, time, length),
        "stroke": at(run, piston(run, "stroke"), time),
        "reference_stroke": at(run, "reference_stroke", time),
        "valve_command": _held(run, "valve_command", time),
        "pressure_lifting": at(run, piston(run, "pressure_lifting"), time),
        "pressure_lowering": at(run, piston(run, "pressure_lowering"), time),
        "logic_block": _first(run, time, ("logic_block",)),
    }
    columns = [time, *(series[name] for name in Frame._fields[1:])]
    return [Frame(*map(float, row)) for row in zip(*columns, strict=True)]


def _deflection(run: Recording, time: Array, length: float) -> Array:
    if "tcp_deflection" in run.signals:
        return at(run, "tcp_deflection", time)
    return np.asarray(tcp_deflection(_first(run, time, ("deflection",)), length))


def _first(run: Recording, time: Array, names: Sequence[str]) -> Array:
    for name in names:
        if name in run.signals:
            return at(run, name, time)
    return np.full(time.size, np.nan)


def _held(run: Recording, name: str, time: Array) -> Array:
    """Return a signal that keeps its value from one message to the next."""
    signal = run[name]
    return signal.value[np.clip(np.searchsorted(signal.time, time, "right") - 1, 0, None)]
