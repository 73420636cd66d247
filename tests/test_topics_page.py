"""docs/topics.md against the tables of topics and against what the nodes take."""

import re
from pathlib import Path

import pytest

from emir_analysis import node_controls, robot_controls
from emir_analysis.control_protocols import NodeControl
from emir_msgs_py.robot_topics import ROBOT_TOPICS
from emir_msgs_py.topics import (
    OFFERED_COMMANDS,
    RECORDED,
    TOPICS,
    VALVE_COMMAND,
    Topic,
)

PAGE = Path(__file__).parents[1] / "docs" / "topics.md"
PARTS = {"Joint 1": TOPICS, "The whole robot": ROBOT_TOPICS}
BESIDE = {
    "/clock", "/diagnostics", "description_joint_states", "joint_trajectory", "orders", RECORDED,
    "robot_description",
}  # fmt: skip
CONTROLS: dict[str, dict[str, type[NodeControl]]] = {
    "Joint 1": {
        "trajectory_node": node_controls.TrajectoryControl,
        "cascade_node": node_controls.CascadeControl,
        "pfc_node": node_controls.PfcControl,
        "pfc_tip_node": node_controls.PfcTipControl,
        "lqg_node": node_controls.LqgControl,
        "mpc_node": node_controls.MpcControl,
        "force_loop_node": node_controls.ForceLoopControl,
    },
    "The whole robot": {
        "trajectory_node": robot_controls.RobotTrajectoryControl,
        "cascade_node": robot_controls.RobotCascadeControl,
        "pfc_node": robot_controls.RobotPfcControl,
        "force_loop_node": robot_controls.RobotForceLoopControl,
    },
}
EACH = [(part, topic) for part, table in PARTS.items() for topic in table]


def _rows(part: str) -> dict[str, list[str]]:
    """Return the cells of a part's table by the topic in the first of them."""
    text = PAGE.read_text().split(f"\n## {part}\n", 1)[1].split("\n## ", 1)[0]
    lines = [line for line in text.splitlines() if line.startswith("| `")]
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    return {name.strip("`"): others for name, *others in cells}


def _nodes(cell: str) -> set[str]:
    return set(re.findall(r"`(\w+_node)`", cell))


@pytest.mark.parametrize(("part", "names"), [
    *((part, {topic.name for topic in table}) for part, table in PARTS.items()),
    ("Beside the tables", BESIDE),
])  # fmt: skip
def test_every_topic_and_no_other_stands_on_the_page(part: str, names: set[str]) -> None:
    assert _rows(part).keys() == names


@pytest.mark.parametrize(("part", "topic"), EACH, ids=[f"{p}-{t.name}" for p, t in EACH])
def test_the_page_says_what_the_table_says(part: str, topic: Topic) -> None:
    kind, publishers, takers, numbers = _rows(part)[topic.name]
    controls = CONTROLS[part]
    assert kind == topic.type.rpartition("/")[2]
    there = {"plant_node", *controls}
    if part == "Joint 1":
        there.add("selector_node")
    assert _nodes(publishers) == set(topic.publishers) & there
    taking = {node for node, control in controls.items() if topic in control.inputs}
    if topic.name == VALVE_COMMAND.name:
        taking.add("plant_node")
    if topic in OFFERED_COMMANDS.values():
        taking.add("selector_node")
    assert _nodes(takers) == taking
    units = {field.unit for field in topic.fields.values()}
    for unit in units:
        assert re.search(rf"(?<![\w/^]){re.escape(unit)}(?![\w/^])", numbers), unit
