"""The table of topics of the whole robot, in place of joint 1's when the model is `robot`.

Names and types are those of joint 1's table, with six entries where that has one: the base first,
then joints 1-5; signals are named after the joint. The pressures of all chambers come as one
message of named numbers: a FluidPressure of its own for each would double the traffic.
The force loops act every plant period: the whole robot has modes on the oil's springs up to 15 Hz,
which a loop of 32 ms would excite.
"""

from collections.abc import Sequence
from dataclasses import replace

from emir_msgs_py.topics import (
    CASCADE_TERMS,
    CYLINDER_PREVIEW,
    CYLINDER_REFERENCE,
    CYLINDER_STATES,
    FORCE_LOOP_TERMS,
    JOINT_STATES,
    PFC_TERMS,
    TRUTH,
    VALVE_COMMAND,
    VELOCITY_COMMAND,
    Every,
    Field,
    Quality,
    Topic,
    named_numbers,
)

POSE = "geometry_msgs/msg/PoseStamped"

JOINTS = ("base", "joint1", "joint2", "joint3", "joint4", "joint5")
CYLINDERS = ("base_motor", "cylinder1", "cylinder2", "cylinder3", "cylinder4", "cylinder5")
GROUND = "base_link"


def of_joints(quantity: str) -> tuple[str, ...]:
    """Return the six signals of a quantity, base first."""
    return tuple(f"{joint}_{quantity}" for joint in JOINTS)


def _units(joint: str, unit: str) -> str:
    """Return the unit of a piston's quantity; the base turns on a motor."""
    return unit if joint != "base" else {"m": "rad", "m/s": "rad/s", "N": "N m"}.get(unit, unit)


def _six(
    topic: Topic,
    frame: str,
    *quantities: tuple[str, str, str],
    every: Every | None = None,
    optional: Sequence[str] = (),
) -> Topic:
    """Return a topic of joint 1 for six: quantities are (signal, array of the message, unit).

    every: its period, if that is another. optional: signals that are 0 where they are left out.
    """
    fields = {
        f"{joint}_{signal}": Field(
            f"{array}[{i}]", _units(joint, unit), 0.0 if signal in optional else None
        )
        for signal, array, unit in quantities
        for i, joint in enumerate(JOINTS)
    }
    names = JOINTS if topic is JOINT_STATES else CYLINDERS
    return replace(topic, every=every or topic.every, fields=fields, names=names, frame=frame)


def _six_numbers(topic: Topic, *, every: Every | None = None) -> Topic:
    """Return a topic of joint 1's named numbers for six, joint by joint; every: as for `_six`."""
    units = {
        f"{joint}_{name}": _units(joint, field.unit)
        for joint in JOINTS
        for name, field in topic.fields.items()
    }
    return named_numbers(topic.name, topic.publisher, every or topic.every, units, topic.quality)


def _pose(name: str, publisher: str, prefix: str, quality: Quality) -> Topic:
    fields = {f"{prefix}_{axis}": Field(f"pose.position.{axis}", "m") for axis in "xyz"}
    fields |= {f"{prefix}_q{axis}": Field(f"pose.orientation.{axis}", "1") for axis in "xyzw"}
    every: Every = "plant" if publisher == "plant_node" else "control"
    return Topic(name, POSE, publisher, every, quality, fields, (), GROUND)


ROBOT_JOINT_STATES = _six(JOINT_STATES, GROUND, ("angle", "position", "rad"))
ROBOT_CYLINDER_STATES = _six(
    CYLINDER_STATES, GROUND, ("stroke", "position", "m"), ("force", "effort", "N")
)
PRESSURES = named_numbers(
    "chamber_pressures", "plant_node", "plant",
    {f"{joint}_pressure_{side}": "Pa" for side in ("lifting", "lowering") for joint in JOINTS},
)  # fmt: skip
TCP_POSE = _pose("tcp_pose", "plant_node", "tcp", "sensor")
TCP_DEFLECTION = named_numbers(
    "tcp_deflection", "plant_node", "plant",
    {f"deflection_{axis}": "m" for axis in "xyz"}
    | {f"deflection_about_{axis}": "rad" for axis in "xyz"},
)  # fmt: skip
TRUE_QUANTITIES = {  # of every joint; the model's name -> unit
    "angle": "rad", "rate": "rad/s", "stroke": "m", "velocity": "m/s", "force": "N",
    "pressure_lifting": "Pa", "pressure_lowering": "Pa", "spool": "1", "logic_block": "1",
}  # fmt: skip
ROBOT_TRUTH = named_numbers(
    TRUTH.name, "plant_node", "plant",
    {
        f"{joint}_true_{quantity}": _units(joint, unit)
        for quantity, unit in TRUE_QUANTITIES.items()
        for joint in JOINTS
    }
    | {"supply_pressure": "Pa"},
)  # fmt: skip
ROBOT_CYLINDER_REFERENCE = _six(
    CYLINDER_REFERENCE, GROUND,
    ("reference_stroke", "position", "m"), ("reference_velocity", "velocity", "m/s"),
    ("reference_force", "effort", "N"),
)  # fmt: skip
ROBOT_CYLINDER_PREVIEW = _six_numbers(CYLINDER_PREVIEW)
TCP_REFERENCE = _pose("tcp_reference", "trajectory_node", "tcp_reference", "command")
ROBOT_VELOCITY_COMMAND = _six(
    VELOCITY_COMMAND, GROUND,
    ("velocity_command", "velocity", "m/s"), ("expected_force", "effort", "N"),
    optional=("expected_force",),
)  # fmt: skip
ROBOT_VALVE_COMMAND = _six(VALVE_COMMAND, GROUND, ("valve_command", "position", "1"), every="plant")
ROBOT_CASCADE_TERMS = _six_numbers(CASCADE_TERMS)
ROBOT_PFC_TERMS = _six_numbers(PFC_TERMS)
ROBOT_FORCE_LOOP_TERMS = _six_numbers(FORCE_LOOP_TERMS, every="plant")

ROBOT_TOPICS: tuple[Topic, ...] = (
    ROBOT_JOINT_STATES, ROBOT_CYLINDER_STATES, PRESSURES, TCP_POSE, TCP_DEFLECTION, ROBOT_TRUTH,
    ROBOT_CYLINDER_REFERENCE, ROBOT_CYLINDER_PREVIEW, TCP_REFERENCE, ROBOT_VELOCITY_COMMAND,
    ROBOT_VALVE_COMMAND, ROBOT_CASCADE_TERMS, ROBOT_PFC_TERMS, ROBOT_FORCE_LOOP_TERMS,
)  # fmt: skip
ROBOT_PLANT_TOPICS = tuple(topic for topic in ROBOT_TOPICS if topic.publisher == "plant_node")
