"""One number of the paper beside ours."""

from dataclasses import dataclass

YES, NO, NOT_MEASURED = "yes", "no", "not measured"


@dataclass(frozen=True)
class Number:
    """number: on the list of what the paper states. ours: with its unit, as measured.

    met: YES, NO or NOT_MEASURED. reason: why it is not, or under which reading it is.
    """

    number: int
    what: str
    paper: str
    ours: str
    how: str
    met: str
    reason: str = ""


def judged(is_met: bool) -> str:  # noqa: FBT001 (the one thing that it takes)
    """Return YES or NO."""
    return YES if is_met else NO


def is_about(ours: float, paper: float, digit: float) -> bool:
    """Tell whether a number rounds to the paper's; digit: what its last digit stands for."""
    return abs(ours - paper) <= 0.5 * digit
