"""Files that parameters name go with the recording: a replay elsewhere needs nothing else."""

import shutil
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")

import yaml

from emir_analysis import bags
from emir_analysis.replay import replay
from emir_analysis.stamped import same
from emir_control import pfc_file
from emir_plant.sheet import data
from emir_ros.run import main as run_graph


def test_a_replay_elsewhere_takes_design_and_machine_from_the_recording(tmp_path: Path) -> None:
    """The machine's file is based on another, which has to come along."""
    here, bag = tmp_path / "here", tmp_path / "run"
    here.mkdir()
    design = yaml.safe_load(pfc_file.default_file(pfc_file.STROKE).read_text())
    design["tuning"]["response_time"] = 2.25
    (here / "design.yaml").write_text(yaml.safe_dump(design))
    shutil.copy(data("joint1.yaml"), here / "base.yaml")
    (here / "machine.yaml").write_text(
        "based_on: base.yaml\neffects: {coulomb_friction: {force: 2.0e+3}}\n"
    )
    (here / "params.yaml").write_text(
        f"pfc_node: {{ros__parameters: {{model_file: {here / 'design.yaml'}}}}}\n"
        f"plant_node: {{ros__parameters: {{machine_file: {here / 'machine.yaml'}}}}}\n"
    )
    words = ["--controller", "pfc", "--params", str(here / "params.yaml")]
    assert run_graph([*words, "--duration", "3.2", "--bag", str(bag)]) == 0
    kept = {a.name: a.data for a in bags.attachments(bag)}
    of_design = "parameter_files/pfc_node/model_file/design.yaml"
    assert kept[of_design] == (here / "design.yaml").read_bytes()
    shutil.rmtree(here)
    assert same(replay(bag, "pfc", {}))
    assert same(replay(bag, "plant", {}))
    assert not same(replay(bag, "pfc", {"model_file": "", "response_time": 1.5}))


def test_the_projects_own_design_is_kept_as_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Another version may come with another one."""
    bag = tmp_path / "run"
    file = tmp_path / "params.yaml"
    file.write_text("pfc_node: {ros__parameters: {model_file: scheduled}}\n")
    words = ["--controller", "pfc", "--params", str(file), "--duration", "2.4"]
    assert run_graph([*words, "--bag", str(bag)]) == 0
    replaced = tmp_path / pfc_file.find(pfc_file.SCHEDULED, pfc_file.STROKE).name
    shutil.copy(pfc_file.default_file(pfc_file.STROKE), replaced)  # which follows nothing
    find = pfc_file.find
    monkeypatch.setattr(
        pfc_file,
        "find",
        lambda name, output: replaced if name == "scheduled" else find(name, output),
    )
    assert same(replay(bag, "pfc", {}))
    assert not same(replay(bag, "pfc", {"model_file": "scheduled"}))
