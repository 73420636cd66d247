"""What is put into actuator number k of a seed, and how it is moved."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from emir_analysis.blind.actuator.hidden import CATALOGUE, Hidden
from emir_analysis.blind.actuator.machine import Actuator, Numbers
from emir_analysis.blind.hidden import Random, between, either_sign
from emir_analysis.blind.machine import Array, NotSolvedError, Sizes
from emir_analysis.blind.turns import hidden_in, kind_of

Effects = tuple[type[Hidden], ...]

MATTERS = 0.05  # of the pressure's standard deviation: the least RMS that an effect has to make
ATTEMPTS = 30  # to draw effects and sizes that matter
HIGHEST = 50.0  # pressure; signals are of order one
REST = 20.0  # samples, before the first move


@dataclass(frozen=True)
class Puzzle:
    """An actuator with what is hidden in it, and its run.

    hidden: names. kind: of KINDS. size: the least RMS that one of the hidden makes alone, as a
    share of the pressure's standard deviation. opening, pressure: (n,), without noise.
    """

    machine: Actuator
    kind: str
    hidden: tuple[str, ...]
    size: float
    opening: Array
    pressure: Array


def puzzle(
    seed: int, number: int, foreign: Effects, samples: int, only: tuple[str, ...] = ()
) -> Puzzle:
    """Build actuator `number` of a seed and let it move for so many samples.

    foreign: what no catalogue holds; without any, no machine has it. only: effects from which to
    draw, all when empty. Equal arguments give equal machines. Raises NotSolvedError where none
    is found in which what is hidden matters.
    """
    random = np.random.default_rng((seed, number))
    numbers = drawn(random)
    for tried in range(ATTEMPTS):
        opening = moves(samples, random)
        effects = hidden_in(seed, number, CATALOGUE, foreign, only, tried)
        sizes, least = _drawn_sizes(effects, numbers, opening, random)
        machine = _with_all(effects)(numbers, sizes)
        pressure = machine.run(opening)
        if least >= MATTERS and np.abs(pressure).max() <= HIGHEST:
            names = tuple(effect.name for effect in effects)
            size = least if effects else 0.0
            return Puzzle(machine, kind_of(number, foreign), names, size, opening, pressure)
    raise NotSolvedError(f"nothing that matters in {ATTEMPTS} draws")


def drawn(random: Random) -> Numbers:
    """Return an actuator's numbers."""
    return Numbers(
        gain=either_sign(random, 0.7, 2.0),
        lag=between(random, 0.8, 4.0),
        frequency=between(random, 0.15, 0.5),
        friction=between(random, 0.3, 1.2),
    )


def moves(samples: int, random: Random) -> Array:
    """Return openings (samples,): ramps and holds, both ways, small and large, some shut."""
    times, levels = [0.0, REST], [0.0, 0.0]
    while times[-1] < samples:
        ramp, hold = random.uniform(3.0, 15.0), random.uniform(2.0, 25.0)
        wide, small = random.uniform(-1.0, 1.0, 2), random.uniform(-0.4, 0.4)
        level = float(random.choice([0.0, *wide, small]))
        times += [times[-1] + ramp, times[-1] + ramp + hold]
        levels += [level, level]
    return np.interp(np.arange(samples), times, levels)


def _drawn_sizes(
    effects: Effects, numbers: Numbers, opening: Array, random: Random
) -> tuple[Sizes, float]:
    """Return sizes of all effects, and the least difference that one of them makes alone."""
    plain = Actuator(numbers).run(opening)
    sizes: Sizes = {}
    least = np.inf
    for effect in effects:
        own = effect.draw(random)
        apart = effect(numbers, own).run(opening) - plain
        least = min(least, float(np.sqrt(np.mean(apart**2)) / plain.std()))
        sizes |= own
    return sizes, least


def _with_all(effects: Effects) -> Any:
    if len(effects) > 1:
        return type("Actuator", effects, {})
    return effects[0] if effects else Actuator
