"""A recording in lock step replays bit for bit; what was not recorded so does not."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.records import Schema

from emir_analysis.cli import main
from emir_analysis.replay import replay
from emir_analysis.rosbag2_writer import Rosbag2Writer
from emir_analysis.stamped import same
from emir_common.parameter_tree import declared
from emir_plant.sheet import joint1

OWN_BAG = Path(__file__).parents[2] / "bags" / "lift"


def _copy(
    folder: Path, about: dict[str, str], nodes: dict[str, dict[str, float]] | None = None
) -> Path:
    """The project's own recording with another description, and what its nodes told."""
    with next(OWN_BAG.glob("*.mcap")).open("rb") as stream, Rosbag2Writer(folder) as writer:
        writer.add_metadata("emir", about)
        if nodes is not None:
            told = {f"{node}_node": json.dumps(values) for node, values in nodes.items()}
            writer.add_metadata("emir.parameters", told)
        for schema, channel, message in make_reader(stream).iter_messages():
            assert isinstance(schema, Schema)
            if channel.topic not in writer.topics:
                writer.add_topic(channel.topic, schema, channel.metadata)
            writer.write(channel.topic, message.data, message.log_time, message.publish_time)
    return folder


@pytest.mark.parametrize("node", ["trajectory", "cascade", "force_loop"])
def test_a_lockstep_recording_replays_bit_for_bit(node: str) -> None:
    fields = replay(OWN_BAG, node, {})
    assert same(fields)
    assert sum(field.recorded.size for field in fields) >= 2 * 101  # 3.2 s / 32 ms and the first
    assert main(["replay", str(OWN_BAG), "--node", node]) == 0


def test_another_gain_answers_in_proportion(capsys: pytest.CaptureFixture[str]) -> None:
    """Half the gain is half the feedback of law (11), the feedforward stays as it is."""
    fields = {field.name: field for field in replay(OWN_BAG, "cascade", {"gain": 1.0})}
    feedback = fields["feedback"]
    assert feedback.replayed == pytest.approx(feedback.recorded / 2.0, rel=1e-12)
    assert feedback.largest_difference > 1e-3
    assert fields["feedforward"].equal == fields["feedforward"].recorded.size
    assert main(["replay", str(OWN_BAG), "--node", "cascade", "--set", "gain=10e-1"]) == 0
    assert "open loop: what it is fed stays as recorded" in capsys.readouterr().out


def test_parameters_of_the_run_are_those_of_the_recording(tmp_path: Path) -> None:
    """A recording that claims another gain than it was made with does not replay."""
    parameters = {"cascade_node": {"gain": 1.0}, "/**": {"lockstep": True}}
    bag = _copy(tmp_path / "bag", {"parameters": json.dumps(parameters)})
    assert main(["replay", str(bag), "--node", "cascade"]) == 1
    assert main(["replay", str(bag), "--node", "force_loop"]) == 0
    assert same(replay(bag, "cascade", {"gain": 2.0}))


def _machine() -> dict[str, float]:
    """Its parameters as the graph records them: those of joint 1, and how it stood."""
    values = {path: value for path, (_, value) in declared(joint1()).items()}
    return values | {"initial_angle": math.pi / 4, "initial_pressure_lowering": 2e6}


def test_the_machine_replays_what_another_computer_recorded(tmp_path: Path) -> None:
    """Not bit for bit: compiled code and mathematical libraries differ in the last digits.

    On the computer that recorded, every bit agrees: tests/ros/test_graph.py.
    """
    fields = replay(_copy(tmp_path / "bag", {}, {"plant": _machine()}), "plant", {})
    assert {len(field.recorded) for field in fields} == {401}  # 3.2 s / 8 ms and the first
    truth = [field for field in fields if field.topic == "truth"]
    assert len(truth) == 12
    for field in truth:
        assert field.largest_difference <= 1e-6 * np.abs(field.recorded).max(), field.name


def test_a_heavier_machine_needs_a_higher_pressure(tmp_path: Path) -> None:
    bag = _copy(tmp_path / "bag", {}, {"plant": _machine()})
    fields = {f.name: f for f in replay(bag, "plant", {"effects.payload.mass": 500.0})}
    before, after = fields["pressure_lifting"].recorded, fields["pressure_lifting"].replayed
    torque = 500.0 * 9.81 * 22.5 * math.cos(math.pi / 4)  # N m
    force = torque / 0.63  # m, dh/dalpha at 45 deg
    assert after[0] - before[0] == pytest.approx(force / (math.pi / 4 * 0.28**2), rel=0.03)


@pytest.mark.parametrize("more", [[], ["--set", "response_time=2.0"]])
def test_a_node_that_was_not_in_the_run_is_told(
    more: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its inputs may have been: compared would be another controller's answers."""
    bag = _copy(tmp_path / "bag", {}, {"trajectory": {}, "cascade": {"gain": 2.0}, "plant": {}})
    assert main(["replay", str(bag), "--node", "pfc", *more]) == 1
    told = capsys.readouterr().err
    assert "pfc was not in this run; it has parameters of trajectory, cascade, plant" in told
    assert main(["replay", str(bag), "--node", "cascade"]) == 0


def test_a_recording_without_the_machines_parameters_says_so(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["replay", str(OWN_BAG), "--node", "plant"]) == 1
    assert "holds no parameters of plant_node" in capsys.readouterr().err


BAD = {
    "node": (["--node", "magic"], "--node magic: there are trajectory"),
    "topic": (["--node", "pfc"], "no topic cylinder_preview"),
    "parameter": (["--node", "cascade", "--set", "gan=1"], "cascade: gan: there is no such"),
    "range": (["--node", "cascade", "--set", "gain=-1"], "cascade: gain = -1: outside"),
    "type": (["--node", "cascade", "--set", "gain=high"], "cascade: gain = 'high': not a number"),
    "form": (["--node", "cascade", "--set", "gain"], "--set gain: not of the form PARAM=VALUE"),
    "yaml": (["--node", "cascade", "--set", "gain=["], "--set gain=[: [ is not a value"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_one_clear_line(case: str, capsys: pytest.CaptureFixture[str]) -> None:
    words, said = BAD[case]
    assert main(["replay", str(OWN_BAG), *words]) == 1
    told = capsys.readouterr().err
    assert said in told
    assert len(told.splitlines()) == 1


BAD_NODES = {
    "angle's type": ("plant", "initial_angle=high", "plant: initial_angle = 'high': not a number"),
    "angle": ("plant", "initial_angle=5", "plant: boom angle 286.5 deg: outside the linkage's"),
    "file": ("plant", "machine_file=5", "5: No such file"),
    "list": ("selector", "controllers=5", "selector: controllers = 5: not a list"),
    "times": ("selector", "switch_times=[[0]]", "switch_times = [[0]]: not a list of numbers"),
    "controller": ("selector", "controller=foo", "selector: controller 'foo': running are"),
}


@pytest.mark.parametrize("case", BAD_NODES)
def test_a_value_of_another_kind_is_one_clear_line(
    case: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    node, value, said = BAD_NODES[case]
    bag = _copy(tmp_path / "bag", {}, {"plant": _machine(), "selector": {}})
    assert main(["replay", str(bag), "--node", node, "--set", value]) == 1
    told = capsys.readouterr().err
    assert said in told
    assert len(told.splitlines()) == 1


def test_a_broken_description_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bag = _copy(tmp_path / "bag", {"parameters": "[1, 2"})
    assert main(["replay", str(bag), "--node", "cascade"]) == 1
    assert "parameters: not JSON of nodes" in capsys.readouterr().err
