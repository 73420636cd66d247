"""Simulating a machine under a recorded command, from rest, without looking at a sensor again."""

from collections.abc import Sequence

import numpy as np

from emir_analysis.diagnosis.experiment import SUBSTEP, Experiment
from emir_analysis.root_mean_square import column_rms
from emir_analysis.signals import Array
from emir_plant import lanes
from emir_plant.parameters import Machine
from emir_plant.plant import Plant, SimulationError
from emir_plant.sensors import readings, undistorted

SHOWN = ("angle", "stroke", "pressure_lifting", "pressure_lowering", "deflection")
ANGLE_COLUMN, STROKE_COLUMN = 0, 1  # of what is shown
COMPARED = slice(1, None)  # columns behind the resolver's angle: in the order of OUTPUTS

BLOCK = 15.0  # s
STABLE = 2.0  # rad, of the fastest oscillation in a step; Runge-Kutta 4 is unstable above 2.8


def free_runs(
    machines: Sequence[Machine],
    experiment: Experiment,
    starts: Sequence[tuple[float, float]],
    *,
    coarse: bool = False,
) -> Array:
    """Return what the sensors show, (m, n, 5) in the order of SHOWN, without noise.

    The machines start at rest at the sensors' (angle, rad, and p_S, Pa); p_H follows from the
    balance of forces, the logic block is settled. A machine that cannot rest there gives NaN.
    coarse: in twice the integration step, for half the time; good for comparing such runs.
    """
    made = {id(machine): Plant(machine) for machine in machines}  # one may stand there many times
    plants = [made[id(machine)] for machine in machines]
    states = [_at_rest(plant, *start) for plant, start in zip(plants, starts, strict=True)]
    able = [k for k, state in enumerate(states) if state is not None]
    result = np.full((len(plants), experiment.angle.size, len(SHOWN)), np.nan)
    if not able:
        return result
    stride = experiment.stride(coarse_step(plants)) if coarse else 1
    given = np.concatenate([experiment.commands, experiment.later])
    commands = np.ascontiguousarray(given[::stride])  # or more is compiled
    row = experiment.every_row * experiment.step
    truths = lanes.simulate_many(
        np.array([states[k] for k in able]),
        commands,
        experiment.step * stride,
        experiment.every_row // stride,
        np.concatenate([plants[k].record for k in able], dtype=plants[0].record.dtype),
        min(experiment.step * stride, stable_step(plants)),
    )
    for k, truth in zip(able, truths, strict=True):
        shown = readings(plants[k], truth, row)
        run = np.column_stack([getattr(shown, name) for name in SHOWN])
        result[k] = experiment.sampling.read(run, row, experiment.time)
    return result


def coarse_step(plants: Sequence[Plant]) -> float:
    """Return the step, s, of coarse integration that all machines allow."""
    return min(SUBSTEP, stable_step(plants))


def stable_step(plants: Sequence[Plant]) -> float:
    """Return the longest step, s, of Runge-Kutta 4 that is stable for all machines."""
    return STABLE / max(plant.fastest for plant in plants)


def _at_rest(plant: Plant, angle: float, pressure_lowering: float) -> Array | None:
    true_angle = undistorted(angle, "angle", plant.machine)
    true_pressure = undistorted(pressure_lowering, "pressure_lowering", plant.machine)
    try:
        return plant.initial(true_angle, max(true_pressure, 0.0))
    except SimulationError:
        return None


def block_medians(errors: Sequence[Array], periods: Sequence[float]) -> Array:
    """Return the median over blocks of each column's RMS: one late stick does not decide.

    errors: (n, c) of each recording, sampled every period, s.
    """
    blocks = []
    for error, period in zip(errors, periods, strict=True):
        size = max(1, round(BLOCK / period))
        starts = range(0, max(len(error) - size // 2, 1), size)
        blocks += [column_rms(error[k : k + size]) for k in starts]
    return np.asarray(np.median(blocks, axis=0))
