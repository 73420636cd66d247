"""A set of effects with fitted parameters, and how it becomes another."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np
from numpy.typing import NDArray

from emir_analysis.diagnosis.fit import Solution
from emir_analysis.diagnosis.unknowns import Unknown, Unknowns, unknowns
from emir_analysis.signals import Array
from emir_common.parameter_tree import declared, with_values
from emir_plant.effects import REGISTRY
from emir_plant.parameters import Machine
from emir_plant.sheet import Sheet


@dataclass(frozen=True, eq=False)  # each is one fit: arrays have no one answer to ==
class Trial:
    """A set of effects with fitted parameters.

    x: (k,). covariance: (k, k) of x, from the curvature of the last fit; NaN before.
    """

    effects: tuple[str, ...]
    unknowns: Unknowns
    x: Array
    covariance: Array

    @property
    def name(self) -> str:
        """The effects' names."""
        return " + ".join(self.effects) or "parameters only"

    @cached_property
    def machine(self) -> Machine:
        """The machine with the fitted parameters."""
        return self.unknowns.at(self.x)

    @property
    def spread(self) -> Array:
        """Standard deviations of x, (k,)."""
        return np.asarray(np.sqrt(np.maximum(np.diag(self.covariance), 0.0)))

    def at(self, x: Array) -> "Trial":
        """Return the trial with other parameters, (k,)."""
        return Trial(self.effects, self.unknowns, x, self.covariance)

    @property
    def numbers(self) -> int:
        """How many numbers say what it is: those fitted, and each form that is not the usual."""
        return self.x.size + self.unusual

    @property
    def unusual(self) -> int:
        """How many of its effects' forms are not the usual ones."""
        usual = {path: at[0] for name in self.effects for path, at in _forms(name).items()}
        return sum(usual[path] != at for path, at in self.form.items())

    @property
    def form(self) -> dict[str, float]:
        """The forms that its effects have, by dotted path."""
        of_each = [path for name in self.effects for path in _forms(name)]
        stated = declared(self.unknowns.machine) if of_each else {}
        return {path: stated[path][1] for path in of_each}

    def forms(self, effect: str) -> "list[Trial]":
        """Return the trial with each form of an effect, the usual one first."""
        of_each = _forms(effect)
        return [
            self.formed(dict(zip(of_each, at, strict=True))) for at in product(*of_each.values())
        ]

    def formed(self, form: dict[str, float]) -> "Trial":
        """Return the trial with effects of some forms, by dotted path."""
        if not form:
            return self
        machine = with_values(self.unknowns.machine, form)
        return replace(self, unknowns=replace(self.unknowns, machine=machine))

    @property
    def has_series(self) -> bool:
        """Tell whether one of its effects is a series, with terms enough to stand for another."""
        return any(REGISTRY[effect].is_series for effect in self.effects)

    def without(self, effect: str) -> "Trial":
        """Return the trial with one effect less."""
        others = tuple(name for name in self.effects if name != effect)
        gone = [u.path for u in self.unknowns.members if u.path.startswith(f"effects.{effect}.")]
        usual = {path: values[0] for path, values in _forms(effect).items()}
        return replace(self._less(gone), effects=others).formed(usual)

    def cost_without(self, effect: str) -> float:
        """Return by how much leaving an effect out adds to the squared errors, to first order.

        In units of the noise, all else doing its best. 0 where that is not told, and where a size
        is fitted by its logarithm, since that is never 0.
        """
        members, own = self.unknowns.members, f"effects.{effect}."
        sizes = [k for k, u in enumerate(members) if u.path.startswith(own) and not u.shapes]
        if any(members[k].logarithmic for k in sizes):
            return 0.0
        spread = self.covariance[np.ix_(sizes, sizes)]
        if not np.all(np.isfinite(spread)):
            return 0.0
        off = self.x[sizes] - [members[k].at(0.0) for k in sizes]
        return float(off @ np.linalg.pinv(spread) @ off)

    def with_sizes(self, effect: str, sizes: Sequence[str]) -> "Trial":
        """Return the trial with the other sizes of an effect at 0, no longer to be fitted."""
        others = [size for size in REGISTRY[effect].sizes if size not in sizes]
        return self._less([f"effects.{effect}.{size}" for size in others])

    def with_one_size(self, effect: str, size: str) -> "Trial":
        """Return the trial with one size of an effect alone."""
        return self.with_sizes(effect, [size])

    def with_each_size(self, effect: str) -> "list[Trial]":
        """Return the trial with each size of an effect alone, if it has several."""
        sizes = self.sizes(effect)
        return [self.with_one_size(effect, s) for s in sizes] if len(sizes) > 1 else []

    def with_a_term_less(self, effect: str) -> "Trial | None":
        """Return the trial without the last size of an effect, if there are others before it.

        What else is fitted is where it is most probable then, to first order.
        """
        sizes = self.sizes(effect)
        if len(sizes) == 1:
            return None
        path = f"effects.{effect}.{sizes[-1]}"
        last = [unknown.path for unknown in self.unknowns.members].index(path)
        along = self.covariance[:, last] / self.covariance[last, last]
        x = self.x - self.x[last] * np.where(np.isfinite(along), along, 0.0)
        return self._less([path]).at(np.delete(np.clip(x, *self.unknowns.bounds), last))

    def sizes(self, effect: str) -> list[str]:
        """Return which sizes of an effect are fitted."""
        paths = [unknown.path for unknown in self.unknowns.members]
        return [s for s in REGISTRY[effect].sizes if f"effects.{effect}.{s}" in paths]

    def fixed(self, path: str, value: float) -> "Trial":
        """Return the trial with a parameter at a value, SI unit, no longer to be fitted."""
        less = self._less([path])
        machine = with_values(less.unknowns.machine, {path: value})
        return replace(less, unknowns=replace(less.unknowns, machine=machine))

    def also(self, unknown: Unknown) -> "Trial":
        """Return the trial with one parameter more to be fitted, begun at its start."""
        members = Unknowns(self.unknowns.machine, (*self.unknowns.members, unknown))
        covariance = np.pad(self.covariance, (0, 1), constant_values=np.nan)
        return Trial(self.effects, members, np.append(self.x, unknown.start), covariance)

    def _less(self, paths: Sequence[str]) -> "Trial":
        kept = np.array([u.path not in paths for u in self.unknowns.members], dtype=bool)
        members = tuple(u for u, stays in zip(self.unknowns.members, kept, strict=True) if stays)
        left = Unknowns(self.unknowns.machine, members)
        return Trial(self.effects, left, self.x[kept], _given(self.covariance, kept))

    def continued(self, solution: Solution) -> "Trial":
        """Return the trial with the parameters of a further fit."""
        k = len(self.unknowns.members)
        return Trial(self.effects, self.unknowns, solution.x[:k], solution.covariance[:k, :k])


def _given(covariance: Array, kept: NDArray[np.bool_]) -> Array:
    """Return the covariance of what is kept, (j, j), the others being known.

    covariance: (k, k); of what the data do not tell it is infinite, before any fit NaN. kept: (k,).
    """
    left = covariance[np.ix_(kept, kept)]
    known = ~kept & np.isfinite(np.diag(covariance))
    shared = covariance[np.ix_(kept, known)]
    return np.asarray(left - shared @ np.linalg.pinv(covariance[np.ix_(known, known)]) @ shared.T)


def trial(sheet: Sheet, effects: tuple[str, ...], known: Trial | None = None) -> Trial:
    """Return a trial at its starting values, or a trial fitted before with the further effects."""
    if known is None:
        members = unknowns(sheet, effects)
        x = members.start
    else:
        new = unknowns(replace(sheet, tolerances={}), effects[len(known.effects) :])
        members = Unknowns(known.unknowns.machine, (*known.unknowns.members, *new.members))
        x = np.append(known.x, new.start)
    return Trial(effects, members, x, np.full((x.size, x.size), np.nan))


def _forms(effect: str) -> dict[str, tuple[float, ...]]:
    """Return the values that give an effect other forms, by dotted path."""
    return {f"effects.{effect}.{name}": at for name, at in REGISTRY[effect].forms.items()}


def moved(x: Array, places: Sequence[int], values: Sequence[float]) -> Array:
    """Return a vector, (k,), with other values at some places."""
    point = x.copy()
    point[list(places)] = values
    return point


def with_all_terms(known: Trial, effect: str, sheet: Sheet) -> Trial:
    """Return a trial with all terms of a series to be fitted, begun at 0 where they were not."""
    paths = [unknown.path for unknown in known.unknowns.members]
    all_of_it = unknowns(replace(sheet, tolerances={}), (effect,)).members
    more = tuple(unknown for unknown in all_of_it if unknown.path not in paths)
    members = Unknowns(known.unknowns.machine, (*known.unknowns.members, *more))
    x = np.append(known.x, np.zeros(len(more)))
    return Trial(known.effects, members, x, np.full((x.size, x.size), np.nan))
