"""What the tests of this folder share: an rclpy that runs; and they may import helpers."""

import gc
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE), str(HERE.parent / "analysis")]


@pytest.fixture
def ros(ros_domain: int) -> Iterator[None]:
    """Have rclpy running; the test's module has seen to it that there is one."""
    import rclpy

    rclpy.init()
    yield
    rclpy.try_shutdown()
    gc.collect()  # else the test's nodes may stay in this domain, which has its turn again


@pytest.fixture
def executor(ros: None) -> Iterator[Any]:
    """Give an executor, shut down at the end: left over, it may complain when it is collected."""
    from rclpy.executors import SingleThreadedExecutor

    made = SingleThreadedExecutor()
    yield made
    made.shutdown()
