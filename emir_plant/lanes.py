"""Many machines at a time, in the lanes of the processor's vector registers.

The right-hand side of `core.py` runs in a loop over LANES machines, which the compiler turns into
vector instructions; every number comes out as it does for a machine by itself. Both ways of every
branch are gone there, which takes that none calls the C library and none has a memory or steps of
its own. Machines with effects that do run one by one.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from emir_plant import core, integration
from emir_plant.core import COLUMNS, DELAY_LINE, MODES, P_S, PLAYED, Array
from emir_plant.effects import valve_hysteresis
from emir_plant.jit import compiled_in_place, on_all_cores
from emir_plant.lane import lane
from emir_plant.record import EFFECT_FIELDS, EFFECT_SIZES

LANES = 8  # doubles in the widest registers there are
ONE_BY_ONE = (  # what the names begin with of effects that
    "coulomb_friction",  # have steps of their own, as all dry friction,
    "stribeck_friction",
    "pressure_dependent_friction",
    "unnamed",
    "backlash",
    "command_delay",  # a memory longer than a number,
    "entrained_air",  # or a power
)
STAGES = ("k1", "k2", "k3", "k4", "between")


def simulate_many(  # noqa: PLR0913, PLR0917 (as integration.simulate)
    starts: Array,
    commands: Array,
    dt: float,
    every: int,
    parameters: NDArray[Any],
    step: float = integration.STEP,
) -> Array:
    """Run m machines under the same commands, on all cores.

    starts: (m, n) states; commands: (k,), each held for dt, s; parameters: (m,) records;
    step: s, the longest of the integration. Returns (m, 1 + k // every, len(Truth)) as
    `integration.simulate` gives it for each, bit by bit.
    """
    together = ~_one_by_one(parameters)
    if np.sum(together) < LANES:
        return integration.simulate_each(starts, commands, dt, every, parameters, step)
    result = np.empty((len(starts), 1 + commands.size // every, COLUMNS))
    alone = starts[~together], commands, dt, every, parameters[~together], step
    result[~together] = integration.simulate_each(*alone)
    groups = _side_by_side(starts[together], parameters[together])
    found = np.empty((groups.size, LANES, *result.shape[1:]))

    def run(group: int) -> None:
        _simulate(groups[group : group + 1], commands, dt, every, step, found[group])

    on_all_cores(run, groups.size)
    result[together] = found.reshape(-1, *result.shape[1:])[: np.sum(together)]
    return result


def _one_by_one(parameters: NDArray[Any]) -> NDArray[np.bool_]:
    """Tell which machines, (m,) records, have an effect for which they run one by one."""
    sizes = [name for name in EFFECT_SIZES if name.startswith(ONE_BY_ONE)]
    return np.asarray(np.any([parameters[name] != 0.0 for name in sizes], axis=0))


def _side_by_side(starts: Array, parameters: NDArray[Any]) -> NDArray[Any]:
    """Return records of LANES machines each; the last one fills up the rest."""
    groups, size = -(-len(starts) // LANES), starts.shape[1] * LANES
    left_out = [name for name in EFFECT_FIELDS if name.startswith(ONE_BY_ONE)]
    kept = [name for name in parameters.dtype.names or () if name not in left_out]
    layout = [(name, np.float64, (*parameters.dtype[name].shape, LANES)) for name in kept]
    layout += [(name, np.float64, (size,)) for name in ("state", *STAGES)]
    machines = np.zeros(groups, layout)
    members = np.minimum(np.arange(groups * LANES), len(starts) - 1).reshape(groups, LANES)
    machines["state"] = np.moveaxis(starts[members], 1, -1).reshape(groups, size)
    for name in kept:
        machines[name] = np.moveaxis(parameters[name][members], 1, -1)
    return machines


@compiled_in_place
def _write_rates(m: Any, x: Array, dx: Array) -> None:
    for i in range(LANES):
        command = m.state[PLAYED * LANES + i]
        core.write_derivative_of(x[i::LANES], command, lane(m, i), dx[i::LANES])


@compiled_in_place
def _write_sum(x: Array, h: float, rates: Array, result: Array) -> None:
    """Write x + h rates to result, but for the delay line, which is empty."""
    for i in range(DELAY_LINE * LANES):
        result[i] = x[i] + h * rates[i]
    for k in range(x.size - MODES * LANES):
        i = MODES * LANES + k  # counted from 0, or the compiler does not see neighbours
        result[i] = x[i] + h * rates[i]


@compiled_in_place
def _step(m: Any, command: float, h: float) -> None:
    """Advance the machines m by one step of Runge-Kutta 4, as `core` does without friction."""
    x, k1, k2, k3, k4, between = m.state, m.k1, m.k2, m.k3, m.k4, m.between
    for i in range(LANES):
        k = PLAYED * LANES + i
        x[k] = valve_hysteresis.played(command, x[k], lane(m, i))
    _write_rates(m, x, k1)
    _write_sum(x, 0.5 * h, k1, between)
    _write_rates(m, between, k2)
    _write_sum(x, 0.5 * h, k2, between)
    _write_rates(m, between, k3)
    _write_sum(x, h, k3, between)
    _write_rates(m, between, k4)
    for i in range(DELAY_LINE * LANES):
        x[i] += h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i])
    for k in range(x.size - MODES * LANES):
        i = MODES * LANES + k
        x[i] += h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i])
    for i in range((P_S + 1) * LANES):
        x[i] = max(x[i], 0.0)  # p_H and p_S
    for i in range(LANES):
        integration.remember(x[i::LANES], lane(m, i))


@compiled_in_place
def _simulate(  # noqa: PLR0913, PLR0917 (as integration.simulate)
    group: NDArray[Any], commands: Array, dt: float, every: int, step: float, result: Array
) -> None:
    """Write the truths of one group, (1,), to result, (LANES, 1 + k // every, COLUMNS)."""
    steps = max(1, math.ceil(dt / step - 1e-9))
    m = group[0]
    for k in range(commands.size + 1):
        if k % every == 0:
            for i in range(LANES):
                p = lane(m, i)
                for column, value in enumerate(core.truth_of(m.state[i::LANES], p)):
                    result[i, k // every, column] = value
        if k < commands.size:
            for _ in range(steps):
                _step(m, commands[k], dt / steps)
