"""Where a free run may start: at rest, inside what the sensors leave open."""

from collections.abc import Sequence

import numpy as np

from emir_analysis.diagnosis.evidence import Evidence
from emir_analysis.diagnosis.experiment import PRESSURE_LIFTING, Experiment
from emir_analysis.signals import Array
from emir_plant.core import P_H
from emir_plant.parameters import Machine
from emir_plant.plant import Plant, SimulationError
from emir_plant.sensors import undistorted


class Starts:
    """States of rest at the start of a recording that the sensors leave open.

    Two numbers from -1 to 1: the angle within the resolver's step, and p_S within twice its noise;
    where no sensor shows p_S, that with which the boom rests on p_H within twice its noise; where
    none shows p_H either, p_S within what lets the boom rest.

    is_told: a sensor shows p_S, or p_H, from which it follows.
    """

    def __init__(self, experiment: Experiment, evidence: Evidence) -> None:
        sensors = evidence.stated.sensors
        angle, pressure = experiment.start()
        self._of_lifting, half_range = 2.0 * np.array(sensors.pressure_noises)
        shown = not np.isnan(pressure)
        self._lifting = np.nan if shown else experiment.pressure_at_rest(PRESSURE_LIFTING)
        self.is_told = shown or not np.isnan(self._lifting)
        if not shown:
            self._range = low, high = _resting_pressures(evidence.stated, angle)
            pressure, half_range = 0.5 * (low + high), 0.5 * (high - low)
        self._middle = np.array([angle, pressure])
        self._half = np.array([0.5 * sensors.resolver_step, half_range])

    def at(self, points: Array, machines: Sequence[Machine]) -> list[tuple[float, float]]:
        """Return angle, rad, and p_S, Pa, for (m, 2) numbers and as many machines."""
        told = [(float(a), float(p)) for a, p in self._middle + self._half * points]
        if np.isnan(self._lifting):
            return told
        high = self._lifting + self._of_lifting * points[:, 1]
        return [
            (angle, self._below(machine, angle, float(p), otherwise))
            for (angle, otherwise), p, machine in zip(told, high, machines, strict=True)
        ]

    def _below(self, machine: Machine, angle: float, lifting: float, otherwise: float) -> float:
        """Return the p_S, Pa, with which a machine rests on a p_H, Pa, at an angle, rad.

        As sensors show all of them. The other value where the machine cannot rest there.
        """
        plant, cylinder = Plant(machine), machine.cylinder
        true_angle = undistorted(angle, "angle", machine)
        try:
            alone = float(plant.initial(true_angle, 0.0)[P_H])
        except SimulationError:
            return otherwise
        more = undistorted(lifting, "pressure_lifting", machine) - alone
        below = more * cylinder.area_lifting / cylinder.area_lowering
        return float(np.clip(below, *self._range))


def _resting_pressures(machine: Machine, angle: float) -> tuple[float, float]:
    """Return between which p_S, Pa, a machine can rest at an angle, rad: half the pump's or less.

    More is not left in a lowering chamber that was shut at standstill.
    """
    low, high = machine.supply.pT, 0.5 * machine.supply.p0
    plant = Plant(machine)
    for _ in range(5):
        try:
            plant.initial(angle, high)
        except SimulationError:
            high = 0.5 * (low + high)
        else:
            return low, high
    return low, low
