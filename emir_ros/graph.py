"""The nodes of a run and the ROS arguments that set them up."""

import json
import re
import tempfile
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from emir_analysis.recorded_parameters import OF_A_TOPIC, OF_EVERY_NODE
from emir_analysis.robot_files import FILES, robot_of
from emir_analysis.robot_setup import path_parameters, trajectory_of
from emir_analysis.switching import Selector, Switch
from emir_common.parameter_tree import with_values
from emir_common.quantity import ParameterError
from emir_common.version import software_version
from emir_control.robot_trajectory import RobotTrajectoryInputs
from emir_control.trajectory import TrajectoryParameters, named
from emir_msgs_py.robot_topics import ROBOT_TOPICS
from emir_msgs_py.topics import JOINT1, OFFERED_COMMANDS, ROBOT, TOPICS, VALVE_LOOPS
from emir_plant.robot import require_pinocchio
from emir_ros.machines import RobotStart
from emir_ros.run_parameters import WILDCARDS, reaches, read_entries, values_of

CONTROLLERS: dict[str, tuple[str, ...]] = {
    name: ("trajectory_node", f"{name}_node", "force_loop_node")
    for name in ("cascade", "pfc", "pfc_tip")
}
CONTROLLERS |= {name: ("trajectory_node", f"{name}_node") for name in VALVE_LOOPS}
NODES = tuple(dict.fromkeys(  # each once
    ("recorder_node", *(node for nodes in CONTROLLERS.values() for node in nodes),
     "selector_node", "plant_node")
))  # fmt: skip
MODELS = {JOINT1: TOPICS, ROBOT: ROBOT_TOPICS}
OF_THE_NODE = ("trajectory", *OF_EVERY_NODE)  # of trajectory_node, but not of its trajectory
KNOWN_TO_LINE = ("supply.p0", "geometry.payload", "effects.payload.mass")  # of the robot's plant
ROBOT_CONTROLLERS = ("cascade", "pfc")


@dataclass(frozen=True)
class Plan:
    """What a run of the graph shall do.

    controller: a key of CONTROLLERS. switches: to which others, and when; these run from the
    start as well, and hold their state ready. duration: s; None: as long as the trajectory takes.
    params: ROS 2 parameter file, or None. model: a key of MODELS. namespace: of all nodes and
    topics, so that several machines have their place in one ROS domain.
    """

    bag: Path
    controller: str = "cascade"
    trajectory: str = "lift-lower"
    duration: float | None = None
    params: Path | None = None
    lockstep: bool = True
    model: str = JOINT1
    switches: tuple[Switch, ...] = ()
    namespace: str = ""

    @property
    def controllers(self) -> tuple[str, ...]:
        """Return the names of the controllers that run, each once."""
        return tuple(dict.fromkeys((self.controller, *(s.name for s in self.switches))))

    @property
    def nodes(self) -> tuple[str, ...]:
        """Return the names of the run's nodes, the plant last."""
        loops = dict.fromkeys(node for name in self.controllers for node in CONTROLLERS[name])
        selector = ("selector_node", "force_loop_node") if self.switches else ()
        return ("recorder_node", *dict.fromkeys((*loops, *selector)), "plant_node")

    @property
    def topics(self) -> tuple[str, ...]:
        """Return the names of the topics that these nodes publish, in the table's order."""
        offered = () if self.switches else OFFERED_COMMANDS.values()
        return tuple(
            topic.name
            for topic in MODELS[self.model]
            if topic not in offered and not set(topic.publishers).isdisjoint(self.nodes)
        )


def check(plan: Plan) -> None:
    """Raise ParameterError for what can be seen to be wrong before anything starts."""
    _check_model(plan)
    Selector(plan.controllers, _from_the_start(plan))
    if not re.fullmatch(r"([A-Za-z_]\w*(/[A-Za-z_]\w*)*)?", plan.namespace, re.ASCII):
        raise ParameterError(
            f"namespace {plan.namespace!r}: letters, digits and _, not a digit first"
        )
    if plan.bag.exists():
        raise ParameterError(f"{plan.bag}: exists already, and is not overwritten")
    if plan.duration is not None and not 0.0 < plan.duration < float("inf"):
        raise ParameterError(f"duration = {plan.duration:g} s: has to be positive")
    _check_entries(plan)
    end = duration(plan)
    for switch in plan.switches:
        if switch.time >= end:
            raise ParameterError(
                f"--switch {switch.time:g}={switch.name}: the run is over after {end:g} s"
            )


def _check_entries(plan: Plan) -> None:
    """Raise ParameterError, naming file and node, for no node of a run or for another model's."""
    for pattern, values in read_entries(plan.params).items():
        where, name = f"{plan.params}: {pattern}: ", pattern.rsplit("/", 1)[-1]
        if name not in (*NODES, *WILDCARDS):
            raise ParameterError(f"{where}no such node; there are {', '.join(NODES)}")
        model = values.get("model", plan.model)
        if model not in list(MODELS):
            raise ParameterError(f"{where}model {model!r}: there are {', '.join(MODELS)}")
        if model != plan.model and any(reaches(pattern, n, plan.namespace) for n in NODES):
            raise ParameterError(
                f"{where}for the model {model}, and the run is of {plan.model}:"
                f" give --model {model}"
            )


def _check_model(plan: Plan) -> None:
    if plan.model not in MODELS:
        raise ParameterError(f"model {plan.model!r}: there are {', '.join(MODELS)}")
    if plan.model == ROBOT:
        require_pinocchio()
        if plan.switches:
            raise ParameterError("switching: the whole robot keeps one controller")
    known = ROBOT_CONTROLLERS if plan.model == ROBOT else tuple(CONTROLLERS)
    for name in plan.controllers:
        if name not in known:
            there = "the whole robot has" if plan.model == ROBOT else "there are"
            raise ParameterError(f"controller {name!r}: {there} {', '.join(known)}")


def duration(plan: Plan) -> float:
    """Return how long the run takes, s. Raises ParameterError for a trajectory that cannot be."""
    given = read_parameters(plan)
    given_to_node = given.get("trajectory_node", {})
    own = {
        name: value
        for name, value in given_to_node.items()
        if name not in OF_THE_NODE and not name.startswith(OF_A_TOPIC)
    }
    if plan.model == ROBOT:
        takes = _robot_duration(plan, given, own)
    else:
        takes = _joint1_duration(plan, own)
    return takes if plan.duration is None else plan.duration


def _joint1_duration(plan: Plan, own: dict[str, Any]) -> float:
    """Return how long joint 1's trajectory takes, s."""
    with _told_by(plan, "trajectory_node", own):
        return named(plan.trajectory, with_values(TrajectoryParameters(), own)).duration


def _robot_duration(plan: Plan, given: dict[str, dict[str, Any]], own: dict[str, Any]) -> float:
    """Return how long the robot's trajectory takes, s, from where and with what it is to start."""
    with _told_by(plan, "trajectory_node", own):
        sheet = robot_of(own)
    plant = given.get("plant_node", {})
    with _told_by(plan, "plant_node", plant):
        main = with_values(sheet.main, {k: v for k, v in plant.items() if k in KNOWN_TO_LINE})
        angles = {k: v for k, v in plant.items() if k.startswith("initial_angles.")}
        start = RobotTrajectoryInputs(with_values(RobotStart(), angles).initial_angles.angles)
        path = with_values(path_parameters(sheet), {"supply": main.supply.p0})
        if own.get("weigh", path.weigh):
            path = with_values(path, {"arm.payload": main.payload})
    values = {name: value for name, value in own.items() if name not in FILES}
    with _told_by(plan, "trajectory_node", values):
        planned = trajectory_of(sheet, plan.trajectory, path, values)
        return planned.initial(start).timing.duration


@contextmanager
def _told_by(plan: Plan, node: str, values: Collection[str]) -> Iterator[None]:
    """Put file and node in front of what is wrong, where the file has values for the node."""
    where = f"{plan.params}: {node}: " if values else ""
    try:
        yield
    except ParameterError as error:
        raise ParameterError(f"{where}{error}") from None


def read_parameters(plan: Plan) -> dict[str, dict[str, Any]]:
    """Return what the plan's parameter file says to nodes of its run, {node: {name: value}}.

    Raises ParameterError, naming file and node, for what is no such file.
    """
    entries = read_entries(plan.params)
    found = {node: values_of(entries, node, plan.namespace) for node in NODES}
    return {node: values for node, values in found.items() if values}


@contextmanager
def ros_arguments(plan: Plan) -> Iterator[list[str]]:
    """Give the ROS arguments that every node of the run gets, valid inside the context."""
    given, own = read_parameters(plan), _run_parameters(plan)
    nodes = {f"/**/{node}": {"ros__parameters": given.get(node, {}) | own[node]} for node in NODES}
    with tempfile.TemporaryDirectory(prefix="emir-") as folder:
        file = Path(folder) / "run.yaml"
        file.write_text(yaml.safe_dump(nodes), encoding="utf-8")
        words = ["--params-file", str(file)]
        if plan.namespace:
            words += ["-r", f"__ns:=/{plan.namespace}"]
        yield ["--ros-args", *words]


def unused(plan: Plan) -> list[str]:
    """Return what of the parameter file the run does not take, a line for each reason."""
    own, lines = _run_parameters(plan), []
    elsewhere, found = [], []
    for pattern, given in read_entries(plan.params).items():
        nodes = [node for node in NODES if reaches(pattern, node, plan.namespace)]
        if not nodes:
            elsewhere.append(pattern)
        names = [
            name
            for name, value in given.items()
            if any(name in own[node] and own[node][name] != value for node in nodes)
        ]
        if names:
            found.append(f"{pattern}: {', '.join(names)}")
    if found:
        lines.append(f"not used, the run sets it: {'; '.join(found)}")
    if elsewhere:
        lines.append(f"not used, of another namespace: {', '.join(elsewhere)}")
    return lines


def _run_parameters(plan: Plan) -> dict[str, dict[str, Any]]:
    """Return what the run itself sets, of each node."""
    nodes: dict[str, dict[str, Any]] = {
        "plant_node": {"duration": float(duration(plan)), "wait_for_recorder": True},
        "trajectory_node": _trajectory_parameters(plan),
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
        nodes["force_loop_node"] = {"standby": not set(VALVE_LOOPS).isdisjoint(plan.controllers)}
    of_every_node = {"lockstep": plan.lockstep, "model": plan.model}
    return {node: of_every_node | nodes.get(node, {}) for node in NODES}


def _trajectory_parameters(plan: Plan) -> dict[str, Any]:
    """Return the trajectory's name and, if another than the sheet's, the robot's pump pressure."""
    given = read_parameters(plan)
    pressure = given.get("plant_node", {}).get("supply.p0")
    if plan.model != ROBOT or pressure is None:
        return {"trajectory": plan.trajectory}
    supply = given.get("trajectory_node", {}).get("supply", pressure)
    return {"trajectory": plan.trajectory, "supply": float(supply)}


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
        "model": plan.model,
        "controller": ", then ".join(
            [plan.controller, *(f"{s.name} from {s.time:g} s" for s in plan.switches)]
        ),
        "trajectory": plan.trajectory,
        "duration": f"{duration(plan):g} s",
        "time": "lockstep" if plan.lockstep else "realtime",
        "parameters": json.dumps(read_parameters(plan)),
    }
