"""The signals of a run of the graph, from a recording in any namespace."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from emir_analysis.graph_topics import graph_topics
from emir_analysis.signals import Recording, Source, load
from emir_msgs_py.robot_topics import (
    PRESSURES,
    ROBOT_CYLINDER_REFERENCE,
    ROBOT_CYLINDER_STATES,
    ROBOT_JOINT_STATES,
    ROBOT_TRUTH,
    ROBOT_VALVE_COMMAND,
    TCP_DEFLECTION,
    TCP_POSE,
    TCP_REFERENCE,
)
from emir_msgs_py.topics import (
    BOOM_DEFLECTION,
    CYLINDER_REFERENCE,
    CYLINDER_STATES,
    JOINT_STATES,
    PRESSURE_LIFTING,
    PRESSURE_LOWERING,
    TRUTH,
    VALVE_COMMAND,
)

NEEDED = (CYLINDER_STATES, CYLINDER_REFERENCE, VALVE_COMMAND, PRESSURE_LIFTING, PRESSURE_LOWERING)
OPTIONAL = (JOINT_STATES, BOOM_DEFLECTION, TRUTH)  # a real machine has no truth
ROBOT_NEEDED = (
    ROBOT_CYLINDER_STATES, ROBOT_CYLINDER_REFERENCE, ROBOT_VALVE_COMMAND, PRESSURES, TCP_POSE,
    TCP_DEFLECTION, TCP_REFERENCE,
)  # fmt: skip
ROBOT_OPTIONAL = (ROBOT_JOINT_STATES, ROBOT_TRUTH)

Array = NDArray[np.float64]


def load_run(path: Path) -> Recording:
    """Read the signals of a run, by the names of the topic table.

    Raises InputError for a recording that lacks a topic of the graph, or is of several graphs.
    """
    there = graph_topics(path)
    sources: dict[str, Source] = {}
    robot = there.full_name(TCP_POSE) is not None
    needed, optional = (ROBOT_NEEDED, ROBOT_OPTIONAL) if robot else (NEEDED, OPTIONAL)
    for topic in (*needed, *optional):
        name = there.needed(topic) if topic in needed else there.full_name(topic)
        if name is not None:
            fields = topic.fields.items()
            sources |= {signal: Source(name, about.path, about.unit) for signal, about in fields}
    return load(path, sources)


def is_robot(recording: Recording) -> bool:
    """Return whether the run is one of the whole robot."""
    return "tcp_x" in recording.signals


def at(recording: Recording, name: str, times: Array) -> Array:
    """Return a signal at the given times, s, linear between its samples."""
    signal = recording[name]
    return np.interp(times, signal.time, signal.value)


def piston(recording: Recording, quantity: str) -> str:
    """Return the best signal for `stroke`, `pressure_lifting` ...: the true one, if recorded."""
    true = f"true_{quantity}"
    return true if true in recording.signals else quantity
