"""A hydraulic actuator of which little is known: a valve, oil, a moving mass.

A machine in normalised units: valve opening in, oil pressure out, time in whatever the recording
counts (seconds or samples). The oil's capacity is the unit of volume per pressure, so that a
flow is the rate at which it would raise the pressure, and a velocity the flow that it takes up.
See docs/actuator.md.
"""

from emir_plant.actuator.effects import REGISTRY
from emir_plant.actuator.model import simulate
from emir_plant.actuator.parameters import Actuator
from emir_plant.actuator.sheet import (
    SAMPLE,
    ActuatorSheet,
    is_actuator,
    load_actuator,
    write_actuator,
)

__all__ = [
    "REGISTRY",
    "SAMPLE",
    "Actuator",
    "ActuatorSheet",
    "is_actuator",
    "load_actuator",
    "simulate",
    "write_actuator",
]
