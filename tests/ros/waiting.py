"""Waiting for what a test has set going, no longer than it may take on a busy computer."""

import time
from collections.abc import Callable

DEADLINE = 120.0  # s


def until(
    condition: Callable[[], object], act: Callable[[], object], told: Callable[[], object] = str
) -> None:
    """Act until a condition holds; told: what to show of a wait in vain."""
    deadline = time.monotonic() + DEADLINE
    while not condition():
        assert time.monotonic() < deadline, told()
        act()
