"""A command's outputs: what cannot be written is told before hours of work, and loses nothing."""

import os
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from matplotlib.backend_bases import FigureCanvasBase
from matplotlib.figure import Figure

from emir_analysis.errors import InputError
from emir_common.quantity import ParameterError


def check_outputs(
    files: Sequence[Path | None], folder: Path | None, inputs: Sequence[Path | None]
) -> None:
    """Raise InputError for an output that cannot be written or would overwrite something.

    files: to write, replaced where they exist; none of them may be another one, an input, or lie
    in a folder that is one. folder: to write into, which has to be new or empty. None: not asked
    for.
    """
    given = {path.resolve() for path in inputs if path is not None}
    taken = set(given)
    for file in files:
        if file is None:
            continue
        if not file.parent.is_dir():
            raise InputError(f"{file}: no such folder {file.parent}")
        if file.exists() and not file.is_file():
            raise InputError(f"{file}: not a file that can be written")
        _check_apart(file, given)
        if file.resolve() in taken:
            raise InputError(f"{file}: an input or another output is of that name")
        _check_writable(file)
        taken.add(file.resolve())
    if folder is not None:
        _check_apart(folder, given)
        _check_folder(folder, taken)


def check_picture(file: Path | None) -> None:
    """Raise InputError for a picture of a kind that cannot be drawn. None: not asked for."""
    known = FigureCanvasBase.get_supported_filetypes()
    if file is not None and file.suffix[1:].lower() not in known:
        raise InputError(f"{file}: no kind of picture; there are .{', .'.join(sorted(known))}")


def write_all(
    writes: Iterable[tuple[Path | None, Callable[[Path], None]]],
) -> list[InputError]:
    """Write every output that is asked for, whatever becomes of one; return what could not be."""
    failed = []
    for path, write in writes:
        try:
            if path is not None:
                write(path)
        except (InputError, ParameterError) as error:
            failed.append(InputError(str(error)))
    return failed


def write_text(file: Path, text: str) -> None:
    """Write a text in UTF-8. Raises InputError, naming the file."""
    with written(file):
        file.write_text(text, encoding="utf-8")


def write_picture(file: Path, figure: Figure) -> None:
    """Draw a figure, its kind by the file's name. Raises InputError, naming the file."""
    with written(file):
        try:
            figure.savefig(file, dpi=120)
        except ValueError as error:  # no kind of picture
            raise InputError(f"{file}: {error}") from None


@contextmanager
def written(output: Path) -> Iterator[None]:
    """Turn why an output cannot be written into an InputError that names it."""
    try:
        yield
    except OSError as error:
        raise InputError(f"{output}: {error.strerror}") from None


def _check_apart(output: Path, inputs: set[Path]) -> None:
    """Raise InputError for an output in a folder that is read."""
    read = inputs.intersection(output.resolve().parents)
    if read:
        raise InputError(f"{output}: lies in {min(read)}, which is read")


def _check_folder(folder: Path, taken: set[Path]) -> None:
    if folder.resolve() in taken:
        raise InputError(f"{folder}: an input or another output is of that name")
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise InputError(f"{folder}: exists already, and is not overwritten")
    there = next(parent for parent in (folder, *folder.resolve().parents) if parent.exists())
    if not there.is_dir():
        raise InputError(f"{folder}: {there} is not a folder")
    _check_room(there, folder)


def _check_writable(file: Path) -> None:
    if not file.exists():
        _check_room(file.parent, file)
    elif not os.access(file, os.W_OK):
        raise InputError(f"{file}: may not be written")


def _check_room(there: Path, output: Path) -> None:
    """Raise InputError where a folder takes no file: who may write may not be able to."""
    try:
        with tempfile.TemporaryFile(dir=there):
            pass
    except OSError as error:
        raise InputError(f"{output}: may not be written: {error.strerror}") from None
