"""The course of a diagnosis: balances, parameters, effects, verdict - from one recording."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from emir_analysis.diagnosis.balances import BALANCES, Balances, noise_floor
from emir_analysis.diagnosis.candidates import (
    LINKAGE,
    Trial,
    fit_balances,
    fit_free_run,
    shortlist,
    trial,
)
from emir_analysis.diagnosis.experiment import COMMAND, OUTPUTS, Experiment, noise
from emir_analysis.diagnosis.free_run import errors, rms
from emir_analysis.diagnosis.select import (
    EXPLAINED,
    SEEN,
    SPEAKS,
    STRONG,
    balance_score,
    free_run_score,
    named,
    quiet,
    rivals,
)
from emir_analysis.diagnosis.shape import Shape, best_shape
from emir_analysis.signals import Array
from emir_plant.sheet import Sheet

AT_NOISE = 1.1  # times the sensor noise: free-run error of a model that lacks nothing
MOST_EFFECTS = 2  # that are looked for in one machine
MOST_SIMULATED = 3  # trials of a round that go on from the balances to the free run

Progress = Callable[[str], None]


@dataclass(frozen=True)
class Tried:
    """A trial and its scores on the unseen part; smaller is better.

    free_run: None where the balances already spoke against it.
    """

    trial: Trial
    balances: float
    free_run: float | None = None


@dataclass(frozen=True)
class Findings:
    """What a recording says about the machine.

    verdict: nothing_missing, found, ambiguous or unexplained. refitted: parameters only, chosen:
    with the effects named, both fitted to the whole recording. rejected: effects that were best
    among all and yet leave too much. tried: all trials. rivals: those as good as the chosen one.
    residuals: (w, 5) of each balance for the machine as stated (`before`), `refitted` and
    `after`; floor: (5,) the sensors' share. speaking: the loudest balance that is not down to
    the noise at the end, shape: of its residual.
    """

    experiment: Experiment
    sheet: Sheet
    verdict: str
    refitted: Trial
    chosen: Trial
    rejected: tuple[str, ...]
    tried: tuple[Tried, ...]
    rivals: tuple[Trial, ...]
    balances: Balances
    residuals: dict[str, Array]
    floor: Array
    speaking: str | None
    shape: Shape | None


def diagnose(experiment: Experiment, sheet: Sheet, progress: Progress) -> Findings:
    """Find out from one recording what the data sheet's machine lacks."""
    sensors = noise(sheet.machine)
    balances = Balances(experiment, sheet.machine)
    floor = _floor(experiment, trial(sheet, ()), sensors)
    tried, best = _search(experiment, sheet, balances, floor, progress)
    chosen = best[0]
    progress("fitting to the whole recording")
    parameters_only = tried[0]
    plain = fit_balances(parameters_only.trial, balances, floor)
    simulated = parameters_only.free_run is not None
    refitted = fit_free_run(parameters_only.trial if simulated else plain, experiment, sensors)
    balanced, final = plain, refitted
    if chosen.effects:
        balanced = fit_balances(chosen, balances, floor)
        final = fit_free_run(chosen, experiment, sensors)
    machines = [sheet.machine, plain.machine, balanced.machine]
    before, unaided, after = balances.residuals(machines)
    floor = _floor(experiment, final, sensors)
    free_run = rms(errors(final.machine, experiment)) / sensors
    convincing = _convincing(final, unaided, after, floor, free_run)
    verdict = _verdict(final, len(best) - 1, convincing=convincing)
    if verdict == "unexplained":
        final, after = refitted, unaided
        floor = _floor(experiment, final, sensors)
    speaking = loudest(after, floor)
    return Findings(
        experiment=experiment,
        sheet=sheet,
        verdict=verdict,
        refitted=refitted,
        chosen=final,
        rejected=chosen.effects if verdict == "unexplained" else (),
        tried=tuple(tried),
        rivals=tuple(best[1:]),
        balances=balances,
        residuals={"before": before, "refitted": unaided, "after": after},
        floor=floor,
        speaking=speaking,
        shape=None if speaking is None else _shape(experiment, balances, after, speaking),
    )


def _search(
    experiment: Experiment, sheet: Sheet, balances: Balances, floor: Array, progress: Progress
) -> tuple[list[Tried], list[Trial]]:
    """Return all that was tried and the best trials, on the part that the selection may see.

    Forward selection: effects are added one at a time, as long as the unseen part gets better.
    """
    sensors = noise(sheet.machine)
    head = experiment.head(SEEN)
    seen = Balances(head, sheet.machine)

    def simulated(screened: Tried) -> Tried:
        progress(f"free run: {screened.trial.name}")
        fitted = fit_free_run(screened.trial, head, sensors)
        return Tried(fitted, screened.balances, free_run_score(fitted, experiment, sensors))

    def screened(effects: tuple[str, ...], known: Trial | None) -> Tried:
        start = trial(sheet, effects, known)
        progress(f"balances: {start.name}")
        fitted = fit_balances(start, seen, floor)
        return Tried(fitted, balance_score(fitted, balances, floor))

    best = screened((), None)
    if quiet(rms(balances.residuals([best.trial.machine])[0]), floor):
        best = simulated(best)
        if np.all(rms(errors(best.trial.machine, experiment)) <= AT_NOISE * sensors):
            return [best], [best.trial]  # nothing is left that an effect could explain
    tried = [best]
    equal = [best.trial]
    while len(best.trial.effects) < MOST_EFFECTS:
        known = best.trial if best.trial.effects else None
        progress(f"shortlist beside: {best.trial.name}")
        others = shortlist(best.trial, sheet, seen, floor)
        round_ = [screened((*best.trial.effects, name), known) for name in others]
        promising = sorted(
            (t for t in round_ if t.balances < best.balances - STRONG), key=lambda t: t.balances
        )[:MOST_SIMULATED]
        if promising and best.free_run is None:
            best = simulated(best)
            tried[0] = best
        runs = {t.trial.name: simulated(t) for t in promising}
        tried += [runs.get(t.trial.name, t) for t in round_]
        better = [t for t in runs.values() if _free(t) < _free(best) - STRONG]
        if not better:
            break
        equal = rivals([t.trial for t in better], [_free(t) for t in better])
        best = min(better, key=_free)
        residuals = balances.residuals([best.trial.machine])[0]
        if quiet(rms(residuals), _floor(experiment, best.trial, sensors)):
            break
    return tried, equal


def _free(tried: Tried) -> float:
    return float("inf") if tried.free_run is None else tried.free_run


def _floor(experiment: Experiment, fitted: Trial, sensors: Array) -> Array:
    floor = noise_floor(experiment, fitted.machine)
    floor[LINKAGE] = sensors[0]
    return floor


def _convincing(final: Trial, unaided: Array, after: Array, floor: Array, free_run: Array) -> bool:
    """Tell whether a trial says enough of what the recording shows.

    unaided, after: residuals (w, 5) without and with its effects. free_run: (4,) RMS errors in
    units of the sensors' noise.
    """
    if final.effects:
        return named(rms(unaided), rms(after), floor)
    return quiet(rms(after), floor) and bool(np.all(free_run <= EXPLAINED))


def _verdict(final: Trial, rival_count: int, *, convincing: bool) -> str:
    if not convincing:
        return "unexplained"
    if not final.effects:
        return "nothing_missing"
    return "ambiguous" if rival_count else "found"


def loudest(residual: Array, floor: Array) -> str | None:
    """Return the balance that is furthest above its noise, if one speaks.

    A missing force bends the boom too, so the bending counts only where nothing else speaks.
    """
    loudness = dict(zip(BALANCES, rms(residual) / floor, strict=True))
    loud = [name for name, ratio in loudness.items() if ratio > SPEAKS]
    first = [name for name in loud if name != "bending"]
    return max(first or loud, key=loudness.__getitem__, default=None)


def _shape(experiment: Experiment, balances: Balances, residual: Array, speaking: str) -> Shape:
    every = experiment.every
    command = np.append(experiment.commands, experiment.commands[-1])[::every]
    signals = {
        name: (unit, balances.average(experiment.outputs[:, k]))
        for k, (name, unit) in enumerate(OUTPUTS.items())
    }
    signals["piston_velocity"] = ("m/s", balances.average(balances.velocity))
    signals["piston_force"] = ("N", balances.average(balances.force))
    signals[COMMAND] = ("1", balances.average(command))
    signals["time"] = ("s", balances.time)
    column = list(BALANCES).index(speaking)
    return best_shape(residual[:, column], signals["piston_velocity"][1], signals)
