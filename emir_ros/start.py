"""`python -m emir_ros.start NAME ...`: run a node as `ros2 run emir_ros NAME ...` does.

With `run` as NAME, the graph as `emir run` does, with `bench` as `emir bench graph` does. Loading
libraries takes a second or more, in which it may already be told to stop.
"""

import os
import signal
import sys
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from types import FrameType

GRAPHS = {"run": "emir run", "bench": "emir bench graph"}  # module, and who says something
INTERRUPTED = 130  # what a shell reports after Ctrl-C


def main() -> None:
    """Load the node that the command line names and run it.

    Exit code 0 if it is stopped meanwhile, 130 for the graph, whenever that is interrupted; 1 with
    one line where there is no such node.
    """
    name = sys.argv.pop(1) if len(sys.argv) > 1 else ""
    for stop in signal.SIGINT, signal.SIGTERM:
        signal.signal(stop, partial(_interrupt, GRAPHS[name]) if name in GRAPHS else _end)
    if name in GRAPHS:
        graph = import_module(f"emir_ros.{name}").main
        signal.signal(signal.SIGINT, signal.default_int_handler)
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        try:
            sys.exit(graph())
        except KeyboardInterrupt:
            sys.stderr.write(f"{GRAPHS[name]}: interrupted\n")
            sys.exit(INTERRUPTED)
    if not name.endswith("_node") or find_spec(f"emir_ros.{name}") is None:
        sys.exit(f"emir_ros.start: {name or 'nothing'} given, not the name of a node")
    import_module(f"emir_ros.{name}").main()


def _interrupt(who: str, _number: int, _frame: FrameType | None) -> None:
    sys.stderr.write(f"{who}: interrupted\n")
    os._exit(INTERRUPTED)


def _end(_number: int, _frame: FrameType | None) -> None:
    os._exit(0)  # an exception may come out of a C library's loading as another one


if __name__ == "__main__":
    main()
