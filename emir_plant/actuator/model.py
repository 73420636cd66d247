"""Runs of the actuator: free, or driven by the measured pressure.

What the spool drags behind play is no differential equation: it is moved at a step's end.
"""

from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from emir_common.parameter_tree import declared
from emir_plant.actuator.equations import (
    ARM,
    CLOCK,
    EDGES,
    PRESSURE,
    SPOOL,
    STATES,
    SWING,
    VELOCITY,
    WAY,
    dragged,
    fastest,
    leakage,
    line_loss,
    may_switch,
    metering_edges,
    play_ahead,
    valve_flow,
    write_slope,
)
from emir_plant.actuator.parameters import Actuator
from emir_plant.actuator.unnamed import PLACES
from emir_plant.jit import compiled_in_place

Array = NDArray[np.float64]

STEPS = 2  # of the integration between two samples, at least
SWITCHING = 8  # times as many where a load-holding valve may switch
RESOLVED = 2.0  # of the fastest rate times a step; RK4 is stable up to 2.8
MOST_STEPS = 40  # what is stiffer than these resolve is not simulated: so is no machine
NOWHERE = 1e6  # a pressure that only a run out of all bounds has
SHOWN, MOVED = 0, 1  # columns of a run: pressure at the transducer, way of the piston
FREE = np.zeros(0)  # in place of a measured pressure: the simulated one goes into every term


class _Step(NamedTuple):
    """A step of the integration: when, in samples from the run's start, and its length."""

    begin: float
    middle: float
    end: float
    length: float


@cache
def _layout(paths: tuple[str, ...]) -> np.dtype[Any]:
    shapes = {path: (PLACES,) if path.endswith(".points") else () for path in paths}
    return np.dtype([(_field(path), np.float64, shape) for path, shape in shapes.items()])


def _field(path: str) -> str:
    return path.replace(".", "_")


def record(actuator: Actuator) -> NDArray[Any]:
    """Return the parameters as the flat record, (1,), that the compiled functions read."""
    values = {path: value for path, (_, value) in declared(actuator).items()}
    return np.array([tuple(values.values())], dtype=_layout(tuple(values)))


def column(records: NDArray[Any], path: str) -> Array:
    """Return a view, (m,), of the parameter of a dotted path in (m,) records.

    One number of a list is given by its place behind the list's path.
    """
    whole, _, place = path.rpartition(".")
    if place.isdecimal():
        return np.asarray(records[_field(whole)])[:, int(place)]
    return np.asarray(records[_field(path)])


def simulate(actuator: Actuator, command: Array, period: float, start: float = 0.0) -> Array:
    """Return the measured pressure (n,) of a free run from standstill.

    command: (n,) valve opening, straight between its samples. period: time between them. start:
    pressure at the first sample.
    """
    return run_each(record(actuator), command, period, start)[0]


def run_each(parameters: NDArray[Any], command: Array, period: float, start: float) -> Array:
    """Return the same of many machines, (m, n). parameters: (m,) records."""
    return np.asarray(_run_each(parameters, command, FREE, period, start)[:, :, SHOWN])


def driven(actuator: Actuator, command: Array, pressure: Array, period: float) -> Array:
    """Return the integral (n,) of the oil's modelled pressure rate under the measured pressure.

    The measured pressure (n,) goes into every term, also into the force that moves the mass.
    What the transducer sees of a line's loss is part of the integral.
    """
    return np.asarray(_run_each(record(actuator), command, pressure, period, 0.0)[0, :, SHOWN])


def way(actuator: Actuator, command: Array, pressure: Array, period: float) -> Array:
    """Return how far the piston has moved (n,) under the measured pressure (n,), as a volume."""
    return np.asarray(_run_each(record(actuator), command, pressure, period, 0.0)[0, :, MOVED])


@compiled_in_place
def _begin(x: Any, opening: float, pressure: float, p: Any) -> None:
    """Write the state at a run's start to x, zeros so far."""
    x[SPOOL] = opening
    x[EDGES] = opening
    x[PRESSURE] = pressure
    creeping = valve_flow(opening, pressure, 0.0, p) - leakage(pressure, p)
    creeping *= p.effects_valve_null_offset_creeping
    x[VELOCITY], x[ARM], x[SWING] = creeping, creeping, creeping


@compiled_in_place
def _at(values: Any, time: float) -> float:
    """Return a sampled signal between its samples; the first or last value beyond them."""
    if time <= 0.0:
        return values[0]
    k = int(time)
    if k >= values.size - 1:
        return values[-1]
    return values[k] + (values[k + 1] - values[k]) * (time - k)


@compiled_in_place
def _pressure(x: Any, measured: Any, time: float, p: Any) -> float:
    """Return the oil's pressure: the simulated one or, behind the line, that of the measured."""
    if measured.size == 0:
        return x[PRESSURE]
    pressure = _at(measured, time)
    edges = metering_edges(x[SPOOL], x[EDGES], p)
    return pressure - line_loss(valve_flow(edges, pressure, x[CLOCK], p), p)


@compiled_in_place
def _ahead(x: Any, step: float, slope: Any, y: Any) -> None:
    """Write x + step slope to y."""
    for i in range(STATES):
        y[i] = x[i] + step * slope[i]


@compiled_in_place
def _advance(step: _Step, commands: Any, measured: Any, p: Any, work: Any) -> None:
    """Advance x in place by a step of RK4.

    commands: at the step's begin, middle and end. work: see `_write_run`.
    """
    x, y, a, b, c, d = work[0], work[1], work[2], work[3], work[4], work[5]
    h, (first, second, last) = step.length, commands
    write_slope(x, _pressure(x, measured, step.begin, p), first, p, a)
    _ahead(x, 0.5 * h, a, y)
    write_slope(y, _pressure(y, measured, step.middle, p), second, p, b)
    _ahead(x, 0.5 * h, b, y)
    write_slope(y, _pressure(y, measured, step.middle, p), second, p, c)
    _ahead(x, h, c, y)
    write_slope(y, _pressure(y, measured, step.end, p), last, p, d)
    for i in range(STATES):
        x[i] += h / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i])
    x[EDGES] = metering_edges(x[SPOOL], x[EDGES], p)


@compiled_in_place
def _write_run(  # noqa: PLR0913, PLR0917 (compiled code has no object to bundle them in)
    p: Any, command: Any, measured: Any, period: float, start: float, work: Any, run: Any
) -> None:
    """Write a run, (n, 2): what the transducer shows and the way.

    measured: pressure that goes into every term, or FREE; the pressure shown is then the integral
    of its modelled rate. work: (6, STATES) of zeros: the state x, one ahead of it, four slopes.
    """
    usual = max(STEPS, int(np.ceil(fastest(p) * period / RESOLVED)))
    if usual > MOST_STEPS:
        run[:] = NOWHERE
        return
    x = work[0]
    lag = p.effects_command_delay_delay / period
    play = play_ahead(p)
    held = command[0]
    _begin(x, held, start, p)
    for k in range(command.size):
        now = x[PRESSURE] if measured.size == 0 else measured[k]
        run[k, SHOWN] = x[PRESSURE] + line_loss(valve_flow(x[EDGES], now, x[CLOCK], p), p)
        run[k, MOVED] = x[WAY]
        steps = usual
        if may_switch(x, dragged(held, _at(command, k + 1 - lag), play), p):
            steps *= SWITCHING
        for j in range(steps):
            step = _Step(k + j / steps, k + (j + 0.5) / steps, k + (j + 1) / steps, period / steps)
            first = held
            second = dragged(first, _at(command, step.middle - lag), play)
            held = dragged(second, _at(command, step.end - lag), play)
            _advance(step, (first, second, held), measured, p, work)
        if not abs(x[PRESSURE]) < NOWHERE:
            run[k + 1 :] = NOWHERE
            break


@compiled_in_place
def _write_runs(  # noqa: PLR0913, PLR0917 (as _write_run)
    parameters: Any, command: Any, measured: Any, period: float, start: float, work: Any, runs: Any
) -> None:
    for m in range(parameters.size):
        _write_run(parameters[m], command, measured, period, start, work[m], runs[m])


def _run_each(
    parameters: NDArray[Any], command: Array, measured: Array, period: float, start: float
) -> Array:
    """Return what `_write_run` writes for each of (m,) records, (m, n, 2)."""
    machines = parameters.size
    work, runs = np.zeros((machines, 6, STATES)), np.empty((machines, command.size, 2))
    _write_runs(parameters, command, measured, period, start, work, runs)
    return runs
