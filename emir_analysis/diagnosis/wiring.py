"""Signals that are not what the signal map calls them: exchanged, turned round, in another unit.

The machine as the data sheet has it tells: with the right wiring far less is missing in the
balances, whatever else the machine lacks.
"""

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from emir_analysis.diagnosis.balances import BALANCES, DEFLECTION, Balances, H, S, level
from emir_analysis.diagnosis.experiment import OUTPUTS, STROKE, Experiment
from emir_analysis.errors import InputError
from emir_analysis.signals import Array
from emir_plant.parameters import Machine

BEGINNING = 20.0  # s of a recording, which are enough
LESS = 3.0  # times, geometric mean; the right wiring leaves a tenth and less of a wrong one's


class Wiring(NamedTuple):
    """Another wiring, the balances that it changes, and what is to be done."""

    columns: dict[str, tuple[str, float]]  # output: what it truly is, times a factor
    balances: tuple[str, ...]
    told: str


WIRINGS = (
    Wiring(
        {H: (S, 1.0), S: (H, 1.0)},
        ("force", "lifting_chamber", "lowering_chamber"),
        f"{H} and {S} look exchanged; exchange them in the signal map",
    ),
    Wiring(
        {DEFLECTION: (DEFLECTION, -1.0)},
        ("bending",),
        f"{DEFLECTION} has its sign turned round; it is negative where the boom sags",
    ),
    *(
        Wiring(
            {DEFLECTION: (DEFLECTION, factor)},
            ("bending",),
            f"{DEFLECTION} looks to be in {unit}; it has to be recorded in rad",
        )
        for unit, factor in (("deg", math.radians(1.0)), ("mrad", 1e-3))
    ),
    Wiring(
        {STROKE: (STROKE, -1.0)},
        ("linkage",),
        f"{STROKE} has its sign turned round; it grows when lifting",
    ),
)


def check_wiring(experiment: Experiment, machine: Machine) -> None:
    """Raise InputError where a recording fits the machine far better with another wiring."""
    early = experiment.until(BEGINNING)
    missing = _missing(early, machine)
    for wiring in WIRINGS:
        if _told(wiring, experiment):
            changed = [list(BALANCES).index(name) for name in wiring.balances]
            left = LESS * _missing(_rewired(early, wiring), machine)
            if np.prod(left[changed]) < np.prod(missing[changed]):
                raise InputError(
                    f"{experiment.name}: {wiring.told} (far less is missing in the balances then)"
                )


def _told(wiring: Wiring, experiment: Experiment) -> bool:
    """Tell whether a recording has what the balances take that a wiring changes."""
    if STROKE in wiring.columns and not experiment.own_stroke:
        return False  # computed from the angle
    return all(BALANCES[name].signals <= experiment.measured for name in wiring.balances)


def _rewired(experiment: Experiment, wiring: Wiring) -> Experiment:
    outputs, order = experiment.outputs.copy(), list(OUTPUTS)
    for name, (true, factor) in wiring.columns.items():
        outputs[:, order.index(name)] = factor * experiment.outputs[:, order.index(true)]
    return replace(experiment, outputs=outputs)


def _missing(experiment: Experiment, machine: Machine) -> Array:
    """Return what is missing in each balance, (5,), NaN where the machine cannot rest."""
    return level(Balances(experiment, machine).residuals([machine])[0])
