"""Which recorded topic is which of the graph's."""

from pathlib import Path

import pytest
from mcap.writer import Writer

from emir_analysis.cli import main
from emir_analysis.errors import InputError
from emir_analysis.graph_topics import graph_topics
from emir_msgs_py.topics import CYLINDER_STATES, OFFERED_COMMANDS, TOPICS, VELOCITY_COMMAND


def _recorded(folder: Path, names: list[str]) -> Path:
    """Return a recording that has topics and no message."""
    bag = folder / "some.mcap"
    with bag.open("wb") as stream:
        writer = Writer(stream)
        writer.start()  # type: ignore[no-untyped-call]  # mcap's, untyped
        schema = writer.register_schema("sensor_msgs/msg/JointState", "ros2msg", b"")
        for name in names:
            writer.register_channel(name, "cdr", schema)
        writer.finish()  # type: ignore[no-untyped-call]
    return bag


@pytest.mark.parametrize("namespace", ["", "/rig", "/hall/rig"])
def test_any_namespace_will_do(namespace: str, tmp_path: Path) -> None:
    there = graph_topics(_recorded(tmp_path, [f"{namespace}/{topic.name}" for topic in TOPICS]))
    for topic in TOPICS:
        assert there.full_name(topic) == f"{namespace}/{topic.name}"


def test_what_a_controller_offers_is_not_what_drives(tmp_path: Path) -> None:
    there = graph_topics(_recorded(tmp_path, ["/cascade/velocity_command", "/velocity_command"]))
    assert there.full_name(VELOCITY_COMMAND) == "/velocity_command"
    assert there.full_name(OFFERED_COMMANDS["cascade"]) == "/cascade/velocity_command"


def test_two_machines_in_one_recording_are_not_mixed(tmp_path: Path) -> None:
    names = [f"/{rig}/{topic.name}" for rig in ("left", "right") for topic in TOPICS]
    with pytest.raises(InputError, match=r"more than one machine: /left/cyl.*, /right/cyl"):
        graph_topics(_recorded(tmp_path, names)).full_name(CYLINDER_STATES)


@pytest.mark.parametrize("words", [["analyze"], ["diagnose"], ["view", "--bag"]])
def test_commands_refuse_two_machines(
    words: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    names = [f"/{rig}/{topic.name}" for rig in ("a", "b") for topic in TOPICS]
    assert main([*words, str(_recorded(tmp_path, names))]) == 1
    assert "of more than one machine: /a/" in capsys.readouterr().err
