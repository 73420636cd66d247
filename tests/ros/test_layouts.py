"""The layouts for Foxglove, PlotJuggler and RViz name what the graph publishes."""

import json
import re
from pathlib import Path
from xml.etree import ElementTree as ET

import yaml

from emir_msgs_py.robot_topics import TCP_POSE
from emir_msgs_py.topics import DIAGNOSTICS, JOINT_STATE, TOPICS, Topic, by_name

DESCRIPTION = "robot_description"  # as ROS has it

LAYOUTS = Path(__file__).parents[2] / "emir_ros" / "layouts"


def _plotjuggler_names(topic: Topic) -> set[str]:
    """How PlotJuggler calls the fields: a joint state's by the joint's name."""
    names = set()
    for field in topic.fields.values():
        found = re.fullmatch(r"(\w+)\[(\d+)\]", field.path)
        if topic.type == JOINT_STATE and found:
            names.add(f"/{topic.name}/{topic.names[int(found[2])]}/{found[1]}")
        else:
            names.add(f"/{topic.name}/{field.path}")
    return names


def test_foxglove_plots_what_is_published() -> None:
    layout = json.loads((LAYOUTS / "foxglove.json").read_text())
    panels = layout["configById"]
    placed = set(re.findall(r'"([\w]+![\w]+)"', json.dumps(layout["layout"])))
    assert placed == set(panels)
    paths = [path["value"] for panel in panels.values() for path in panel.get("paths", [])]
    assert len(paths) == 8
    for path in paths:
        topic, _, field = path.removeprefix("/").partition(".")
        assert field in {known.path for known in by_name(topic).fields.values()}


def test_arm_and_status_are_looked_for_where_they_are() -> None:
    """What no table of signals has: the description, and what nodes say of themselves."""
    panels = json.loads((LAYOUTS / "foxglove.json").read_text())["configById"]
    assert set(panels["3D!arm"]["topics"]) == {f"/{DESCRIPTION}"}
    assert panels["DiagnosticSummary!nodes"]["topicToRender"] == DIAGNOSTICS
    manager = yaml.safe_load((LAYOUTS / "emir.rviz").read_text())["Visualization Manager"]
    (model,) = [d for d in manager["Displays"] if d["Class"].endswith("/RobotModel")]
    assert model["Description Topic"]["Value"] == f"/{DESCRIPTION}"
    assert model["Description Topic"]["Durability Policy"] == "Transient Local"


def test_foxglove_names_the_units_of_what_it_plots() -> None:
    panels = json.loads((LAYOUTS / "foxglove.json").read_text())["configById"]
    for panel in panels.values():
        for path in panel.get("paths", []):
            name, _, field = path["value"].removeprefix("/").partition(".")
            (unit,) = {f.unit for f in by_name(name).fields.values() if f.path == field}
            assert f"[{unit}]" in panel["title"]


def test_plotjuggler_plots_what_is_published() -> None:
    known = set().union(*map(_plotjuggler_names, TOPICS))
    tree = ET.parse(LAYOUTS / "plotjuggler.xml")  # noqa: S314 (our own file)
    curves = [curve.attrib["name"] for curve in tree.iter("curve")]
    assert len(curves) == 8
    assert set(curves) <= known


def test_rviz_shows_the_arm_in_a_frame_that_there_is() -> None:
    manager = yaml.safe_load((LAYOUTS / "emir.rviz").read_text())["Visualization Manager"]
    frame = manager["Global Options"]["Fixed Frame"]
    assert frame == by_name("joint_states").frame
    (pose,) = [d for d in manager["Displays"] if d["Class"].endswith("/Pose")]
    assert pose["Topic"]["Value"] == f"/{TCP_POSE.name}"
