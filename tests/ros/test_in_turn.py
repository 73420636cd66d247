"""Messages taken in turn: nobody starves beside two nodes that answer each other for ever."""

from collections.abc import Iterator
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")

from rclpy.task import Future
from std_msgs.msg import String
from std_srvs.srv import Trigger

from emir_msgs_py.topics import VALVE_COMMAND, VELOCITY_COMMAND, Topic
from emir_ros import qos
from emir_ros.in_turn import spin_in_turn
from emir_ros.main import StopRequest, make_executor, start_ros
from emir_ros.shell import Shell

LOCKSTEP = ["--ros-args", "-p", "lockstep:=true"]


class Player(Shell):
    """Answers each message with one of the next stamp."""

    def __init__(self, name: str, heard: Topic, said: Topic) -> None:
        super().__init__(name, [said], LOCKSTEP)
        self.said, self.stamp = said, 0
        self.hear(heard, self._answer, qos.offered(lockstep=True))

    def _answer(self, _: bytes) -> None:
        self.serve()

    def serve(self) -> None:
        """Say something."""
        self.stamp += 1
        self.publish_all(self.stamp, dict.fromkeys(self.said.fields, 0.0))


@pytest.fixture
def game(ros_domain: int) -> Iterator[tuple[list[Player], StopRequest]]:
    import rclpy

    stop = start_ros()
    players = [
        Player("first", VALVE_COMMAND, VELOCITY_COMMAND),
        Player("second", VELOCITY_COMMAND, VALVE_COMMAND),
    ]
    yield players, stop
    for player in players:
        player.destroy_node()
    rclpy.shutdown()


def _spin(players: list[Player], ended: Future, stop: StopRequest) -> None:
    with make_executor() as executor:
        players[0].serve()
        spin_in_turn(executor, players, ended, stop)


def test_services_and_messages_as_objects_are_heard_all_the_same(
    game: tuple[list[Player], StopRequest],
) -> None:
    (first, second), stop = game
    ended, heard = Future(), []

    def serve(_: Any, response: Trigger.Response) -> Trigger.Response:
        second.create_publisher(String, "word", qos.latched()).publish(String(data="served"))
        return response

    def hear(message: String) -> None:
        heard.append((message.data, first.stamp))
        ended.set_result(None)

    first.create_service(Trigger, "ask", serve)
    first.create_subscription(String, "word", hear, qos.latched())
    client = second.create_client(Trigger, "ask")
    assert client.wait_for_service(120.0)
    client.call_async(Trigger.Request())
    _spin([first, second], ended, stop)
    assert heard[0][0] == "served"
    assert second.stamp > 1


def test_told_to_stop_it_stops(game: tuple[list[Player], StopRequest]) -> None:
    players, stop = game
    stop.made = True
    with pytest.raises(KeyboardInterrupt):
        _spin(players, Future(), stop)
