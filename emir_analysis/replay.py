"""A recording's inputs fed to its controller, the answers compared with the recorded ones.

Open loop: what was recorded is fed whatever the controller answers.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from emir_analysis import bags
from emir_analysis.errors import InputError
from emir_analysis.node_controls import (
    CascadeControl,
    ForceLoopControl,
    NodeControl,
    PfcControl,
    PfcTipControl,
    TrajectoryControl,
)
from emir_analysis.run_signals import full_name
from emir_common.parameter_tree import with_values
from emir_common.quantity import ParameterError
from emir_control import pfc_file
from emir_control.cascade import Cascade, CascadeParameters
from emir_control.force_loop import ForceLoop, ForceLoopParameters
from emir_control.pfc import Pfc, PfcParameters
from emir_control.tip import Tip
from emir_control.trajectory import TrajectoryParameters, named
from emir_msgs_py import conversions
from emir_msgs_py.topics import CONTROL_PERIOD_NS, Topic

Array = NDArray[np.float64]
Values = dict[str, Any]

NODES = ("trajectory", "cascade", "pfc", "pfc_tip", "force_loop")
OF_EVERY_NODE = (
    "lockstep",
    "model",
    "input_timeout",
)  # parameters of the node, not of its controller


@dataclass(frozen=True)
class FieldComparison:
    """A signal as recorded and as replayed, (n,) each, one value a control period.

    n = 0: an older recording that does not have the topic.
    """

    topic: str
    name: str
    unit: str
    recorded: Array
    replayed: Array

    @property
    def equal(self) -> int:
        """Return how many samples agree in every bit."""
        return int(np.sum(self.recorded.view(np.int64) == self.replayed.view(np.int64)))

    @property
    def largest_difference(self) -> float:
        """Return the largest difference; nan where one of the two is not a number."""
        differ = self.recorded.view(np.int64) != self.replayed.view(np.int64)
        return float(np.max(np.abs(self.replayed - self.recorded)[differ], initial=0.0))


def replay(bag: Path, node: str, changed: Mapping[str, Any]) -> list[FieldComparison]:
    """Feed a lock-step recording to a node's controller and compare the outputs.

    node: of NODES. changed: parameters by dotted name, over those of the recorded run. Raises
    InputError for a recording without the node's topics or not in lock step, ParameterError for
    a parameter that does not exist or is out of range.
    """
    if node not in NODES:
        raise InputError(f"--node {node}: there are {', '.join(NODES)}")
    about = bags.metadata(bag).get("emir", {})
    control = _control(node, {**_recorded_parameters(bag, node, about), **changed})
    inputs = _by_stamp(bag, control.inputs)
    there = bags.recorded_topics(bag)
    kept = tuple(topic for topic in control.outputs if full_name(topic, there))
    outputs = _by_stamp(bag, kept or control.outputs)
    state, rows = None, []
    for stamp, signals in sorted(inputs.items()):
        state, answer = control.step(state, signals, CONTROL_PERIOD_NS * 1e-9)
        if stamp in outputs:
            rows.append((outputs[stamp], answer))
    if not rows:
        raise InputError(f"{bag}: no control period with all topics of {node}: not in lock step?")
    return [
        FieldComparison(
            topic.name,
            name,
            field.unit,
            np.array([recorded[name] for recorded, _ in rows if name in recorded], dtype=float),
            np.array([answer[name] for recorded, answer in rows if name in recorded], dtype=float),
        )
        for topic in control.outputs
        for name, field in topic.fields.items()
    ]


def text(fields: list[FieldComparison], changed: Mapping[str, Any]) -> str:
    """Return the comparison as lines of text."""
    lines = []
    if changed:
        given = ", ".join(f"{name} = {value}" for name, value in changed.items())
        lines.append(f"with {given}; open loop: the machine does not answer")
    wide = max(len(field.name) for field in fields)
    return "\n".join([*lines, *(f"  {field.name:{wide}}  {_line(field)}" for field in fields)])


def _line(field: FieldComparison) -> str:
    if not field.recorded.size:
        return "   not recorded"
    difference = f"largest difference {field.largest_difference:.3g} {field.unit}"
    return f"{field.equal:>6} of {field.recorded.size} equal, {difference}"


def same(fields: list[FieldComparison]) -> bool:
    """Return whether every sample agrees in every bit."""
    return all(field.equal == field.recorded.size for field in fields)


def _recorded_parameters(bag: Path, node: str, about: Mapping[str, str]) -> Values:
    """Return what the run set for the node's controller, by dotted name."""
    try:
        nodes = json.loads(about.get("parameters", "{}"))
        values = {**nodes.get("/**", {}), **nodes.get(f"{node}_node", {})}
        if node == "trajectory" and "trajectory" in about:  # of the command line, which prevails
            values["trajectory"] = about["trajectory"]
    except (ValueError, AttributeError, TypeError):
        raise InputError(f"{bag}: metadata: parameters: not JSON of nodes") from None
    return {name: value for name, value in values.items() if name not in OF_EVERY_NODE}


def _control(node: str, values: Values) -> NodeControl:
    try:
        if node == "cascade":
            return CascadeControl(Cascade(with_values(CascadeParameters(), values)))
        if node == "force_loop":
            return ForceLoopControl(ForceLoop(with_values(ForceLoopParameters(), values)))
        if node == "pfc":
            return PfcControl(Pfc(_design(pfc_file.STROKE, values)))
        if node == "pfc_tip":
            return PfcTipControl(Tip(Pfc(_design(pfc_file.TIP_ANGLE, values))))
        name = values.pop("trajectory", "lift-lower")
        return TrajectoryControl(named(name, with_values(TrajectoryParameters(), values)))
    except ParameterError as error:
        raise ParameterError(f"{node}: {error}") from None


def _design(output: str, values: Values) -> PfcParameters:
    file = values.pop("model_file", "")
    design = pfc_file.load(Path(str(file)) if file else pfc_file.default_file(output), output)
    words = {name: values.pop(name) for name in ("form", "future") if name in values}
    return with_values(replace(design, **words), values)


def _by_stamp(bag: Path, topics: tuple[Topic, ...]) -> dict[int, dict[str, float]]:
    """Return the signals of each control period in which every topic was recorded."""
    there = bags.recorded_topics(bag)
    names = {topic.name: full_name(topic, there) for topic in topics}
    for name, full in names.items():
        if full is None:
            raise InputError(f"{bag}: no topic {name}; there are {', '.join(sorted(there))}")
    messages = bags.read(bag, {full for full in names.values() if full})
    found: list[dict[int, dict[str, float]]] = []
    for topic in topics:
        full = names[topic.name] or ""
        try:
            found.append(
                {
                    message.stamp: conversions.values(topic, message.data)
                    for message in messages[full]
                    if message.stamp % CONTROL_PERIOD_NS == 0
                }
            )
        except LookupError as error:
            raise InputError(f"{bag}: {full}: {error}") from None
    stamps = set(found[0]).intersection(*found[1:])
    return {
        stamp: {name: value for of_topic in found for name, value in of_topic[stamp].items()}
        for stamp in stamps
    }
