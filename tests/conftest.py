"""What all tests share: a ROS environment of their own, and the way to the reference material."""

import os
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
from domains import reserved_domain  # stands beside, in no package

# Matrices are small, and threads cost more than they gain. Before numpy is loaded.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# Each of pytest-xdist's processes has one core: more threads there wait for each other.
if "PYTEST_XDIST_WORKER" in os.environ:
    os.environ.setdefault("NUMBA_NUM_THREADS", "1")


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
    with reserved_domain() as domain:
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
