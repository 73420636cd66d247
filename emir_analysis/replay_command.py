"""`emir replay`: a recording's inputs to one of its nodes, its answers beside the recorded ones."""

from argparse import ArgumentParser
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import yaml

from emir_analysis.errors import InputError
from emir_analysis.recorded_orders import orders
from emir_analysis.replay import NODES, replay, text
from emir_analysis.stamped import same
from emir_common.yaml_file import read_value


def command(words: Sequence[str]) -> tuple[str, bool]:
    """Replay; return what to tell, and whether it went as it should.

    It does where every bit is the same, or with parameters that were changed. Raises InputError or
    ParameterError.
    """
    options = _parser().parse_args(words)
    changed = _changed(options.set)
    fields = replay(options.bag, options.node, changed)
    told = [order.line for order in orders(options.bag, f"{options.node}_node")]
    return "\n".join([*told, text(fields, changed)]), bool(changed) or same(fields)


def _changed(entries: Iterable[str]) -> dict[str, Any]:
    """Return the values by name of entries PARAM=VALUE."""
    changed = {}
    for entry in entries:
        name, equals, value = entry.partition("=")
        if not equals:
            raise InputError(f"--set {entry}: not of the form PARAM=VALUE")
        try:
            changed[name] = read_value(value)
        except yaml.YAMLError:
            raise InputError(f"--set {entry}: {value} is not a value") from None
    return changed


def _parser() -> ArgumentParser:
    parser = ArgumentParser(
        prog="emir replay",
        description="Give the recorded inputs to what one node computes, and compare its answers"
        " with the recorded ones, bit by bit. Exit code 1 where they differ.",
    )
    parser.add_argument(
        "bag", type=Path, metavar="BAG", help="a recording of the graph, made in lock step"
    )
    parser.add_argument("--node", required=True, metavar="NAME", help=f"one of {', '.join(NODES)}")
    parser.add_argument(
        "--set", action="append", default=[], metavar="PARAM=VALUE",
        help="with this parameter of the node: how far the answers are then from the recorded ones,"
        " the inputs being the same (open loop); may be repeated",
    )  # fmt: skip
    return parser
