"""What all tests share: a ROS environment of their own, and the way to the reference material."""

import fcntl
import itertools
import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

# Matrices are small, and threads cost more than they gain. Before numpy is loaded.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# Each of pytest-xdist's processes has one core: more threads there wait for each other.
if "PYTEST_XDIST_WORKER" in os.environ:
    os.environ.setdefault("NUMBA_NUM_THREADS", "1")

DOMAINS = range(1, 102)  # 0 is everybody's; above 101 the ports meet Linux's ephemeral ones
_turn = itertools.islice(itertools.cycle(DOMAINS), os.getpid() % len(DOMAINS), None)


@contextmanager
def _reserved_domain() -> Iterator[int]:
    """Yield a domain that no other test of this machine uses; a file lock holds it."""
    folder = Path(tempfile.gettempdir()) / f"emir-ros-domains-{os.getuid()}"
    folder.mkdir(exist_ok=True)
    for domain in itertools.islice(_turn, len(DOMAINS)):
        with (folder / str(domain)).open("w") as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                continue
            yield domain
            return
    pytest.fail("every ROS domain is taken by another test")


@pytest.fixture(autouse=True)
def ros_domain(
    monkeypatch: pytest.MonkeyPatch, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[int]:
    """Give each test a ROS domain of its own, within this machine; yield its number."""
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    monkeypatch.delenv("ROS_LOCALHOST_ONLY", raising=False)  # would override the line above
    monkeypatch.delenv("ROS_STATIC_PEERS", raising=False)
    monkeypatch.setenv("ROS_LOG_DIR", str(tmp_path_factory.getbasetemp() / "ros_log"))
    if Path(sys.prefix, "share", "ament_index").is_dir():
        monkeypatch.setenv("AMENT_PREFIX_PATH", sys.prefix, prepend=os.pathsep)
    with _reserved_domain() as domain:
        monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
        yield domain


@pytest.fixture(scope="session")
def shared() -> Path:
    """Return the folder of the reference material; skip the test where there is none."""
    beside = Path(__file__).parents[2] / "shared"
    folder = Path(os.environ.get("EMIR_SHARED", beside))
    if not folder.is_dir():
        pytest.skip(f"reference material missing: no folder {folder}; EMIR_SHARED can name it")
    return folder
