"""The model's rates along a recording: its state is the measured one wherever a sensor shows it.

They are integrated together with the states that no sensor shows, in steps that follow the spool:
between two samples the valve's flow changes too fast for the trapezoidal rule. The boom's rate,
which friction depends on, has to be smoothed; what the piston sweeps is taken from the angle as
it was read, since smoothing would take some of the slow mode away.

Pressures, boom angle and its rate are taken from the recording. What no sensor shows is
simulated from what the sensors do show: the spool from the command, the logic block from
p_H, the bending modes from the measured force. So an error in one balance cannot leak into
another, and every effect that the machine's right-hand side holds is in the right balance.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from emir_analysis.signals import Array
from emir_plant import core
from emir_plant.effects import (
    command_delay,
    linkage_error,
    terms,
    valve_hysteresis,
)
from emir_plant.hydraulics import chambers
from emir_plant.jit import compiled_in_place, on_all_cores
from emir_plant.measured_step import (
    END,
    advance,
    mean_rate,
    write_rates,
    write_swings,
)


class Modelled(NamedTuple):
    """What the model says along the recording, each (m, n) for m machines and n samples."""

    pressure_lifting: Array  # integral of dp_H/dt since the start, Pa
    pressure_lowering: Array  # integral of dp_S/dt since the start, Pa
    turning: Array  # change of the rate of the boom's rigid rotation since the start, rad/s
    bending: Array  # boom angle minus rigid rotation, rad
    deflection: Array  # alpha_6 - alpha_1, rad


@compiled_in_place
def _swept(turned: float, measured: Array, p: Any) -> tuple[float, float]:
    """Return the changes of p_H and p_S, Pa, that a small turn of the boom, rad, makes."""
    stroke = linkage_error.stroke(measured[2], p)
    moved = linkage_error.lever_arm(measured[2], p) * turned
    volume = chambers.volume_lifting(stroke, p)
    stiffness = terms.stiffness_lifting(measured[0], volume, p)
    lifting = chambers.pressure_rate(-p.area_lifting * moved, volume, measured[0], stiffness)
    volume = chambers.volume_lowering(stroke, p)
    stiffness = terms.stiffness_lowering(measured[1], volume, p)
    lowering = chambers.pressure_rate(p.area_lowering * moved, volume, measured[1], stiffness)
    return lifting, lowering


@compiled_in_place
def _follow(  # noqa: PLR0913, PLR0917 (compiled code has no object to bundle them in)
    x: Array,
    arriving: Array,
    dt: float,
    measured: Array,
    parameters: NDArray[Any],
    swings: Array,
    work: Array,
    at: Array,
    result: Array,
) -> None:
    """Write the columns of Modelled along measured, (n, 5), to result, (5, n); steps of dt, s.

    x: (s,) the state at the start, advanced in place. arriving: (k,) the command at the valve.
    swings: (n + 1, 2, 2), work: (4, s) and at: (3, 5), zeros.
    """
    p = parameters[0]
    write_swings(dt, p, swings)
    samples, n = measured.shape[0], p.mode_joint.size
    every = arriving.size // (samples - 1)
    lifting, lowering, turning = 0.0, 0.0, 0.0
    write_rates(x, arriving[0], measured[0], p, work[END])
    for k in range(samples):
        result[0, k], result[1, k], result[2, k] = lifting, lowering, turning
        for i in range(1, n):
            bent = x[core.MODES + i]
            result[3, k] += p.mode_joint[i] * bent
            result[4, k] += (p.mode_tip_angle[i] - p.mode_joint[i]) * bent
        if k == samples - 1:
            break
        for j in range(every):
            for i in range(measured.shape[1]):
                slope = (measured[k + 1, i] - measured[k, i]) / every
                for row in range(3):
                    at[row, i] = measured[k, i] + slope * (j + 0.5 * row)
            command = arriving[k * every + j]
            x[core.PLAYED] = valve_hysteresis.played(command, x[core.PLAYED], p)
            advance(x, x[core.PLAYED], dt, at, p, swings, work)
            left_out = (measured[k + 1, 4] - measured[k, 4]) / every - dt * at[1, 3]
            swept_lifting, swept_lowering = _swept(left_out, at[1], p)
            lifting += swept_lifting
            lowering += swept_lowering
            lifting += dt * mean_rate(work, core.P_H)
            lowering += dt * mean_rate(work, core.P_S)
            turning += dt * p.mode_joint[0] * mean_rate(work, core.MODES + n)


def follow(
    starts: Array, commands: Array, dt: float, measured: Array, parameters: NDArray[Any]
) -> Array:
    """Return (m, 5, n), the columns of Modelled, of m machines along one recording.

    starts: (m, s) states. commands: (k,) y2, each held for dt, s; k a multiple of n - 1.
    measured: (m, n, 5) p_H, p_S, Pa, smoothed boom angle, rad, its rate, rad/s, and the angle as
    it was read, rad, as each machine's sensors mean them. parameters: (m,) records.
    """
    result = np.zeros((parameters.size, 5, measured.shape[1]))

    def run(m: int) -> None:
        own, x = parameters[m : m + 1], starts[m].copy()
        arriving = command_delay.delayed(commands, dt, own)
        work, at = np.zeros((4, x.size)), np.zeros((3, measured.shape[2]))
        swings = np.zeros((own["mode_joint"].size + 1, 2, 2))
        _follow(x, arriving, dt, measured[m], own, swings, work, at, result[m])

    on_all_cores(run, parameters.size)
    return result
