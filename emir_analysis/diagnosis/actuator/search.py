"""Which effects an actuator has: chosen by the free run's error on blocks left out of the fit."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from emir_analysis.diagnosis.actuator.fitting import Fitted, Mask, fit, free_run_error
from emir_analysis.diagnosis.actuator.record import ActuatorRecord
from emir_plant.actuator import REGISTRY, ActuatorSheet

AT_NOISE = 1.1  # times the noise: free-run error of a model that lacks nothing
FOLDS = 4  # each leaves every fourth block out
BLOCK = 1.25  # slow periods in a block, so that it is not known from its neighbours
INDEPENDENT = 4.0  # errors in a slow period that count as independent
BETTER = 6.0  # difference of two scores that counts as strong evidence (Kass and Raftery 1995)
MOST_EFFECTS = 8
BREADTH = 3  # sets of effects that are followed at a time: the best first one may lead astray
MOST_FITTED = 8  # candidates beside each that go on from a first fit to one with restarts
RESTARTS = 3
FIRST_RESTARTS = 8

Progress = Callable[[str], None]


@dataclass(frozen=True)
class Tried:
    """A fit, its score (smaller is better) and the RMS error of blocks left out of fits like it.

    unseen: infinite where the score already spoke against it.
    """

    fitted: Fitted
    score: float
    unseen: float = math.inf


@dataclass(frozen=True)
class Search:
    """What was tried, in its order, and the chosen one; rivals: as good and no larger."""

    plain: Tried
    chosen: Tried
    tried: tuple[Tried, ...]
    rivals: tuple[Tried, ...]


def search(
    sheet: ActuatorSheet, record: ActuatorRecord, noise: float, progress: Progress
) -> Search:
    """Add one effect after the other while score and blocks left out get better, then drop.

    An effect is added where it makes the score better by BETTER and the error of the blocks left
    out smaller than without it. noise: of the pressure; a model that is down to it lacks nothing.
    """
    progress("parameters only")
    plain_fit = fit(sheet, (), record, sheet.machine, restarts=FIRST_RESTARTS)
    slow = 2.0 * np.pi / plain_fit.machine.load.frequency / record.period
    independent = record.pressure.size / slow * INDEPENDENT
    folds = _folds(record.pressure.size, max(1, round(BLOCK * slow)))

    def fitted(effects: tuple[str, ...], known: Fitted, restarts: int = RESTARTS) -> Tried:
        found = fit(sheet, effects, record, known.machine, restarts=restarts)
        return Tried(found, _score(found.rms, independent, found.x.size))

    def tested(tried: Tried) -> Tried:
        progress(f"blocks left out: {tried.fitted.name}")
        return replace(tried, unseen=_unseen(sheet, tried.fitted, record, folds))

    plain = tested(Tried(plain_fit, _score(plain_fit.rms, independent, plain_fit.x.size)))
    tried = [plain]
    parents: dict[frozenset[str], Tried] = {}
    accepted = [plain]
    followed = [plain]
    while (
        followed
        and len(followed[0].fitted.effects) < MOST_EFFECTS
        and min(t.unseen for t in followed) > AT_NOISE * noise
    ):
        found: dict[frozenset[str], Tried] = {}
        for parent in followed:
            progress(f"candidates beside: {parent.fitted.name}")
            for child in _promising(parent, fitted):
                same = frozenset(child.fitted.effects)
                if same not in found or child.score < found[same].score:
                    found[same] = child
                    parents[same] = parent
        better = sorted(found.values(), key=lambda t: t.score)
        held = [tested(t) for t in better[:BREADTH]]
        tried += held + better[BREADTH:]
        followed = [t for t in held if t.unseen < parents[frozenset(t.fitted.effects)].unseen]
        accepted += followed
    best = _dropped(_smallest(accepted), fitted, tested, tried)
    rivals = [t for t in accepted if _is_rival(t, best)]
    return Search(plain, best, tuple(tried), tuple(rivals))


def _promising(parent: Tried, fitted: Callable[..., Tried]) -> list[Tried]:
    """Return the candidates beside a set of effects that make the score better."""
    names = [name for name in REGISTRY if name not in parent.fitted.effects]
    first = [fitted((*parent.fitted.effects, name), parent.fitted, 1) for name in names]
    first.sort(key=lambda t: t.score)
    again = [fitted(t.fitted.effects, parent.fitted) for t in first[:MOST_FITTED]]
    better = [min(pair, key=lambda t: t.score) for pair in zip(first, again, strict=False)]
    return [t for t in better if t.score < parent.score - BETTER]


def _smallest(accepted: list[Tried]) -> Tried:
    """Return the one with the fewest parameters of those that are as good as the best."""
    least = min(t.score for t in accepted)
    good = [t for t in accepted if t.score < least + BETTER]
    return min(good, key=lambda t: (t.fitted.x.size, t.score))


def _is_rival(one: Tried, best: Tried) -> bool:
    other = set(one.fitted.effects) != set(best.fitted.effects)
    as_good = one.score < best.score + BETTER and one.fitted.x.size <= best.fitted.x.size
    return other and as_good


def _dropped(
    best: Tried,
    fitted: Callable[[tuple[str, ...], Fitted], Tried],
    tested: Callable[[Tried], Tried],
    tried: list[Tried],
) -> Tried:
    """Leave out each effect in turn, where that does the fit and the blocks left out no harm."""
    for name in best.fitted.effects[:-1]:  # the last one was tested last
        fewer = tuple(effect for effect in best.fitted.effects if effect != name)
        without = fitted(fewer, best.fitted)
        if without.score < best.score:
            without = tested(without)
            if without.unseen < best.unseen:
                best = without
        tried.append(without)
    return best


def _score(rms: float, independent: float, unknowns: int) -> float:
    """Return the Bayesian information criterion; smaller is better."""
    return independent * 2.0 * float(np.log(rms)) + unknowns * float(np.log(independent))


def _folds(samples: int, block: int) -> list[Mask]:
    """Return the samples that each fit sees, (n,) true: all but every fourth block."""
    number = np.arange(samples) // block
    return [number % FOLDS != fold for fold in range(FOLDS)]


def _unseen(
    sheet: ActuatorSheet, whole: Fitted, record: ActuatorRecord, folds: list[Mask]
) -> float:
    """Return the RMS error of all blocks, each simulated by a fit that has not seen it."""
    error = np.zeros(record.pressure.size)
    for seen in folds:
        part = fit(sheet, whole.effects, record, whole.machine, seen=seen)
        error[~seen] = free_run_error(part.machine, record)[~seen]
    return float(np.sqrt(np.mean(error**2)))
