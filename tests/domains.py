"""ROS domains for tests: of those that run at once each has one of its own."""

import fcntl
import itertools
import os
import socket
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

DOMAINS = range(1, 102)  # 0 is everybody's; above 101 the ports meet Linux's ephemeral ones
_turn = itertools.islice(itertools.cycle(DOMAINS), os.getpid() % len(DOMAINS), None)


@contextmanager
def reserved_domain() -> Iterator[int]:
    """Yield a domain that no other test of this machine uses; a file lock holds it.

    What a test has left behind, garbage that is not collected yet or a process, still publishes:
    there the next test does not go.
    """
    folder = Path(tempfile.gettempdir()) / f"emir-ros-domains-{os.getuid()}"
    folder.mkdir(exist_ok=True)
    for domain in itertools.islice(_turn, len(DOMAINS)):
        with (folder / str(domain)).open("w") as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                continue
            if is_inhabited(domain):
                continue
            yield domain
            return
    pytest.fail("every ROS domain is taken by another test")


def is_inhabited(domain: int) -> bool:
    """Return whether a participant listens in the domain, at a port of DDSI-RTPS 2.2, 9.6.1.1."""
    first = 7400 + 250 * domain
    return not all(_is_free(port) for port in range(first + 10, first + 250, 2))


def _is_free(port: int) -> bool:
    with socket.socket(type=socket.SOCK_DGRAM) as ours:
        try:
            ours.bind(("", port))
        except OSError:
            return False
    return True
