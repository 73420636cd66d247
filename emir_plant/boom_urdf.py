"""Joint 1 with the stretched boom as URDF: sections in a row, every bending spring a joint."""

import xml.etree.ElementTree as ET

import numpy as np
from numpy.typing import NDArray

from emir_plant.boom import boom_modes, rigid_arm_joints
from emir_plant.parameters import Geometry

Array = NDArray[np.float64]

ROOT = "base_link"
WIDE = 0.5  # m, how thick a section is drawn
LIFT = "0 -1 0"


def boom_urdf(geometry: Geometry) -> str:
    """Return the description: joint1, then bend1 ... between the sections of an arm."""
    root = ET.Element("robot", name="emir_joint1")
    ET.SubElement(root, "link", name=ROOT)
    length = geometry.section_length
    parent = ROOT
    for k, (joint, moves) in enumerate(_joints(geometry)):
        link = f"section{k + 1}"
        element = ET.SubElement(root, "joint", name=joint, type="revolute" if moves else "fixed")
        ET.SubElement(element, "origin", xyz=f"{length if k else 0.0!r} 0 0", rpy="0 0 0")
        ET.SubElement(element, "parent", link=parent)
        ET.SubElement(element, "child", link=link)
        if moves:
            ET.SubElement(element, "axis", xyz=LIFT)
            ET.SubElement(element, "limit", lower="-3.2", upper="3.2", effort="0", velocity="10")
        visual = ET.SubElement(ET.SubElement(root, "link", name=link), "visual")
        ET.SubElement(visual, "origin", xyz=f"{0.5 * length!r} 0 0", rpy="0 0 0")
        shape = ET.SubElement(visual, "geometry")
        ET.SubElement(shape, "box", size=f"{length!r} {WIDE} {WIDE}")
        parent = link
    ET.SubElement(root, "link", name="tcp")
    mount = ET.SubElement(root, "joint", name="tcp_mount", type="fixed")
    ET.SubElement(mount, "origin", xyz=f"{length!r} 0 0", rpy="0 0 0")
    ET.SubElement(mount, "parent", link=parent)
    ET.SubElement(mount, "child", link="tcp")
    ET.indent(root)
    return ET.tostring(root, encoding="unicode")


def bending(geometry: Geometry) -> tuple[tuple[str, ...], Array]:
    """Return the moving joints' names, and their angles, rad, per modal coordinate, (n, m)."""
    rotations = boom_modes(geometry).shapes
    angles = np.diff(rotations, axis=0, prepend=np.zeros((1, rotations.shape[1])))
    joints = _joints(geometry)
    moving = [k for k, (_, moves) in enumerate(joints) if moves]
    return tuple(joints[k][0] for k in moving), angles[moving]


def _joints(geometry: Geometry) -> list[tuple[str, bool]]:
    """Return the joint before every section: its name and whether it moves."""
    coordinate = rigid_arm_joints(geometry).argmax(axis=1)
    moves = [True, *(np.diff(coordinate) > 0)]
    return [("joint1" if k == 0 else f"bend{k}", bool(free)) for k, free in enumerate(moves)]
