"""Runs of the graph in closed loop, diagnosed without being told what each topic carries."""

from pathlib import Path

import pytest
import yaml

pytest.importorskip("rclpy", reason="needs ROS 2")

from emir_analysis.diagnosis.command import command
from emir_analysis.errors import InputError
from emir_analysis.import_command import import_csv
from emir_ros.run import main as run_graph

HIDDEN = {  # effect: {field: size}
    "sensor_delay": {"pressure_lifting": 0.03},  # s
    "external_load": {"force": 2e3},  # N, all the time
}


@pytest.mark.parametrize("effect", HIDDEN)
def test_what_a_run_had_in_it_is_found(effect: str, tmp_path: Path) -> None:
    """In 17.6 s of one move up and one down, at rest in the last third but for two seconds."""
    parameters, bag = tmp_path / "machine.yaml", tmp_path / "run"
    machine = {"effects": {effect: HIDDEN[effect]}}
    parameters.write_text(yaml.safe_dump({"/**/plant_node": {"ros__parameters": machine}}))
    words = ["--namespace", "left", "--params", str(parameters), "--bag", str(bag)]
    assert run_graph(words) == 0
    found = command(bag, None, None, None, None, None, lambda _: None)
    assert found.verdict == "found"
    assert [named.name for named in found.effects] == [effect]
    for field, size in HIDDEN[effect].items():
        assert found.effects[0].parameters[field].value == pytest.approx(size, rel=0.05)
    for name, signal in found.signals.items():
        assert signal.with_effect < 1.1 * signal.noise, name


def test_what_is_not_of_the_graph_is_asked_for_its_signals(tmp_path: Path) -> None:
    table, signals = tmp_path / "rig.csv", tmp_path / "signals.yaml"
    table.write_text("t,y\n0,0\n1,0\n2,0\n")
    signals.write_text(
        "time: {column: t, unit: s}\n"
        'valve_command: {column: y, topic: /rig/valve_command, field: "position[0]", unit: "1"}\n'
    )
    import_csv(table, signals, tmp_path / "rig")
    with pytest.raises(InputError, match=r"no topic joint_states, .*--signals.*/rig/valve_command"):
        command(tmp_path / "rig", None, None, None, None, None, lambda _: None)
