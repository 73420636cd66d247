"""`emir bench graph`: how fast the graph steps, how late messages and timers are.

Everything is measured from outside the nodes: by recordings, and by the clock on the wall.
"""

import argparse
import math
import multiprocessing
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
from numpy.typing import NDArray
from rclpy.duration import Duration
from rclpy.qos import QoSProfile

from emir_analysis import bags, columns
from emir_analysis.bench.reading import reading_figures
from emir_analysis.bench.timing import Figure, text, write_json
from emir_analysis.columns import Columns
from emir_analysis.errors import InputError
from emir_analysis.outputs import check_outputs
from emir_common.quantity import ParameterError
from emir_msgs_py import conversions
from emir_msgs_py.topics import CONTROL_PERIOD_NS, JOINT_STATES, PLANT_PERIOD_NS, VALVE_COMMAND
from emir_ros import qos
from emir_ros.graph import Plan
from emir_ros.main import make_executor, out_of_garbage_collection
from emir_ros.run import run_plan
from emir_ros.shell import NodeError
from emir_ros.start import INTERRUPTED
from emir_ros.wire import Wire, stamp_ns

Array = NDArray[np.float64]
Part = tuple[str, list[Figure]]

START = 2.0  # s of simulated time in a short run, whose cost is that of starting and stopping
RATES = (31.25, 1000.0)  # Hz, at which latency is measured
PROCESSES = {"one": "one process", "many": "many processes"}
NUMBER = "position[0]"  # of a JointState's message
RECORDED_RATE = 25_000.0  # Hz
SETTLING = 30.0  # s within which two processes have to find each other


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure what the arguments say; returns the exit code."""
    options = _parser().parse_args(arguments)
    try:
        check_outputs([options.json], None, [])
        found = {}
        for title, figures in _parts(options):
            print(text(title, figures), flush=True)  # noqa: T201 (a command prints)
            found[title] = figures
        if options.json:
            write_json(found, options.json)
    except (InputError, NodeError, ParameterError) as error:
        sys.stderr.write(f"emir bench graph: {error}\n")
        return 1
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="emir bench graph", description=(
        "How fast the graph steps in lock step, how late messages and control periods are in real"
        " time, what the recorder takes, how fast recordings are read."
    ))  # fmt: skip
    for name, default, what in (
        ("simulated", 60.0, "simulated time of a run in lock step"),
        ("latency", 10.0, "time for each rate"),
        ("jitter", 20.0, "time of each run in real time, two unloaded and one loaded"),
        ("recorder", 10.0, "time during which messages are sent to the recorder"),
        ("reading", 3.0, "time for each reader"),
    ):
        about = f"{what}; default {default:g}"
        parser.add_argument(f"--{name}", type=_positive, default=default, metavar="S", help=about)
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures")
    return parser


def _positive(word: str) -> float:
    value = float(word)
    if not 0.0 < value < math.inf:
        raise argparse.ArgumentTypeError(f"{word}: has to be positive")
    return value


def _parts(options: argparse.Namespace) -> Iterator[Part]:
    with tempfile.TemporaryDirectory(prefix="emir-bench-") as name:
        folder = Path(name)
        for processes in ("one", "many"):
            yield _lockstep(folder, processes, options.simulated)
        yield from (_latency(rate, options.latency) for rate in RATES)
        for processes in ("one", "many"):
            title = f"Control period in real time, {PROCESSES[processes]}"
            yield title, _jitter(folder / f"alone-{processes}", processes, options.jitter)
        with _busy_processors():
            title = "The same, a busy process on every processor"
            figures = _jitter(folder / "loaded", "many", options.jitter)
        yield title, figures
        yield _recorder(folder / "recorder", options.recorder)
        bag = folder / f"{options.simulated:g}-one"
        yield "Reading that recording, every message decoded", reading_figures(bag, options.reading)


def _lockstep(folder: Path, processes: str, simulated: float) -> Part:
    """Run the whole graph, recorded; what a short run takes, too, does not count."""
    taken = []
    for name, duration in (("first", START), ("0", START), (f"{simulated:g}", START + simulated)):
        plan = Plan(bag=folder / f"{name}-{processes}", duration=duration)
        begin = time.perf_counter()
        _run(plan, processes)
        taken.append(time.perf_counter() - begin)
    seconds = taken[2] - taken[1]  # the first run loaded and compiled
    messages = sum(map(len, bags.read(plan.bag).values())) * simulated / (simulated + START)
    return f"Lock step in {PROCESSES[processes]}, recorded", [
        Figure("plant periods of 8 ms", simulated * 1e9 / PLANT_PERIOD_NS / seconds, "1/s"),
        Figure("control periods of 32 ms", simulated * 1e9 / CONTROL_PERIOD_NS / seconds, "1/s"),
        Figure("messages", messages / seconds, "1/s"),
        Figure("simulated time", simulated / seconds, "s/s"),
    ]


def _run(plan: Plan, processes: str) -> None:
    code = run_plan(plan, processes)
    if code == INTERRUPTED:
        raise KeyboardInterrupt
    if code != 0:
        raise NodeError("the graph did not run to its end")


def _latency(rate: float, seconds: float) -> Part:
    """Measure from before `publish` in one process to the callback in another.

    It begins when the first message has arrived: what is sent while both still get to know each
    other waits for that.
    """
    here, there = multiprocessing.get_context("spawn").Pipe()
    listener = multiprocessing.get_context("spawn").Process(target=_listen, args=(there,))
    listener.start()
    there.close()  # so that its end shows
    wire, period, sent = Wire(JOINT_STATES), 1.0 / rate, 0
    with ExitStack() as ending:
        ending.callback(listener.terminate)
        ending.enter_context(_told_if_it_ends())
        publisher = ending.enter_context(_publisher("bench", qos.offered(lockstep=False)))
        while not here.poll(0.01):
            publisher.publish(wire.encode(time.monotonic_ns(), {"angle": 0.0}))
        here.recv()
        begin = time.monotonic()
        while sent < rate * seconds:
            time.sleep(max(begin + sent * period - time.monotonic(), 0.0))
            publisher.publish(wire.encode(time.monotonic_ns(), {"angle": 0.0}))
            sent += 1
        publisher.wait_for_all_acked(Duration(seconds=SETTLING))
        time.sleep(0.1)
        here.send("enough")
        sent_at, late = np.array(here.recv()).T
        listener.join()
    late = late[sent_at >= begin]
    title = f"Latency between two processes at {rate:g} Hz"
    return title, [*_spread(late), Figure("lost", 100.0 * (1.0 - late.size / sent), "%")]


def _listen(connection: Connection) -> None:
    """Say that a message came, then report when each was sent and how long it took, s."""
    rclpy.init()
    node = rclpy.create_node("bench_listener")
    heard: list[tuple[float, float]] = []

    def receive(data: bytes) -> None:
        sent = stamp_ns(data)
        heard.append((sent * 1e-9, (time.monotonic_ns() - sent) * 1e-9))

    kind = conversions.message_class(JOINT_STATES.type)
    node.create_subscription(kind, "bench", receive, qos.offered(lockstep=False), raw=True)
    with make_executor() as executor, out_of_garbage_collection():
        executor.add_node(node)
        while not heard:
            executor.spin_once(timeout_sec=0.1)
        connection.send("heard")
        while not connection.poll():
            executor.spin_once(timeout_sec=0.1)
    connection.send(heard)
    node.destroy_node()
    rclpy.try_shutdown()


def _spread(seconds: Array) -> list[Figure]:
    """Return median, 99 % quantile and maximum, ms."""
    if not seconds.size:
        raise NodeError("no message arrived")
    median, late, most = np.quantile(seconds, [0.5, 0.99, 1.0]) * 1e3
    return [
        Figure("median", median, "ms"),
        Figure("p99", late, "ms"),
        Figure("largest", most, "ms"),
    ]


def _jitter(bag: Path, processes: str, seconds: float) -> list[Figure]:
    """Return how far the control period of the running graph is from 32 ms."""
    _run(Plan(bag=bag, trajectory="hold", duration=seconds + START, lockstep=False), processes)
    stamps = _recorded(bag, VALVE_COMMAND.name, NUMBER).stamp
    periods = np.diff(stamps[stamps >= stamps[0] + START * 1e9])  # when everybody has started
    return _spread(np.abs(periods - CONTROL_PERIOD_NS) * 1e-9)


def _recorded(bag: Path, topic: str, path: str) -> Columns:
    """Return one number of a topic's messages in a recording."""
    return columns.read(bag, {f"/{topic}": [path]})[f"/{topic}"]


@contextmanager
def _busy_processors() -> Iterator[None]:
    """Keep every processor busy with a process that computes and nothing else."""
    command = [sys.executable, "-c", "while True: pass"]
    busy = [subprocess.Popen(command) for _ in range(os.cpu_count() or 1)]  # noqa: S603 (our own)
    try:
        yield
    finally:
        for process in busy:
            process.kill()
            process.wait()


def _recorder(bag: Path, seconds: float, rate: float = RECORDED_RATE) -> Part:
    """Send numbered messages to a recorder of its own process; look for them in its file.

    Sender and recorder find each other while messages are sent already: the first one that is
    recorded begins the count.
    """
    words = ["--ros-args", "-p", f"bag:={bag}", "-p", f"topics:=[{JOINT_STATES.name}]"]
    recorder = subprocess.Popen(  # noqa: S603 (our own node)
        [sys.executable, "-P", "-m", "emir_ros.recorder_node", *words]
    )
    profile = qos.offered(lockstep=False)
    profile.depth = max(round(rate * qos.DEPTH * PLANT_PERIOD_NS * 1e-9), 1)
    wire, sent = Wire(JOINT_STATES), 0
    try:
        with _publisher(JOINT_STATES.name, profile) as publisher:
            begin = time.monotonic()
            while (now := time.monotonic() - begin) < seconds:
                while sent < now * rate:
                    publisher.publish(wire.encode(time.time_ns(), {"angle": float(sent)}))
                    sent += 1
                time.sleep(1e-4)
            publisher.wait_for_all_acked(Duration(seconds=SETTLING))
    finally:
        recorder.send_signal(signal.SIGINT)
        recorder.wait()
    numbers = _recorded(bag, JOINT_STATES.name, NUMBER).values[NUMBER]
    first = int(numbers.min())
    return f"Recorder, messages sent for {seconds:g} s", [
        Figure("sent", sent / now, "1/s"),
        Figure("recorded", numbers.size / now, "1/s"),
        Figure("lost", float(sent - first - numbers.size), "1"),
        Figure("sent before the first one recorded", float(first), "1"),
    ]


@contextmanager
def _told_if_it_ends() -> Iterator[None]:
    try:
        yield
    except EOFError:
        raise NodeError("the process that listens ended early") from None


@contextmanager
def _publisher(topic: str, profile: QoSProfile) -> Iterator[Any]:
    """Give what publishes joint states on a topic that somebody listens to."""
    rclpy.init()
    node = rclpy.create_node("bench_sender")
    try:
        kind = conversions.message_class(JOINT_STATES.type)
        publisher = node.create_publisher(kind, topic, profile)
        _find_listener(publisher)
        yield publisher
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


def _find_listener(publisher: Any) -> None:
    """Wait until somebody listens to what is to be published."""
    until = time.monotonic() + SETTLING
    while not publisher.get_subscription_count():
        if time.monotonic() > until:
            raise NodeError(f"nobody listens to {publisher.topic_name} within {SETTLING:g} s")
        time.sleep(0.01)


if __name__ == "__main__":
    sys.exit(main())
