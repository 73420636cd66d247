"""`emir info`: what is in a recording."""

from argparse import ArgumentParser
from collections.abc import Sequence
from pathlib import Path

from emir_analysis.info import fields_text, info, parameters_text, text


def command(words: Sequence[str]) -> str:
    """Return what the recording says, as asked for. Raises InputError."""
    options = _parser().parse_args(words)
    found = info(options.bag)
    told = []
    if options.fields:
        told.append(fields_text(found))
    if options.parameters:
        told.append(parameters_text(found))
    return "\n".join(told or [text(found)])


def _parser() -> ArgumentParser:
    parser = ArgumentParser(
        prog="emir info",
        description="What is in a recording: how it was made, whether it was finished, its topics"
        " with type, number and rate of messages.",
    )
    parser.add_argument("bag", type=Path, metavar="BAG", help="any recording in MCAP")
    parser.add_argument(
        "--fields", action="store_true", help="instead: unit and meaning of every field"
    )
    parser.add_argument(
        "--parameters", action="store_true",
        help="instead: the nodes' parameters, as a ROS parameter file",
    )  # fmt: skip
    return parser
