"""The files that parameters name, such as a design or a machine: kept in the recording of a run.

Each is an attachment `parameter_files/NODE/PARAMETER/FILE`. A file that one of these is based on
lies beside it. A controller's design is kept also where it is one of the project's own: of other
versions these may differ.
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory
from typing import Any

from mcap.records import Attachment

from emir_analysis import bags
from emir_common.quantity import ParameterError
from emir_common.yaml_file import read_map
from emir_control import pfc_file
from emir_control.pfc_file import STROKE, TIP_ANGLE
from emir_plant.sheet import BASED_ON

FOLDER = "parameter_files"
SUFFIX = "_file"  # of the parameters that name one
DESIGN, DESIGNED = "model_file", {"pfc_node": STROKE, "pfc_tip_node": TIP_ANGLE}
MEDIA_TYPE = "application/yaml"


def attachments(node: str, values: Mapping[str, Any]) -> Iterator[Attachment]:
    """Yield the files that a node's parameters name. Raises ParameterError for a broken one."""
    for parameter, name in sorted(values.items()):
        named = _named(node, parameter, str(name))
        if named is not None:
            for file in _with_base(named):
                path = f"{FOLDER}/{node}/{parameter}/{file.name}"
                yield Attachment(0, 0, path, MEDIA_TYPE, _content(file))


@contextmanager
def unpacked(bag: Path, node: str, values: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """Give the parameters with the recording's own files in place of those that they name.

    Valid inside the context. Older recordings hold none: the parameters are then as they are.
    """
    with TemporaryDirectory(prefix="emir-") as folder:
        kept = dict(values)
        for attachment in bags.attachments(bag):
            match PurePosixPath(attachment.name).parts:
                case (first, of, parameter, name) if (first, of) == (FOLDER, node):
                    file = Path(folder) / parameter / name
                    file.parent.mkdir(exist_ok=True)
                    file.write_bytes(attachment.data)
                    if name == _name(node, parameter, values):
                        kept[parameter] = str(file)
        yield kept


def _named(node: str, parameter: str, name: str) -> Path | None:
    """Return the file that a parameter means, None where it means none."""
    if parameter == DESIGN and node in DESIGNED:
        return pfc_file.find(name, DESIGNED[node])
    return Path(name) if parameter.endswith(SUFFIX) and Path(name).is_file() else None


def _name(node: str, parameter: str, values: Mapping[str, Any]) -> str:
    """Return how the file was called that a parameter meant; it need not be there any more."""
    name = str(values.get(parameter, ""))
    if parameter == DESIGN and node in DESIGNED:
        return pfc_file.find(name, DESIGNED[node]).name
    return Path(name).name


def _with_base(file: Path) -> list[Path]:
    base = read_map(file, what="entry").get(BASED_ON)
    if base is None:
        return [file]
    if Path(str(base)).name != str(base):
        raise ParameterError(f"{file}: {BASED_ON}: {base} does not lie beside it")
    return [file, file.parent / str(base)]


def _content(file: Path) -> bytes:
    try:
        return file.read_bytes()
    except OSError as error:
        raise ParameterError(f"{file}: {error.strerror}") from None
