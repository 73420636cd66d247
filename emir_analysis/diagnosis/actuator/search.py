"""Which effects an actuator has: chosen by the free run's error on parts left out of the fit."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from emir_analysis.diagnosis.actuator.fitting import Fitted, Mask, fit, free_run_error
from emir_analysis.diagnosis.actuator.record import ActuatorRecord
from emir_analysis.signals import Array
from emir_plant.actuator import REGISTRY, ActuatorSheet

AT_NOISE = 1.1  # times the noise: free-run error of a model that lacks nothing
PARTS = 4  # of the recording, each left out once: whole movements, not pieces between their like
INDEPENDENT = 4.0  # errors in a slow period that count as independent
MOST_EFFECTS = 8
BREADTH = 3  # sets of effects that are followed at a time: the best first one may lead astray
MOST_FITTED = 8  # candidates beside each that go on from a first fit to one with restarts
MOST_TESTED = 8  # sets at a time that are fitted with parts left out
RESTARTS = 3
FIRST_RESTARTS = 8

Progress = Callable[[str], None]
Test = Callable[["Tried"], "Tried"]


@dataclass(frozen=True)
class Tried:
    """A fit and its score (Bayesian information criterion, smaller is better).

    left_out: errors (n,) of all parts, each simulated by a fit that has not seen it; None where
    the score already spoke against it.
    """

    fitted: Fitted
    score: float
    left_out: Array | None = None

    @property
    def unseen(self) -> float:
        """Return the RMS error of the parts left out; infinite where they were not."""
        return math.inf if self.left_out is None else float(np.sqrt(np.mean(self.left_out**2)))


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
    """Add one effect after the other while the error on parts left out gets smaller.

    After each, those added before are dropped where that makes it smaller, too. Of all sets as
    good as the best one that with the fewest parameters is chosen. noise: of the pressure; a
    model that is down to it lacks nothing.
    """
    progress("parameters only")
    plain_fit = fit(sheet, (), record, sheet.machine, restarts=FIRST_RESTARTS)
    slow = 2.0 * np.pi / plain_fit.machine.load.frequency / record.period
    independent = record.pressure.size / slow * INDEPENDENT
    parts = _parts(record.pressure.size)

    def fitted(effects: tuple[str, ...], known: Fitted, restarts: int = RESTARTS) -> Tried:
        found = fit(sheet, effects, record, known.machine, restarts=restarts)
        return Tried(found, _score(found.rms, independent, found.x.size))

    def tested(tried: Tried) -> Tried:
        progress(f"parts left out: {tried.fitted.name}")
        return replace(tried, left_out=_left_out(sheet, tried.fitted, record, parts))

    plain = tested(Tried(plain_fit, _score(plain_fit.rms, independent, plain_fit.x.size)))
    tried = {_key(plain): plain}
    accepted = followed = [plain]
    while (
        followed
        and len(followed[0].fitted.effects) < MOST_EFFECTS
        and followed[0].unseen > AT_NOISE * noise
    ):
        worst: dict[frozenset[str], float] = {}  # error above which a set is no better than before
        found: dict[frozenset[str], Tried] = {}
        for parent in followed:
            progress(f"candidates beside: {parent.fitted.name}")
            for child in _promising(parent, fitted):
                key = _key(child)
                worst[key] = min(worst.get(key, math.inf), parent.unseen)
                if key not in found or child.score < found[key].score:
                    found[key] = child
        ordered = sorted((t for t in found.values() if _key(t) not in tried), key=lambda t: t.score)
        held = [tested(t) for t in ordered[:MOST_TESTED]]
        tried |= {_key(t): t for t in (*held, *ordered[MOST_TESTED:])}
        better = sorted((t for t in held if t.unseen < worst[_key(t)]), key=lambda t: t.unseen)
        better = [*_without(better[0], fitted, tested, tried), *better] if better else []
        accepted = [*accepted, *better]
        followed = better[:BREADTH]
    block = max(1, round(slow))
    best = min(accepted, key=lambda t: t.unseen)
    good = [t for t in accepted if _is_as_good(t, best, block)]
    chosen = min(good, key=lambda t: (t.fitted.x.size, t.unseen))
    rivals = [t for t in good if t is not chosen and t.fitted.x.size <= chosen.fitted.x.size]
    return Search(plain, chosen, tuple(tried.values()), tuple(rivals))


def _key(tried: Tried) -> frozenset[str]:
    return frozenset(tried.fitted.effects)


def _promising(parent: Tried, fitted: Callable[..., Tried]) -> list[Tried]:
    """Return the candidates beside a set of effects that fit better than it."""
    names = [name for name in REGISTRY if name not in parent.fitted.effects]
    first = [fitted((*parent.fitted.effects, name), parent.fitted, 1) for name in names]
    first.sort(key=lambda t: t.score)
    again = [fitted(t.fitted.effects, parent.fitted) for t in first[:MOST_FITTED]]
    better = [min(pair, key=lambda t: t.score) for pair in zip(first, again, strict=False)]
    return [t for t in better if t.fitted.rms < parent.fitted.rms]


def _without(
    best: Tried,
    fitted: Callable[..., Tried],
    tested: Test,
    tried: dict[frozenset[str], Tried],
) -> list[Tried]:
    """Drop effects, one after the other, while the parts left out get better; the best first."""
    found: list[Tried] = []
    while len(best.fitted.effects) > 1:
        fewer = []
        for name in best.fitted.effects:
            left = tuple(effect for effect in best.fitted.effects if effect != name)
            if frozenset(left) not in tried:
                fewer.append(tested(fitted(left, best.fitted)))
        tried |= {_key(t): t for t in fewer}
        fewer = [t for t in fewer if t.unseen < best.unseen]
        if not fewer:
            break
        best = min(fewer, key=lambda t: t.unseen)
        found.insert(0, best)
    return found


def _is_as_good(one: Tried, best: Tried, block: int) -> bool:
    """Return whether one set's error on parts left out is within a standard error of the best's.

    Both are compared block by block, each of a slow period (Breiman et al. 1984).
    """
    if one.left_out is None or best.left_out is None:
        return False
    difference = one.left_out**2 - best.left_out**2
    count = max(2, difference.size // block)
    means = np.array([part.mean() for part in np.array_split(difference, count)])
    return bool(means.mean() <= means.std(ddof=1) / math.sqrt(count))


def _score(rms: float, independent: float, unknowns: int) -> float:
    """Return the Bayesian information criterion; smaller is better."""
    return independent * 2.0 * float(np.log(rms)) + unknowns * float(np.log(independent))


def _parts(samples: int) -> list[Mask]:
    """Return the samples that each fit sees, (n,) true: all but one part of the recording."""
    number = np.arange(samples) * PARTS // samples
    return [number != part for part in range(PARTS)]


def _left_out(
    sheet: ActuatorSheet, whole: Fitted, record: ActuatorRecord, parts: list[Mask]
) -> Array:
    """Return the errors (n,) of all parts, each simulated by a fit that has not seen it."""
    error = np.zeros(record.pressure.size)
    for seen in parts:
        part = fit(sheet, whole.effects, record, whole.machine, seen=seen)
        error[~seen] = free_run_error(part.machine, record)[~seen]
    return error
