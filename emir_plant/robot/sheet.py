"""Reading the robot from YAML: nested groups, each entry `name: {value, unit, source}`.

Effects of a joint are switched on by name: `joint3: {effects: {viscous_friction: {...}}, ...}`;
those of joint 1 stand in its own file.
"""

import dataclasses
from dataclasses import MISSING
from pathlib import Path
from typing import Any, get_type_hints

from emir_common.quantity import ParameterError, quantities
from emir_common.yaml_file import read_map
from emir_plant.parameters import Machine
from emir_plant.robot.parameters import Robot
from emir_plant.sheet import EFFECTS, data, joint1, load_sheet


def robot(file: Path | None = None, main: Path | None = None) -> Robot:
    """Return the robot of two files, its own and its main joint's.

    Without them it is EMIR as the project states it (data/robot.yaml and data/joint1.yaml).
    Raises ParameterError as `load_robot` and `load_sheet`.
    """
    return load_robot(file or data("robot.yaml"), load_sheet(main).machine if main else joint1())


def load_robot(path: Path, main: Machine) -> Robot:
    """Read a robot from YAML; `main` is its main joint.

    Raises ParameterError, naming file and key, for a file that cannot be read, a missing or
    unknown key, another unit, a value outside its range.
    """
    content = read_map(path, what="parameters")
    try:
        return _group(Robot, content, "", {"main": main})
    except ParameterError as error:
        raise ParameterError(f"{path}: {error}") from None


def _group(kind: Any, content: Any, prefix: str, given: dict[str, Any] | None = None) -> Any:
    """Return a parameter dataclass from a map; `given` fields do not stand in the file."""
    values = dict(given or {})
    if not isinstance(content, dict):
        raise ParameterError(f"{prefix.rstrip('.') or 'file'}: no parameters in it")
    hints, declared = get_type_hints(kind), quantities(kind)
    fields = [field for field in dataclasses.fields(kind) if field.name not in values]
    wanted = {field.name for field in fields}
    stated = wanted & content.keys()
    for name in content.keys() - wanted:
        there = ", ".join(sorted(wanted))
        raise ParameterError(f"{prefix}{name}: there is no such parameter; there are {there}")
    for name in sorted({field.name for field in fields if _needed(field)} - stated):
        allowed = f"; allowed is {declared[name].allowed}" if name in declared else ""
        raise ParameterError(f"{prefix}{name}: missing{allowed}")
    for name in stated:
        path = prefix + name
        if name not in declared:
            values[name] = _group(hints[name], content[name], path + ".")
            continue
        value = _entry(content[name], path, declared[name].unit)
        declared[name].check(path, value)
        values[name] = value
    return kind(**values)


def _needed(field: dataclasses.Field[Any]) -> bool:
    """Tell whether a file has to state a field; effects, for one, are off where it does not."""
    return field.default is MISSING and field.default_factory is MISSING


def _entry(entry: Any, path: str, unit: str) -> Any:
    if EFFECTS in path and isinstance(entry, int | float):
        return entry
    if not isinstance(entry, dict) or "value" not in entry:
        raise ParameterError(f"{path}: no value")
    if entry.get("unit", "1") != unit:
        raise ParameterError(f"{path}: in {entry.get('unit', '1')}, expected {unit}")
    return entry["value"]
