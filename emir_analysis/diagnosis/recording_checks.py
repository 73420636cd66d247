"""What makes a recording useless for a diagnosis, each said in one line with the remedy."""

import math

import numpy as np

from emir_analysis.errors import InputError
from emir_analysis.signals import Array, Signal
from emir_plant.parameters import Machine

LARGEST_GAP = 0.2  # s without a sample: the slow mode is still followed by interpolation
LEAST_MOTION = 20  # resolver steps of travel below which nothing can be told from a recording
AT_REST = 0.05  # of the whole travel: a boom that sinks through a leak before its first move
LEAST_PRESSURE = 1e-3  # of the pump's pressure; a chamber that stays below is not in Pa
LARGEST = {  # beyond which a signal is not in its unit, and the unit that it is likely in
    "valve_command": (2.0, "per cent"),
    "joint_angle": (2.0 * math.pi, "deg"),
    "piston_stroke": (20.0, "mm"),
    "tip_deflection_angle": (1.0, "mrad or deg"),
}


def check_sampling(name: str, signal: Signal) -> None:
    """Raise InputError where a signal has a gap."""
    gaps = np.diff(signal.time)
    widest = int(np.argmax(gaps))
    if gaps[widest] > LARGEST_GAP:
        raise InputError(
            f"{name}: {signal.name} has a gap of {gaps[widest]:.2f} s"
            f" at {signal.time[widest]:.2f} s; record without gaps"
        )


def check_motion(name: str, angle: Array, machine: Machine) -> None:
    """Raise InputError where the boom never moves."""
    step = machine.sensors.resolver_step
    if np.ptp(angle) < LEAST_MOTION * step:
        raise InputError(
            f"{name}: never moves (the angle stays within {np.ptp(angle):.2g} rad);"
            " record moves up and down over some degrees"
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


def check_values(name: str, shown: dict[str, Array], machine: Machine) -> None:
    """Raise InputError for a sensor that stands still or speaks another unit than it says."""
    for signal, value in shown.items():
        if np.ptp(value) == 0.0:
            raise InputError(
                f"{name}: {signal} is constant at {value[0]:.4g} while the boom moves; check the"
                " sensor and record again, or leave it out of the signal map"
            )
        size = float(np.max(np.abs(value)))
        if signal in LARGEST and size > LARGEST[signal][0]:
            raise InputError(
                f"{name}: {signal} reaches {size:.4g}, more than a machine can; is it in"
                f" {LARGEST[signal][1]}? It has to be recorded in the signal map's unit"
            )
        if signal.startswith("pressure") and size < LEAST_PRESSURE * machine.supply.p0:
            raise InputError(
                f"{name}: {signal} stays below {size:.4g} Pa, no pressure that carries a boom; is"
                " it in bar? It has to be recorded in Pa, absolute"
            )
