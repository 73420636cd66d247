"""What a ROS 2 parameter file says to the nodes of one run: those in its namespace.

What rcl would make of the file's patterns and their order is done here, once: the run then gives
each node the values that it was checked with.
"""

import re
from pathlib import Path
from typing import Any

from emir_common.quantity import ParameterError
from emir_common.yaml_file import read_map

WILDCARDS = {"*": r"/\w+", "**": r"(/\w+)*"}  # of rcl: one word of a path, any number of them
Values = dict[str, Any]


def read_entries(file: Path | None) -> dict[str, Values]:
    """Return a ROS 2 parameter file as {node's name or pattern: {dotted name: value}}; {} for None.

    Raises ParameterError, naming file and node, for what is no such file.
    """
    found = {}
    for name, entry in (read_map(file, what="node") if file else {}).items():
        if not isinstance(entry, dict) or not isinstance(entry.get("ros__parameters"), dict):
            raise ParameterError(f"{file}: {name}: ros__parameters is missing")
        found[str(name)] = _flat(entry["ros__parameters"], f"{file}: {name}: ")
    return found


def _flat(tree: dict[Any, Any], where: str, prefix: str = "") -> Values:
    flat: Values = {}
    for key, value in tree.items():
        path = f"{prefix}{key}"
        found = _flat(value, where, f"{path}.") if isinstance(value, dict) else {path: value}
        for name in found.keys() & flat.keys():
            raise ParameterError(f"{where}{name} stands twice")
        flat |= found
    return flat


def reaches(pattern: str, node: str, namespace: str) -> bool:
    """Return whether a name in a parameter file is that of a node in a namespace.

    As for rcl, `*` is one word of the path and `**` any number of them; but a name without a path
    is meant in any namespace.
    """
    path = pattern if "/" in pattern else f"/**/{pattern}"
    words = path.removeprefix("/").split("/")
    regex = "".join(WILDCARDS.get(word, f"/{re.escape(word)}") for word in words)
    place = f"/{namespace}" if namespace else ""
    return re.fullmatch(regex, f"{place}/{node}") is not None


def values_of(entries: dict[str, Values], node: str, namespace: str) -> Values:
    """Return all that a parameter file says to a node; as for rcl, what comes later prevails."""
    values: Values = {}
    for pattern, given in entries.items():
        if reaches(pattern, node, namespace):
            values |= given
    return values
