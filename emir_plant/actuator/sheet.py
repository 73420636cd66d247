"""An actuator's data sheet in YAML.

    machine: actuator
    time_unit: sample                # or s: what the recording's stamps count
    valve:
      gain: {value: 2.0, range: [0.2, 20.0]}
    effects: {}                      # those that are known to be there, with their parameters

An entry with a range is fitted inside it; one without is exact.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from emir_common.parameter_tree import declared, with_values
from emir_common.quantity import ParameterError
from emir_common.yaml_file import read_map
from emir_plant.actuator.effects import KNOWN
from emir_plant.actuator.parameters import Actuator, Load, Valve

MACHINE = "actuator"
SAMPLE = "sample"
TIME_UNITS = (SAMPLE, "s")
GROUPS = ("valve", "load", "sensor")
HEADINGS = ("machine", "time_unit", "effects")
_BLANK = Actuator(Valve(gain=1.0, time_constant=1.0), Load(frequency=1.0))
_NEEDED = ("valve.gain", "valve.time_constant", "load.frequency")


@dataclass(frozen=True)
class ActuatorSheet:
    """An actuator as stated; ranges: lowest and highest value of what is fitted, by path."""

    machine: Actuator
    ranges: dict[str, tuple[float, float]]
    time_unit: str


def is_actuator(path: Path) -> bool:
    """Return whether a data sheet describes an actuator.

    Raises ParameterError as `read_map`, and for one that does but is not called so.
    """
    content = read_map(path, what="parameters")
    called, valve = content.get("machine"), content.get("valve")
    if called != MACHINE and isinstance(valve, dict) and "gain" in valve:
        raise ParameterError(
            f"{path}: machine = {called!r}: valve.gain is an actuator's: {MACHINE!r} is meant?"
        )
    return bool(called == MACHINE)


def load_actuator(path: Path) -> ActuatorSheet:
    """Read a data sheet.

    Raises ParameterError, naming file and entry, for what is missing, unknown, no number or
    outside its range.
    """
    content = read_map(path, what="parameters")
    try:
        return _sheet(content)
    except ParameterError as error:
        raise ParameterError(f"{path}: {error}{_unit_hint(content, str(error))}") from None


def write_actuator(path: Path, sheet: ActuatorSheet) -> None:
    """Write a data sheet that `load_actuator` reads, effects that are off left out.

    Raises ParameterError when the file cannot be written.
    """
    content: dict[str, Any] = {"machine": MACHINE, "time_unit": sheet.time_unit}
    for dotted, (_, value) in declared(sheet.machine).items():
        *groups, name = dotted.split(".")
        if groups[0] == "effects" and not getattr(sheet.machine.effects, groups[1]).is_on:
            continue
        place = content
        for group in groups:
            place = place.setdefault(group, {})
        entry = {"value": list(value) if isinstance(value, tuple) else value}
        if dotted in sheet.ranges:
            entry["range"] = list(sheet.ranges[dotted])
        place[name] = entry
    try:
        path.write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
    except OSError as error:
        raise ParameterError(f"{path}: {error.strerror}") from None


def _unit_hint(content: dict[Any, Any], error: str) -> str:
    """Return what to do about a value in seconds that is out of range: ranges suit samples."""
    by_itself = "outside" in error and "outside its range" not in error
    if not by_itself or content.get("time_unit", "s") != "s":
        return ""
    return "; the time of a fast machine is stated in samples (time_unit: sample)"


def _sheet(content: dict[Any, Any]) -> ActuatorSheet:
    time_unit = content.get("time_unit", "s")
    if time_unit not in TIME_UNITS:
        raise ParameterError(f"time_unit = {time_unit!r}: {' or '.join(TIME_UNITS)}")
    entries = _entries(content)
    known = declared(_BLANK)
    for path in entries:
        if path not in known:
            raise ParameterError(f"{path}: there is no such parameter")
    for path in _NEEDED:
        if path not in entries:
            raise ParameterError(f"{path}: missing")
    values = {path: _value(entry["value"], path) for path, entry in entries.items()}
    ranges = {p: _range(e["range"], p, values[p]) for p, e in entries.items() if "range" in e}
    for path, ends in ranges.items():
        for end in ends:
            known[path][0].check(f"{path}, its range", end)
    return ActuatorSheet(with_values(_BLANK, values), ranges, time_unit)


def _entries(content: dict[Any, Any]) -> dict[str, dict[str, Any]]:
    """Return the sheet's entries by dotted path, each with its value."""
    for name in content:
        if name not in (*GROUPS, *HEADINGS):
            there = ", ".join((*HEADINGS, *GROUPS))
            raise ParameterError(f"{name}: there is no such entry; there are {there}")
    groups = {name: content[name] for name in GROUPS if name in content}
    effects = content.get("effects") or {}
    if not isinstance(effects, dict):
        raise ParameterError(f"effects = {effects!r}: not a map of effects by name")
    for name, members in effects.items():
        if name not in KNOWN:
            raise ParameterError(f"effects.{name}: there is no such effect of an actuator")
        groups[f"effects.{name}"] = members
    found = {}
    for group, members in groups.items():
        if not isinstance(members, dict):
            raise ParameterError(f"{group} = {members!r}: not a map of its parameters")
        for name, entry in members.items():
            whole = entry if isinstance(entry, dict) else {"value": entry}
            if "value" not in whole:
                raise ParameterError(f"{group}.{name}: no value")
            found[f"{group}.{name}"] = whole
    return found


def _range(limits: Any, path: str, value: Any) -> tuple[float, float]:
    if isinstance(value, list):
        raise ParameterError(f"{path}: a list has no range")
    if not isinstance(limits, list) or len(limits) != 2:  # noqa: PLR2004 - low and high
        raise ParameterError(f"{path}: range = {limits!r}: not a list of lowest and highest value")
    low, high = (_number(limit, path) for limit in limits)
    if low >= high:
        raise ParameterError(f"{path}: range = [{low:g}, {high:g}]: the lowest value comes first")
    if not low <= value <= high:
        raise ParameterError(f"{path} = {value:g}: outside its range {low:g} ... {high:g}")
    return low, high


def _value(value: Any, path: str) -> Any:
    return [_number(v, path) for v in value] if isinstance(value, list) else _number(value, path)


def _number(value: Any, path: str) -> float:
    try:
        return float(value)
    except (TypeError, ValueError):
        raise ParameterError(f"{path} = {value!r}: not a number") from None
