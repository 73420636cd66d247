"""An actuator's files: data sheet, signal map, and its run as two recordings."""

from pathlib import Path

import numpy as np
import yaml

from emir_analysis.blind.actuator.machine import Numbers
from emir_analysis.blind.actuator.puzzle import Puzzle
from emir_analysis.blind.hidden import Random
from emir_analysis.blind.mcap_file import Sampled, write_signals

NOISE = 0.015  # of the pressure's spread
STATED = 0.7  # of a factor's logarithm: how far a sheet may be off
DIGITS = 4  # on a sheet
FACTORS = {"gain": 2.0, "lag": 2.0, "frequency": 1.5, "friction": 2.0}
OPENING, PRESSURE = "/actuator/valve_opening", "/actuator/oil_pressure"

SIGNAL_MAP = f"""\
valve_opening: {{topic: {OPENING}, field: "position[0]", unit: "1"}}
oil_pressure: {{topic: {PRESSURE}, field: fluid_pressure, unit: "1"}}
"""


def data_sheet(numbers: Numbers, noise: float, random: Random) -> str:
    """Return a data sheet, YAML: values near the machine's, with ranges about them."""

    def entry(name: str) -> dict[str, float | list[float]]:
        value, factor = getattr(numbers, name), FACTORS[name]
        off = STATED * np.log(factor)
        stated = value * float(np.exp(random.uniform(-off, off)))
        ends = sorted(_rounded(end) for end in (stated / factor**2, stated * factor**2))
        return {"value": _rounded(stated), "range": ends}

    sheet = {
        "machine": "actuator",
        "time_unit": "sample",
        "valve": {"gain": entry("gain"), "time_constant": entry("lag")},
        "load": {"frequency": entry("frequency"), "viscous_friction": entry("friction")},
        "sensor": {"pressure_noise": {"value": _rounded(noise)}},
    }
    return str(yaml.safe_dump(sheet, sort_keys=False))


def noise_of(made: Puzzle) -> float:
    """Return the standard deviation of the transducer's noise."""
    return NOISE * float(made.pressure.std())


def write(paths: tuple[Path, Path], made: Puzzle, random: Random) -> None:
    """Write a run with noise as two recordings, the second from where the first ends."""
    shown = made.pressure + noise_of(made) * random.standard_normal(made.pressure.size)
    cut = made.opening.size // 2
    for path, begin, end in zip(paths, (0, cut), (cut, made.opening.size), strict=True):
        signals = {OPENING: made.opening[begin:end], PRESSURE: shown[begin:end]}
        write_signals(
            path, {topic: Sampled(1.0, values, begin) for topic, values in signals.items()}
        )


def _rounded(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")
