"""`emir analyze`: figures and plots of recordings of the graph, one or several side by side."""

from argparse import ArgumentParser
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from emir_analysis import run_report
from emir_analysis.errors import IncompleteError
from emir_analysis.outputs import check_outputs, write_all


def command(words: Sequence[str]) -> str:
    """Analyze, write, return the figures.

    Raises InputError; IncompleteError, with the figures, where not all can be written.
    """
    options = _parser().parse_args(words)
    writes = [
        (options.json, run_report.write_json),
        (options.csv, run_report.write_csv),
        (options.html, run_report.write_report),
        (options.picture, run_report.write_path),
    ]
    check_outputs([file for file, _ in writes], None, options.bag)
    runs = [run_report.analyze(bag) for bag in options.bag]
    run_report.check_alike(runs)
    told = run_report.text(runs[0]) if len(runs) == 1 else run_report.comparison(runs)
    failed = write_all((file, partial(write, runs)) for file, write in writes)
    if failed:
        raise IncompleteError(told, failed)
    return told


def _parser() -> ArgumentParser:
    parser = ArgumentParser(
        prog="emir analyze",
        description="Figures of recordings of the graph: tracking error, lag, deflection,"
        " pressures. Several recordings stand side by side.",
    )
    parser.add_argument(
        "bag", type=Path, nargs="+", metavar="BAG", help="recordings of the graph, of one model"
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures")
    parser.add_argument(
        "--csv", type=Path, metavar="FILE", help="write the figures, one line for each recording"
    )
    parser.add_argument("--html", type=Path, metavar="FILE", help="write a page with plots")
    parser.add_argument(
        "--picture", type=Path, metavar="FILE",
        help="of the whole robot: draw the way of its TCP",
    )  # fmt: skip
    return parser
