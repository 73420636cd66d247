"""Reading a table of numbers from a CSV file, with one clear line for what is wrong with it."""

import csv
import math
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from emir_analysis.errors import InputError
from emir_analysis.signals import Array

SEPARATORS = ",;\t"


def read_columns(file: Path, wanted: Iterable[str]) -> dict[str, Array]:
    """Return the wanted columns by name, (n,) each.

    The first line names the columns; comma, semicolon or tab stand between. Columns that nobody
    wants may hold anything. Raises InputError, naming file, line and column, for a file that
    cannot be read, a missing header or column, rows of different length, text, blanks and NaN.
    """
    rows = _rows(file)
    if not rows:
        raise InputError(f"{file}: empty")
    header = [name.strip() for name in rows[0][1]]
    if all(_is_number(name) for name in header):
        raise InputError(f"{file}: no header: the first line has to name the columns")
    for name in wanted:
        if header.count(name) != 1:
            found = "no" if name not in header else "more than one"
            raise InputError(f"{file}: {found} column {name}; there are {', '.join(header)}")
    if len(rows) == 1:
        raise InputError(f"{file}: a header and no rows")
    for line, row in rows[1:]:
        if len(row) != len(header):
            raise InputError(f"{file}: line {line}: {len(row)} cells under {len(header)} columns")
    return {name: _column(file, rows[1:], name, header.index(name)) for name in wanted}


def _rows(file: Path) -> list[tuple[int, list[str]]]:
    """Return each row that is not blank with the number of its line."""
    try:
        with file.open(encoding="utf-8-sig", newline="") as stream:
            first = stream.readline()
            stream.seek(0)
            separator = max(SEPARATORS, key=first.count)
            reader = csv.reader(stream, delimiter=separator)
            return [(reader.line_num, row) for row in reader if any(cell.strip() for cell in row)]
    except OSError as error:
        raise InputError(f"{file}: {error.strerror}") from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{file}: not a CSV file: {error}") from None


def _column(file: Path, rows: list[tuple[int, list[str]]], name: str, index: int) -> Array:
    values = np.empty(len(rows))
    for k, (line, row) in enumerate(rows):
        text = row[index].strip()
        if not _is_number(text):
            shown = repr(text) if text else "empty"
            raise InputError(f"{file}: line {line}: {name} is {shown}, not a number")
        values[k] = float(text)
        if not math.isfinite(values[k]):
            raise InputError(f"{file}: line {line}: {name} is {text}")
    return values


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
