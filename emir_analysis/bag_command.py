"""`emir bag recover`: a complete recording of what can be read of one that was cut off."""

from argparse import ArgumentParser
from collections.abc import Callable, Sequence
from pathlib import Path

from emir_analysis.recover import recover


def command(words: Sequence[str], progress: Callable[[str], None]) -> str:
    """Recover, return what was saved. Raises InputError or ParameterError."""
    options = _parser().parse_args(words)
    saved = recover(options.bag, options.out)
    for line in saved.damage:
        progress(f"emir bag: {line}; what came before it is saved")
    return f"{options.out}: {saved.messages} messages over {saved.duration_ns * 1e-9:.3f} s"


def _parser() -> ArgumentParser:
    parser = ArgumentParser(prog="emir bag", description="Recover a recording.")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    about = "A complete recording of what can be read of one that was cut off or damaged"
    recovery = commands.add_parser("recover", help=about, description=about)
    recovery.add_argument("bag", type=Path, metavar="BAG", help="folder or .mcap file")
    recovery.add_argument(
        "--out", type=Path, required=True, metavar="DIR", help="folder to write; must not exist"
    )
    return parser
