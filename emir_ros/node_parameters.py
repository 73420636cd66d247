"""ROS parameters derived from parameter dataclasses, so that each is declared once."""

import math
from array import array
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any, TypeVar, get_args

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.exceptions import ParameterException
from rclpy.node import Node
from rclpy.parameter import Parameter

from emir_analysis.recorded_parameters import OF_A_TOPIC
from emir_analysis.robot_files import robot_of
from emir_common.parameter_tree import declared, with_values
from emir_common.quantity import ParameterError, Quantity
from emir_control import pfc_file
from emir_control.pfc import Form, Future, PfcParameters
from emir_msgs_py.robot_topics import ROBOT_TOPICS
from emir_msgs_py.topics import TOPICS
from emir_plant.plant import SimulationError
from emir_plant.robot.parameters import Robot
from emir_ros import qos
from emir_ros.live_parameters import is_live

Tree = TypeVar("Tree")


def declare_tree(node: Node, tree: Tree, without: str = "", live: Collection[str] = ()) -> Tree:
    """Declare every quantity of the dataclass as a ROS parameter; return it as then set.

    live: the last parts of those that may change while the node runs (`LiveParameters`).
    without: what the parameters' names leave out of the front of the quantities' paths. Raises
    ParameterError, naming node and parameter, for a value that is out of range.
    """
    values = {}
    for path, (about, default) in declared(tree).items():
        text, fixed = describe(about), not is_live(path, live)
        value = declare(node, path.removeprefix(without), default, text, fixed=fixed)
        if value != default:
            values[path] = value
    try:
        result = with_values(tree, values)
    except ParameterError as error:
        raise ParameterError(f"{node.get_name()}: {error}") from None
    for path, (about, default) in declared(tree).items():
        _tell_range(node, path.removeprefix(without), about, default)
    return result


def _tell_range(node: Node, name: str, about: Quantity, default: Any) -> None:
    """Put a quantity's range into its parameter's descriptor, where tools look for it.

    Not when it is declared: rclpy would then refuse a value before we can say its unit.
    """
    descriptor = node.describe_parameter(name)
    if type(default) is float:
        span = FloatingPointRange(from_value=about.low, to_value=about.high, step=0.0)
        descriptor.floating_point_range = [span]
    elif type(default) is int:
        low, high = math.ceil(about.low), math.floor(about.high)
        descriptor.integer_range = [IntegerRange(from_value=low, to_value=high, step=1)]


def declare_robot_sheet(node: Node) -> Robot:
    """Declare the files of the robot's sheet and return what they say.

    Raises ParameterError, naming file and key.
    """
    main = declare(node, "machine_file", "", "YAML of the main joint; empty: EMIR's joint 1")
    file = declare(node, "robot_file", "", "YAML of the robot beyond that; empty: EMIR")
    return robot_of({"robot_file": file, "machine_file": main})


def declare_pfc(node: Node, output: str, live: Collection[str] = ()) -> PfcParameters:
    """Declare a predictive controller's design file and, on top of it, its tuning.

    live: as for `declare_tree`. Raises ParameterError, naming node and parameter or file.
    """
    about = "YAML made by emir design; empty or `scheduled`: those that come with the project"
    file = declare(node, "model_file", "", about)
    with naming(node):
        design = pfc_file.load(pfc_file.find(file, output), output)
        design = replace(
            design,
            form=declare(node, "form", design.form, ", ".join(get_args(Form))),
            future=declare(node, "future", design.future, ", ".join(get_args(Future))),
        )
    return declare_tree(node, design, live=live)


@contextmanager
def naming(node: Node) -> Iterator[None]:
    """Put the node's name in front of what is wrong with its parameters, if it is not there.

    A machine that cannot be as they say (SimulationError) is a ParameterError, too.
    """
    name = f"{node.get_name()}: "
    try:
        yield
    except (ParameterError, SimulationError) as error:
        raise ParameterError(name + str(error).removeprefix(name)) from None


def declare(node: Node, name: str, default: Any, description: str, *, fixed: bool = True) -> Any:
    """Declare one parameter, as a rule fixed while the node runs, and return its value.

    Raises ParameterError for a value of another type; an integer will do for a float.
    """
    descriptor = ParameterDescriptor(description=description, read_only=fixed, dynamic_typing=True)
    try:
        value = node.declare_parameter(name, default, descriptor).value
    except ParameterException as error:
        raise ParameterError(f"{node.get_name()}: {name}: {error}") from None
    if isinstance(default, float) and type(value) is int:
        value = float(value)
    if isinstance(default, tuple) and isinstance(value, list | array):
        value = tuple(value)
    if type(value) is not type(default):
        kind = type(default).__name__
        raise ParameterError(f"{node.get_name()}: {name} = {value!r}: not of type {kind}")
    return value


def reject_unknown(node: Node) -> None:
    """Raise ParameterError if a value was given for a parameter that the node does not have.

    Those of a topic's quality of service are left to `check_overrides`.
    """
    for name in _given(node):
        known = node.has_parameter(name) or name == "start_type_description_service"
        if not known and not name.startswith(OF_A_TOPIC):
            raise _unknown(node, name, "parameter", _known_beside(node, name))


def _given(node: Node) -> dict[str, Parameter]:
    """Return the values from command line and files; rclpy offers no other way to them."""
    found: dict[str, Parameter] = node._parameter_overrides  # noqa: SLF001
    return found


def check_overrides(node: Node) -> None:
    """Raise ParameterError for a topic's quality of service that no node would take.

    To be called before any topic is published or subscribed to. It may be given to all nodes, also
    to those without the topic, and in lock step to none.
    """
    for name, given in _given(node).items():
        if name.startswith(OF_A_TOPIC):
            _check_override(node, name, given.value)


def _check_override(node: Node, name: str, value: Any) -> None:
    if node.get_parameter("lockstep").value:
        raise ParameterError(f"{node.get_name()}: {name}: fixed in lock step")
    topic, *words = name.removeprefix(OF_A_TOPIC).split(".")
    topics = {node.resolve_topic_name(known.name) for known in (*TOPICS, *ROBOT_TOPICS)}
    if topic not in topics:
        raise _unknown(node, name, "topic", topics)
    keys = {f"{end}.{key}" for end in ("publisher", "subscription") for key in qos.OVERRIDABLE}
    if ".".join(words) not in keys:
        raise _unknown(node, name, "quality", keys)
    try:
        qos.check_override(words[-1], value)
    except ParameterError as error:
        raise ParameterError(f"{node.get_name()}: {name} = {error}") from None


def _unknown(node: Node, name: str, what: str, known: Collection[str]) -> ParameterError:
    """Return what says that there is none of that name, and which there are."""
    there = ", ".join(sorted(known))
    return ParameterError(f"{node.get_name()}: {name}: there is no such {what}; there are {there}")


def _known_beside(node: Node, name: str) -> set[str]:
    """Return what the node has where an unknown dotted name leaves the known ones."""
    words = name.split(".")[:-1]
    while words and not node.get_parameters_by_prefix(".".join(words)):
        words.pop()
    known = node.get_parameters_by_prefix(".".join(words))
    return {path.partition(".")[0] for path in known}


def describe(about: Quantity) -> str:
    """Return one line: meaning, unit and range."""
    return f"{about.meaning} [{about.unit}], {about.low:g} ... {about.high:g}"
