"""Recordings cut off at any byte are made whole; `rosbags` is the judge of that."""

import resource
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import recorded
import yaml
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from emir_analysis.cli import main
from emir_analysis.errors import InputError
from emir_analysis.recover import recover
from emir_analysis.rosbag2_writer import CHUNK

OWN_BAG = Path(__file__).parents[2] / "bags" / "lift"

Raw = list[tuple[str, str, int, bytes]]


def _raw(bag: Path) -> Raw:
    """Topic, type, log time and payload of each message, by another reader."""
    with AnyReader([bag]) as reader:
        return [(c.topic, c.msgtype, time, data) for c, time, data in reader.messages()]


def _cut(bag: Path, folder: Path, share: float) -> Path:
    """What a recorder leaves that was killed: no metadata.yaml, and the file ends anywhere."""
    folder.mkdir()
    content = next(bag.glob("*.mcap")).read_bytes()
    (folder / "cut_0.mcap").write_bytes(content[: round(share * len(content))])
    return folder


@pytest.mark.parametrize("share", [0.3, 0.77, 0.999])
def test_what_is_recovered_is_what_was_recorded(share: float, tmp_path: Path) -> None:
    out = tmp_path / "whole"
    saved = recover(_cut(OWN_BAG, tmp_path / "cut", share), out)
    before, after = _raw(OWN_BAG), _raw(out)
    assert after == before[: len(after)]
    assert len(after) == saved.messages
    assert len(after) > (share - 0.2) * len(before)  # a chunk, 64 KiB of 470, may be lost
    assert not saved.damage


def test_the_recovered_recording_is_complete(tmp_path: Path) -> None:
    out = tmp_path / "whole"
    recover(_cut(OWN_BAG, tmp_path / "cut", 0.8), out)
    text = (out / "metadata.yaml").read_text()
    about = yaml.safe_load(text)["rosbag2_bagfile_information"]
    assert about["version"] == 9
    assert about["message_count"] == len(_raw(out))
    with (
        (out / "whole_0.mcap").open("rb") as new_file,
        next(OWN_BAG.glob("*.mcap")).open("rb") as old_file,
    ):
        new, old = make_reader(new_file), make_reader(old_file)
        summary, expected = new.get_summary(), old.get_summary()
        assert summary is not None
        assert expected is not None
        assert summary.statistics is not None
        assert summary.statistics.message_count == about["message_count"]
        assert summary.channels == expected.channels
        assert summary.schemas == expected.schemas
        records = {record.name: record.metadata for record in new.iter_metadata()}
        described = {record.name: record.metadata for record in old.iter_metadata()}
    assert records["emir"] == described["emir"]
    assert records["rosbag2"]["serialized_metadata"] == text


def test_a_finished_recording_of_another_writer_comes_through_whole(tmp_path: Path) -> None:
    bag, time = tmp_path / "bag", np.arange(50) * 0.01
    recorded.write_bag(bag, {"joint_states": (time, time), "pressure_lifting": (time, time)})
    recover(bag, tmp_path / "copy")
    assert _raw(tmp_path / "copy") == _raw(bag)


def test_all_before_a_damage_is_saved_and_the_damage_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bag = _cut(OWN_BAG, tmp_path / "bag", 1.0)
    content = bytearray((bag / "cut_0.mcap").read_bytes())
    content[len(content) // 2] ^= 0xFF
    (bag / "cut_0.mcap").write_bytes(content)
    for reader in ("info", "analyze"):
        assert main([reader, str(bag)]) == 1
        assert "cut_0.mcap: damaged" in capsys.readouterr().err
    assert main(["bag", "recover", str(bag), "--out", str(tmp_path / "whole")]) == 0
    told = capsys.readouterr()
    assert "damaged" in told.err
    assert len(told.err.splitlines()) == 1
    after = _raw(tmp_path / "whole")
    assert after == _raw(OWN_BAG)[: len(after)]
    assert f"{len(after)} messages" in told.out


def test_nothing_to_recover_leaves_nothing_behind(tmp_path: Path) -> None:
    bag = _cut(OWN_BAG, tmp_path / "cut", 0.001)
    with pytest.raises(InputError, match="no message is readable"):
        recover(bag, tmp_path / "whole")
    assert not (tmp_path / "whole").exists()


def test_nothing_is_written_over(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "precious").write_text("data")
    assert main(["bag", "recover", str(OWN_BAG), "--out", str(tmp_path)]) == 1
    assert "exists already" in capsys.readouterr().err
    assert (tmp_path / "precious").read_text() == "data"


def test_info_counts_what_another_reader_counts(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["info", str(OWN_BAG)]) == 0
    lines = capsys.readouterr().out.splitlines()
    with AnyReader([OWN_BAG]) as reader:
        for connection in reader.connections:
            (line,) = [line for line in lines if line.split()[0] == connection.topic]
            assert line.split()[1:3] == [connection.msgtype, str(connection.msgcount)]
    assert "controller: cascade" in lines
    assert "file: finished" in lines
    assert "recorded: 3.200 s, 2911 messages" in lines  # bags/README.md; metadata.yaml
    (rate,) = [line.split()[3] for line in lines if "/truth" in line]
    assert float(rate) == 125.0  # every 8 ms


def test_info_says_what_was_cut_off(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["info", str(_cut(OWN_BAG, tmp_path / "cut", 0.5))]) == 0
    assert "cut off (cut_0.mcap)" in capsys.readouterr().out
    assert main(["info", str(tmp_path / "nowhere")]) == 1
    assert "no such recording" in capsys.readouterr().err


def test_a_writer_killed_outright_loses_no_whole_chunk(tmp_path: Path) -> None:
    """The writer is killed by SIGKILL after 1200 messages of 1 kB, of which it may owe a chunk."""
    script = (
        "import os, signal, sys; from pathlib import Path; from mcap.records import Schema;"
        "from emir_analysis.rosbag2_writer import Rosbag2Writer;"
        "w = Rosbag2Writer(Path(sys.argv[1]));"
        "w.add_topic('/a', Schema(0, b'byte[] data', 'ros2msg', 'x/msg/Bytes'), {});"
        "[w.write('/a', bytes([k % 256]) * 1000, k, k) for k in range(1200)];"
        "os.kill(os.getpid(), signal.SIGKILL)"
    )
    subprocess.run([sys.executable, "-c", script, str(tmp_path / "bag")], check=False)
    assert not (tmp_path / "bag" / "metadata.yaml").exists()
    saved = recover(tmp_path / "bag", tmp_path / "whole")
    assert 1200 - 2 * CHUNK / 1000 <= saved.messages <= 1200
    with (tmp_path / "whole" / "whole_0.mcap").open("rb") as stream:
        messages = [message for _, _, message in make_reader(stream).iter_messages()]
    assert [m.data for m in messages] == [bytes([k % 256]) * 1000 for k in range(saved.messages)]


def test_a_full_disk_is_one_line_and_keeps_what_was_written(tmp_path: Path) -> None:
    """A limit on the file's size stands for the end of the disk; the system says the same."""
    script = "import sys; from emir_analysis.cli import main; sys.exit(main(sys.argv[1:]))"
    out, limit = tmp_path / "whole", 300_000
    finished = subprocess.run(
        [sys.executable, "-c", script, "bag", "recover", str(OWN_BAG), "--out", str(out)],
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit)),
    )
    assert finished.returncode == 1
    (line,) = finished.stderr.splitlines()
    assert line.startswith(f"emir bag: {out / 'whole_0.mcap'}: File too large: recording ended")
    assert recover(out, tmp_path / "again").messages > 0


def test_nothing_is_recovered_into_the_recording_itself(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bag = _cut(OWN_BAG, tmp_path / "cut", 0.5)
    before = sorted(tmp_path.rglob("*"))
    assert main(["bag", "recover", str(bag), "--out", str(bag / "in" / "it")]) == 1
    assert f"lies in {bag}, which is read" in capsys.readouterr().err
    assert sorted(tmp_path.rglob("*")) == before
