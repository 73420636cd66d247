"""Which effects an actuator has: chosen by the evidence of the recording for each set of them."""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np

from emir_analysis.diagnosis.actuator.fitting import Begin, Fitted, Fitting, free_run_error
from emir_analysis.diagnosis.actuator.unknowns import sizes
from emir_analysis.diagnosis.select import AT_NOISE, STRONG
from emir_analysis.diagnosis.side_by_side import side_by_side
from emir_analysis.root_mean_square import rms
from emir_plant.actuator import REGISTRY

PARTS_LEFT_OUT = 4  # each once: whole movements, not pieces between their like
MOST_EFFECTS = 8
BREADTH = 3  # sets of effects that are followed at a time: the best first one may lead astray
RANDOM_STARTS = 3  # starts at random of a promising set
RANDOM_STARTS_ALONE = 8  # of a fit that knows of no other
SETS_SETTLED = 8  # sets of which each starts once more from the others' machines
MUCH = 0.7  # of the error without effects, on parts left out: half of its square
BARE_MENTION = 0.5 * math.log(10.0)  # in the evidence: "barely worth mentioning" (Jeffreys 1961)

Progress = Callable[[str], None]


class Misstated(NamedTuple):
    """The parameters with another value of the data sheet, by dotted path, fitted along."""

    path: str
    fitted: Fitted


@dataclass(frozen=True)
class Search:
    """The fits of all sets that were tried, the best first; rivals: as good and no larger.

    unseen: RMS error of parts left out of the fit, each simulated by a machine that has not seen
    it, by the sets' names: of parameters only, of the chosen set and of its rivals. Where no
    effects explain the recording, misstated: another value of the data sheet that does, or curve:
    the machine with what has no name as a curve, if one is measured.
    """

    plain: Fitted
    chosen: Fitted
    tried: tuple[Fitted, ...]
    rivals: tuple[Fitted, ...]
    unseen: dict[str, float]
    curve: Fitted | None = None
    misstated: Misstated | None = None

    @property
    def last(self) -> Fitted:
        """Return what explains the recording best."""
        if self.misstated is not None:
            return self.misstated.fitted
        return self.curve or self.chosen


def parameters_only(fitting: Fitting) -> Fitted:
    """Return the fit without effects."""
    return fitting.fit((), Begin(drawn=RANDOM_STARTS_ALONE))


def search(fitting: Fitting, plain: Fitted, progress: Progress, most: int = MOST_EFFECTS) -> Search:
    """Add and drop single effects, from none on, while that leads to sets of more evidence.

    The sets with the most evidence are fitted once more from each other's machines. Of those as
    good as the best one that with the fewest parameters is chosen; where parameters alone are at
    the noise of the pressure, one that is much more probable, or none.
    plain: the fit without effects. most: effects that are asked for in one machine.
    """
    noise = fitting.noise
    tried = _climbed(fitting, plain, progress, most)
    progress("the best from each other's machines")
    good = _first(tried.values(), SETS_SETTLED)
    begin = Begin([f.machine for f in good], drawn=RANDOM_STARTS, thorough=True)
    again = side_by_side(lambda f: fitting.fit(f.effects, begin), good)
    tried |= {_key(f): f for f in again}
    _settle_below(fitting, tried)
    ordered = _first(tried.values(), len(tried))
    plain = tried[frozenset()]
    chosen, rivals = _choice(ordered)
    if chosen.rms <= AT_NOISE * noise:
        known = {_key(f) for f in rivals}
        rivals += [f for f in ordered if _key(f) not in known and _does_as_well(f, chosen)]
    if plain.rms <= AT_NOISE * noise and _better(chosen, plain) < STRONG:
        chosen, rivals = plain, []
    chosen = _with_sizes_that_tell(fitting, chosen)
    shown = [plain, chosen, *rivals]
    progress("parts left out")
    unseen = {f.name: unseen_error(fitting, f.effects) for f in shown}
    return Search(plain, chosen, tuple(ordered), tuple(rivals), unseen)


def _climbed(
    fitting: Fitting, plain: Fitted, progress: Progress, most: int
) -> dict[frozenset[str], Fitted]:
    """Return the sets tried from parameters only on, until the best ones' neighbours all are."""
    tried = {_key(plain): plain}
    left: set[frozenset[str]] = set()  # sets whose neighbours have been tried
    best = plain
    while True:
        breadth = 1 if best.rms <= AT_NOISE * fitting.noise else BREADTH
        parents = [f for f in _first(tried.values(), breadth) if _key(f) not in left]
        if not parents:
            return tried
        for parent in parents:
            progress(f"beside: {parent.name}")
            left.add(_key(parent))
            found = _neighbours(fitting, parent, tried, most)
            tried |= {_key(f): f for f in found}
        best = _first(tried.values(), 1)[0]


def _settle_below(fitting: Fitting, tried: dict[frozenset[str], Fitted]) -> None:
    """Fit the chosen set's own with one effect less once more from its machine, if that is better.

    On the way up one of them may have been left in a poor minimum, which an effect that is not
    there led out of. Goes on as long as another set is chosen.
    """
    before: frozenset[str] | None = None
    while (chosen := _choice(_first(tried.values(), len(tried)))[0]) and _key(chosen) != before:
        before = _key(chosen)
        smaller = [tuple(e for e in chosen.effects if e != name) for name in chosen.effects]
        begun = partial(fitting.fit, begin=Begin([chosen.machine]))
        for fitted in side_by_side(begun, smaller):
            known = tried.get(_key(fitted))
            if known is None or fitted.evidence > known.evidence:
                tried[_key(fitted)] = fitted


def _with_sizes_that_tell(fitting: Fitting, chosen: Fitted) -> Fitted:
    """Return a set without those sizes of its effects without which it is as probable.

    A limit of the flow that the recording only just reaches is none that it tells.
    """
    gone: list[str] = []
    for path in sizes(chosen.effects):
        without = [*gone, path]
        fewer = fitting.fit(chosen.effects, Begin([chosen.machine]), without=without)
        _, effect, _ = path.split(".")
        stays_on = getattr(fewer.machine.effects, effect).is_on
        if stays_on and fewer.evidence > chosen.evidence - BARE_MENTION:
            chosen, gone = fewer, without
    return chosen


def _choice(ordered: list[Fitted]) -> tuple[Fitted, list[Fitted]]:
    """Return the smallest of the sets as good as the best one, and others no larger."""
    as_good = [f for f in ordered if _probable(f) > _probable(ordered[0]) - BARE_MENTION]
    chosen = min(as_good, key=lambda f: f.x.size)
    return chosen, [f for f in as_good if f is not chosen and f.x.size <= chosen.x.size]


def _does_as_well(other: Fitted, chosen: Fitted) -> bool:
    """Tell whether a set with another effect in place of one makes the recording as probable.

    It may be less probable beforehand, such as a null offset of a sixth of the stroke beside a load
    that does the same: no recording says that.
    """
    added, gone = _key(other) - _key(chosen), _key(chosen) - _key(other)
    exchanged = len(added) == len(gone) == 1
    as_likely = other.likelihood > chosen.likelihood - BARE_MENTION
    return exchanged and as_likely and other.x.size <= chosen.x.size


def _better(one: Fitted, other: Fitted) -> float:
    """Return by how much a set is more probable, as STRONG is meant."""
    return 2.0 * (_probable(one) - _probable(other))


def _key(fitted: Fitted) -> frozenset[str]:
    return frozenset(fitted.effects)


def _first(fits: Iterable[Fitted], count: int) -> list[Fitted]:
    """Return the most probable ones, the best first."""
    return sorted(fits, key=lambda f: -_probable(f))[:count]


def _probable(fitted: Fitted) -> float:
    """Return the logarithm of how probable a set is, but for a constant.

    Before anything is measured any number of effects is as probable as another, and so is any
    set of that number: the more there are to choose from, the less each of them (Scott and Berger
    2010, Annals of Statistics 38, 2587).
    """
    return fitted.evidence - math.log(math.comb(len(REGISTRY), len(fitted.effects)))


def _neighbours(
    fitting: Fitting, parent: Fitted, tried: dict[frozenset[str], Fitted], most: int
) -> list[Fitted]:
    """Fit the sets with one effect more or less; the better half again from further starts."""
    sets = [_key(parent) ^ {name} for name in REGISTRY]
    new = [s for s in sets if s not in tried and len(s) <= most]
    ordered = [tuple(name for name in REGISTRY if name in s) for s in new]
    begin = Begin([parent.machine], levels=True)
    first = side_by_side(lambda effects: fitting.fit(effects, begin), ordered)
    first = _first(first, len(first))
    better, others = first[: len(first) // 2], first[len(first) // 2 :]
    again = side_by_side(
        lambda f: fitting.fit(f.effects, Begin([f.machine], drawn=RANDOM_STARTS)), better
    )
    return [*again, *others]


def unseen_error(fitting: Fitting, effects: tuple[str, ...]) -> float:
    """Return the RMS error of all parts, each by a fit that knows nothing of it."""
    record = fitting.record
    number = np.arange(record.pressure.size) * PARTS_LEFT_OUT // record.pressure.size
    parts = [number == part for part in range(PARTS_LEFT_OUT)]
    begin = Begin([fitting.sheet.machine], drawn=RANDOM_STARTS_ALONE, levels=True)
    fits = side_by_side(lambda part: fitting.fit(effects, begin, seen=~part), parts)
    error = np.zeros(record.pressure.size)
    for part, fitted in zip(parts, fits, strict=True):
        error[part] = free_run_error(fitted.machine, record)[part]
    return rms(error)
