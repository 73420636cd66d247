"""Reading a YAML file that holds a map, with one clear line for what is wrong with it."""

import re
from pathlib import Path
from typing import Any

import yaml

from emir_common.quantity import ParameterError


class _Loader(yaml.SafeLoader):
    """YAML in which no key of a map stands twice: the first would be lost without a word.

    And in which 2e7 is a number as it is for ROS and by YAML 1.2; the library wants 2.0e+7. An
    anchor that holds itself is refused: what reads it would never come to an end.
    """

    def __init__(self, stream: str) -> None:
        """Construct every value whole, in which the library notices one that holds itself."""
        super().__init__(stream)
        self.deep_construct = True

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:  # noqa: FBT001, FBT002 (as in the library)
        """Return the map. Raises ConstructorError for a key that stands twice."""
        names: set[str] = set()
        for key, _ in node.value:
            if not isinstance(key, yaml.ScalarNode):
                continue  # the library tells which of these can be a key
            if key.value in names:
                raise yaml.constructor.ConstructorError(
                    None, None, f"{key.value} stands twice", key.start_mark
                )
            names.add(key.value)
        return super().construct_mapping(node, deep=deep)


_Loader.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(r"[-+]?(\d+\.?\d*|\.\d+)[eE][-+]?\d+$"),
    list("-+.0123456789"),
)


def read_value(text: str) -> Any:
    """Return what a text is as YAML. Raises yaml.YAMLError for what is none."""
    try:
        return yaml.load(text, _Loader)  # noqa: S506 (a SafeLoader)
    except ValueError as error:  # as of a date that no calendar has
        raise yaml.YAMLError(str(error)) from None
    except RecursionError:
        raise yaml.YAMLError("nested too deep") from None


def read_map(file: Path, *, what: str) -> dict[Any, Any]:
    """Return the map that a YAML file holds.

    what: the name of its entries, for the message when there are none. Raises ParameterError,
    naming the file, for one that cannot be read, is not YAML, holds no map or a key twice.
    """
    try:
        content = read_value(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise ParameterError(f"{file}: {error.strerror}") from None
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise ParameterError(f"{file}: not YAML: {' '.join(str(error).split())}") from None
    if not isinstance(content, dict) or not content:
        raise ParameterError(f"{file}: no {what} in it")
    return content
