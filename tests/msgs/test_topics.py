"""The table of topics against the objects and the messages that it speaks of."""

from collections import Counter
from types import SimpleNamespace

import pytest

from emir_msgs_py import conversions
from emir_msgs_py.meanings import field_table
from emir_msgs_py.robot_topics import JOINTS, ROBOT_TOPICS
from emir_msgs_py.topics import TOPICS, TRUTH, Topic, by_name
from emir_plant.core import Truth
from emir_plant.sensors import Measurement

EVERY = (*TOPICS, *ROBOT_TOPICS)
IDS = [f"{topic.name}-{len(topic.fields)}" for topic in EVERY]


@pytest.mark.parametrize("table", [TOPICS, ROBOT_TOPICS], ids=["joint1", "robot"])
def test_names_are_relative_and_signals_unique(table: tuple[Topic, ...]) -> None:
    assert not any(topic.name.startswith("/") for topic in table)
    assert max(Counter(topic.name for topic in table).values()) == 1
    assert max(Counter(signal for topic in table for signal in topic.fields).values()) == 1
    assert by_name("truth", table) in table
    assert by_name("truth") is TRUTH


def test_robot_has_joint_1s_topics_for_six() -> None:
    """Same name, type, quality and publisher; six numbers for each one of joint 1."""
    ours = {topic.name: topic for topic in ROBOT_TOPICS}
    shared = [topic for topic in TOPICS if topic.name in ours and topic is not TRUTH]
    assert {"joint_states", "cylinder_states", "valve_command"} <= {t.name for t in shared}
    for topic in shared:
        other = ours[topic.name]
        assert (other.type, other.quality) == (topic.type, topic.quality)
        assert other.publisher == topic.publisher
        wanted = {f"{joint}_{signal}" for joint in JOINTS for signal in topic.fields}
        assert set(other.fields) >= wanted
        forces = {name for name in other.fields if name.endswith(("_force", "_force_feedback"))}
        assert set(other.fields) - wanted <= forces  # which joint 1's own do not expect


def test_truth_has_the_models_outputs_in_their_order() -> None:
    names = [name.removeprefix("true_") for name in TRUTH.fields]
    assert names == list(Truth._fields)


def test_every_measurement_is_published() -> None:
    plants = {s for t in TOPICS if t.publisher == "plant_node" for s in t.fields}
    assert set(Measurement._fields) <= plants


@pytest.mark.parametrize("topic", EVERY, ids=IDS)
def test_every_field_has_a_meaning_of_its_own(topic: Topic) -> None:
    meanings = [entry["meaning"] for entry in field_table(topic).values()]
    assert all(meanings)
    assert len(set(meanings)) == len(meanings)


@pytest.mark.parametrize("topic", EVERY, ids=IDS)
def test_signals_survive_the_message_and_its_cdr(topic: Topic) -> None:
    serialization = pytest.importorskip("rclpy.serialization", reason="needs ROS 2")
    signals = {name: 0.1 + 1.7 * k for k, name in enumerate(topic.fields)}
    message = conversions.message(topic, 1_234_567_890_123, signals)
    cdr = serialization.serialize_message(message)
    back = serialization.deserialize_message(cdr, type(message))
    assert conversions.values(topic, back) == signals
    assert conversions.stamp_ns(back) == 1_234_567_890_123
    assert back.header.frame_id == topic.frame


def test_a_field_that_is_not_there_is_named() -> None:
    pytest.importorskip("rclpy", reason="needs ROS 2")
    message = conversions.message(by_name("valve_command"), 0, {"valve_command": 0.5})
    with pytest.raises(LookupError, match=r"no velocity\[3\]"):
        conversions.field_value(message, "velocity[3]")


def test_velocity_command_without_forces_is_one_whose_forces_are_not_known() -> None:
    command = {topic.name: topic for topic in ROBOT_TOPICS}["velocity_command"]
    given = SimpleNamespace(velocity=[0.01] * 6, effort=[])
    told = conversions.values(command, given)
    assert told["joint2_velocity_command"] == 0.01
    assert all(told[f"{joint}_expected_force"] == 0.0 for joint in JOINTS)
    with pytest.raises(LookupError, match=r"no velocity\[0\]"):
        conversions.values(command, SimpleNamespace(velocity=[], effort=[]))


def test_numbers_of_a_joint_state_belong_to_the_names_beside_them() -> None:
    """As in every JointState: whoever sends them may have another order, and more joints."""
    states = {topic.name: topic for topic in ROBOT_TOPICS}["joint_states"]
    given = SimpleNamespace(
        name=["gripper", *reversed(JOINTS)],
        position=[9.0, *(0.1 * k for k in reversed(range(6)))],
        velocity=[],
        effort=[],
    )
    told = conversions.values(states, given)
    assert [told[f"{joint}_angle"] for joint in JOINTS] == [0.1 * k for k in range(6)]
    given.effort = [5.0, 6.0]  # of whom nobody knows
    assert conversions.values(states, given) == told
    given.name[1] = "another"
    with pytest.raises(LookupError, match=f"no {JOINTS[-1]}, but gripper, another"):
        conversions.values(states, given)
    given.name[0], given.name[1] = JOINTS[0], JOINTS[-1]
    with pytest.raises(LookupError, match=f"names {JOINTS[0]} more than once"):
        conversions.values(states, given)


def test_a_command_to_another_valve_is_none_to_ours() -> None:
    given = SimpleNamespace(name=["some_other_valve"], position=[0.6], velocity=[], effort=[])
    with pytest.raises(LookupError, match="but some_other_valve"):
        conversions.values(by_name("valve_command"), given)
