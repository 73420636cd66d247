"""Parameters of the whole robot beyond those of the main joint: frozen dataclasses, SI units.

The values stand in data/robot.yaml; what joint 1 shares with the main joint's own model (its
triangle, the boom's length, mass and bending springs, hydraulics, supply) in data/joint1.yaml.
"""

from dataclasses import dataclass, field, fields

from emir_common.quantity import ParameterError, check_ranges, quantity
from emir_plant.effects import Effects
from emir_plant.linkage import third_side
from emir_plant.parameters import Machine

JOINTS = 5  # horizontal ones; paper 2.1
FOUR_BARS = ("joint2", "joint3", "joint4", "joint5")


@dataclass(frozen=True, kw_only=True)
class Linkage:
    """Lengths and directions of a linkage, see `linkage.py`; thrust_bar 0 means a triangle.

    Directions turn from the carrying arm's axis (forward) towards up.
    """

    foot: float = quantity("m", 0.05, 20.0, "cylinder foot to lever pivot")
    lever: float = quantity("m", 0.05, 20.0, "lever pivot to rod eye")
    thrust_bar: float = quantity("m", 0.0, 20.0, "rod eye to arm-side pin")
    arm_link: float = quantity("m", 0.05, 20.0, "joint to arm-side pin")
    ground_link: float = quantity("m", 0.0, 20.0, "joint to lever pivot")
    foot_direction: float = quantity("rad", -6.2832, 6.2832, "lever pivot to cylinder foot")
    ground_direction: float = quantity("rad", -6.2832, 6.2832, "joint to lever pivot")
    arm_link_direction: float = quantity("rad", -6.2832, 6.2832, "arm-side pin, alpha = 0")
    assembly: int = quantity("1", -1, 1, "side of the loop on which lever and bar are mounted")
    length_retracted: float = quantity("m", 0.05, 20.0, "cylinder foot to rod eye, retracted")
    stroke: float = quantity("m", 0.01, 20.0, "of the piston from end to end")


@dataclass(frozen=True, kw_only=True)
class Parts:
    """Masses of a linkage's parts, each a slender uniform rod between its pins.

    The lever's mass counts for nothing in a triangle, where it belongs to the arm.
    """

    barrel_mass: float = quantity("kg", 0.0, 5000.0, "cylinder, from its foot")
    barrel_length: float = quantity("m", 0.05, 20.0, "of the cylinder's tube")
    piston_mass: float = quantity("kg", 0.0, 5000.0, "piston and rod, up to the rod eye")
    piston_length: float = quantity("m", 0.05, 20.0, "of piston and rod")
    lever_mass: float = quantity("kg", 0.0, 5000.0, "lever pivot to rod eye")
    thrust_bar_mass: float = quantity("kg", 0.0, 5000.0, "rod eye to arm-side pin")


@dataclass(frozen=True, kw_only=True)
class Drive:
    """Size of a joint's cylinder and valve; all else is the main joint's, made to its scale."""

    bore: float = quantity("m", 0.01, 1.0, "diameter of the piston")
    rod: float = quantity("m", 0.005, 0.9, "diameter of the rod")
    dead_volume_lifting: float = quantity("m^3", 1e-5, 1.0, "retracted, lines included")
    dead_volume_lowering: float = quantity("m^3", 1e-5, 1.0, "extended, lines included")
    flow_nominal: float = quantity("m^3/s", 1e-6, 0.1, "into the lifting chamber, fully open")


@dataclass(frozen=True, kw_only=True)
class Joint:
    """A joint with a four-bar."""

    linkage: Linkage
    parts: Parts
    drive: Drive
    effects: Effects = field(default_factory=Effects)


@dataclass(frozen=True, kw_only=True)
class MainJoint:
    """What joint 1 has beside the main joint's own parameters."""

    stroke: float = quantity("m", 0.01, 20.0, "of the piston, from h = 0")
    parts: Parts


@dataclass(frozen=True, kw_only=True)
class Base:
    """The rotating column and its hydraulic motor.

    Its effects take N for N m, m for rad.
    """

    column_mass: float = quantity("kg", 1.0, 1e5, "rotating column")
    column_inertia: float = quantity("kg m^2", 1.0, 1e6, "about the vertical axis")
    height: float = quantity("m", 0.0, 20.0, "ground to joint 1")
    displacement: float = quantity("m^3/rad", 1e-5, 1.0, "motor with gear, per angle of the base")
    chamber: float = quantity("m^3", 1e-5, 1.0, "each of the two equal chambers with lines")
    flow_nominal: float = quantity("m^3/s", 1e-6, 0.1, "into either chamber, fully open")
    effects: Effects = field(default_factory=Effects)


@dataclass(frozen=True, kw_only=True)
class Arm:
    """One elastic arm: a hollow steel box; all five are alike."""

    youngs_modulus: float = quantity("Pa", 1e9, 1e12, "E")
    poisson_ratio: float = quantity("1", 0.0, 0.5, "nu")
    height: float = quantity("m", 0.02, 5.0, "of the box, outside")
    width: float = quantity("m", 0.02, 5.0, "of the box, outside")
    wall: float = quantity("m", 1e-4, 0.2, "thickness of the box's walls")
    damping_time: float = quantity("s", 0.0, 0.1, "dampers / springs of the cuts")


@dataclass(frozen=True, kw_only=True)
class Pump:
    """The one pump of all actuators; it holds the main joint's p0 while its flow lasts."""

    flow_max: float = quantity("m^3/s", 1e-5, 1.0, "largest flow")
    droop: float = quantity("Pa", 1e4, 1e7, "missing pressure at which it gives its largest flow")
    line_volume: float = quantity("m^3", 1e-4, 10.0, "oil between pump and valves")


@dataclass(frozen=True, kw_only=True)
class EndStop:
    """What the piston meets at the ends of its stroke."""

    stiffness: float = quantity("N/m", 1e5, 1e10, "of cylinder head and piston")
    damping: float = quantity("N s/m", 0.0, 1e8, "while pressed in")


@dataclass(frozen=True, kw_only=True)
class Robot:
    """All parameters of the robot.

    Raises ParameterError, with group and field named, for a value outside its range, a box
    without a hollow or an arm lighter than the linkage on it.
    """

    main: Machine
    base: Base
    arm: Arm
    pump: Pump
    end_stop: EndStop
    joint1: MainJoint
    joint2: Joint
    joint3: Joint
    joint4: Joint
    joint5: Joint

    def __post_init__(self) -> None:
        check_ranges(self.base, "base.")
        for name, effects in self.effects.items():
            for effect in fields(Effects):
                check_ranges(getattr(effects, effect.name), f"{name}.effects.{effect.name}.")
        for name in ("arm", "pump", "end_stop"):
            check_ranges(getattr(self, name), f"{name}.")
        check_ranges(self.joint1, "joint1.")
        check_ranges(self.joint1.parts, "joint1.parts.")
        for number, joint in enumerate(self.four_bars, start=2):
            for name in ("linkage", "parts", "drive"):
                check_ranges(getattr(joint, name), f"joint{number}.{name}.")
            if joint.linkage.assembly == 0 or joint.linkage.thrust_bar == 0.0:
                raise ParameterError(f"joint{number}.linkage: no four-bar")
        if 2.0 * self.arm.wall >= min(self.arm.width, self.arm.height):
            raise ParameterError(f"arm.wall = {self.arm.wall:g}: leaves no hollow in the box")
        if self.main.geometry.arms != JOINTS:
            raise ParameterError(f"geometry.arms = {self.main.geometry.arms}: the robot has 5")
        lightest = min(self.structure_masses)
        if lightest <= 0.0:
            raise ParameterError("geometry.boom_mass: an arm is lighter than the linkage on it")

    @property
    def four_bars(self) -> tuple[Joint, ...]:
        """The joints 2-5."""
        return (self.joint2, self.joint3, self.joint4, self.joint5)

    @property
    def effects(self) -> dict[str, Effects]:
        """The effects of base and joints 2-5; those of joint 1 are the main joint's."""
        others = zip(FOUR_BARS, self.four_bars, strict=True)
        return {"base": self.base.effects} | {name: joint.effects for name, joint in others}

    @property
    def linkages(self) -> tuple[Linkage, ...]:
        """The linkages of joints 1-5."""
        return (self._triangle(), *(joint.linkage for joint in self.four_bars))

    @property
    def parts(self) -> tuple[Parts, ...]:
        """The parts of the linkages of joints 1-5."""
        return (self.joint1.parts, *(joint.parts for joint in self.four_bars))

    @property
    def structure_masses(self) -> tuple[float, ...]:
        """Each arm without the linkage parts mounted on it, kg.

        The boom's mass is uniform with them, as joint 1's own model has it.
        """
        arm = self.main.geometry.boom_mass / JOINTS
        mounted = [
            p.barrel_mass + p.piston_mass + p.lever_mass + p.thrust_bar_mass for p in self.parts[1:]
        ]
        return (*(arm - m for m in mounted), arm)

    def _triangle(self) -> Linkage:
        g = self.main.geometry
        return Linkage(
            foot=g.triangle_a,
            lever=g.triangle_b,
            thrust_bar=0.0,
            arm_link=g.triangle_b,
            ground_link=0.0,
            foot_direction=-g.triangle_gamma0,
            ground_direction=0.0,
            arm_link_direction=0.0,
            assembly=1,
            length_retracted=third_side(g.triangle_a, g.triangle_b, g.triangle_gamma0),
            stroke=self.joint1.stroke,
        )
