"""Which effects could explain what a fitted trial leaves: all are tried, in the balances first.

Cheap enough for every effect of the registry, since only its own few fields are fitted (see
`candidate.py`).
"""

from collections.abc import Callable, Hashable, Iterable
from functools import cached_property
from itertools import combinations
from typing import TypeVar

import numpy as np

from emir_analysis.diagnosis.balances import FORCE
from emir_analysis.diagnosis.candidate import (
    AT_TIP,
    SMALL,
    Candidate,
    Left,
    Screened,
    best_change,
    load_fields,
    starting_fields,
)
from emir_analysis.diagnosis.evidence import Evidence
from emir_analysis.diagnosis.fit import DIFFERENCE_STEP
from emir_analysis.diagnosis.fitting import FREE_RUN_STEP
from emir_analysis.diagnosis.loads import FOR_EVER, LOAD, Load, constant, likely, of_force, of_steps
from emir_analysis.diagnosis.missing import in_balances, in_free_run
from emir_analysis.diagnosis.side_by_side import side_by_side
from emir_analysis.diagnosis.trial import Trial, trial
from emir_analysis.signals import Array
from emir_plant.effects import REGISTRY
from emir_plant.sheet import Sheet

MOST_FITTED = 8  # effects, or pairs of them, whose own fields are fitted
MOST_AGAIN = 4  # of these, from other shares as well: as many as are then fitted to the balances
NEAR_BEST = 2.0  # times the least cost: what leaves more does not come to it by other shares
SILENT = 0.5  # cost of a residual, of which noise makes 0.35: nothing is left to be explained
Found = TypeVar("Found")
BEFORE = -1.0  # s: begin of a load that acts all the time, at rest too
LOAD_STEP = 0.25  # s: between begins of a load; well below half a swing of the slow mode


class OnBalances:
    """A known trial with each further effect of the registry, begun on the balances.

    floor: (5,), what the sensors leave in each balance.
    """

    def __init__(self, known: Trial, sheet: Sheet, evidence: Evidence, floor: Array) -> None:
        self._known, self._sheet = known, sheet
        self._left = Left(known, in_balances(evidence, floor), DIFFERENCE_STEP)
        self._begun = _begun(known, sheet, _by_balance(known, evidence), self._left)

    @cached_property
    def singles(self) -> list[Screened]:
        """The known trial with one further effect, the best first.

        An effect that does not stay on is not in the list.
        """
        begun = sorted(self._begun, key=lambda c: c.expected)
        promising = _in_one_form(begun, lambda c: c.effect)[:MOST_FITTED]
        fits = zip(side_by_side(Candidate.fitted, promising), promising, strict=True)
        found = sorted(fits, key=lambda pair: pair[0].cost)
        least, silent = found[0][0].cost, SILENT * self._left.nothing.size
        for k, (screened, candidate) in enumerate(found[:MOST_AGAIN]):
            if silent < screened.cost <= NEAR_BEST * least:
                found[k] = candidate.fitted_again(screened), candidate
        return sorted((screened for screened, _ in found), key=lambda s: s.cost)

    @cached_property
    def pairs(self) -> list[Screened]:
        """The known trial with two further effects, the best first.

        For two that help only together. Which pairs are fitted is decided to first order; to try
        other shares of them takes long, and fits to the free run do it.
        """
        known, left = self._known, self._left
        pairs = [(a, b) for a, b in combinations(self._begun, 2) if a.effect != b.effect]
        pairs.sort(key=lambda pair: _expected(pair[0], pair[1], left.nothing))
        pairs = _in_one_form(pairs, lambda pair: (pair[0].effect, pair[1].effect))
        together = []
        for one, other in pairs[:MOST_FITTED]:
            start = trial(self._sheet, (*known.effects, one.effect, other.effect), known)
            start = start.formed(one.form | other.form)
            together.append(Candidate(start, known.x.size, [np.append(one.x, other.x)], left))
        return sorted(side_by_side(Candidate.fitted, together), key=lambda s: s.cost)


def screen_free_run(known: Trial, sheet: Sheet, evidence: Evidence) -> list[Screened]:
    """Return the known trial with each further effect of the registry, the best first.

    By the free run, for a known trial whose balances are quiet: the step that is best to first
    order promises too much far from there, so it is simulated, and shorter ones too.
    """
    left = Left(known, in_free_run(known, evidence), FREE_RUN_STEP)
    loads = _by_balance(known, evidence)
    if not evidence.told[FORCE]:
        loads += _by_free_run(known, sheet, evidence, left)
    begun = _begun(known, sheet, loads, left, SMALL)
    stepped = sorted(side_by_side(Candidate.stepped, begun), key=lambda s: s.cost)
    return _in_one_form(stepped, lambda s: s.trial.effects)


def screen_faint_load(known: Trial, sheet: Sheet, evidence: Evidence) -> Screened:
    """Return the known trial with a load from outside that the free run tells.

    As `screen_free_run`, for one that may be less than the noise of the balance of forces; that
    takes as long as all other effects together.
    """
    left = Left(known, in_free_run(known, evidence), FREE_RUN_STEP)
    loads = _by_free_run(known, sheet, evidence, left)
    (begun,) = _begun(known, sheet, loads, left, SMALL, (LOAD,))
    return begun.stepped()


def _by_balance(known: Trial, evidence: Evidence) -> list[Load]:
    """Return loads at the TCP by the force missing in the first recording, none if not told."""
    if not evidence.told[FORCE]:
        return []
    force = evidence.residuals([known.machine])[0][: evidence.windows_of_first, FORCE]
    geometry = evidence.stated.geometry
    at_tip = geometry.triangle_b / geometry.boom_length  # order of magnitude of the lever ratio
    force = at_tip * np.nan_to_num(force)
    mean = float(np.mean(force))
    found = likely(of_force(evidence.time[: force.size], force))
    # by the force a constant is not told from parameters: a swing may have it for its mean
    about_mean = [load._replace(mean=load.mean + mean) for load in found if load.frequency > 0.0]
    return [constant(mean, BEFORE, FOR_EVER), *found, *about_mean]


def _by_free_run(known: Trial, sheet: Sheet, evidence: Evidence, left: Left) -> list[Load]:
    """Return loads at the TCP by what they would change in the free run."""
    loaded = trial(sheet, (*known.effects, LOAD), known)
    members = loaded.unknowns.members[known.x.size :]
    size = SMALL * members[0].value(members[0].start)  # of the force
    begin = np.arange(0.0, float(evidence.experiments[0].time[-1]), LOAD_STEP)
    steps = [load_fields(members, constant(size, float(t), FOR_EVER), AT_TIP) for t in begin]
    nothing = left([known])[0]
    changed = left([loaded.at(np.append(known.x, own)) for own in steps]) - nothing
    return likely(of_steps(begin, np.nan_to_num(changed / size), -np.nan_to_num(nothing)))


def _begun(  # noqa: PLR0913, PLR0917 (what one effect is begun by)
    known: Trial,
    sheet: Sheet,
    loads: list[Load],
    left: Left,
    size: float = 1.0,
    names: Iterable[str] = REGISTRY,
) -> list[Candidate]:
    """Begin each further effect of some in each form.

    size: of its starts, in those on the balances.
    """

    def begin(start: Trial) -> Candidate:
        members = start.unknowns.members[known.x.size :]
        starts = starting_fields(start.effects[-1], members, loads, size)
        return Candidate(start, known.x.size, starts, left)

    new = [trial(sheet, (*known.effects, n), known) for n in names if n not in known.effects]
    return side_by_side(begin, [form for one in new for form in one.forms(one.effects[-1])])


def _in_one_form(found: Iterable[Found], effects: Callable[[Found], Hashable]) -> list[Found]:
    """Return what was found, the best first, but the same effects in other forms."""
    best: dict[Hashable, Found] = {}
    for one in found:
        best.setdefault(effects(one), one)
    return list(best.values())


def _expected(one: Candidate, other: Candidate, nothing: Array) -> float:
    """Return what two effects leave when both do their best, to first order.

    nothing: (n,) what is left without them.
    """
    low, high = (np.append(a, b) for a, b in zip(one.bounds, other.bounds, strict=True))
    x, slopes = np.append(one.x, other.x), np.vstack([one.slopes, other.slopes])
    return best_change(one.at_best + other.at_best - nothing, slopes, low - x, high - x)[1]
