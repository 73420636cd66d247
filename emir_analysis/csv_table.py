"""Reading a table of numbers from a CSV file, with one clear line for what is wrong with it."""

import csv
import math
from collections.abc import Collection, Iterable
from pathlib import Path

import numpy as np

from emir_analysis.errors import InputError
from emir_analysis.signals import Array

SEPARATORS = ",;\t"
COMMENT = "#"


def read_columns(
    file: Path, wanted: Iterable[str], sparse: Collection[str] = ()
) -> dict[str, Array]:
    """Return the wanted columns by name, (n,) each; NaN for a blank cell of a sparse one.

    The first line names the columns, behind comments (#); comma, semicolon or tab stand between.
    Where it is not a comma, a decimal comma is read, too. Columns that nobody wants may hold
    anything. Raises InputError, naming file, line and column, for a file that cannot be read, a
    missing header or column, rows of different length, text, blanks elsewhere and NaN.
    """
    rows, point = _rows(file)
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
    columns = {}
    for name in wanted:
        cells = [(line, row[header.index(name)].strip()) for line, row in rows[1:]]
        columns[name] = _column(file, cells, name, point, sparse=name in sparse)
    return columns


def _rows(file: Path) -> tuple[list[tuple[int, list[str]]], str]:
    """Return each row that is not blank with the number of its line, and what may be its point."""
    try:
        with file.open(encoding="utf-8-sig", newline="") as stream:
            lines = (line for line in stream if line.strip() and not line.startswith(COMMENT))
            first = next(lines, "")
            stream.seek(0)
            separator = max(SEPARATORS, key=first.count)
            reader = csv.reader(stream, delimiter=separator)
            rows = [(reader.line_num, row) for row in reader if any(cell.strip() for cell in row)]
    except OSError as error:
        raise InputError(f"{file}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise InputError(f"{file}: not in UTF-8; save it in that encoding") from None
    except csv.Error as error:
        raise InputError(f"{file}: not a CSV file: {error}") from None
    header = next((k for k, (_, row) in enumerate(rows) if not row[0].startswith(COMMENT)), 0)
    return rows[header:], "." if separator == "," else ","


def _column(
    file: Path, cells: list[tuple[int, str]], name: str, point: str, *, sparse: bool
) -> Array:
    values = np.full(len(cells), math.nan)
    if sparse and not any(text for _, text in cells):
        raise InputError(f"{file}: column {name} is blank")
    for k, (line, text) in enumerate(cells):
        if sparse and not text:
            continue
        number = text.replace(point, ".")
        if not _is_number(number):
            shown = repr(text) if text else "empty"
            raise InputError(f"{file}: line {line}: {name} is {shown}, not a number")
        values[k] = float(number)
        if not math.isfinite(values[k]):
            raise InputError(f"{file}: line {line}: {name} is {text}")
    return values


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
