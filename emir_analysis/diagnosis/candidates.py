"""What is tried: the machine as it is, and with each effect of the registry.

Every trial is fitted twice on the part of a recording that the selection may see: on the
balances, which is quick and finds its way from anywhere, and from there on the free run.
"""

from dataclasses import dataclass

import numpy as np

from emir_analysis.diagnosis.balances import BALANCES, Balances
from emir_analysis.diagnosis.experiment import Experiment
from emir_analysis.diagnosis.fit import STEP, Problem, Solution, fit
from emir_analysis.diagnosis.free_run import free_runs
from emir_analysis.diagnosis.unknowns import Unknowns, unknowns
from emir_analysis.signals import Array
from emir_plant.effects import REGISTRY
from emir_plant.parameters import Machine
from emir_plant.sheet import Sheet

SCREENING_ACCURACY = 1e-3  # relative; the free run continues from there
ACCURACY = 1e-4  # relative, of the free run
LINKAGE = list(BALANCES).index("linkage")
MOST_FITTED = 8  # effects of a shortlist, which are then fitted to the balances
FELT = 1e-6  # share of an effect's shift that no parameter can imitate, and that is rounding


@dataclass(frozen=True)
class Trial:
    """A set of effects with fitted parameters; spread: standard deviations, both (k,)."""

    effects: tuple[str, ...]
    unknowns: Unknowns
    x: Array
    spread: Array

    @property
    def name(self) -> str:
        """The effects' names."""
        return " + ".join(self.effects) or "parameters only"

    @property
    def machine(self) -> Machine:
        """The machine with the fitted parameters."""
        return self.unknowns.at(self.x)

    def continued(self, solution: Solution) -> "Trial":
        """Return the trial with the parameters of a further fit."""
        size = len(self.unknowns.members)
        return Trial(self.effects, self.unknowns, solution.x[:size], solution.spread[:size])


def trial(sheet: Sheet, effects: tuple[str, ...], known: Trial | None = None) -> Trial:
    """Return a trial at its starting values, or at those of a trial fitted before."""
    members = unknowns(sheet, effects)
    fitted = {} if known is None else dict(zip(known.unknowns.members, known.x, strict=True))
    x = np.array([fitted.get(unknown, unknown.start) for unknown in members.members])
    return Trial(effects, members, x, np.full(x.size, np.nan))


def shortlist(known: Trial, sheet: Sheet, balances: Balances, floor: Array) -> list[str]:
    """Return the effects that could explain most of what a fitted trial leaves in the balances.

    To first order: each effect at its trial value shifts the balances in a direction; what of it
    no parameter can imitate takes away a share of the residual. Effects that are on already,
    that cannot be simulated or that no balance feels are not in the list.
    """
    names = [name for name in REGISTRY if name not in known.effects]
    fitted = known.unknowns.values(known.x)
    machines = [known.machine, *(known.unknowns.at(x) for x in _neighbours(known))]
    for name in names:
        members = unknowns(sheet, (*known.effects, name))
        machines.append(members.machine_with(members.values(members.start) | fitted))
    speaking = np.arange(len(BALANCES)) != LINKAGE
    missing = (balances.residuals(machines) / floor)[:, :, speaking].reshape(len(machines), -1)
    shifts = missing[1:] - missing[0]
    parameters, effects = shifts[: known.x.size], shifts[known.x.size :]
    imitated, _ = np.linalg.qr(parameters.T)
    left = missing[0] - imitated @ (imitated.T @ missing[0])
    gains = {}
    for name, shift in zip(names, effects, strict=True):
        own = shift - imitated @ (imitated.T @ shift)
        size = float(own @ own)
        if np.isfinite(size) and size > FELT * float(shift @ shift):
            gains[name] = float(own @ left) ** 2 / size
    return sorted(gains, key=lambda name: -gains[name])[:MOST_FITTED]


def _neighbours(trial: Trial) -> Array:
    """Return the trial's vector with one entry changed a little in each row, (k, k)."""
    _, high = trial.unknowns.bounds
    return np.asarray(trial.x + np.diag(np.where(trial.x + STEP > high, -STEP, STEP)))


def fit_balances(start: Trial, balances: Balances, floor: Array) -> Trial:
    """Fit a trial to the balances of a recording. floor: (5,) what the sensors leave in each."""
    speaking = np.arange(len(BALANCES)) != LINKAGE  # exact geometry: nothing to fit

    def model(points: Array) -> Array:
        missing = balances.residuals([start.unknowns.at(x) for x in points])
        return np.asarray((missing / floor)[:, :, speaking].reshape(len(points), -1))

    low, high = start.unknowns.bounds
    problem = Problem(model, start.x, low, high, start.unknowns.toleranced)
    return start.continued(fit(problem, SCREENING_ACCURACY, robust=True))


def fit_free_run(start: Trial, experiment: Experiment, noise: Array) -> Trial:
    """Fit a trial to the free run of a recording. noise: (4,) of the outputs' sensors.

    The initial angle within a resolver step and the initial p_S within what averaging leaves
    are fitted along and then forgotten: they belong to the recording, not to the machine.
    """
    angle, pressure = experiment.start()
    sensors = start.unknowns.machine.sensors
    step = sensors.resolver_span / 2**sensors.resolver_bits
    own = start.x.size

    def model(points: Array) -> Array:
        shown = free_runs(
            [start.unknowns.at(x[:own]) for x in points],
            experiment,
            [(angle + x[own] * step, pressure + x[own + 1] * noise[2]) for x in points],
        )
        error = (shown[:, :, 1:] - experiment.outputs) / noise
        return np.asarray(error.reshape(len(points), -1))

    low, high = start.unknowns.bounds
    problem = Problem(
        model,
        np.append(start.x, [0.0, 0.0]),
        np.append(low, [-0.5, -1.0]),
        np.append(high, [0.5, 1.0]),
        np.append(start.unknowns.toleranced, [False, False]),
    )
    return start.continued(fit(problem, ACCURACY))
