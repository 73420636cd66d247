"""What sort of machine a plan builds: EMIR's boom, or an actuator in normalised units."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from emir_analysis.blind.actuator import hidden as actuator_hidden
from emir_analysis.blind.actuator import recording as actuator_recording
from emir_analysis.blind.actuator.puzzle import puzzle as actuator_puzzle
from emir_analysis.blind.catalogue import CATALOGUE
from emir_analysis.blind.hidden import Hidden
from emir_analysis.blind.numbers import DATA_SHEET, data_sheet, read_numbers, signal_map
from emir_analysis.blind.plan import Plan, foreign_effects
from emir_analysis.blind.puzzle import puzzle
from emir_analysis.blind.recording import write
from emir_analysis.blind.varied import varied

SHEET, SIGNALS = "datasheet.yaml", "signals.yaml"  # beside a machine's recordings
LEARN, JUDGE = "a.mcap", "b.mcap"


class Secret(NamedTuple):
    """What is hidden in a machine: kind, names, sizes, and what it makes of a signal's spread.

    built: the numbers inside their tolerances, by dotted path of the data sheet; an actuator has
    none.
    """

    kind: str
    hidden: tuple[str, ...]
    sizes: dict[str, float]
    size: float
    built: dict[str, float]


class Family(NamedTuple):
    """A sort of machines.

    base: of their effects. catalogue: the effects that a diagnosis knows. usual, shortest: of a
    recording, in `unit`. made: builds machine `number` of a plan and leaves sheet, signal map
    and recordings in a folder; raises NotSolvedError where that cannot be.
    """

    base: type[Any]
    catalogue: tuple[type[Any], ...]
    usual: float
    shortest: float
    unit: str
    made: Callable[[Plan, int, Path], Secret]


def family(*, actuator: bool) -> Family:
    """Return a plan's."""
    return ACTUATOR if actuator else BOOM


def _boom(plan: Plan, number: int, folder: Path) -> Secret:
    stated = read_numbers(DATA_SHEET)
    if plan.varied:
        stated = varied(stated, np.random.default_rng((plan.seed, number, 2)))
    (folder / SHEET).write_text(data_sheet(stated), encoding="utf-8")
    (folder / SIGNALS).write_text(signal_map(stated.missing), encoding="utf-8")
    foreign = foreign_effects(plan.foreign, Hidden)
    made = puzzle(stated, plan.seed, number, foreign, plan.duration, plan.only)
    noise = np.random.default_rng((plan.seed, number, 1))
    for name, run in ((LEARN, made.learn), (JUDGE, made.judge)):
        write(folder / name, run, made.machine, noise)
    built = {path: getattr(made.machine.built, name) for path, name in stated.toleranced.items()}
    return Secret(made.kind, made.hidden, made.machine.sizes, made.size, built)


def _actuator(plan: Plan, number: int, folder: Path) -> Secret:
    foreign = foreign_effects(plan.foreign, actuator_hidden.Hidden)
    made = actuator_puzzle(plan.seed, number, foreign, 2 * round(plan.duration), plan.only)
    random = np.random.default_rng((plan.seed, number, 1))
    noise = actuator_recording.noise_of(made)
    sheet = actuator_recording.data_sheet(made.machine.n, noise, random)
    (folder / SHEET).write_text(sheet, encoding="utf-8")
    (folder / SIGNALS).write_text(actuator_recording.SIGNAL_MAP, encoding="utf-8")
    actuator_recording.write((folder / LEARN, folder / JUDGE), made, random)
    return Secret(made.kind, made.hidden, made.machine.sizes, made.size, {})


BOOM = Family(Hidden, CATALOGUE, 60.0, 20.0, "s", _boom)
ACTUATOR = Family(
    actuator_hidden.Hidden, actuator_hidden.CATALOGUE, 512.0, 200.0, "samples", _actuator
)
