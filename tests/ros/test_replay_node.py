"""A recording put into a live graph arrives whole, in its order, at the wanted speed."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rosbags.highlevel import AnyReader
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool
from waiting import until

from emir_common.quantity import ParameterError
from emir_ros import qos
from emir_ros.replay_node import ReplayNode

OWN_BAG = Path(__file__).parents[2] / "bags" / "lift"  # 3.2 s
TOPIC = "/joint_states"


class Listener(Node):
    """Keeps what it hears."""

    def __init__(self, topic: str = TOPIC) -> None:
        super().__init__("listener")
        self.heard: list[bytes] = []
        self.clock: list[int] = []
        self.matched = False
        profile = qos.offered(lockstep=True)
        profile.depth = 1000  # all of the recording, however slowly it is taken
        self.create_subscription(
            JointState, topic, self.heard.append, profile, raw=True,
            event_callbacks=SubscriptionEventCallbacks(matched=self._on_match),
        )  # fmt: skip
        self.create_subscription(Clock, "/clock", self._on_clock, 100)
        self.pause = self.create_client(SetBool, "replay_node/pause")

    def _on_match(self, _: object) -> None:
        self.matched = True

    def _on_clock(self, message: Clock) -> None:
        self.clock.append(message.clock.sec * 1_000_000_000 + message.clock.nanosec)


def _recorded() -> list[bytes]:
    with AnyReader([OWN_BAG]) as reader:
        wanted = [c for c in reader.connections if c.topic == TOPIC]
        return [bytes(data) for _, _, data in reader.messages(connections=wanted)]


def _replay(*settings: str) -> ReplayNode:
    words = [word for entry in settings for word in ("-p", entry)]
    return ReplayNode(["--ros-args", "-p", f"bag:={OWN_BAG}", *words])


def _spin(nodes: list[Any], condition: Callable[[], object]) -> None:
    executor = SingleThreadedExecutor()
    for node in nodes:
        executor.add_node(node)
    try:
        until(condition, lambda: executor.spin_once(timeout_sec=0.1))
    finally:
        for node in nodes:
            executor.remove_node(node)
        executor.shutdown()


@pytest.mark.usefixtures("ros")
def test_every_message_arrives_as_it_was_recorded() -> None:
    recorded = _recorded()
    listener, node = Listener(), _replay("rate:=5", "start_paused:=true")
    _spin([listener, node], lambda: listener.matched and listener.clock)
    listener.pause.call_async(SetBool.Request(data=False))
    _spin(
        [listener, node],
        lambda: len(listener.heard) >= len(recorded) and listener.clock[-1] >= 3_200_000_000,
    )  # bags/README.md
    assert node.done
    assert listener.heard == recorded
    assert listener.clock == sorted(listener.clock)


@pytest.mark.usefixtures("ros")
def test_paused_it_stands_still_and_goes_on_from_there() -> None:
    listener, node = Listener(), _replay("start_paused:=true")
    _spin([listener, node], lambda: len(listener.clock) > 5)
    assert set(listener.clock) == {0}  # the recording's first stamp
    answer = listener.pause.call_async(SetBool.Request(data=False))
    _spin([listener, node], lambda: answer.done() and listener.clock[-1] > 50_000_000)
    answer = listener.pause.call_async(SetBool.Request(data=True))
    _spin([listener, node], answer.done)
    heard, position = len(listener.heard), listener.clock[-1]
    _spin([listener, node], lambda: listener.clock.count(listener.clock[-1]) > 5)
    assert listener.clock[-1] - position < 20_000_000  # what was under way
    assert len(listener.heard) <= heard + 3
    assert not node.done


@pytest.mark.usefixtures("ros")
def test_inactive_it_publishes_nothing_and_begins_when_it_is_activated() -> None:
    ticks: list[float] = []
    listener, node = Listener(), _replay("autostart:=false")
    listener.create_timer(0.02, lambda: ticks.append(time.monotonic()))
    _spin([listener, node], lambda: listener.matched and len(ticks) > 20)
    assert listener.clock == []
    activated = time.monotonic_ns()
    node.trigger_configure()
    node.trigger_activate()
    _spin([listener, node], lambda: listener.heard and listener.clock)
    active = time.monotonic_ns() - activated
    assert listener.clock[0] < active  # and not the 0.4 s that it was inactive besides


@pytest.mark.usefixtures("ros")
def test_the_speed_can_be_changed_on_the_way() -> None:
    listener, node = Listener(), _replay("rate:=0.1")
    _spin([listener, node], lambda: listener.clock)
    (refused,) = node.set_parameters([Parameter("rate", value=-1.0)])
    assert not refused.successful
    for bad in (-1, 2000, "fast"):
        (refused,) = node.set_parameters([Parameter("rate", value=bad)])
        assert not refused.successful
        assert "rate = " in refused.reason
    (accepted,) = node.set_parameters([Parameter("rate", value=500)])  # no need of 500.0
    assert accepted.successful
    started = time.monotonic()
    _spin([listener, node], lambda: node.done)
    assert time.monotonic() - started < 0.5 * 32.0  # at a tenth it would have taken 32 s


@pytest.mark.usefixtures("ros")
def test_a_recording_damaged_from_the_start_is_one_line(tmp_path: Path) -> None:
    content = bytearray(next(OWN_BAG.glob("*.mcap")).read_bytes())
    content[30_000:30_100] = bytes(100)  # in the first of its chunks
    file = tmp_path / "damaged.mcap"
    file.write_bytes(content)
    with pytest.raises(ParameterError, match=r"replay_node: .*damaged\.mcap: damaged"):
        ReplayNode(["--ros-args", "-p", f"bag:={file}"])


BAD = {
    "no bag": ("bag:=''", "bag: the recording to replay is missing"),
    "nowhere": ("bag:=nowhere", "nowhere: no such recording"),
    "topic": ("topics:=['/speed']", "topic /speed is not recorded; there are: /boom_deflection"),
    "rate": ("rate:=-1.0", "replay_node: rate = -1: outside 0.01 ... 1000"),
    "rate's type": ("rate:=fast", "replay_node: rate = 'fast': not of type float"),
}


@pytest.mark.usefixtures("ros")
@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_one_clear_line(case: str) -> None:
    setting, said = BAD[case]
    with pytest.raises(ParameterError) as caught:
        _replay(setting)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)
