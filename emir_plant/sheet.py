"""Reading a machine from YAML: its own file or a maker's data sheet, value by value.

An entry is `name: {value, unit, source, tol}`. `tol` is the maker's relative tolerance; an
entry with a tolerance and no value stands for a factor of 1. Entries may be grouped as a map
of plain numbers (`resolver: {bits: 12, span: 1.57}` means resolver_bits, resolver_span).
Effects are switched on by name: `effects: {coulomb_friction: {force: 3.0e+3}}`. A file may state
only what differs from another one beside it: `based_on: joint1.yaml`.
"""

import dataclasses
from collections.abc import Collection, Iterable
from dataclasses import dataclass
from difflib import get_close_matches
from importlib.resources import files
from pathlib import Path
from typing import Any, get_type_hints

from emir_common.quantity import ParameterError, Quantity, quantities
from emir_common.yaml_file import read_map
from emir_plant.effects import REGISTRY, Effects
from emir_plant.parameters import Machine

BASED_ON = "based_on"
MORE_TOLD = "sensors."  # where a data sheet may tell more, such as the recording's rate
ENTRY = ("value", "unit", "tol", "source")  # what an entry says
ALIKE, SAME = 0.7, 0.9  # of two names, in which they are probably the same (difflib)
EFFECTS = "effects."  # in front of an effect's name in a dotted path


@dataclass(frozen=True)
class Sheet:
    """A machine as stated: parameters, relative tolerances and sources by dotted path.

    ignored: entries that are no parameter of the machine, such as the recording's rate, and what
    else entries say.
    """

    machine: Machine
    tolerances: dict[str, float]
    sources: dict[str, str]
    ignored: tuple[str, ...]


def joint1() -> Machine:
    """Return EMIR's main joint as the project states it (data/joint1.yaml)."""
    return load_sheet(data("joint1.yaml"), strict=True).machine


def even_edges() -> Machine:
    """Return it with the valve that steps as paper Fig. 7 says (data/joint1_even_edges.yaml)."""
    return load_sheet(data("joint1_even_edges.yaml"), strict=True).machine


def data(name: str) -> Path:
    """Return a file that comes with the project."""
    return Path(str(files("emir_plant") / "data" / name))


def load_sheet(path: Path, *, strict: bool = False) -> Sheet:
    """Read a machine from YAML.

    strict: every key has to be known; else a data sheet may tell more about its sensors and have
    headings. Raises ParameterError, naming file and key and what is allowed, for a file that
    cannot be read, a missing or unknown key, another unit, a value outside its range.
    """
    content = _nested(_of_plant_node(read_map(path, what="parameters")))
    base = content.pop(BASED_ON, None)
    if base is not None:
        content = _over(_base(path, base), content)
    try:
        return _sheet(content, strict=strict)
    except ParameterError as error:
        raise ParameterError(f"{path}: {error}") from None


def _base(path: Path, name: Any) -> dict[str, Any]:
    file = path.parent / str(name)
    content = _nested(read_map(file, what="parameters"))
    if BASED_ON in content:
        raise ParameterError(f"{path}: {BASED_ON}: {file} is itself based on another")
    return content


def _over(base: dict[str, Any], own: dict[str, Any]) -> dict[str, Any]:
    """Return the entries of both, a map's own entries prevailing over the base's."""
    merged = dict(base)
    for name, entry in own.items():
        below = base.get(name)
        if isinstance(below, dict) and isinstance(entry, dict) and "value" not in entry:
            merged[name] = _over(below, entry)
        else:
            merged[name] = entry
    return merged


def _nested(content: dict[str, Any]) -> dict[str, Any]:
    """Return a map with `group.name: entry` written out as `group: {name: entry}`."""
    found: dict[str, Any] = {}
    for path, entry in content.items():
        group, _, name = str(path).partition(".")
        found = _over(found, {group: _nested({name: entry}) if name else entry})
    return found


def _sheet(content: dict[str, Any], *, strict: bool) -> Sheet:
    entries = {
        f"{group}.{name}": entry
        for group, members in _groups(content).items()
        for name, entry in _entries(members).items()
    }
    kinds = {name: kind for name, kind in get_type_hints(Machine).items() if kind is not Effects}
    kinds |= {EFFECTS + name: kind for name, kind in REGISTRY.items()}
    known = {
        f"{g}.{name}": about
        for g, kind in kinds.items()
        for name, about in quantities(kind).items()
    }
    unknown = [path for path in entries if path not in known]
    headings = {name: entry for name, entry in content.items() if not isinstance(entry, dict)}
    numbers = [name for name, entry in headings.items() if isinstance(entry, int | float)]
    _check_names(entries, known, headings if strict else numbers, strict=strict)
    stated = {path: entries[path] for path in known if path in entries}
    values = {path: _stated(path, entry, known[path]) for path, entry in stated.items()}
    groups = {name: _group(kind, name, values) for name, kind in kinds.items()}
    effects = Effects(**{name: groups.pop(EFFECTS + name) for name in REGISTRY})
    unread = [
        f"{path}.{key}" for path in entries if path in known for key in entries[path]
        if key not in ENTRY
    ]  # fmt: skip
    return Sheet(
        machine=Machine(**groups, effects=effects),
        tolerances={path: _tolerance(e, path) for path, e in stated.items() if "tol" in e},
        sources={path: str(e["source"]) for path, e in stated.items() if "source" in e},
        ignored=(*unknown, *unread, *numbers),
    )


def _check_names(
    entries: Collection[str], known: Collection[str], headings: Collection[str], *, strict: bool
) -> None:
    """Raise ParameterError for an entry, by dotted path, that is no parameter and may not stand.

    headings: what stands in the file beside groups of entries, numbers where headings may stand.
    strict: as for `load_sheet`.
    """
    unknown = [path for path in entries if path not in known]
    for path in unknown:
        near = get_close_matches(path, known, n=1, cutoff=SAME)
        if path.startswith(MORE_TOLD) and near and near[0] not in entries:
            raise ParameterError(f"{path}: there is no such parameter; is {near[0]} meant?")
    for heading in headings:
        meant = [path for path in known if path.rpartition(".")[2] == heading]
        if meant:
            raise ParameterError(f"{heading}: is {meant[0]} meant?")
    wrong = [path for path in unknown if strict or not path.startswith(MORE_TOLD)]
    for path in [*wrong, *(headings if strict else [])]:
        raise ParameterError(f"{path}: there is no such parameter; {_there_are(path, known)}")


def _stated(path: str, entry: dict[str, Any], about: Quantity) -> Any:
    """Return the value of an entry, 1 where it has none. Raises ParameterError for another unit."""
    if entry.get("unit", about.unit) != about.unit:
        raise ParameterError(f"{path}: in {entry['unit']}, expected {about.unit}")
    _check_entry(path, entry)
    return _value(entry.get("value", 1.0), path, about)


def _check_entry(path: str, entry: Iterable[Any]) -> None:
    """Raise ParameterError for a key of an entry that is nearly one which is read."""
    for key in map(str, entry):
        near = get_close_matches(key.lower(), ENTRY, n=1, cutoff=ALIKE)
        meant = ["tol"] if key.lower().startswith("tol") else near
        if key not in ENTRY and meant:
            raise ParameterError(f"{path}: {key}: is {meant[0]} meant?")


def _there_are(path: str, known: Iterable[str]) -> str:
    """Return a list of what stands in the same group, or of the groups."""
    group = path.rpartition(".")[0]
    names = [name.rpartition(".") for name in known]
    inside = [name for where, _, name in names if where == group]
    return f"there are {', '.join(inside or dict.fromkeys(where for where, _, _ in names))}"


def _of_plant_node(content: dict[str, Any]) -> dict[str, Any]:
    """Return the machine's groups where they stand as ROS 2 parameters of the plant node."""
    for name, node in content.items():
        of_plant = str(name).rpartition("/")[2] == "plant_node"
        if of_plant and isinstance(node, dict) and isinstance(node.get("ros__parameters"), dict):
            return dict(node["ros__parameters"])
    return content


def _groups(content: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """Return the groups of parameters in a file by dotted path, each effect being one.

    Raises ParameterError where something else stands for the effects or for one of them.
    """
    effects = content.get("effects") or {}
    if not isinstance(effects, dict):
        raise ParameterError(f"effects = {effects!r}: not a map of effects by name")
    for name, members in effects.items():
        if name not in REGISTRY:
            raise ParameterError(
                f"effects.{name}: there is no such effect; there are {', '.join(REGISTRY)}"
            )
        if not isinstance(members, dict):
            raise ParameterError(f"effects.{name} = {members!r}: not a map of its parameters")
    others = {name: group for name, group in content.items() if isinstance(group, dict)}
    others.pop("effects", None)
    return others | {EFFECTS + name: members for name, members in effects.items()}


def _value(value: Any, path: str, about: Quantity) -> Any:
    if not about.count:
        return _number(value, path)
    about.check(path, value)
    return tuple(map(float, value))


def _number(value: Any, path: str) -> float:
    # YAML reads 1e-12 (no dot) as text, a trap worth stepping around
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise ParameterError(f"{path} = {value!r}: not a number") from None
    return int(number) if isinstance(value, int) else number


def _tolerance(entry: dict[str, Any], path: str) -> float:
    tolerance = _number(entry["tol"], f"{path}: tol")
    if not 0.0 <= tolerance < 1.0:
        raise ParameterError(f"{path}: tol = {tolerance}: a relative one, 0 ... 1, is expected")
    return float(tolerance)


def _entries(members: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """Return the entries of a group, maps of plain numbers spread out."""
    found: dict[str, dict[str, Any]] = {}
    for name, entry in members.items():
        if not isinstance(entry, dict):
            found[name] = {"value": entry}
        elif "value" in entry or "tol" in entry:
            found[name] = entry
        else:
            numbers = {key: n for key, n in entry.items() if isinstance(n, int | float)}
            found |= {f"{name}_{key}": {"value": number} for key, number in numbers.items()}
    return found


def _group(kind: type[Any], name: str, values: dict[str, Any]) -> Any:
    fields = dataclasses.fields(kind)
    given = {f.name: values[f"{name}.{f.name}"] for f in fields if f"{name}.{f.name}" in values}
    for f in fields:
        if f.name not in given and f.default is dataclasses.MISSING:
            raise ParameterError(
                f"{name}.{f.name}: missing; allowed is {f.metadata['quantity'].allowed}"
            )
        whole = f.type in {int, "int"}
        if whole and given.get(f.name, 0) % 1 != 0:
            raise ParameterError(f"{name}.{f.name} = {given[f.name]}: not a whole number")
        if f.name in given and not isinstance(given[f.name], tuple):
            given[f.name] = int(given[f.name]) if whole else float(given[f.name])
    return kind(**given)
