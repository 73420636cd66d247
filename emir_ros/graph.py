"""The nodes of a run and the ROS arguments that set them up."""

import json
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from emir_analysis.switching import Selector, Switch
from emir_common.parameter_tree import with_values
from emir_common.quantity import ParameterError
from emir_common.version import software_version
from emir_common.yaml_file import read_map
from emir_control.trajectory import TrajectoryParameters, named
from emir_msgs_py.topics import OFFERED_COMMANDS, TOPICS

VALVE_CONTROLLERS = ("lqg", "mpc")  # give the valve command, no velocity: no switching
CONTROLLERS: dict[str, tuple[str, ...]] = {
    name: ("trajectory_node", f"{name}_node", "force_loop_node")
    for name in ("cascade", "pfc", "pfc_tip")
}
CONTROLLERS |= {name: ("trajectory_node", f"{name}_node") for name in VALVE_CONTROLLERS}
NODES = tuple(dict.fromkeys(  # each once
    ("recorder_node", *(node for nodes in CONTROLLERS.values() for node in nodes),
     "selector_node", "plant_node")
))  # fmt: skip
EVERY_NODE = "/**"


@dataclass(frozen=True)
class Plan:
    """What a run of the graph shall do.

    controller: a key of CONTROLLERS. switches: to which others, and when; these run from the
    start as well, and hold their state ready. duration: s; None: as long as the trajectory takes.
    params: ROS 2 parameter file, or None.
    """

    bag: Path
    controller: str = "cascade"
    trajectory: str = "lift-lower"
    duration: float | None = None
    params: Path | None = None
    lockstep: bool = True
    switches: tuple[Switch, ...] = ()

    @property
    def controllers(self) -> tuple[str, ...]:
        """Return the names of the controllers that run, each once."""
        return tuple(dict.fromkeys((self.controller, *(s.name for s in self.switches))))

    @property
    def nodes(self) -> tuple[str, ...]:
        """Return the names of the run's nodes, the plant last."""
        loops = dict.fromkeys(node for name in self.controllers for node in CONTROLLERS[name])
        selector = ("selector_node",) if self.switches else ()
        return ("recorder_node", *loops, *selector, "plant_node")

    @property
    def topics(self) -> tuple[str, ...]:
        """Return the names of the topics that these nodes publish, in the table's order."""
        offered = () if self.switches else OFFERED_COMMANDS.values()
        return tuple(
            topic.name
            for topic in TOPICS
            if topic not in offered and not set(topic.publishers).isdisjoint(self.nodes)
        )


def check(plan: Plan) -> None:
    """Raise ParameterError for what can be seen to be wrong before anything starts."""
    for name in plan.controllers:
        if name not in CONTROLLERS:
            raise ParameterError(f"controller {name!r}: there are {', '.join(CONTROLLERS)}")
        if name in VALVE_CONTROLLERS and plan.switches:
            raise ParameterError(f"controller {name!r}: cannot be switched to or from")
    if plan.controller not in VALVE_CONTROLLERS:
        Selector(plan.controllers, _from_the_start(plan))
    if plan.bag.exists():
        raise ParameterError(f"{plan.bag}: exists already, and is not overwritten")
    if plan.duration is not None and not 0.0 < plan.duration < float("inf"):
        raise ParameterError(f"duration = {plan.duration:g} s: has to be positive")
    for node in read_parameters(plan.params):
        if node not in (*NODES, EVERY_NODE):
            raise ParameterError(
                f"{plan.params}: {node}: no such node; there are {', '.join(NODES)}"
            )
    duration(plan)


def duration(plan: Plan) -> float:
    """Return how long the run takes, s."""
    given = read_parameters(plan.params).get("trajectory_node", {})
    own = {key: value for key, value in given.items() if key not in ("trajectory", "lockstep")}
    try:
        trajectory = named(plan.trajectory, with_values(TrajectoryParameters(), own))
    except ParameterError as error:
        where = f"{plan.params}: trajectory_node: " if own else ""
        raise ParameterError(f"{where}{error}") from None
    return trajectory.duration if plan.duration is None else plan.duration


def read_parameters(file: Path | None) -> dict[str, dict[str, Any]]:
    """Return a ROS 2 parameter file as {node: {dotted name: value}}; {} for None.

    Raises ParameterError, naming file and node, for what is no such file.
    """
    if file is None:
        return {}
    found = {}
    for node, entry in read_map(file, what="node").items():
        if not isinstance(entry, dict) or not isinstance(entry.get("ros__parameters"), dict):
            raise ParameterError(f"{file}: {node}: ros__parameters is missing")
        name = node if node == EVERY_NODE else str(node).rsplit("/", 1)[-1]
        found[name] = _flat(entry["ros__parameters"])
    return found


def _flat(tree: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for key, value in tree.items():
        if isinstance(value, dict):
            flat |= _flat(value, f"{prefix}{key}.")
        else:
            flat[f"{prefix}{key}"] = value
    return flat


@contextmanager
def ros_arguments(plan: Plan) -> Iterator[list[str]]:
    """Give the ROS arguments that every node of the run gets, valid inside the context."""
    with tempfile.TemporaryDirectory(prefix="emir-") as folder:
        own = Path(folder) / "run.yaml"
        own.write_text(yaml.safe_dump(_run_parameters(plan)), encoding="utf-8")
        files = [plan.params, own] if plan.params else [own]  # the later file prevails
        yield ["--ros-args", *(word for file in files for word in ("--params-file", str(file)))]


def _run_parameters(plan: Plan) -> dict[str, Any]:
    nodes: dict[str, dict[str, Any]] = {
        EVERY_NODE: {"lockstep": plan.lockstep},
        "plant_node": {"duration": float(duration(plan)), "wait_for_recorder": True},
        "trajectory_node": {"trajectory": plan.trajectory},
        "recorder_node": {
            "bag": str(plan.bag),
            "description": json.dumps(_description(plan)),
            "topics": list(plan.topics),
            "nodes": [name for name in plan.nodes if name != "recorder_node"],
        },
    }
    if plan.switches:
        nodes["selector_node"] = _selector_parameters(plan)
        nodes |= {f"{name}_node": {"standby": True} for name in plan.controllers}
    return {
        node if node == EVERY_NODE else f"/**/{node}": {"ros__parameters": values}
        for node, values in nodes.items()
    }


def _from_the_start(plan: Plan) -> list[Switch]:
    return [Switch(0.0, plan.controller), *plan.switches]


def _selector_parameters(plan: Plan) -> dict[str, Any]:
    switches = _from_the_start(plan)
    return {
        "controllers": list(plan.controllers),
        "switch_times": [switch.time for switch in switches],
        "switch_to": [switch.name for switch in switches],
    }


def _description(plan: Plan) -> dict[str, str]:
    return {
        "software": f"emir {software_version()}",
        "controller": ", then ".join(
            [plan.controller, *(f"{s.name} from {s.time:g} s" for s in plan.switches)]
        ),
        "trajectory": plan.trajectory,
        "duration": f"{duration(plan):g} s",
        "time": "lockstep" if plan.lockstep else "realtime",
        "parameters": json.dumps(read_parameters(plan.params)),
    }
