"""Message definitions as rosbag2 stores them, read from the installed ROS packages."""

import json
import re
from functools import cache
from pathlib import Path

from ament_index_python.packages import PackageNotFoundError, get_package_share_directory
from mcap.records import Schema

from emir_common.quantity import ParameterError

SEPARATOR = "=" * 80
BUILTIN = re.compile(r"(bool|byte|char|u?int(8|16|32|64)|float(32|64)|w?string)\b")


@cache
def definition(type_name: str) -> str:
    """Return the text of a type such as `sensor_msgs/msg/JointState` and of all it contains.

    The form is MCAP's `ros2msg`: the type's own text first, then each contained type once,
    behind a line of `=` and a line `MSG: package/Name`.
    """
    package, _, name = type_name.split("/")
    parts = [_text(package, name)]
    seen = [(package, name)]
    for inner in seen:  # grows while it is walked
        for found in _contained(*inner):
            if found not in seen:
                seen.append(found)
                parts.append(f"{SEPARATOR}\nMSG: {found[0]}/{found[1]}\n{_text(*found)}")
    return "\n".join(parts)


def schema(type_name: str) -> Schema:
    """Return a type's definition as an MCAP file holds it, id 0."""
    return Schema(0, definition(type_name).encode(), "ros2msg", type_name)


@cache
def type_hash(type_name: str) -> str:
    """Return the RIHS01 hash of a type."""
    package, _, name = type_name.split("/")
    path = _folder(package) / f"{name}.json"
    hashes = {entry["type_name"]: entry["hash_string"] for entry in
              json.loads(path.read_text())["type_hashes"]}  # fmt: skip
    return str(hashes[type_name])


def _text(package: str, name: str) -> str:
    return (_folder(package) / f"{name}.msg").read_text()


def _folder(package: str) -> Path:
    try:
        return Path(get_package_share_directory(package)) / "msg"
    except PackageNotFoundError:
        raise ParameterError(
            f"package {package} is not in AMENT_PREFIX_PATH: is ROS 2 sourced?"
        ) from None


def _contained(package: str, name: str) -> list[tuple[str, str]]:
    found = []
    for line in _text(package, name).splitlines():
        kind, _, name_of_field = line.split("#")[0].strip().partition(" ")
        if not name_of_field or BUILTIN.match(kind):
            continue
        owner, _, inner = kind.split("[")[0].rpartition("/")
        found.append((owner or package, inner))
    return found
