"""The numbers of a machine: as its maker states them, and as one machine was built."""

from dataclasses import dataclass, replace
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Self

import numpy as np
import yaml

from emir_common.quantity import ParameterError
from emir_common.yaml_file import read_map

DATA_SHEET = Path(str(files("emir_analysis.blind") / "data" / "datasheet.yaml"))
SIGNAL_MAP = Path(str(files("emir_analysis.blind") / "data" / "signals.yaml"))


@dataclass(frozen=True)
class Numbers:
    """A machine's numbers by the names and in the units of the data sheet (SI)."""

    boom_length: float
    boom_mass: float
    arms: int
    sections_per_arm: int
    section_spring: float
    modes_kept: int
    modal_damping: float
    modal_frequency: float
    triangle_a: float
    triangle_b: float
    triangle_gamma0: float
    area_lifting: float
    area_lowering: float
    volume_lifting_0: float
    volume_lowering_0: float
    beta: float
    p0: float
    pT: float  # noqa: N815 (the data sheet's name)
    flow_nominal: float
    flow_ratio_lowering: float
    dead_zone: float
    natural_frequency: float
    damping: float
    balance_pressure: float
    k_pump_line: float
    k_block_in: float
    k_return_line: float
    k_block_out: float
    k_meter_out_lifting: float
    k_meter_out_lowering: float
    threshold: float
    time_constant_opening: float
    time_constant_closing: float
    resolver_bits: int
    resolver_span: float
    pressure_noise: float
    deflection_noise: float
    payload: float = 0.0
    carried: float = 0.0  # kg, besides, ...
    carried_at: float = 1.0  # ... along the boom, 1: at its tip
    rate: float = 100.0  # 1/s, of the sensors
    command_period: float = 0.032  # s

    def with_factors(self, factors: dict[str, float]) -> Self:
        """Return the numbers with some of them multiplied."""
        return replace(self, **{name: getattr(self, name) * f for name, f in factors.items()})


@dataclass(frozen=True)
class Stated:
    """What the maker says.

    tolerances: relative, by name, of those that have one. missing: signals of the signal map for
    which the machine has no sensor.
    """

    numbers: Numbers
    tolerances: dict[str, float]
    missing: tuple[str, ...] = ()

    @property
    def toleranced(self) -> dict[str, str]:
        """Return the names that have a tolerance by dotted path of the data sheet."""
        groups = read_map(DATA_SHEET, what="parameters")
        return {
            f"{group}.{name}": name
            for group, members in groups.items()
            for name in members
            if name in self.tolerances
        }

    def built(self, random: np.random.Generator) -> Numbers:
        """Return a machine somewhere within the tolerances."""
        factors = {n: 1.0 + tol * random.uniform(-1.0, 1.0) for n, tol in self.tolerances.items()}
        return self.numbers.with_factors(factors)


def data_sheet(stated: Stated) -> str:
    """Return a data sheet as the maker writes it, YAML in the form of DATA_SHEET."""
    groups = read_map(DATA_SHEET, what="parameters")
    for group in groups.values():
        for name, entry in group.items():
            entry["value"] = getattr(stated.numbers, name)
            if name in stated.tolerances:
                entry["tol"] = stated.tolerances[name]
    return str(yaml.safe_dump(groups, sort_keys=False))


def signal_map(missing: tuple[str, ...]) -> str:
    """Return the signal map, YAML, without the sensors that are missing."""
    signals = read_map(SIGNAL_MAP, what="signals")
    return str(yaml.safe_dump({n: s for n, s in signals.items() if n not in missing}))


@cache
def main_joint() -> Numbers:
    """Return the numbers of EMIR's main joint, which `DATA_SHEET` states."""
    return read_numbers(DATA_SHEET).numbers


def read_numbers(file: Path) -> Stated:
    """Read a data sheet. Raises ParameterError for a number that is missing or unknown."""
    groups = read_map(file, what="parameters")
    entries = {name: entry for group in groups.values() for name, entry in group.items()}
    tolerances = {name: float(entry["tol"]) for name, entry in entries.items() if "tol" in entry}
    try:
        numbers = Numbers(**{name: entry["value"] for name, entry in entries.items()})
    except (TypeError, KeyError) as error:
        raise ParameterError(f"{file}: {error}") from None
    return Stated(numbers, tolerances)
