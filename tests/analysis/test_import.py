"""A CSV file becomes a recording that `rosbags` reads; what is wrong with one is told."""

import json
from pathlib import Path

import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from emir_analysis.cli import main
from emir_analysis.import_command import import_csv
from emir_analysis.signals import load, read_signal_map
from emir_msgs_py.definitions import DEFINITIONS, HASHES

MAP = """\
time: {column: t, unit: ms}
pressure: {column: p, column_unit: bar, topic: /rig/pressure, field: fluid_pressure, unit: Pa}
stroke: {column: x, topic: /rig/cylinder, field: "position[0]", unit: m}
speed: {column: v, column_unit: mm/s, topic: /rig/cylinder, field: "velocity[0]", unit: m/s}
"""
TABLE = "t,p,x,v,remark\n0,1.5,0.25,10,start\n20,2.5,0.5,-20,\n50,3,0.75,30,end\n"


@pytest.fixture
def signals(tmp_path: Path) -> Path:
    """A signal map."""
    file = tmp_path / "signals.yaml"
    file.write_text(MAP)
    return file


def _table(folder: Path, text: str = TABLE) -> Path:
    file = folder / "table.csv"
    file.write_text(text)
    return file


def test_another_reader_finds_the_numbers_of_the_table(tmp_path: Path, signals: Path) -> None:
    assert import_csv(_table(tmp_path), signals, tmp_path / "bag").rows == 3
    read: dict[str, list[tuple[float, ...]]] = {"/rig/pressure": [], "/rig/cylinder": []}
    with AnyReader([tmp_path / "bag"]) as reader:
        for connection, log_time, data in reader.messages():
            message = reader.deserialize(data, connection.msgtype)
            stamp = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
            assert stamp == log_time
            if connection.topic == "/rig/pressure":
                read[connection.topic].append((stamp, message.fluid_pressure))
            else:
                assert list(message.name) == ["stroke", "speed"]
                read[connection.topic].append((stamp, message.position[0], message.velocity[0]))
    assert read["/rig/pressure"] == [(0, 1.5e5), (20_000_000, 2.5e5), (50_000_000, 3e5)]
    np.testing.assert_allclose(
        read["/rig/cylinder"], [(0, 0.25, 0.01), (2e7, 0.5, -0.02), (5e7, 0.75, 0.03)]
    )


def test_the_same_map_reads_the_recording(tmp_path: Path, signals: Path) -> None:
    import_csv(_table(tmp_path), signals, tmp_path / "bag")
    recording = load(tmp_path / "bag", read_signal_map(signals))
    np.testing.assert_allclose(recording["stroke"].time, [0.0, 0.02, 0.05])
    np.testing.assert_allclose(recording["pressure"].value, [1.5e5, 2.5e5, 3e5])


def test_a_blank_cell_is_no_message(tmp_path: Path, signals: Path) -> None:
    """Signals of other rates share a table; a topic of two needs both."""
    import_csv(_table(tmp_path, TABLE.replace("20,2.5,0.5", "20,,0.5")), signals, tmp_path / "bag")
    recording = load(tmp_path / "bag", read_signal_map(signals))
    np.testing.assert_allclose(recording["pressure"].time, [0.0, 0.05])
    np.testing.assert_allclose(recording["stroke"].time, [0.0, 0.02, 0.05])
    half = TABLE.replace("20,2.5,0.5", "20,2.5,")
    assert import_csv(_table(tmp_path, half), signals, tmp_path / "half").left_out == 1
    recording = load(tmp_path / "half", read_signal_map(signals))
    np.testing.assert_allclose(recording["speed"].time, [0.0, 0.05])


def test_a_table_in_another_encoding_is_told(
    tmp_path: Path, signals: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "table.csv").write_bytes(TABLE.replace("remark", "Öl").encode("latin-1"))
    words = [str(tmp_path / "table.csv"), "--signals", str(signals)]
    assert main(["import", *words, "--out", str(tmp_path / "bag")]) == 1
    assert "not in UTF-8" in capsys.readouterr().err


GERMAN = TABLE.replace(",", ";").replace(".", ",")


@pytest.mark.parametrize("text", [GERMAN, f"# rig 3, 2026, bar\n#\n{TABLE}", f"# bar\n{GERMAN}"])
def test_a_table_with_comments_or_decimal_commas_is_the_same(
    tmp_path: Path, signals: Path, text: str
) -> None:
    import_csv(_table(tmp_path, text), signals, tmp_path / "bag")
    import_csv(_table(tmp_path), signals, tmp_path / "plain")
    both = [load(tmp_path / name, read_signal_map(signals)) for name in ("bag", "plain")]
    for name in ("pressure", "stroke", "speed"):
        assert both[0][name].value.tolist() == both[1][name].value.tolist()


@pytest.mark.parametrize("kind", DEFINITIONS)
def test_definitions_and_hashes_are_those_of_ros(kind: str) -> None:
    store = get_typestore(Stores.ROS2_JAZZY)
    assert store.hash_rihs01(kind) == HASHES[kind]
    expected, _ = store.generate_msgdef(kind, ros_version=2)
    assert DEFINITIONS[kind].split() == expected.split()


@pytest.mark.parametrize("rows", ["5", "1:2:3", "a:b"])
def test_rows_are_from_one_to_another(
    rows: str, tmp_path: Path, signals: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = [str(_table(tmp_path)), "--signals", str(signals), "--out", str(tmp_path / "bag")]
    assert main(["import", *words, "--rows", rows]) == 1
    assert "not of the form A:B" in capsys.readouterr().err


def test_a_map_without_a_signal_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "map.yaml").write_text("time: {column: t, unit: ms}\n")
    words = [str(_table(tmp_path)), "--signals", str(tmp_path / "map.yaml")]
    assert main(["import", *words, "--out", str(tmp_path / "bag")]) == 1
    assert "no signal in it" in capsys.readouterr().err


def test_rows_without_times_are_samples(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "map.yaml").write_text('u: {column: u, topic: /u, field: data, unit: "1"}\n')
    table = _table(tmp_path, "u;remark\n" + "".join(f"{k};x\n" for k in range(10)))
    words = ["import", str(table), "--signals", str(tmp_path / "map.yaml"), "--rows", "4:"]
    assert main([*words, "--out", str(tmp_path / "bag")]) == 0
    assert "6 rows, time 4 ... 9 samples" in capsys.readouterr().out
    with AnyReader([tmp_path / "bag"], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as r:
        assert [t for _, t, _ in r.messages()] == [k * 10**9 for k in range(4, 10)]
        fields = r.connections[0]
    assert fields.msgtype == "std_msgs/msg/Float64"
    assert main(["info", str(tmp_path / "bag"), "--fields"]) == 0
    assert "column u" in capsys.readouterr().out


def test_blank_lines_before_the_header_do_not_hide_what_separates(tmp_path: Path) -> None:
    (tmp_path / "map.yaml").write_text('u: {column: u, topic: /u, field: data, unit: "1"}\n')
    table = _table(tmp_path, "\n# of the rig\n\nu;w\n1,5;2\n2,5;3\n")
    words = ["import", str(table), "--signals", str(tmp_path / "map.yaml")]
    assert main([*words, "--out", str(tmp_path / "bag")]) == 0


@pytest.mark.parametrize("period", ["1e9", "1e-10"])
def test_a_period_that_no_stamp_can_tell_is_refused(
    period: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "map.yaml").write_text(
        f"time: {{period: {period}, unit: s}}\n"
        'u: {column: u, topic: /u, field: data, unit: "1"}\n'
    )
    table = _table(tmp_path, "u\n" + "1\n" * 10)
    words = ["import", str(table), "--signals", str(tmp_path / "map.yaml")]
    assert main([*words, "--out", str(tmp_path / "bag")]) == 1
    assert "period: " in capsys.readouterr().err


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("t,p,x\n0,1,2\n", "no column v; there are t, p, x"),
        ("t,p,x,v\n0,1,nan,3\n", "line 2: x is nan"),
        ("t,p,x,v\n0,1,,3\n1,1,,3\n", "column x is blank"),
        ("t,p,x,v\n0,1,2,3\n,1,2,3\n", "line 3: t is empty, not a number"),
        ("t,p,x,v\n0,1,oil,3\n", "line 2: x is 'oil', not a number"),
        ("t,p,x,v\n0,1,2,3\n1,2,3\n", "line 3: 3 cells under 4 columns"),
        ("0,1,2,3\n1,2,3,4\n", "no header"),
        ("t,p,x,v\n", "a header and no rows"),
        ("t,p,x,x,v\n0,1,2,2,3\n", "more than one column x"),
        ("t,p,x,v\n1,1,2,3\n1,1,2,3\n", "t does not increase at row 1"),
        ("t,p,x,v\n-5,1,2,3\n1,1,2,3\n", "a stamp holds 0"),
        ("t,p,x,v\n1,1,2,3\n1.0000000001,1,2,3\n", "t: rows are less than 1e-09 s apart"),
        ("", "empty"),
    ],
)
def test_a_table_of_no_use_is_told_in_one_line(
    text: str, reason: str, tmp_path: Path, signals: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = [str(_table(tmp_path, text)), "--signals", str(signals)]
    assert main(["import", *words, "--out", str(tmp_path / "bag")]) == 1
    told = capsys.readouterr().err
    assert reason in told
    assert told.count("\n") == 1
    assert not (tmp_path / "bag").exists()


@pytest.mark.parametrize(
    ("entry", "reason"),
    [
        ("{topic: /a, field: data, unit: m}", "needs the column"),
        ("{column: x, topic: /a, field: data, unit: m}", "stroke and other are one column, x"),
        ("{column: w, topic: /a, field: temperature, unit: K}", "no message for temperature"),
        ("{column: x, column_unit: bar, topic: /a, field: data, unit: m}", "no signal in m"),
        ("{column: w, topic: /a, field: data, unit: bar}", "write column_unit: bar, unit: Pa"),
        ("{column: w, topic: /rig/pressure, field: fluid_pressure, unit: Pa}", "in one field"),
        ("{column: w, topic: /a, field: 'position[100]', unit: m}", "an index is at most 99"),
    ],
)
def test_a_map_of_no_use_is_told(
    entry: str, reason: str, tmp_path: Path, signals: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    signals.write_text(f"{MAP}other: {entry}\n")
    table = _table(tmp_path, TABLE.replace("remark", "w").replace("start", "1").replace("end", "2"))
    words = [str(table), "--signals", str(signals), "--out", str(tmp_path / "bag")]
    assert main(["import", *words]) == 1
    assert reason in capsys.readouterr().err


def test_the_crane_actuator_is_imported_as_it_is(shared: Path, tmp_path: Path) -> None:
    table = shared / "measured" / "crane-actuator" / "actuator.csv"
    (tmp_path / "map.yaml").write_text(
        "time: {column: k, unit: sample}\n"
        'pressure: {column: p, topic: /pressure, field: "position[0]", unit: "1"}\n'
    )
    import_csv(table, tmp_path / "map.yaml", tmp_path / "bag", slice(0, 512))
    recorded = load(tmp_path / "bag", read_signal_map(tmp_path / "map.yaml"))["pressure"]
    lines = table.read_text().splitlines()[1:513]
    assert recorded.value.tolist() == [float(line.split(",")[2]) for line in lines]
    assert json.dumps(recorded.time[:3].tolist()) == "[0.0, 1.0, 2.0]"
