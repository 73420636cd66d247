"""The table of topics: name, type, signals with field and unit, who publishes, how often.

Only standard message types, so that stock tools show every topic. A JointState carries joints
and cylinders (prismatic: position m, velocity m/s, effort N); where a topic carries several
named numbers of a controller it is a JointState too, whose `name` says what each position is.
"""

from dataclasses import dataclass
from typing import Literal

JOINT1, ROBOT = "joint1", "robot"  # the models of the machine; the robot's table: robot_topics.py

JOINT_STATE = "sensor_msgs/msg/JointState"
FLUID_PRESSURE = "sensor_msgs/msg/FluidPressure"

Every = Literal["plant", "control"]
Quality = Literal["sensor", "command"]

PLANT_PERIOD_NS = 8_000_000  # sensors, four times a control period
CONTROL_PERIOD_NS = 32_000_000  # paper 3.2
PLANT_PERIOD, CONTROL_PERIOD = PLANT_PERIOD_NS * 1e-9, CONTROL_PERIOD_NS * 1e-9  # s
TICKS = CONTROL_PERIOD_NS // PLANT_PERIOD_NS  # plant periods in a control period


@dataclass(frozen=True)
class Field:
    """Where a signal stands in its message (`position[0]`, `fluid_pressure`) and its unit.

    absent: its value where a message leaves it out; None: that is an error.
    """

    path: str
    unit: str
    absent: float | None = None


@dataclass(frozen=True)
class Topic:
    """One topic.

    name: relative. publisher: the node that publishes it. every: once a plant or control period.
    quality: sensor data are best effort for whoever asks for it, commands reliable.
    fields: signal -> field. names: the `name` list of a JointState.
    instead: nodes that publish it in the publisher's place, when they are the ones that run.
    """

    name: str
    type: str
    publisher: str
    every: Every
    quality: Quality
    fields: dict[str, Field]
    names: tuple[str, ...] = ()
    frame: str = ""
    instead: tuple[str, ...] = ()

    @property
    def publishers(self) -> tuple[str, ...]:
        """Return the nodes of which one publishes it."""
        return (self.publisher, *self.instead)

    @property
    def period_ns(self) -> int:
        """Return the time between two messages, ns."""
        return PLANT_PERIOD_NS if self.every == "plant" else CONTROL_PERIOD_NS


def named_numbers(
    name: str,
    publisher: str,
    every: Every,
    units: dict[str, str],
    quality: Quality = "sensor",
) -> Topic:
    """Return a topic of numbers with a name each, given with their units."""
    fields = {key: Field(f"position[{i}]", unit) for i, (key, unit) in enumerate(units.items())}
    return Topic(name, JOINT_STATE, publisher, every, quality, fields, tuple(units))


JOINT_STATES = Topic(
    "joint_states",
    JOINT_STATE,
    "plant_node",
    "plant",
    "sensor",
    {"angle": Field("position[0]", "rad")},
    ("joint1",),
    "base_link",
)
CYLINDER_STATES = Topic(
    "cylinder_states",
    JOINT_STATE,
    "plant_node",
    "plant",
    "sensor",
    {"stroke": Field("position[0]", "m"), "force": Field("effort[0]", "N")},
    ("cylinder1",),
    "cylinder1",
)
PRESSURE_LIFTING = Topic(
    "pressure_lifting",
    FLUID_PRESSURE,
    "plant_node",
    "plant",
    "sensor",
    {"pressure_lifting": Field("fluid_pressure", "Pa")},
    (),
    "cylinder1",
)
PRESSURE_LOWERING = Topic(
    "pressure_lowering",
    FLUID_PRESSURE,
    "plant_node",
    "plant",
    "sensor",
    {"pressure_lowering": Field("fluid_pressure", "Pa")},
    (),
    "cylinder1",
)
BOOM_DEFLECTION = Topic(
    "boom_deflection",
    JOINT_STATE,
    "plant_node",
    "plant",
    "sensor",
    {"deflection": Field("position[0]", "rad")},
    ("boom_tip",),
    "boom1",
)
TRUTH = named_numbers(
    "truth", "plant_node", "plant",
    {
        "true_angle": "rad", "true_tip_angle": "rad", "true_stroke": "m", "true_velocity": "m/s",
        "true_force": "N", "true_pressure_lifting": "Pa", "true_pressure_lowering": "Pa",
        "flow_lifting": "m^3/s", "flow_lowering": "m^3/s", "spool": "1", "logic_block": "1",
        "tcp_deflection": "m",
    },
)  # fmt: skip
CYLINDER_REFERENCE = Topic(
    "cylinder_reference",
    JOINT_STATE,
    "trajectory_node",
    "control",
    "command",
    {
        "reference_stroke": Field("position[0]", "m"),
        "reference_velocity": Field("velocity[0]", "m/s"),
    },
    ("cylinder1",),
    "cylinder1",
)
CYLINDER_PREVIEW = named_numbers(  # paper 3.3: N = 20 control periods
    "cylinder_preview",
    "trajectory_node",
    "control",
    {f"reference_stroke_{k}_ahead": "m" for k in range(1, 21)},
    "command",
)
CYLINDER_MOVE = named_numbers(
    "cylinder_move",
    "trajectory_node",
    "control",
    {"move_since": "s", "move_duration": "s", "move_distance": "m"},
    "command",
)
VELOCITY_COMMAND = Topic(
    "velocity_command",
    JOINT_STATE,
    "cascade_node",
    "control",
    "command",
    {"velocity_command": Field("velocity[0]", "m/s")},
    ("cylinder1",),
    "cylinder1",
    ("pfc_node", "pfc_tip_node", "selector_node"),
)
VALVE_LOOPS = ("lqg", "mpc")  # give the valve command, in the place of outer and force loop
OUTER_LOOPS = (
    tuple(  # their names; several at once: selector_node chooses, the others are ready
        node.removesuffix("_node")
        for node in VELOCITY_COMMAND.publishers
        if node != "selector_node"
    )
    + VALVE_LOOPS
)


def _offered(name: str) -> Topic:
    fields = {f"{name}_command": Field("velocity[0]", "m/s")}
    if name in VALVE_LOOPS:
        fields[f"{name}_ready"] = Field("position[0]", "1")
    return Topic(
        f"{name}/velocity_command", JOINT_STATE, f"{name}_node", "control", "command",
        fields, ("cylinder1",), "cylinder1",
    )  # fmt: skip


OFFERED_COMMANDS = {name: _offered(name) for name in OUTER_LOOPS}
SELECTOR_TERMS = named_numbers(
    "selector/terms",
    "selector_node",
    "control",
    {"applied_command": "m/s"} | {f"{name}_active": "1" for name in OUTER_LOOPS},
    "command",
)
VALVE_COMMAND = Topic(
    "valve_command",
    JOINT_STATE,
    "force_loop_node",
    "control",
    "command",
    {"valve_command": Field("position[0]", "1")},
    ("valve1",),
    "cylinder1",
    tuple(f"{name}_node" for name in VALVE_LOOPS),
)
CASCADE_TERMS = named_numbers(
    "cascade/terms",
    "cascade_node",
    "control",
    {"feedforward": "m/s", "feedback": "m/s", "smoothed_reference": "m"},
)


def _pfc_terms(name: str, output_unit: str) -> Topic:
    terms = dict.fromkeys(
        ("unlimited", "reference_term", "model_term", "command_term", "error_term"), "m/s"
    )
    terms |= {"model_error": output_unit, "limited": "1"}
    units = {f"{name}_{term}": unit for term, unit in terms.items()}
    return named_numbers(f"{name}/terms", f"{name}_node", "control", units)


def _lqg_terms(name: str) -> Topic:
    terms = dict.fromkeys(("planned", "wanted", "flow"), "m/s")
    terms |= {"force": "N", "payload": "kg", "deflection": "m", "limited": "1"}
    units = {f"{name}_{term}": unit for term, unit in terms.items()}
    return named_numbers(f"{name}/terms", f"{name}_node", "control", units)


LQG_TERMS = _lqg_terms("lqg")
MPC_TERMS = _lqg_terms("mpc")
PFC_TERMS = _pfc_terms("pfc", "m")
PFC_TIP_TERMS = _pfc_terms("pfc_tip", "rad")
FORCE_LOOP_TERMS = named_numbers(
    "force_loop/terms",
    "force_loop_node",
    "control",
    {"measured_force": "N", "force_feedback": "m/s", "wanted_velocity": "m/s", "saturated": "1"},
)

TOPICS: tuple[Topic, ...] = (
    JOINT_STATES, CYLINDER_STATES, PRESSURE_LIFTING, PRESSURE_LOWERING, BOOM_DEFLECTION, TRUTH,
    CYLINDER_REFERENCE, CYLINDER_PREVIEW, CYLINDER_MOVE, VELOCITY_COMMAND, VALVE_COMMAND,
    CASCADE_TERMS, PFC_TERMS, PFC_TIP_TERMS, LQG_TERMS, MPC_TERMS, FORCE_LOOP_TERMS,
    *OFFERED_COMMANDS.values(), SELECTOR_TERMS,
)  # fmt: skip
PLANT_TOPICS = tuple(topic for topic in TOPICS if topic.publisher == "plant_node")

DIAGNOSTICS = "/diagnostics"  # diagnostic_msgs/DiagnosticArray: what nodes say of themselves
ORDERS = "orders"  # the same type: what a node was ordered or had set while it ran
RECORDED = "recorder/recorded"  # std_msgs/Header: all up to this stamp is in the file (lock step)


def by_name(name: str, table: tuple[Topic, ...] = TOPICS) -> Topic:
    """Return the topic of a relative name; raises KeyError for a name not in the table."""
    return {topic.name: topic for topic in table}[name]
