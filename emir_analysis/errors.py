"""What a user can get wrong."""

from collections.abc import Iterable


class InputError(ValueError):
    """A recording, file or setting cannot be used; the message is one line: what and where."""


class IncompleteError(InputError):
    """Work was done, and its result is known, but not all could be read or written.

    result: what the work has come to, so that nothing is lost.
    """

    def __init__(self, result: object, failed: list[InputError]) -> None:
        super().__init__("; ".join(map(str, failed)))
        self.result = result


def listed(names: Iterable[str]) -> str:
    """Return the names that there are, for a message; "none" where there are none."""
    return ", ".join(sorted(names)) or "none"
