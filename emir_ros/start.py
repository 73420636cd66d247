"""`python -m emir_ros.start NAME ...`: run a node as `ros2 run emir_ros NAME ...` does.

Loading a node's libraries takes a second or more, in which it may already be told to stop.
"""

import signal
import sys
from importlib import import_module
from importlib.util import find_spec
from types import FrameType


def main() -> None:
    """Load the node that the command line names and run it.

    Exit code 0 if it is stopped meanwhile; 1 with one line where there is no such node.
    """
    for stop in signal.SIGINT, signal.SIGTERM:
        signal.signal(stop, _end)
    name = sys.argv.pop(1) if len(sys.argv) > 1 else ""
    if not name.endswith("_node") or find_spec(f"emir_ros.{name}") is None:
        sys.exit(f"emir_ros.start: {name or 'nothing'} given, not the name of a node")
    import_module(f"emir_ros.{name}").main()


def _end(_number: int, _frame: FrameType | None) -> None:
    sys.exit(0)


if __name__ == "__main__":
    main()
