"""Which topics of the graph carry what the diagnosis looks at, in whatever namespace."""

from pathlib import Path

from emir_analysis.diagnosis.experiment import ANGLE, COMMAND, PRESSURE_LOWERING, STROKE
from emir_analysis.errors import InputError
from emir_analysis.graph_topics import graph_topics
from emir_analysis.signals import Source
from emir_msgs_py.robot_topics import TCP_POSE
from emir_msgs_py.topics import (
    BOOM_DEFLECTION,
    CYLINDER_STATES,
    JOINT_STATES,
    PRESSURE_LIFTING,
    VALVE_COMMAND,
    Topic,
)
from emir_msgs_py.topics import PRESSURE_LOWERING as PRESSURE_LOWERING_TOPIC

SENSED: dict[str, tuple[Topic, str]] = {  # the diagnosis's names -> the topic table's
    COMMAND: (VALVE_COMMAND, "valve_command"),
    ANGLE: (JOINT_STATES, "angle"),
    STROKE: (CYLINDER_STATES, "stroke"),
    "pressure_lifting": (PRESSURE_LIFTING, "pressure_lifting"),
    PRESSURE_LOWERING: (PRESSURE_LOWERING_TOPIC, "pressure_lowering"),
    "tip_deflection_angle": (BOOM_DEFLECTION, "deflection"),
}


def graph_signals(path: Path) -> dict[str, Source]:
    """Return the signal map of a recording of the graph with joint 1.

    Raises InputError for a recording of the whole robot, or one that lacks a topic and so is of
    something else than the graph.
    """
    there = graph_topics(path)
    if there.full_name(TCP_POSE) is not None:
        raise InputError(f"{path}: of the whole robot; record joint 1 (`emir run --model joint1`)")
    sources = {}
    for signal, (topic, field) in SENSED.items():
        name = there.full_name(topic)
        if name is None:
            raise InputError(
                f"{path}: no topic {topic.name}, so not of the graph; say with --signals which"
                f" topic carries what; there are {', '.join(sorted(there.names))}"
            )
        sources[signal] = Source(name, topic.fields[field].path, topic.fields[field].unit)
    return sources
