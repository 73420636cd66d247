"""What setup.py, package.xml and the source tree each say of the package agrees."""

import re
import xml.etree.ElementTree as ET
from importlib.metadata import metadata
from pathlib import Path

import pytest

from emir_msgs_py.topics import TOPICS

CHECKOUT = Path(__file__).parents[1]
MANIFEST = ET.parse(CHECKOUT / "package.xml")  # noqa: S314 (our own file)
ROS_TOOLS = {"ament_index_python", "launch", "launch_ros", "rclpy"}


@pytest.mark.parametrize(("tag", "field"), [("version", "Version"), ("license", "License")])
def test_manifest_and_distribution_agree(tag: str, field: str) -> None:
    assert MANIFEST.findtext(tag) == metadata("emir_ros")[field]


def test_every_node_module_has_an_executable() -> None:
    package = CHECKOUT / "emir_ros"
    modules = {path.stem for path in package.glob("*_node.py")}
    executables = {path.name for path in package.glob("executables/*_node")}
    assert modules
    assert executables == modules


def test_ros_packages_that_are_used_are_dependencies() -> None:
    depended = {entry.text for entry in MANIFEST.getroot() if entry.tag.endswith("depend")}
    sources = "\n".join(path.read_text() for path in (CHECKOUT / "emir_ros").rglob("*.py"))
    used = set(re.findall(r"^ *(?:from|import) (\w+)", sources, re.MULTILINE))
    used = {
        name
        for name in used
        if name in ROS_TOOLS or name.endswith(("_msgs", "_srvs", "_interfaces"))
    }
    used |= {topic.type.split("/")[0] for topic in TOPICS}
    assert "rclpy" in used
    assert used <= depended
