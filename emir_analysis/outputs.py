"""Whether a command's outputs can be written, told before hours of work and not after."""

import os
from collections.abc import Sequence
from pathlib import Path

from emir_analysis.errors import InputError


def check_outputs(
    files: Sequence[Path | None], folder: Path | None, inputs: Sequence[Path | None]
) -> None:
    """Raise InputError for an output that cannot be written or would overwrite something.

    files: to write, replaced where they exist; none of them may be another one or an input.
    folder: to write into, which has to be new or empty. None: not asked for.
    """
    taken = {path.resolve() for path in inputs if path is not None}
    for file in files:
        if file is None:
            continue
        if not file.parent.is_dir():
            raise InputError(f"{file}: no such folder {file.parent}")
        if file.exists() and not file.is_file():
            raise InputError(f"{file}: not a file that can be written")
        if not os.access(file if file.exists() else file.parent, os.W_OK):
            raise InputError(f"{file}: may not be written")
        if file.resolve() in taken:
            raise InputError(f"{file}: an input or another output is of that name")
        taken.add(file.resolve())
    if folder is not None:
        _check_folder(folder)


def _check_folder(folder: Path) -> None:
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise InputError(f"{folder}: exists already, and is not overwritten")
    there = next(parent for parent in (folder, *folder.resolve().parents) if parent.exists())
    if not os.access(there, os.W_OK):
        raise InputError(f"{folder}: may not be written")
