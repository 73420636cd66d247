"""`emir view --bag BAG`: serve the page of a recording on this computer until interrupted."""

import argparse
import signal
import socket
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from emir_analysis.errors import InputError
from emir_analysis.run_signals import is_robot, load_run
from emir_analysis.view.frames import frames

if TYPE_CHECKING:
    import viser

HOST = "127.0.0.1"  # nobody else's business


def command(words: list[str], live: Callable[[list[str]], int]) -> int:
    """Serve a recording, or hand over to `live`, which knows ROS."""
    parser = argparse.ArgumentParser(prog="emir view", description=(
        "A recording or the running graph as a page in the browser, served to this computer alone"
        " until Ctrl-C. Needs the extra `view` (docs/view.md)."
    ))  # fmt: skip
    source = parser.add_mutually_exclusive_group(required=True)
    source.add_argument("--bag", type=Path, metavar="BAG", help="a recording of the graph")
    source.add_argument("--live", action="store_true", help="the running graph; needs ROS 2")
    parser.add_argument("--model", metavar="NAME", help="with --live: joint1 (default) or robot")
    parser.add_argument("--port", type=int, default=8080, help="of the page, default 8080")
    options = parser.parse_args(words)
    if options.live:
        model = f"model:={options.model or 'joint1'}"
        return live(["--ros-args", "-p", f"port:={options.port}", "-p", model])
    if options.model is not None:
        raise InputError("--model is for --live: a recording says itself whose it is")
    recording = load_run(options.bag)
    stop = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop.set())
    server = start_server(options.port)
    from emir_analysis.view.page import Page
    from emir_analysis.view.player import Player
    from emir_analysis.view.robot import robot_frames
    from emir_analysis.view.subject import robot_subject, subject_of_joint1

    title = f"EMIR: {options.bag.resolve().name}"
    if is_robot(recording):
        page, shown = Page(server, robot_subject(), title), robot_frames(recording)
    else:
        joint = subject_of_joint1()
        page, shown = Page(server, joint, title), frames(recording, joint.reach)
    player = Player(server, page, shown)
    sys.stdout.write(f"http://localhost:{server.get_port()} shows {options.bag}; Ctrl-C ends\n")
    sys.stdout.flush()
    player.run(stop)
    server.stop()
    return 0


def start_server(port: int) -> "viser.ViserServer":
    """Return a server on this computer alone.

    Raises InputError where the library is not installed or the port is taken.
    """
    try:
        import viser
    except ImportError:
        raise InputError("needs viser: pip install 'emir_ros[view]'") from None
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # a page just closed is no one
        try:
            probe.bind((HOST, port))
        except (OSError, OverflowError) as error:
            said = getattr(error, "strerror", None) or error
            raise InputError(f"--port {port}: {said}") from None
    return viser.ViserServer(host=HOST, port=port, verbose=False)
