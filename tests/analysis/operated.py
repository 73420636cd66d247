"""Recordings for tests of the search alone: the project's own model as its sensors show it."""

from dataclasses import replace

import numpy as np
import recorded

from emir_analysis.diagnosis.balances import sensed
from emir_analysis.diagnosis.experiment import COMMAND_STEP, OUTPUTS, Experiment
from emir_analysis.diagnosis.free_run import free_runs
from emir_analysis.signals import Array
from emir_plant.parameters import Machine

STEPS_PER_SAMPLE = 10
COMMAND_STEPS = round(recorded.COMMAND_PERIOD / COMMAND_STEP)


def moved(
    machine: Machine, duration: float = 16.0, pressure: float = 20e5, seed: int = 5
) -> Experiment:
    """Return a run of random moves, s long, from a p_S at rest, Pa."""
    return operated(machine, recorded.moves(duration, seed), pressure)


def operated(
    machine: Machine, valve_command: Array, pressure: float = 20e5, angle: float = 0.8
) -> Experiment:
    """Return a run under a valve command, one value every 32 ms, from rest at an angle, rad."""
    commands = np.repeat(valve_command, COMMAND_STEPS)
    samples = commands.size // STEPS_PER_SAMPLE + 1
    unseen = np.zeros(samples), np.zeros((samples, len(OUTPUTS)))
    empty = Experiment("run", STEPS_PER_SAMPLE * COMMAND_STEP, commands, *unseen, 20)
    return sensed(empty, machine, free_runs([machine], empty, [(angle, pressure)])[0])


def without(experiment: Experiment, name: str) -> Experiment:
    """Return the recording of a machine that lacks the sensor of an output."""
    outputs = experiment.outputs.copy()
    outputs[:, list(OUTPUTS).index(name)] = np.nan
    return replace(experiment, outputs=outputs, measured=experiment.measured - {name})
