"""`ros2 run emir_ros <node>`: every node is found, starts, and ends well when it is told to."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from emir_msgs_py.topics import OFFERED_COMMANDS, TOPICS, VALVE_COMMAND

rclpy = pytest.importorskip("rclpy", reason="ROS 2 is not installed")

from ament_index_python.packages import PackageNotFoundError, get_package_prefix  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.signals import SignalHandlerOptions  # noqa: E402

PACKAGE = "emir_ros"
NODES = (
    "cascade_node",
    "force_loop_node",
    "lqg_node",
    "mpc_node",
    "pfc_node",
    "pfc_tip_node",
    "plant_node",
    "recorder_node",
    "selector_node",
    "trajectory_node",
)
DEADLINE = 120.0  # s; the machine's first start compiles it

OFFERED = {topic.name for topic in OFFERED_COMMANDS.values()}  # by one of several controllers
PUBLISHED = {name: {t.name for t in TOPICS if name in t.publishers} - OFFERED for name in NODES}
SUBSCRIBED = {"plant_node": {VALVE_COMMAND.name}, "recorder_node": {t.name for t in TOPICS}}


def executables() -> dict[str, Path]:
    """Return the package's executables by name, looked up as ros2cli does.

    ros2pkg.api.get_executable_paths: the prefix from the ament index, then every file below
    <prefix>/lib/<package> that may be executed.
    """
    try:
        prefix = Path(get_package_prefix(PACKAGE))
    except (PackageNotFoundError, OSError):
        pytest.skip(f"{PACKAGE} is not in the ament index: `pip install .` puts it there, -e not")
    paths = (prefix / "lib" / PACKAGE).rglob("*")
    return {path.name: path for path in paths if path.is_file() and os.access(path, os.X_OK)}


@pytest.fixture
def observer() -> Iterator[Node]:
    """Yield a node that looks at the graph."""
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    try:
        node = Node("observer")
        yield node
        node.destroy_node()
    finally:
        rclpy.shutdown()


def missing_topics(observer: Node, name: str) -> list[str]:
    """Return which of the node's topics the graph does not show."""
    published = [f"publishes {t}" for t in PUBLISHED[name] if not observer.count_publishers(t)]
    subscribed = SUBSCRIBED.get(name, set())
    return published + [f"takes {t}" for t in subscribed if not observer.count_subscribers(t)]


def wait_until_seen(observer: Node, name: str, process: subprocess.Popen[str]) -> None:
    """Return once the graph shows all the node's topics; fail when it ends or takes too long."""
    deadline = time.monotonic() + DEADLINE
    while missing := missing_topics(observer, name):
        assert process.poll() is None, f"{name} ended early"
        assert time.monotonic() < deadline, f"{name}: not seen that it {', '.join(missing)}"
        rclpy.spin_once(observer, timeout_sec=0.05)


def test_every_node_has_an_executable() -> None:
    assert executables().keys() >= set(NODES)


@pytest.mark.parametrize("stop", [signal.SIGINT, signal.SIGTERM], ids=lambda s: str(s.name))
@pytest.mark.parametrize("name", NODES)
def test_node_starts_and_stops(
    name: str, stop: signal.Signals, observer: Node, tmp_path: Path
) -> None:
    command = [str(executables()[name])]
    if name == "recorder_node":
        command += ["--ros-args", "-p", f"bag:={tmp_path / 'bag'}"]
    said = tmp_path / "said"
    traced = os.environ | {"PYTHONFAULTHANDLER": "1"}  # says where, should one ever crash
    with (
        said.open("w") as output,
        subprocess.Popen(command, stdout=output, stderr=output, text=True, env=traced) as process,
    ):
        try:
            wait_until_seen(observer, name, process)
            process.send_signal(stop)
            process.wait(DEADLINE)
        finally:
            process.kill()
    assert process.returncode == 0, said.read_text()
    assert "Traceback" not in said.read_text()
    if name == "recorder_node":
        assert "nothing is recorded: no message came of /joint_states" in said.read_text()


@pytest.mark.parametrize("stop", [signal.SIGINT, signal.SIGTERM], ids=lambda s: str(s.name))
def test_told_to_stop_while_it_loads(stop: signal.Signals, tmp_path: Path) -> None:
    slow = tmp_path / "numpy.py"  # in place of what every node loads
    slow.write_text(f"import signal\nsignal.raise_signal({int(stop)})\n")
    command = [sys.executable, "-m", "emir_ros.start", "plant_node"]
    here = os.environ | {"PYTHONPATH": os.pathsep.join([str(tmp_path), *sys.path])}
    finished = subprocess.run(
        command, capture_output=True, text=True, timeout=DEADLINE, check=False, env=here
    )
    assert (finished.returncode, finished.stderr) == (0, "")


@pytest.mark.parametrize("words", [[], ["shell"], ["no_node"]], ids=" ".join)
def test_what_is_no_node_is_refused_in_one_line(words: list[str]) -> None:
    command = [sys.executable, "-m", "emir_ros.start", *words]
    finished = subprocess.run(
        command, capture_output=True, text=True, timeout=DEADLINE, check=False
    )
    assert finished.returncode == 1
    assert finished.stderr.endswith("given, not the name of a node\n")
    assert finished.stderr.count("\n") == 1


@pytest.mark.parametrize(("name", "who"), [("run", "emir run"), ("bench", "emir bench graph")])
def test_the_graph_told_to_stop_while_it_loads(name: str, who: str, tmp_path: Path) -> None:
    slow = tmp_path / "numpy.py"  # in place of what it loads
    slow.write_text("import signal\nsignal.raise_signal(signal.SIGINT)\n")
    command = [sys.executable, "-m", "emir_ros.start", name]
    here = os.environ | {"PYTHONPATH": os.pathsep.join([str(tmp_path), *sys.path])}
    finished = subprocess.run(
        command, capture_output=True, text=True, timeout=DEADLINE, check=False, env=here
    )
    assert (finished.returncode, finished.stderr) == (130, f"{who}: interrupted\n")


@pytest.mark.parametrize("when", ["after", "at the end of"])
def test_a_measurement_is_stopped_also_between_its_runs(when: str, tmp_path: Path) -> None:
    """The first run, in this process, hears of signals in its own way, to its end."""
    raising = "lambda *_: signal.raise_signal(signal.SIGINT)"
    script = (
        "import signal, sys; from pathlib import Path; from emir_ros import bench, run, start\n"
        f"if sys.argv[1] == 'after': then = {raising}\n"
        f"else: run.take_the_rest = {raising}; then = lambda: print('went on')\n"
        "plan = bench.Plan(bag=Path(sys.argv[2]), duration=0.1)\n"
        "bench._parts = lambda _: iter([(bench._run(plan, 'one'), then())])\n"
        "sys.argv[1:] = ['bench']; start.main()"
    )
    finished = subprocess.run(
        [sys.executable, "-c", script, when, str(tmp_path / "bag")],
        capture_output=True,
        text=True,
        timeout=DEADLINE,
        check=False,
    )
    assert finished.returncode == 130, finished.stderr
    assert finished.stderr.splitlines()[-1] == "emir bench graph: interrupted"
    assert "Traceback" not in finished.stderr
    assert finished.stdout == ""


@pytest.mark.parametrize("words", [["-p", "gain:=1.0"], ["--help"], ["gain:=1.0", "--ros-args"]])
def test_what_no_node_knows_is_refused(words: list[str]) -> None:
    """Such as parameters without --ros-args, which would not be set."""
    command = [sys.executable, "-m", "emir_ros.start", "cascade_node", *words]
    finished = subprocess.run(
        command, capture_output=True, text=True, timeout=DEADLINE, check=False
    )
    given = " ".join(word for word in words if word != "--ros-args")
    said = f"cannot start: {given}: not known; parameters are given by --ros-args -p NAME:=VALUE\n"
    assert (finished.returncode, finished.stderr) == (1, said)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--bogus"], "cannot start: UnknownROSArgsError"),
        (["--params-file", "missing.yaml"], "missing.yaml"),
        (["-p", "gain:=[1,2"], "gain:=[1,2"),
        (["-r", "__ns:=1bad"], "__ns:=1bad"),
        (["-p", "use_sim_time:=3"], "use_sim_time"),
        (["-p", "input_timeout:=.nan"], "cascade_node: input_timeout = nan: outside 0 ... 60 s"),
        (["-p", "input_timeout:=-1.0"], "cascade_node: input_timeout = -1: outside 0 ... 60 s"),
    ],
    ids=lambda value: value[-1] if isinstance(value, list) else "",
)
def test_bad_ros_arguments_are_refused_without_a_traceback(words: list[str], said: str) -> None:
    """In one line of our own; rcl may log one before it."""
    command = [sys.executable, "-m", "emir_ros.start", "cascade_node", "--ros-args", *words]
    finished = subprocess.run(
        command, capture_output=True, text=True, timeout=DEADLINE, check=False
    )
    assert finished.returncode == 1
    own = [line for line in finished.stderr.splitlines() if "[rcl]" not in line]
    assert len(own) == 1
    assert said in own[0]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["-p", "description:=nojson"], "recorder_node: description = 'nojson': not JSON"),
        (["-p", "description:='[1, 2]'"], "not JSON of texts by key"),
        (["-p", "nodes:=[bad name]"], "bad name"),
    ],
    ids=lambda value: value[1] if isinstance(value, list) else "",
)
def test_a_recorder_that_cannot_start_leaves_no_folder(
    words: list[str], said: str, tmp_path: Path
) -> None:
    bag = tmp_path / "bag"
    command = [sys.executable, "-m", "emir_ros.start", "recorder_node"]
    finished = subprocess.run(
        [*command, "--ros-args", "-p", f"bag:={bag}", *words],
        capture_output=True, text=True, timeout=DEADLINE, check=False,
    )  # fmt: skip
    assert finished.returncode == 1
    assert said in finished.stderr
    assert "Traceback" not in finished.stderr
    assert not bag.exists()


STUCK = """
import emir_ros.main
from emir_ros.cascade_node import CascadeNode

class Stuck(CascadeNode):
    def __init__(self):
        super().__init__()
        self.end()

    def destroy_node(self):
        while True:
            pass

emir_ros.main.LONGEST_END = 1
emir_ros.main.run(Stuck)
"""


def test_what_goes_wrong_at_the_very_end_is_one_line() -> None:
    """Such as a disk that is full just when the recording is finished."""
    script = (
        "from emir_ros.main import run; from emir_ros.shell import NodeError, Shell\n"
        "class Node(Shell):\n"
        "    def __init__(self): super().__init__('rig', []); self.ended.set_result(None)\n"
        "    def close(self): raise NodeError('rig: disk full')\n"
        "run(Node)"
    )
    finished = subprocess.run(
        [sys.executable, "-c", script],
        capture_output=True,
        text=True,
        timeout=DEADLINE,
        check=False,
    )
    assert (finished.returncode, finished.stderr) == (1, "rig: disk full\n")


def test_a_node_that_cannot_end_is_ended() -> None:
    command = [sys.executable, "-c", STUCK]
    finished = subprocess.run(
        command, capture_output=True, text=True, timeout=DEADLINE, check=False
    )
    assert finished.returncode == -signal.SIGALRM
    assert "Traceback" not in finished.stderr
