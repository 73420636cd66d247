"""Quality of service of the graph's topics."""

from typing import Any

import yaml
from rclpy.qos import (
    DurabilityPolicy,
    HistoryPolicy,
    QoSProfile,
    ReliabilityPolicy,
)

from emir_msgs_py.topics import Topic

DEPTH = 64  # plant periods: half a second of sensor data

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


def requested(topic: Topic, *, lockstep: bool) -> QoSProfile:
    """Return what a control node asks for: fresh sensor data or every command."""
    profile = offered(lockstep=lockstep)
    if topic.quality == "sensor" and not lockstep:
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
