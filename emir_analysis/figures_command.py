"""`emir figures`: the paper's figures and a table of its numbers, into a folder."""

from argparse import ArgumentParser
from collections.abc import Callable, Sequence
from pathlib import Path

from emir_analysis.errors import InputError
from emir_analysis.paper_figures import FIGURES, draw


def command(words: Sequence[str], progress: Callable[[str], None]) -> str:
    """Draw, return the files, one a line. Raises InputError."""
    options = _parser().parse_args(words)
    numbers = options.only.split(",")
    if not all(number.isdecimal() for number in numbers):
        raise InputError(f"--only {options.only}: not numbers with commas between")
    files = draw(list(map(int, numbers)), options.folder or options.out, progress)
    return "\n".join(map(str, files))


def _parser() -> ArgumentParser:
    everything = ",".join(map(str, FIGURES))
    parser = ArgumentParser(
        prog="emir figures",
        description="The paper's figures as this machine draws them, and a table (table.md,"
        " table.json) of the paper's numbers beside ours, measured anew.",
    )
    parser.add_argument(
        "--only", default=everything, metavar="N,N", help=f"these figures; default {everything}"
    )
    folder = parser.add_mutually_exclusive_group(required=True)
    folder.add_argument("folder", type=Path, nargs="?", metavar="DIR", help="where to write")
    folder.add_argument("--out", type=Path, metavar="DIR", help="the same, as an option")
    return parser
