"""Options that were given to a command and that it has no use for."""

from argparse import Namespace
from collections.abc import Mapping

from emir_analysis.errors import InputError


def check_unused(options: Namespace, others: Mapping[str, object], why: str) -> None:
    """Raise InputError, naming them and why, for options that differ from their defaults.

    others: the options that are not used, with their defaults.
    """
    given = sorted(name for name, usual in others.items() if getattr(options, name) != usual)
    if given:
        names = ", ".join(f"--{name.replace('_', '-')}" for name in given)
        raise InputError(f"{names}: {why}")
