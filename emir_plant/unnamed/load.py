"""A load from outside that follows no formula, as a curve over time."""

from dataclasses import dataclass
from typing import Any

from emir_common.quantity import quantity
from emir_plant.curve import place_within, value
from emir_plant.jit import compiled

COURSE = 361  # points: a quarter of a second apart in a recording of 90 s
TIME = 1  # what the curve runs over


@dataclass(frozen=True, kw_only=True)
class UnnamedLoad:
    """A force across the boom at the TCP, beside that of `effects.external_load`.

    For joint_share of it a torque about the joint, L times as large, which bends no arm. Before its
    first and beyond its last point it is as there.
    """

    over: int = quantity("1", 0, 1, "0 off, 1 over the time since the run's start", default=0)
    first: float = quantity("s", 0.0, 1e5, "time of the first point", default=0.0)
    last: float = quantity("s", 0.0, 1e5, "time of the last point", default=1.0)
    course: tuple[float, ...] = quantity(
        "N",
        -1e6,
        1e6,
        "at evenly spaced points, as at the TCP, up positive",
        default=(0.0,) * COURSE,
        count=COURSE,
    )
    joint_share: float = quantity("1", 0.0, 1.0, "of it, about the joint", default=0.0)


@compiled
def course(time: float, p: Any) -> float:
    """Return the force, N, as at the TCP, at a time since the start of the run, s."""
    if p.unnamed_load_over == 0.0:
        return 0.0
    at = place_within(time, p.unnamed_load_first, p.unnamed_load_last, COURSE)
    return value(p.unnamed_load_course, at)


@compiled
def at_tip(load: float, p: Any) -> float:
    """Return what of a load, N, acts across the boom at the TCP, N, up positive."""
    across: float = (1.0 - p.unnamed_load_joint_share) * load
    return across


@compiled
def about_joint(load: float, p: Any) -> float:
    """Return what of a load, N, turns the boom about its joint, N m, upward positive."""
    torque: float = p.unnamed_load_joint_share * load * p.boom_length
    return torque
