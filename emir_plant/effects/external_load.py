"""A force that no state of the machine explains: wind, contact, a swinging load."""

import math
from dataclasses import dataclass
from typing import Any, ClassVar

from emir_common.quantity import quantity
from emir_plant.effects.base import Balance, Effect
from emir_plant.elementary import cosine, exponential
from emir_plant.jit import compiled


@dataclass(frozen=True)
class ExternalLoad(Effect):
    """Force across the boom at the TCP, up positive: M + F exp(-d s) cos(2 pi f s + phase).

    s = t - t_0, the time since it set in. All of it has come after a rise, and after its duration
    it falls as it rose; both along straight lines. With t_0 long before the run the machine rests
    under it. f = 0 gives a constant load or, with a short duration, a pulse; f > 0 a harmonic one
    about a mean M. For piston_share of it a force along the piston's rod instead, outward positive,
    L / b times as large: at the longest lever arm b it has the moment of the one at the TCP, and
    bends no arm. For joint_share of the rest a torque about the joint, L times as large at every
    angle, which bends none either. For vertical_share of what is left it is vertical, as a weight
    is, and acts by the cosine of the angle.
    """

    balance: ClassVar[Balance] = "force"
    sizes: ClassVar[tuple[str, ...]] = ("force", "mean")
    source: ClassVar[str] = "wind pressure 0.3 kPa on a boom of 15 m^2 gives about 2 kN at the TCP"
    trial: ClassVar[dict[str, float]] = {
        "force": 1e3,
        "mean": 1e3,
        "frequency": 0.2,
        "phase": 0.5,
        "start": 1.0,
        "rise": 0.5,
        "duration": 1e3,
        "decay": 0.05,
        "piston_share": 0.5,
        "joint_share": 0.5,
        "vertical_share": 0.5,
    }

    force: float = quantity("N", -1e5, 1e5, "F, as at the TCP", default=0.0)
    mean: float = quantity("N", -1e5, 1e5, "M, as at the TCP", default=0.0)
    frequency: float = quantity("Hz", 0.0, 20.0, "f; 0: constant while it acts", default=0.0)
    phase: float = quantity("rad", -6.3, 6.3, "at the start", default=0.0)
    start: float = quantity("s", -1e6, 1e6, "t_0, since the start of the run", default=0.0)
    rise: float = quantity("s", 0.0, 1e3, "from nothing to all of it, and back", default=0.0)
    duration: float = quantity("s", 1e-3, 1e6, "how long it acts", default=1e6)
    decay: float = quantity("1/s", 0.0, 10.0, "d, of the swing", default=0.0)
    piston_share: float = quantity(
        "1", 0.0, 1.0, "of it, on the rod, L / b times as large", default=0.0
    )
    joint_share: float = quantity(
        "1", 0.0, 1.0, "of the rest, a torque about the joint, L times as large", default=0.0
    )
    vertical_share: float = quantity(
        "1", 0.0, 1.0, "of what is left, vertical, not across the boom", default=0.0
    )


@compiled
def force(time: float, p: Any) -> float:
    """Return the force, N, as at the TCP, at a time since the start of the run, s."""
    if p.external_load_force == 0.0 and p.external_load_mean == 0.0:
        return 0.0
    since = time - p.external_load_start
    share = _risen(since, p.external_load_rise)
    share -= _risen(since - p.external_load_duration, p.external_load_rise)
    angle = 2.0 * math.pi * p.external_load_frequency * since + p.external_load_phase
    swing = p.external_load_force * exponential(-p.external_load_decay * max(since, 0.0))
    return share * (p.external_load_mean + swing * cosine(angle))


@compiled
def at_tip(load: float, angle: float, p: Any) -> float:
    """Return what of a load, N, acts across the boom at the TCP, N, up positive.

    angle: of the boom to the horizontal, rad.
    """
    across = 1.0 - p.external_load_vertical_share * (1.0 - cosine(angle))
    beside = (1.0 - p.external_load_piston_share) * (1.0 - p.external_load_joint_share)
    return beside * across * load


@compiled
def on_piston(load: float, p: Any) -> float:
    """Return what of a load, N, acts along the piston's rod, N."""
    return p.external_load_piston_share * load * p.boom_length / p.triangle_b


@compiled
def about_joint(load: float, p: Any) -> float:
    """Return what of a load, N, turns the boom about its joint, N m, upward positive."""
    share = (1.0 - p.external_load_piston_share) * p.external_load_joint_share
    return share * load * p.boom_length


@compiled
def _risen(since: float, rise: float) -> float:
    """Return the share of a load that has come, at a time, s, since it set in."""
    if since < 0.0:
        return 0.0
    return 1.0 if since >= rise else since / rise
