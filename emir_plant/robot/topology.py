"""The robot's bodies and joints as a Pinocchio model: a tree, the linkages' loops cut open.

Ground - column (turns about z) - arms. Arm i turns about the horizontal joint i and consists of
rigid sections; between them the six coordinates of a cut (`stiffness.py`) as a translation and
three small rotations. On the section that carries joint i hang the linkage's cylinder with its
piston and, for joints 2-5, the lever with its thrust bar. Their coordinates follow from the
joint's angle (`linkage.py`); all others are independent. Frames: x forward, y left, z up.

Bodies as the paper counts them: 5 arms of 4 sections, 5 cylinders, 5 pistons, 5 levers, 4 thrust
bars, 39 together; the column makes 40. The lever of joint 1 is fixed to arm 1.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from emir_plant.parameters import GRAVITY
from emir_plant.robot.linkage import CYLINDER, LENGTH, LEVER, THRUST_BAR
from emir_plant.robot.parameters import JOINTS, Linkage, Parts, Robot
from emir_plant.robot.stiffness import COORDINATES, box

LIFTING = np.array([0.0, -1.0, 0.0])  # axis of the horizontal joints: turning about it lifts
TCP = "tcp"

Index = NDArray[np.int64]


@dataclass(frozen=True)
class Topology:
    """The tree and which of its coordinates are what.

    model: Pinocchio's. independent: (n,) where they stand in the tree's coordinates.
    joints: (6,) base and joints 1-5 among the independent ones. cuts: (15, 6) likewise.
    parts: (18, 3) of every dependent coordinate its place in the tree, its linkage (0-4) and its
    row of `linkage.motion`.
    """

    model: Any
    independent: Index
    joints: Index
    cuts: Index
    parts: Index

    @property
    def bodies(self) -> tuple[str, ...]:
        """The names of all bodies, the column first."""
        frames = self.model.frames
        return tuple(f.name for f in frames if f.type == pin.FrameType.BODY)


class _Tree:
    """A Pinocchio model that grows; every body gets the name of the joint that moves it."""

    def __init__(self) -> None:
        self.model = pin.Model()
        self.model.gravity.linear = np.array([0.0, 0.0, -GRAVITY])

    def joint(self, parent: int, kind: Any, place: NDArray[np.float64], name: str) -> int:
        at = pin.SE3(np.eye(3), place)
        return int(self.model.addJoint(parent, kind, at, name))

    def body(self, joint: int, inertia: Any, name: str) -> None:
        self.model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
        self.frame(joint, np.zeros(3), name, pin.FrameType.BODY)

    def frame(self, joint: int, place: NDArray[np.float64], name: str, kind: Any) -> None:
        self.model.addFrame(pin.Frame(name, joint, pin.SE3(np.eye(3), place), kind))

    def coordinate(self, joint: int) -> int:
        return int(self.model.idx_vs[joint])


def topology(robot: Robot) -> Topology:
    """Return the tree of the robot with its payload, payloads of effects included."""
    g, tree = robot.main.geometry, _Tree()
    carrier = tree.joint(0, pin.JointModelRZ(), np.zeros(3), "base")
    tree.body(carrier, _column(robot), "column")
    joints, cuts, linkages, sections = [carrier], [], [], []
    place = np.array([0.0, 0.0, robot.base.height])
    for number in range(1, JOINTS + 1):
        linkages.append(_linkage(tree, carrier, place, robot, number))
        name = f"arm{number}_section1"
        carrier = tree.joint(
            carrier, pin.JointModelRevoluteUnaligned(LIFTING), place, f"joint{number}"
        )
        joints.append(carrier)
        section = _section(robot, number)
        tree.body(carrier, section, name)
        sections.append(carrier)
        place = np.array([g.section_length, 0.0, 0.0])
        for k in range(2, g.sections_per_arm + 1):
            name = f"arm{number}_section{k}"
            shift = tree.joint(carrier, pin.JointModelTranslation(), place, f"{name}_shift")
            carrier = tree.joint(
                shift, pin.JointModelSphericalZYX(), np.zeros(3), f"{name}_rotation"
            )
            cuts.append(shift)
            tree.body(carrier, section, name)
            sections.append(carrier)
    _loads(tree, sections, robot)
    tree.frame(carrier, place, TCP, pin.FrameType.OP_FRAME)
    first = tree.model.frames[tree.model.getFrameId("arm1_section1")].parentJoint
    tree.frame(first, np.zeros(3), "joint1_lever", pin.FrameType.BODY)
    return _indexed(tree, joints, cuts, linkages)


def _indexed(
    tree: _Tree, joints: list[int], cuts: list[int], linkages: list[dict[int, int]]
) -> Topology:
    parts = np.array(
        [
            (tree.coordinate(joint), driver, row)
            for driver, of in enumerate(linkages)
            for row, joint in of.items()
        ]
    )
    independent = np.setdiff1d(np.arange(tree.model.nv), parts[:, 0])
    of_joints = np.array([tree.coordinate(j) for j in joints])
    of_cuts = np.array([tree.coordinate(j) for j in cuts]).reshape(-1, 1) + np.arange(COORDINATES)
    return Topology(
        model=tree.model,
        independent=independent,
        joints=np.searchsorted(independent, of_joints),
        cuts=np.searchsorted(independent, of_cuts),
        parts=parts,
    )


def _linkage(
    tree: _Tree, carrier: int, place: NDArray[np.float64], robot: Robot, number: int
) -> dict[int, int]:
    """Hang a joint's linkage on its carrier; return its joints by row of `linkage.motion`."""
    shape: Linkage = robot.linkages[number - 1]
    parts: Parts = robot.parts[number - 1]
    pivot = place + _polar(shape.ground_link, shape.ground_direction)
    foot = pivot + _polar(shape.foot, shape.foot_direction)
    turning = pin.JointModelRevoluteUnaligned(LIFTING)
    prefix = f"joint{number}_"
    cylinder = tree.joint(carrier, turning, foot, prefix + "cylinder")
    tree.body(cylinder, _rod(parts.barrel_mass, parts.barrel_length), prefix + "cylinder")
    piston = tree.joint(cylinder, pin.JointModelPX(), np.zeros(3), prefix + "piston")
    tree.body(piston, _rod(parts.piston_mass, -parts.piston_length), prefix + "piston")
    found = {CYLINDER: cylinder, LENGTH: piston}
    if shape.thrust_bar == 0.0:
        return found
    lever = tree.joint(carrier, turning, pivot, prefix + "lever")
    tree.body(lever, _rod(parts.lever_mass, shape.lever), prefix + "lever")
    end = np.array([shape.lever, 0.0, 0.0])
    bar = tree.joint(lever, turning, end, prefix + "thrust_bar")
    tree.body(bar, _rod(parts.thrust_bar_mass, shape.thrust_bar), prefix + "thrust_bar")
    return found | {LEVER: lever, THRUST_BAR: bar}


def _loads(tree: _Tree, sections: list[int], robot: Robot) -> None:
    """Hang the stated payload on the TCP, and that of an effect where it is along the arms."""
    g, effect = robot.main.geometry, robot.main.effects.payload
    for mass, share in ((g.payload, 1.0), (effect.mass, effect.place)):
        way = share * g.boom_length
        k = min(int(way / g.section_length), len(sections) - 1)
        place = np.array([way - k * g.section_length, 0.0, 0.0])
        load = pin.Inertia(mass, np.zeros(3), np.zeros((3, 3)))
        tree.model.appendBodyToJoint(sections[k], load, pin.SE3(np.eye(3), place))


def _polar(length: float, direction: float) -> NDArray[np.float64]:
    return length * np.array([np.cos(direction), 0.0, np.sin(direction)])


def _column(robot: Robot) -> Any:
    base = robot.base
    centre = np.array([0.0, 0.0, 0.5 * base.height])
    return pin.Inertia(base.column_mass, centre, base.column_inertia * np.eye(3))


def _section(robot: Robot, number: int) -> Any:
    """Return a section's inertia: its mass spread along the box's walls."""
    mass = robot.structure_masses[number - 1] / robot.main.geometry.sections_per_arm
    shape, length = box(robot.arm), robot.main.geometry.section_length
    about_y, about_z = shape.bending_vertical / shape.area, shape.bending_lateral / shape.area
    slender = length**2 / 12.0
    inertia = mass * np.diag([about_y + about_z, slender + about_y, slender + about_z])
    return pin.Inertia(mass, np.array([0.5 * length, 0.0, 0.0]), inertia)


def _rod(mass: float, length: float) -> Any:
    """Return the inertia of a slender rod from the origin to `length` along x."""
    across = mass * length**2 / 12.0
    centre = np.array([0.5 * length, 0.0, 0.0])
    return pin.Inertia(mass, centre, np.diag([0.0, across, across]))
