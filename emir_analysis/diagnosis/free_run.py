"""Simulating a machine under a recorded command, from rest, without looking at a sensor again."""

from collections.abc import Sequence

import numpy as np

from emir_analysis.diagnosis.experiment import COMMAND_STEP, Experiment
from emir_analysis.signals import Array
from emir_plant import core
from emir_plant.core import Truth
from emir_plant.parameters import Machine
from emir_plant.plant import Plant, SimulationError

_COLUMN = {name: k for k, name in enumerate(Truth._fields)}


def outputs(truth: Array) -> Array:
    """Return the compared outputs (..., 4), in the order of OUTPUTS, of a truth (..., 12)."""
    deflection = truth[..., _COLUMN["tip_angle"]] - truth[..., _COLUMN["angle"]]
    measured = [_COLUMN[n] for n in ("stroke", "pressure_lifting", "pressure_lowering")]
    return np.concatenate([truth[..., measured], deflection[..., None]], axis=-1)


def free_runs(
    machines: Sequence[Machine], experiment: Experiment, starts: Sequence[tuple[float, float]]
) -> Array:
    """Return the truth, (m, n, 12), of machines started at rest at (angle, rad, and p_S, Pa).

    p_H follows from the balance of forces, the logic block is settled. A machine that cannot
    rest there gives NaN.
    """
    plants = [Plant(machine) for machine in machines]
    states = [_at_rest(plant, *start) for plant, start in zip(plants, starts, strict=True)]
    able = [k for k, state in enumerate(states) if state is not None]
    result = np.full((len(plants), experiment.angle.size, len(Truth._fields)), np.nan)
    if able:
        result[able] = core.simulate_many(
            np.array([states[k] for k in able]),
            experiment.commands,
            COMMAND_STEP,
            experiment.every,
            np.concatenate([plants[k].record for k in able]),
        )
    return result


def _at_rest(plant: Plant, angle: float, pressure_lowering: float) -> Array | None:
    try:
        return plant.initial(angle, max(pressure_lowering, 0.0))
    except SimulationError:
        return None


def free_run(machine: Machine, experiment: Experiment) -> Array:
    """Return the outputs, (n, 4), of one machine from the recording's own first samples."""
    return outputs(free_runs([machine], experiment, [experiment.start()])[0])


def errors(machine: Machine, experiment: Experiment) -> Array:
    """Return simulated minus measured outputs, (n, 4), SI units."""
    return free_run(machine, experiment) - experiment.outputs


def rms(error: Array) -> Array:
    """Return the root mean square of each column."""
    return np.asarray(np.sqrt(np.mean(np.square(error), axis=0)))


def block_medians(error: Array, period: float, block: float = 15.0) -> Array:
    """Return the median over blocks, s, of each column's RMS: one late stick does not decide."""
    size = max(1, round(block / period))
    blocks = [error[k : k + size] for k in range(0, len(error) - size // 2, size)]
    return np.asarray(np.median([rms(part) for part in blocks], axis=0))
