"""Split, compressed and flushed recordings, read by `rosbags` and by mcap's own reader."""

import os
import resource
import signal
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from mcap.reader import make_reader
from mcap.records import Attachment, Schema
from rosbags.highlevel import AnyReader

from emir_analysis import bags
from emir_analysis.info import info
from emir_analysis.rosbag2_writer import CHUNK, Rosbag2Writer
from emir_common.quantity import ParameterError

HEADER = Schema(
    0,
    b"builtin_interfaces/Time stamp\nstring frame_id\n" + b"=" * 80
    + b"\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n",
    "ros2msg",
    "std_msgs/msg/Header",
)  # fmt: skip
SECOND = 1_000_000_000


def _header(k: int) -> bytes:
    """A std_msgs/Header in CDR: encapsulation, sec, nanosec, empty string."""
    return b"\0\1\0\0" + k.to_bytes(4, "little") + bytes(4) + b"\1\0\0\0\0"


def _write(writer: Rosbag2Writer, count: int) -> None:
    """One message a second on /a."""
    writer.add_metadata("emir", {"controller": "cascade"})
    writer.add_topic("/a", HEADER, {})
    for k in range(count):
        writer.write("/a", _header(k), k * SECOND, k * SECOND)


@pytest.mark.parametrize("told", ["x, y", "[1]", '{"x": "m"}', '{"x": {"unit": "m"}}'])
def test_what_others_say_of_a_topic_is_no_table_of_ours(told: str, tmp_path: Path) -> None:
    with Rosbag2Writer(tmp_path / "bag") as writer:
        writer.add_topic("/a", HEADER, {"fields": told})
        writer.write("/a", _header(0), 0, 0)
    assert info(tmp_path / "bag").topics["/a"].fields == {}


@pytest.mark.parametrize("compression", ["none", "zstd"])
def test_a_recording_split_by_time_is_one_to_its_readers(compression: str, tmp_path: Path) -> None:
    with Rosbag2Writer(tmp_path / "bag", compression, max_duration=2.0) as writer:
        _write(writer, 25)
    names = [file.name for file in bags.files(tmp_path / "bag")]
    assert names == [f"bag_{k}.mcap" for k in range(13)]
    with AnyReader([tmp_path / "bag"]) as reader:
        assert [data for _, _, data in reader.messages()] == [_header(k) for k in range(25)]
        assert reader.message_count == 25
        assert reader.duration == 24 * SECOND + 1  # rosbags counts the last nanosecond
    assert [m.data.stamp.sec for m in bags.read(tmp_path / "bag")["/a"]] == list(range(25))
    assert info(tmp_path / "bag").topics["/a"].count == 25
    about = yaml.safe_load((tmp_path / "bag" / "metadata.yaml").read_text())
    entries = about["rosbag2_bagfile_information"]["files"]
    assert [entry["message_count"] for entry in entries] == [2] * 12 + [1]
    for name in names:  # each explains itself
        with (tmp_path / "bag" / name).open("rb") as stream:
            stored = {r.name: r.metadata for r in make_reader(stream).iter_metadata()}
        assert stored["emir"] == {"controller": "cascade"}


def test_what_comes_late_makes_a_file_no_longer(tmp_path: Path) -> None:
    """A message of the very beginning behind the first and behind others of every file."""
    with Rosbag2Writer(tmp_path / "bag", max_duration=2.0) as writer:
        writer.add_topic("/a", HEADER, {})
        for k in range(6):
            for at in (k, 0, k):
                writer.write("/a", _header(at), at * SECOND, at * SECOND)
    about = yaml.safe_load((tmp_path / "bag" / "metadata.yaml").read_text())
    entries = about["rosbag2_bagfile_information"]["files"]
    assert [entry["message_count"] for entry in entries] == [6, 6, 6]


def test_a_file_that_has_grown_to_its_size_is_followed_by_another(tmp_path: Path) -> None:
    with Rosbag2Writer(tmp_path / "bag", max_size=1_200_000) as writer:
        writer.add_topic("/a", HEADER, {})
        for k in range(4000):
            writer.write("/a", bytes(1000), k, k)
    sizes = [file.stat().st_size for file in bags.files(tmp_path / "bag")]
    assert len(sizes) == 4  # of four megabytes
    assert max(sizes) < 1_200_000 + 2 * CHUNK + 10_000  # a chunk, then the index


def test_zstd_is_smaller_and_the_same(tmp_path: Path) -> None:
    sizes = {}
    for compression in ("none", "zstd"):
        with Rosbag2Writer(tmp_path / compression, compression) as writer:
            _write(writer, 5000)
        sizes[compression] = next((tmp_path / compression).glob("*.mcap")).stat().st_size
    assert sizes["zstd"] < 0.7 * sizes["none"]


def test_an_unknown_compression_is_refused_before_anything_is_made(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="compression 'zip': there are none, zstd"):
        Rosbag2Writer(tmp_path / "bag", "zip")
    assert not (tmp_path / "bag").exists()


def test_an_empty_folder_is_taken_and_a_filled_one_is_not_written_over(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    folder.mkdir()
    with Rosbag2Writer(folder) as writer:
        _write(writer, 1)
    before = sorted(folder.iterdir())
    with pytest.raises(ParameterError, match="exists already, and is not overwritten"):
        Rosbag2Writer(folder)
    with pytest.raises(ParameterError, match="exists already, and is not overwritten"):
        Rosbag2Writer(before[0])  # a file of that name
    assert sorted(folder.iterdir()) == before


@pytest.mark.parametrize("what", ["attachment", "topic", "message"])
def test_a_full_disk_is_told_as_the_caller_wants_it(what: str, tmp_path: Path) -> None:
    """A limit on the file's size stands for the end of the disk; the system says the same."""
    writer = Rosbag2Writer(tmp_path / "bag", failure=lambda said: RuntimeError(f"rig: {said}"))
    _write(writer, 1)
    large = bytes(4 * CHUNK)
    fill = {
        "attachment": lambda: writer.add_attachment(Attachment(0, 0, "a", "b", large)),
        "topic": lambda: writer.add_topic("/b", Schema(0, large, "ros2msg", "x/msg/B"), {}),
        "message": lambda: writer.write("/a", large, SECOND, SECOND),
    }
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (CHUNK, limits[1]))
    try:
        with pytest.raises(RuntimeError, match=r"rig: .*bag_0\.mcap: File too large: recording"):
            fill[what]()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert writer.closed


def test_what_was_flushed_outlives_the_process(tmp_path: Path) -> None:
    """Killed by SIGKILL right behind a flush: all is there, although no chunk was full."""
    script = (
        "import os, signal, sys; from pathlib import Path; from mcap.records import Schema;"
        "from emir_analysis.rosbag2_writer import Rosbag2Writer;"
        "w = Rosbag2Writer(Path(sys.argv[1]));"
        "w.add_topic('/a', Schema(0, b'byte[] data', 'ros2msg', 'x/msg/Bytes'), {});"
        "[w.write('/a', bytes(10), k, k) for k in range(30)];"
        "w.flush();"
        "os.kill(os.getpid(), signal.SIGKILL)"
    )
    finished = subprocess.run(
        [sys.executable, "-c", script, str(tmp_path / "bag")], env=os.environ, check=False
    )
    assert finished.returncode == -signal.SIGKILL
    assert info(tmp_path / "bag").topics["/a"].count == 30
