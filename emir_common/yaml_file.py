"""Reading a YAML file that holds a map, with one clear line for what is wrong with it."""

from pathlib import Path
from typing import Any

import yaml

from emir_common.quantity import ParameterError


def read_map(file: Path, *, what: str) -> dict[Any, Any]:
    """Return the map that a YAML file holds.

    what: the name of its entries, for the message when there are none. Raises ParameterError,
    naming the file, for one that cannot be read, is not YAML or holds no map.
    """
    try:
        content = yaml.safe_load(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise ParameterError(f"{file}: {error.strerror}") from None
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise ParameterError(f"{file}: not YAML: {' '.join(str(error).split())}") from None
    if not isinstance(content, dict) or not content:
        raise ParameterError(f"{file}: no {what} in it")
    return content
