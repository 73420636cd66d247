"""What is put into machine number k of a seed: one effect, two, none or a foreign one."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from emir_analysis.blind.catalogue import CATALOGUE
from emir_analysis.blind.hidden import Hidden, Random
from emir_analysis.blind.machine import Array, Machine, NotSolvedError, Sizes
from emir_analysis.blind.numbers import Numbers, Stated
from emir_analysis.blind.operator import Operator
from emir_analysis.blind.recording import SEEN_IN, Run, Start, operated, repeated, spread_of_strokes
from emir_analysis.blind.turns import hidden_in, kind_of

Effects = tuple[type[Hidden], ...]

MATTERS = 0.05  # of a signal's standard deviation: the least RMS that effects have to make
STRONGER = 1.6  # times, where they make less
ATTEMPTS = 4  # to make them matter, before others are drawn
DRAWS = 30  # of effects, where those before do not matter
PROBE = 25.0  # s of a run, over which it is found out whether they do


@dataclass(frozen=True)
class Puzzle:
    """A machine with what is hidden in it, and its two recordings.

    hidden: names. kind: of KINDS. size: RMS that the hidden makes in the signal that it changes
    most, as a share of that signal's standard deviation. learn, judge: the runs.
    """

    machine: Machine
    kind: str
    hidden: tuple[str, ...]
    size: float
    learn: Run
    judge: Run


def puzzle(  # noqa: PLR0913, PLR0917 (what a machine is made of, one by one)
    stated: Stated,
    seed: int,
    number: int,
    foreign: Effects,
    duration: float,
    only: tuple[str, ...] = (),
) -> Puzzle:
    """Build machine `number` of a seed and let it move for twice `duration`, s.

    foreign: what no catalogue holds; without any, no machine has it. only: effects from which to
    draw, all when empty. Equal arguments give equal machines. Raises NotSolvedError where nothing
    that is drawn makes a difference.
    """
    random = np.random.default_rng((seed, number))
    numbers = stated.built(random)
    start = Start(random.uniform(0.7, 0.87), random.uniform(15e5, 35e5))
    machine, size = None, 0.0
    for tried in range(DRAWS):
        effects = hidden_in(seed, number, CATALOGUE, foreign, only, tried)
        machine, size = _that_matters(effects, numbers, start, stated, random)
        if machine is not None:
            break
    else:
        raise NotSolvedError(f"nothing of {DRAWS} draws makes a difference")
    runs = [
        operated(machine, start, _operator(random, stated, abrupt=abrupt), duration)
        for abrupt in (False, True)
    ]
    names = tuple(effect.name for effect in effects)
    return Puzzle(machine, kind_of(number, foreign), names, size, *runs)


def _operator(random: Random, stated: Stated, *, abrupt: bool) -> Operator:
    strokes = spread_of_strokes(stated.numbers)
    return Operator(random, stated.numbers, strokes, abrupt=abrupt)


def _that_matters(
    effects: Effects,
    numbers: Numbers,
    start: Start,
    stated: Stated,
    random: Random,
) -> tuple[Machine | None, float]:
    """Return a machine whose effects each make a difference, and the least difference."""
    if not effects:
        return Machine(numbers), 0.0
    sizes: Sizes = {}
    least = np.inf
    for effect in effects:
        own, size = _large_enough(effect, numbers, start, stated, random)
        if own is None:
            return None, 0.0
        sizes |= own
        least = min(least, size)
    kind: Any = type("Machine", effects, {}) if len(effects) > 1 else effects[0]
    return kind(numbers, sizes), float(least)


def _large_enough(
    effect: type[Hidden], numbers: Numbers, start: Start, stated: Stated, random: Random
) -> tuple[Sizes | None, float]:
    sizes = effect.drawn(random, stated.numbers)
    seed = int(random.integers(2**31))
    for _ in range(ATTEMPTS):
        operator = _operator(np.random.default_rng(seed), stated, abrupt=True)
        with_it = operated(effect(numbers, sizes), start, operator, PROBE)
        without = repeated(Machine(numbers), start, with_it.commands)
        made = difference(with_it, without, stated.missing)
        if made >= MATTERS:
            return sizes, made
        sizes = {n: v * STRONGER if n in effect.grows else v for n, v in sizes.items()}
    return None, 0.0


def difference(one: Run, other: Run, missing: tuple[str, ...]) -> float:
    """Return the RMS between runs, as a share of the standard deviation, in the worst signal.

    missing: signals of the signal map for which there is no sensor; what shows there alone shows
    nowhere.
    """

    def share(name: str) -> float:
        a: Array = one.shown[name]
        b: Array = other.shown[name]
        return float(np.sqrt(np.mean((a - b) ** 2)) / b.std())

    return max(share(name) for name in one.shown if SEEN_IN[name] - set(missing))
