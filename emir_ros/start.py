"""`python -m emir_ros.start NAME ...`: run a node as `ros2 run emir_ros NAME ...` does.

Loading a node's libraries takes a second or more, in which it may already be told to stop.
"""

import signal
import sys
from importlib import import_module
from types import FrameType


def main() -> None:
    """Load the node that the command line names and run it; exit code 0 if stopped meanwhile."""
    for stop in signal.SIGINT, signal.SIGTERM:
        signal.signal(stop, _end)
    name = sys.argv.pop(1)
    import_module(f"emir_ros.{name}").main()


def _end(_number: int, _frame: FrameType | None) -> None:
    sys.exit(0)


if __name__ == "__main__":
    main()
