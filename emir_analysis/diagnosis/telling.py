"""What a recording cannot tell, and what to record instead."""

from collections.abc import Sequence

import numpy as np

from emir_analysis.diagnosis.balances import BALANCES
from emir_analysis.diagnosis.evidence import Evidence
from emir_analysis.diagnosis.experiment import COMMAND_STEP
from emir_analysis.diagnosis.fitting import glimpsed
from emir_analysis.diagnosis.free_run import COMPARED, free_runs
from emir_analysis.diagnosis.friction_laws import sticks
from emir_analysis.diagnosis.resized import resized
from emir_analysis.diagnosis.select import HOPELESS, STRONG, beyond, excess, free_run_score
from emir_analysis.diagnosis.trial import Trial
from emir_analysis.diagnosis.unknowns import is_share
from emir_analysis.root_mean_square import rms
from emir_analysis.signals import Array
from emir_common.parameter_tree import declared

# what only this balance shows: effects that can otherwise not be named, or not be told apart
ONLY_HERE = {
    "force": "friction, payload, external load and linkage are told apart by the motion alone",
    "lifting_chamber": "valve, leakage and air of the lifting side show in the motion alone",
    "lowering_chamber": "valve, leakage and air of the lowering side show in the motion alone",
    "linkage": "a stroke that does not fit the angle goes unseen",
    "bending": "bending shows in the free run alone, and a load is told from friction less well",
}

REACHES = np.geomspace(1e-2, 1e3, 16)  # in trial values
TWO_DEVIATIONS = 4.0  # by how much a score is worse there
REST = 1.0  # s


def _moves(*pieces: tuple[float, float]) -> Array:
    """Return a command on its grid: at rest, then pieces of (y2, s)."""
    parts = [np.zeros(round(REST / COMMAND_STEP))]
    parts += [np.full(round(length / COMMAND_STEP), y) for y, length in pieces]
    return np.concatenate(parts)


MOVEMENTS = {
    "slow moves up and down (a fifth of the opening, 6 s each)": _moves(
        (0.28, 6.0), (0.0, 2.0), (-0.28, 6.0), (0.0, 6.0)
    ),
    "fast moves up and down (two thirds of the opening, 2 s each)": _moves(
        (0.7, 2.0), (0.0, 4.0), (-0.7, 2.0), (0.0, 4.0), (0.7, 2.0), (-0.7, 2.0), (0.0, 4.0)
    ),
    "short reversals at the edge of the dead zone (1 s each)": _moves(
        *[(y, 1.0) for _ in range(5) for y in (0.2, -0.2)], (0.0, 10.0)
    ),
    "one move and then a minute at rest with both chambers shut": _moves((0.4, 2.0), (0.0, 57.0)),
    "openings that grow and shrink again without closing (1.5 s each)": _moves(
        *[(y, 1.5) for y in (0.3, 0.6, 0.3)],
        (0.0, 3.0),
        *[(-y, 1.5) for y in (0.3, 0.6, 0.3)],
        (0.0, 6.0),
    ),
    "one long move over most of the stroke (10 s)": _moves((0.45, 10.0), (0.0, 9.0)),
}


def untold(evidence: Evidence) -> dict[str, str]:
    """Return, by the balance that missing sensors leave out, what can then not be told."""
    lines = {}
    for name, told in zip(BALANCES, evidence.told, strict=True):
        if not told:
            missing = " and ".join(sorted(BALANCES[name].signals - evidence.measured))
            lines[name] = f"without {missing} {ONLY_HERE[name]}"
    return lines


def open_shares(chosen: Trial, evidence: Evidence) -> dict[str, Trial]:
    """Return the trials at the other end of shares that were set, where they are as good.

    By the share's dotted path. Of the size that suits it there, and the other parameters move with
    it where it is not far off, but for what sticks: a step of the resolver decides there.
    """
    fitted = {unknown.path for unknown in chosen.unknowns.members}
    good = free_run_score(chosen, evidence, seen=0.0) + STRONG
    found = {}
    for path, (_, value) in declared(chosen.machine).items():
        named = path.startswith(tuple(f"effects.{effect}." for effect in chosen.effects))
        if named and path not in fitted and is_share(path):
            other = chosen.fixed(path, 1.0 - value)
            if free_run_score(other, evidence, seen=0.0) >= good and not sticks(chosen):
                other = _elsewhere(resized(other, path, evidence), evidence)
            if free_run_score(other, evidence, seen=0.0) < good:
                found[path] = other
    return found


def _elsewhere(other: Trial, evidence: Evidence) -> Trial:
    """Return a trial with the other parameters moved, where it is not far off."""
    near = excess(other, evidence) < beyond(HOPELESS)
    return glimpsed(other, evidence) if near else other


def between_steps(chosen: Trial, k: int, evidence: Evidence) -> tuple[float, float]:
    """Return the values of a trial's k-th parameter between which its free run stays as good.

    For one that acts in steps, as a threshold does: slopes say nothing of it.
    """
    unknown, x = chosen.unknowns.members[k], float(chosen.x[k])
    limit = free_run_score(chosen, evidence, seen=0.0) + TWO_DEVIATIONS

    def end(way: float, farthest: float) -> float:
        for reach in REACHES:
            at = chosen.x.copy()
            at[k] = x + way * reach
            if reach >= farthest:
                return x + way * farthest
            if free_run_score(chosen.at(at), evidence, seen=0.0) > limit:
                return float(at[k])
        return x + way * farthest

    return unknown.value(end(-1.0, x - unknown.low)), unknown.value(end(1.0, unknown.high - x))


def movement(rivals: Sequence[Trial], evidence: Evidence) -> tuple[str, float]:
    """Return which movement tells fitted trials apart best, and how far.

    How far: least RMS difference between two of them, in units of the sensors' noise.
    """
    apart = {name: _apart(rivals, commands, evidence) for name, commands in MOVEMENTS.items()}
    best = max(apart, key=apart.__getitem__)
    return best, apart[best]


def _apart(rivals: Sequence[Trial], commands: Array, evidence: Evidence) -> float:
    experiment = evidence.experiments[0].under(commands)
    start = experiment.start()
    begin = (start[0], evidence.stated.supply.pT if np.isnan(start[1]) else start[1])
    machines = [trial.machine for trial in rivals]
    runs = free_runs(machines, experiment, [begin] * len(machines))[:, :, COMPARED]
    shown = (runs / evidence.sensors)[:, :, evidence.shown]
    differences = [rms(shown[i] - shown[j]) for i in range(len(rivals)) for j in range(i)]
    return float(np.nan_to_num(min(differences), nan=0.0))
