"""Quality of service of the graph's topics."""

from typing import Any

import yaml
from rclpy.duration import Duration
from rclpy.qos import (
    DurabilityPolicy,
    HistoryPolicy,
    QoSProfile,
    ReliabilityPolicy,
)
from rclpy.qos_overriding_options import QoSOverridingOptions, QoSPolicyKind

from emir_common.quantity import ParameterError
from emir_msgs_py.topics import Topic

DEPTH = 64  # plant periods: half a second of sensor data

LEASE = Duration(seconds=1.0)  # after which a publisher without sign of life counts as dead

WORDS = {
    "history": HistoryPolicy, "reliability": ReliabilityPolicy, "durability": DurabilityPolicy
}  # fmt: skip
NUMBERS = {  # least and most; of times, ns
    "depth": (1, 2**31 - 1), "deadline": (0, 2**63 - 1), "liveliness_lease_duration": (0, 2**63 - 1)
}  # fmt: skip
OVERRIDABLE = (*WORDS, *NUMBERS)

INFINITE = {"sec": 9223372036, "nsec": 854775807}  # how rosbag2 writes "no limit"


def offered(*, lockstep: bool) -> QoSProfile:
    """Return what every publisher of the graph offers.

    Reliable, so that it suits best-effort and reliable readers. In lock step also transient
    local: no step is taken before everybody has answered the last one, so a reader that is
    discovered late still gets all that it missed, and nobody has to wait for discovery.
    """
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=DEPTH,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if lockstep else DurabilityPolicy.VOLATILE,
    )


def latched() -> QoSProfile:
    """Return what is offered for the one message that whoever comes late gets, too."""
    profile = offered(lockstep=True)
    profile.depth = 1
    return profile


def promised(topic: Topic, *, lockstep: bool) -> QoSProfile:
    """Return `offered`, in real time with a deadline of two periods and a sign of life."""
    profile = offered(lockstep=lockstep)
    if not lockstep:
        profile.deadline = Duration(nanoseconds=2 * topic.period_ns)
        profile.liveliness_lease_duration = LEASE
    return profile


def overridable(*, lockstep: bool) -> QoSOverridingOptions | None:
    """Return what parameters `qos_overrides.<topic>...` may change: nothing in lock step.

    A subscription may ask for a deadline and for signs of life. By itself none does: it would then
    hear nobody who promises none, such as `ros2 topic pub` or `ros2 bag play`.
    """
    if lockstep:
        return None
    return QoSOverridingOptions([QoSPolicyKind[name.upper()] for name in OVERRIDABLE])


def check_override(policy: str, value: Any) -> None:
    """Raise ParameterError for a value that a policy of OVERRIDABLE cannot have.

    What rcl has against it, it says in several lines, or it takes it for no limit.
    """
    if policy in NUMBERS:
        low, high = NUMBERS[policy]
        if type(value) is not int or not low <= value <= high:
            raise ParameterError(f"{value!r}: not a whole number of {low} ... {high}")
    else:
        known = [word.lower() for word in WORDS[policy].__members__ if word != "UNKNOWN"]
        if str(value).lower() not in known:
            raise ParameterError(f"{value!r}: there are {', '.join(known)}")


def requested(topic: Topic, *, lockstep: bool) -> QoSProfile:
    """Return what a control node asks for: fresh sensor data or every command.

    In lock step only the latest sample of a sensor is kept: the plant sends nothing newer before
    the one that starts a period was answered. Those between two periods are then replaced before
    the node is called for them.
    """
    profile = offered(lockstep=lockstep)
    if topic.quality == "sensor":
        if lockstep:
            profile.depth = 1
        else:
            profile.reliability = ReliabilityPolicy.BEST_EFFORT
    return profile


def recorded(text: str) -> QoSProfile:
    """Return the reliability and durability that a recording's channel says was offered.

    text: `offered_qos_profiles` of the channel's metadata; what it does not say is as `offered`.
    """
    profile = offered(lockstep=False)
    for entry in yaml.safe_load(text) or []:
        if str(entry.get("durability")) in ("transient_local", "1"):  # by number before Jazzy
            profile.durability = DurabilityPolicy.TRANSIENT_LOCAL
        if str(entry.get("reliability")) in ("best_effort", "2"):
            profile.reliability = ReliabilityPolicy.BEST_EFFORT
    return profile


def as_rosbag2(profile: QoSProfile) -> dict[str, Any]:
    """Return the profile as rosbag2's metadata version 9 writes it."""
    return {
        "history": profile.history.name.lower(),
        "depth": profile.depth,
        "reliability": profile.reliability.name.lower(),
        "durability": profile.durability.name.lower(),
        "deadline": INFINITE,
        "lifespan": INFINITE,
        "liveliness": "automatic",
        "liveliness_lease_duration": INFINITE,
        "avoid_ros_namespace_conventions": False,
    }
