"""Speed of reading a recording, beside other libraries that decode every message of it.

Ours twice: as the analysis reads, the numbers of every field that the recording explains as
columns; and as objects, all of them held.
"""

from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

from emir_analysis import bags, columns
from emir_analysis.bench.timing import Contender, Figure, rates
from emir_analysis.info import info


def reading_figures(bag: Path, seconds: float) -> list[Figure]:
    """Return messages decoded per second; seconds: about what each reader gets."""
    messages = sum(len(of_topic) for of_topic in bags.read(bag).values())

    def contender(name: str, run: Callable[[Path], None]) -> Contender:
        return Contender(name, lambda: run(bag), messages)

    found = [
        contender("emir_analysis.columns", _columns(bag)),
        contender("emir_analysis.bags", _objects),
        contender("mcap-ros2-support", _mcap),
    ]
    if find_spec("rosbags") is None:
        missing = [Figure("rosbags", None, "1/s", note="rosbags is not installed")]
        return rates(found, "1/s", seconds) + missing
    return rates([*found, contender("rosbags", _rosbags)], "1/s", seconds)


def _columns(bag: Path) -> Callable[[Path], None]:
    explained = {
        name: [entry["path"] for entry in topic.fields.values()]
        for name, topic in info(bag).topics.items()
        if topic.fields
    }

    def read(bag: Path) -> None:
        columns.read(bag, explained)

    return read


def _objects(bag: Path) -> None:
    bags.read(bag)


def _mcap(bag: Path) -> None:
    from mcap_ros2.reader import read_ros2_messages  # noqa: PLC0415 (only wanted here)

    for file in bags.files(bag):
        for message in read_ros2_messages(file):
            _ = message.ros_msg


def _rosbags(bag: Path) -> None:
    from rosbags.highlevel import AnyReader  # noqa: PLC0415 (as above)

    with AnyReader([bag]) as reader:
        for connection, _, data in reader.messages():
            reader.deserialize(data, connection.msgtype)
