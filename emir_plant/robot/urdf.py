"""The robot as URDF, generated from the same numbers: cylinders and bending are joints.

URDF knows trees of one-freedom joints only. So the linkages' parts have joints of their own,
whose positions follow from the arm's (`joint_positions`; a piston's is its distance from the
cylinder's foot), and a cut becomes three prismatic and
three revolute joints with massless links between them.
"""

import xml.etree.ElementTree as ET
from typing import Any

import numpy as np
from numpy.typing import NDArray

from emir_plant.robot.dynamics import Mechanics
from emir_plant.robot.parameters import JOINTS
from emir_plant.robot.topology import TCP

Array = NDArray[np.float64]

UP, LIFT, ALONG, LEFT = "0 0 1", "0 -1 0", "1 0 0", "0 1 0"
SHIFTS = (("x", ALONG), ("y", LEFT), ("z", UP))
TURNS = (("yaw", UP), ("pitch", LEFT), ("roll", ALONG))
FREE = 1e3  # m or rad, a limit that limits nothing
EFFORT, VELOCITY = "1e7", "10"  # asked for by the format, used by nobody here


def urdf(mechanics: Mechanics) -> str:
    """Return the robot's description."""
    root = ET.Element("robot", name="emir")
    ET.SubElement(root, "link", name="world")
    for joint in range(1, mechanics.topology.model.njoints):
        _add_joint(root, mechanics, joint)
    frame = mechanics.topology.model.frames[mechanics.topology.model.getFrameId(TCP)]
    ET.SubElement(root, "link", name=TCP)
    fixed = ET.SubElement(root, "joint", name=f"{TCP}_mount", type="fixed")
    _origin(fixed, frame.placement.translation)
    ET.SubElement(fixed, "parent", link=_link(mechanics, frame.parentJoint))
    ET.SubElement(fixed, "child", link=TCP)
    ET.indent(root)
    return ET.tostring(root, encoding="unicode")


def joint_positions(mechanics: Mechanics, q: Array) -> dict[str, float]:
    """Return the positions, m or rad, of all joints of the description at q, (n,), by name."""
    z, _, _, _ = mechanics.expand(q, np.zeros_like(q))
    model, positions = mechanics.topology.model, {}
    for joint in range(1, model.njoints):
        steps = _steps(mechanics, joint)
        start = model.idx_qs[joint]
        for k, (name, _, _) in enumerate(steps):
            positions[name] = float(z[start + k])
    return positions


def _link(mechanics: Mechanics, joint: int) -> str:
    """Return the link that a joint of the tree moves: its body, or the one between a cut's two."""
    if joint == 0:
        return "world"
    name = str(mechanics.topology.model.names[joint])
    if name == "base":
        return "column"
    if name.startswith("joint") and len(name) == len("joint1"):
        return f"arm{name[-1]}_section1"
    return name.removesuffix("_rotation")


def _steps(mechanics: Mechanics, joint: int) -> list[tuple[str, str, str]]:
    """Return name, kind and axis of the one-freedom joints that stand for a joint of the tree."""
    name = str(mechanics.topology.model.names[joint])
    if name.endswith("_shift"):
        return [(f"{name.removesuffix('_shift')}_{k}", "prismatic", a) for k, a in SHIFTS]
    if name.endswith("_rotation"):
        return [(f"{name.removesuffix('_rotation')}_{k}", "revolute", a) for k, a in TURNS]
    if name.endswith("_piston"):
        return [(name, "prismatic", ALONG)]
    return [(name, "revolute", UP if name == "base" else LIFT)]


def _add_joint(root: ET.Element, mechanics: Mechanics, joint: int) -> None:
    model = mechanics.topology.model
    steps, child = _steps(mechanics, joint), _link(mechanics, joint)
    parent = _link(mechanics, model.parents[joint])
    place = model.jointPlacements[joint].translation
    for k, (name, kind, axis) in enumerate(steps):
        last = k == len(steps) - 1
        link = child if last else f"{name}_link"
        element = ET.SubElement(root, "joint", name=name, type=kind)
        _origin(element, place if k == 0 else np.zeros(3))
        ET.SubElement(element, "parent", link=parent)
        ET.SubElement(element, "child", link=link)
        ET.SubElement(element, "axis", xyz=axis)
        low, high = _limits(mechanics, name)
        limits = {"lower": repr(low), "upper": repr(high), "effort": EFFORT, "velocity": VELOCITY}
        ET.SubElement(element, "limit", limits)
        body = ET.SubElement(root, "link", name=link)
        if last and model.inertias[joint].mass > 0.0:
            _inertial(body, model.inertias[joint])
            _visual(body, mechanics, link)
        parent = link


def _limits(mechanics: Mechanics, name: str) -> tuple[float, float]:
    number = int(name[-1]) if name[-1].isdigit() else 0
    if name == f"joint{number}" and 1 <= number <= JOINTS:
        of = mechanics.reaches[number - 1]
        return of.angle_low, of.angle_high
    if name.endswith("_piston"):
        shape = mechanics.robot.linkages[int(name[len("joint")]) - 1]
        return shape.length_retracted, shape.length_retracted + shape.stroke
    return -FREE, FREE


def _origin(parent: ET.Element, place: Array) -> None:
    ET.SubElement(parent, "origin", xyz=_text(place), rpy="0 0 0")


def _inertial(link: ET.Element, inertia: Any) -> None:
    element = ET.SubElement(link, "inertial")
    _origin(element, inertia.lever)
    ET.SubElement(element, "mass", value=repr(float(inertia.mass)))
    m = inertia.inertia
    entries = {
        f"i{'xyz'[a]}{'xyz'[b]}": repr(float(m[a, b])) for a in range(3) for b in range(a, 3)
    }
    ET.SubElement(element, "inertia", entries)


def _visual(link: ET.Element, mechanics: Mechanics, name: str) -> None:
    """Draw sections as their box, all other parts as bars between their pins."""
    size, middle = _box(mechanics, name)
    visual = ET.SubElement(link, "visual")
    _origin(visual, middle)
    ET.SubElement(ET.SubElement(visual, "geometry"), "box", size=_text(size))
    material = ET.SubElement(visual, "material", name="boom" if "arm" in name else "drive")
    color = "0.9 0.6 0.1 1" if "arm" in name else "0.4 0.4 0.45 1"
    ET.SubElement(material, "color", rgba=color)


def _box(mechanics: Mechanics, name: str) -> tuple[Array, Array]:
    """Return a link's size and middle, (3,) m each, in its own frame."""
    machine, g = mechanics.robot, mechanics.robot.main.geometry
    if name == "column":
        height = max(machine.base.height, 0.1)
        return np.array([0.6, 0.6, height]), np.array([0.0, 0.0, 0.5 * height])
    if name.startswith("arm"):
        size = np.array([g.section_length, machine.arm.width, machine.arm.height])
        return size, _ahead(g.section_length)
    number, part = int(name[len("joint")]), name.split("_", 1)[1]
    parts, shape = machine.parts[number - 1], machine.linkages[number - 1]
    length, thick = {
        "cylinder": (parts.barrel_length, 0.3),
        "piston": (-parts.piston_length, 0.15),
        "lever": (shape.lever, 0.1),
        "thrust_bar": (shape.thrust_bar, 0.1),
    }[part]
    return np.array([abs(length), thick, thick]), _ahead(length)


def _ahead(length: float) -> Array:
    return np.array([0.5 * length, 0.0, 0.0])


def _text(values: Array) -> str:
    return " ".join(repr(float(value)) for value in values)
