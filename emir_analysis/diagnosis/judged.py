"""The models on recordings that no fit has seen: free runs, one step ahead, a black box beside."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from emir_analysis.diagnosis import black_box
from emir_analysis.diagnosis.diagnose import Findings
from emir_analysis.diagnosis.evidence import Evidence
from emir_analysis.diagnosis.experiment import OUTPUTS, Experiment
from emir_analysis.diagnosis.fitting import fit_balances, fit_free_run
from emir_analysis.diagnosis.foresight import explained
from emir_analysis.diagnosis.friction_laws import sticks
from emir_analysis.diagnosis.load_course import elsewhere, has_course
from emir_analysis.diagnosis.loads import LOAD
from emir_analysis.diagnosis.run_errors import free_run, free_run_errors, mean_square
from emir_analysis.diagnosis.select import EXPLAINED, HELPS, HOPELESS, at_noise, leaves_quiet
from emir_analysis.diagnosis.trial import Trial
from emir_analysis.root_mean_square import column_rms, rms
from emir_analysis.signals import Array
from emir_plant.parameters import Machine

STAGES = ("nominal", "refitted", "with_effect")
NOMINAL, REFITTED = STAGES[:2]
BLACK_BOX = "black_box"
WITHIN = 3.0  # standard deviations, within which a size is the same
OF_ONE_RUN = {LOAD, "flow_gain_drift"}  # come when they come, in each recording


@dataclass(frozen=True)
class Judged:
    """What each model says of the judge recordings.

    runs: by stage, the free run's outputs (n, 4) of each recording, SI units. one_step: by stage,
    errors (n, 4) of the change from one sample to the next, of each recording, as in `Balances`.
    NaN where an output has no sensor or a machine cannot rest where the recording starts.
    rivals: RMS error of each of them, all signals together, in units of the sensors' noise.
    surprising: what was found does not explain them, or one of their signals. reconciled: the same
    effects, or none, do with other parameters inside the tolerances, and the recordings that were
    fitted, too; not asked where something is known to be unexplained or sticks.
    """

    evidence: Evidence
    runs: dict[str, list[Array]]
    one_step: dict[str, list[Array]]
    rivals: tuple[float, ...]
    surprising: bool
    reconciled: bool

    def errors(self, stage: str) -> list[Array]:
        """Return simulated minus measured, (n, 4), of each recording."""
        pairs = zip(self.runs[stage], self.evidence.experiments, strict=True)
        return [run - experiment.outputs for run, experiment in pairs]

    def off(self, stage: str) -> float:
        """Return the RMS error of all signals together, in units of the sensors' noise."""
        errors = np.concatenate(self.errors(stage)) / self.evidence.sensors
        return rms(errors[:, self.evidence.shown])


def machines(findings: Findings, judge: Evidence) -> dict[str, Machine]:
    """Return the machine of each stage; without an effect named, the last is the re-fitted one."""
    found = (findings.sheet.machine, findings.refitted.machine, there(findings, judge).machine)
    return dict(zip(STAGES, found, strict=True))


def there(findings: Findings, judge: Evidence) -> Trial:
    """Return what was found as it is in judge recordings: loads of any course are others there."""
    same = judge.name == findings.evidence.name
    return findings.chosen if same else elsewhere(findings.chosen)


def judged(findings: Findings, experiments: Sequence[Experiment]) -> Judged:
    """Run every model, its parameters as they are, on recordings to be judged on."""
    evidence = Evidence(experiments, findings.sheet.machine)
    evidence.check_like(findings.evidence)
    stages = machines(findings, evidence)
    runs = {
        stage: [free_run(machine, e, evidence) for e in evidence.experiments]
        for stage, machine in stages.items()
    }
    one_step = {stage: evidence.one_step(machine) for stage, machine in stages.items()}
    free = black_box.train(findings.evidence)
    ahead = black_box.train_one_step(findings.evidence)
    runs[BLACK_BOX] = [_spread(free.free_run(e), evidence) for e in evidence.experiments]
    one_step[BLACK_BOX] = [_spread(ahead.one_step(e), evidence) for e in evidence.experiments]
    chosen = there(findings, evidence)
    alone = loudest_signal(chosen.machine, evidence)[1]
    surprising = not explained(chosen, evidence) or alone > EXPLAINED
    asked = findings.verdict != "unexplained" and not sticks(chosen)
    asked = asked and not has_course(findings.chosen)
    reconciled = asked and surprising and _reconciled(findings, evidence)
    rivals = tuple(math.sqrt(mean_square(rival, evidence)) for rival in findings.rivals)
    return Judged(evidence, runs, one_step, rivals, surprising, reconciled)


def carries(findings: Findings, judged: Judged) -> bool:
    """Tell whether the effects found are the machine's, as far as the judge recordings know.

    Those that are take away of what parameters alone leave in every recording, or leave little, or
    do so with other parameters; of rivals it is enough that one does. Not asked of what comes in
    one recording only, or of what sticks, which may part from any model.
    """
    named = [findings.chosen, *findings.rivals]
    if judged.reconciled or any(_known_here_alone(trial) for trial in named):
        return True
    off, alone = (judged.off(STAGES[-1]), *judged.rivals), judged.off(REFITTED)
    return not all(left > HOPELESS and left >= HELPS * alone for left in off)  # NaN: no rest there


def _known_here_alone(trial: Trial) -> bool:
    """Tell whether other recordings say little of a trial."""
    return not trial.effects or bool(OF_ONE_RUN.intersection(trial.effects)) or sticks(trial)


def loudest_signal(machine: Machine, evidence: Evidence) -> tuple[str, float]:
    """Return the signal whose free run is furthest off, and its RMS error in units of its noise."""
    left = column_rms(np.concatenate(free_run_errors(machine, evidence)))
    names = [name for name, shown in zip(OUTPUTS, evidence.shown, strict=True) if shown]
    worst = int(np.argmax(left))
    return names[worst], float(left[worst])


def _reconciled(findings: Findings, judge: Evidence) -> bool:
    """Tell whether the same effects bring all recordings together to the noise.

    What was fitted may have left some of them open, or have known them from next to nothing.
    """
    if not np.all(np.isfinite(np.concatenate(free_run_errors(findings.chosen.machine, judge)))):
        return False  # it cannot even rest there
    experiments = [*findings.evidence.experiments, *judge.experiments]
    both = Evidence(experiments, findings.sheet.machine)
    balanced = fit_balances(findings.chosen, both, both.floor(findings.chosen.machine))
    fitted = fit_free_run(balanced, both)
    left_alone = _same_sizes(findings.chosen, fitted)
    return left_alone and at_noise(fitted, both) and leaves_quiet(fitted, both)


def _same_sizes(found: Trial, fitted: Trial) -> bool:
    """Tell whether a further fit leaves the effects as they were found."""
    sizes = [u.path.startswith("effects.") for u in found.unknowns.members]
    moved = np.abs(fitted.x - found.x)[sizes]
    return bool(np.all(moved <= WITHIN * found.spread[sizes]))


def _spread(shown: Array, evidence: Evidence) -> Array:
    """Return the outputs that sensors show, (n, c), at their places among all, (n, 4)."""
    result = np.full((len(shown), evidence.shown.size), np.nan)
    result[:, evidence.shown] = shown
    return result
