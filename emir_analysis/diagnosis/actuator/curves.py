"""What has no name, measured: the curve over one signal that explains an actuator best."""

from dataclasses import dataclass, replace

import numpy as np

from emir_analysis.diagnosis.actuator.fitting import Begin, Fitted, Fitting
from emir_analysis.diagnosis.actuator.record import ActuatorRecord
from emir_analysis.diagnosis.actuator.search import MUCH, RANDOM_STARTS, Search, unseen_error
from emir_analysis.diagnosis.side_by_side import side_by_side
from emir_analysis.signals import Array
from emir_common.parameter_tree import with_values
from emir_plant.actuator import Actuator, ActuatorSheet
from emir_plant.actuator.model import way
from emir_plant.actuator.unnamed import CURVES


@dataclass(frozen=True)
class CurveResult:
    """A curve: what over which signal, its points (signal, value) in the units of the data sheet.

    left: RMS error of the recording with it, in the pressure's unit.
    """

    name: str
    what: str
    over: str
    balance: str
    points: tuple[tuple[float, float], ...]
    left: float


def measured(fitting: Fitting, found: Search) -> Fitted | None:
    """Return the machine with the most probable curve, if that foretells parts left out.

    It has to leave less than MUCH of what parameters alone do there, and less than the effects
    that come closest.
    """
    visited = _visited(found.plain.machine, fitting.record)
    fittings = {
        name: replace(fitting, sheet=_with_places(fitting.sheet, name, signal))
        for name, signal in visited.items()
    }
    begin = Begin([found.plain.machine], drawn=RANDOM_STARTS)
    fits = side_by_side(lambda name: fittings[name].fit((name,), begin), CURVES)
    best = max(fits, key=lambda fitted: fitted.evidence)
    unseen = unseen_error(fittings[best.effects[0]], best.effects)
    plain, chosen = (found.unseen[f.name] for f in (found.plain, found.chosen))
    return best if unseen < min(MUCH * plain, chosen) else None


def as_result(curve: Fitted) -> CurveResult:
    """Return a fitted curve in words and numbers."""
    (name,) = curve.effects
    found = getattr(curve.machine.effects, name)
    return CurveResult(name, found.what, found.over, found.balance, found.table(), curve.rms)


def _with_places(sheet: ActuatorSheet, name: str, visited: Array) -> ActuatorSheet:
    """Return a sheet with a curve that reaches over what its signal does, (n,)."""
    ends = {"low": float(visited.min()), "high": float(visited.max())}
    machine = with_values(sheet.machine, {f"effects.{name}.{k}": v for k, v in ends.items()})
    return replace(sheet, machine=machine)


def _visited(machine: Actuator, record: ActuatorRecord) -> dict[str, Array]:
    """Return the signal that each curve is over, (n,), by the measured pressure."""
    moved = way(machine, record.opening, record.pressure, record.period)
    signals = {
        "valve opening": record.opening,
        "oil pressure": record.pressure,
        "velocity": np.gradient(moved, record.period),
        "way": moved,
    }
    return {name: signals[kind.over] for name, kind in CURVES.items()}
