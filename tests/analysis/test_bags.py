"""Recordings written by `rosbags` are read back as they are; bad ones are told in one line."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import recorded
from rosbags.highlevel import AnyReader

from emir_analysis import bags
from emir_analysis.errors import InputError
from emir_analysis.signals import Source, load, read_signal_map

TIME = np.arange(500) * 0.01
ANGLE = np.sin(TIME)
PRESSURE = 1e7 + 1e5 * np.cos(TIME)
ANGLE_SOURCE = Source("/rig/joint_states", "position[0]", "rad")


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    """A recording of two topics that arrived 50 ms after their stamps."""
    path = tmp_path / "bag"
    topics = {"joint_states": (TIME, ANGLE), "pressure_lifting": (TIME, PRESSURE)}
    recorded.write_bag(path, topics, delay=0.05)
    return path


def test_the_messages_are_those_written(bag: Path) -> None:
    messages = bags.read(bag)
    assert set(messages) == {"/rig/joint_states", "/rig/pressure_lifting"}
    joint = messages["/rig/joint_states"]
    assert [message.data.position[0] for message in joint] == ANGLE.tolist()
    assert [message.stamp for message in joint[:3]] == [
        recorded.START + k * 10_000_000 for k in range(3)
    ]
    assert all(message.log_time - message.stamp == 50_000_000 for message in joint)


def test_signals_are_timed_by_the_headers(bag: Path) -> None:
    pressure = Source("/rig/pressure_lifting", "fluid_pressure", "Pa")
    recording = load(bag, {"angle": ANGLE_SOURCE, "pressure": pressure})
    assert recording.start_ns == recorded.START
    np.testing.assert_allclose(recording["angle"].time, TIME, atol=1e-9)
    np.testing.assert_array_equal(recording["angle"].value, ANGLE)
    np.testing.assert_array_equal(recording["pressure"].value, PRESSURE)
    assert recording["pressure"].unit == "Pa"


def test_a_file_alone_and_a_folder_without_metadata_are_read(bag: Path) -> None:
    whole = bags.read(bag)
    file = next(bag.glob("*.mcap"))
    assert bags.read(file).keys() == whole.keys()
    (bag / "metadata.yaml").unlink()
    assert len(bags.read(bag)["/rig/joint_states"]) == len(whole["/rig/joint_states"])


def test_a_recording_that_was_cut_off_is_read_as_far_as_it_goes(bag: Path) -> None:
    file = next(bag.glob("*.mcap"))
    content = file.read_bytes()
    file.write_bytes(content[: -len(content) // 20])  # without the index, in mid-record
    angle = load(bag, {"angle": ANGLE_SOURCE})["angle"]
    np.testing.assert_array_equal(angle.value, ANGLE[: angle.value.size])
    assert angle.value.size > 100


def _no_path(bag: Path) -> tuple[Path, str]:
    return bag / "nowhere", "no such recording"


def _no_mcap(bag: Path) -> tuple[Path, str]:
    next(bag.glob("*.mcap")).unlink()
    return bag, "no .mcap file"


def _part_missing(bag: Path) -> tuple[Path, str]:
    file = next(bag.glob("*.mcap"))
    file.rename(file.with_name("part_1.mcap"))
    return bag, f"{file.name}, which its metadata.yaml lists, is missing"


def _other_storage(bag: Path) -> tuple[Path, str]:
    file = next(bag.glob("*.mcap"))
    file.rename(file.with_name("bag_0.db3"))
    metadata = bag / "metadata.yaml"
    metadata.write_text(metadata.read_text().replace(file.name, "bag_0.db3"))
    return bag, "bag_0.db3 is no .mcap file; `ros2 bag convert` makes one"


def _no_topic(bag: Path) -> tuple[Path, str]:
    recorded.write_bag(bag.parent / "other", {"cylinder": (TIME, ANGLE)})
    return bag.parent / "other", "/rig/joint_states is not recorded; there are: /rig/cylinder"


def _not_mcap(bag: Path) -> tuple[Path, str]:
    next(bag.glob("*.mcap")).write_bytes(b"something else entirely, long enough to look at")
    return bag, "damaged"


def _no_message(bag: Path) -> tuple[Path, str]:
    file = next(bag.glob("*.mcap"))
    file.write_bytes(file.read_bytes()[:40])
    return bag, "there are: none"


@pytest.mark.parametrize(
    "spoil",
    [_no_path, _no_mcap, _part_missing, _other_storage, _no_topic, _not_mcap, _no_message],
)
def test_what_cannot_be_read_is_told_in_one_line(
    bag: Path, spoil: Callable[[Path], tuple[Path, str]]
) -> None:
    path, reason = spoil(bag)
    with pytest.raises(InputError, match=reason) as told:
        load(path, {"angle": ANGLE_SOURCE})
    assert str(path) in str(told.value)
    assert "\n" not in str(told.value)


@pytest.mark.parametrize(
    ("time", "value", "reason"),
    [
        (TIME[:1], ANGLE[:1], "too few"),
        (np.append(TIME, 1.0), np.append(ANGLE, 0.0), "two messages with one stamp at 1.000 s"),
        (TIME, np.where(TIME == 2.0, np.nan, ANGLE), "nan at 2.000 s"),
    ],
)
def test_a_signal_that_is_none_is_told(
    tmp_path: Path, time: recorded.Array, value: recorded.Array, reason: str
) -> None:
    recorded.write_bag(tmp_path / "bag", {"joint_states": (time, value)})
    with pytest.raises(InputError, match=reason):
        load(tmp_path / "bag", {"angle": ANGLE_SOURCE})


def test_stamps_that_go_back_are_told(tmp_path: Path) -> None:
    time = TIME.copy()
    time[[100, 101]] = time[[101, 100]]
    topics = {"joint_states": (time, ANGLE)}
    recorded.write_bag(tmp_path / "bag", topics, stamped_otherwise=True)
    with pytest.raises(InputError, match=r"stamps out of order at 1\.000 s"):
        load(tmp_path / "bag", {"angle": ANGLE_SOURCE})


@pytest.mark.parametrize("field", ["position[1]", "velocity[0]", "angle", "name[0]", "header"])
def test_a_field_that_is_no_number_is_told(bag: Path, field: str) -> None:
    with pytest.raises(InputError, match="field"):
        load(bag, {"angle": Source("/rig/joint_states", field, "rad")})


@pytest.mark.parametrize("text", ["", "[1, 2]", "angle: {topic: /a}", "a: {b: [", "angle: 3"])
def test_a_signal_map_that_is_none_is_told(tmp_path: Path, text: str) -> None:
    file = tmp_path / "signals.yaml"
    file.write_text(text)
    with pytest.raises(InputError, match=r"signals\.yaml"):
        read_signal_map(file)


def test_another_reader_reads_the_same(shared: Path) -> None:
    path = shared / "recordings" / "elm_a"
    messages = bags.read(path, ["/rig/cylinder", "/rig/pressure_lifting"])
    with AnyReader([path]) as reader:
        for topic, field in (("/rig/cylinder", "position"), ("/rig/pressure_lifting", None)):
            chosen = [c for c in reader.connections if c.topic == topic]
            expected = [
                (log_time, reader.deserialize(data, connection.msgtype))
                for connection, log_time, data in reader.messages(chosen)
            ]
            assert [m.log_time for m in messages[topic]] == [log_time for log_time, _ in expected]
            values = [
                m.data.position[0] if field else m.data.fluid_pressure for m in messages[topic]
            ]
            assert values == [m.position[0] if field else m.fluid_pressure for _, m in expected]
