"""The files that parameters name, such as a design or a machine: kept in the recording of a run.

Each is an attachment `parameter_files/NODE/PARAMETER/FILE`. A file that one of these is based on
lies beside it.
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
from emir_plant.sheet import BASED_ON

FOLDER = "parameter_files"
SUFFIX = "_file"  # of the parameters that name one
MEDIA_TYPE = "application/yaml"


def attachments(node: str, values: Mapping[str, Any]) -> Iterator[Attachment]:
    """Yield the files that a node's parameters name.

    A name that is no file, such as `scheduled`, is one of the project's own. Raises ParameterError
    for a file that cannot be read.
    """
    for parameter, name in sorted(values.items()):
        if parameter.endswith(SUFFIX) and name and Path(str(name)).is_file():
            for file in _with_base(Path(name)):
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
                    if name == Path(str(values.get(parameter, ""))).name:
                        kept[parameter] = str(file)
        yield kept


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
