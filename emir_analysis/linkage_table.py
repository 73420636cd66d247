"""The linkages of joints 1-5: range, transmission ratio, dead points."""

import math
from typing import Any

from emir_plant.robot.reach import Reach, reach
from emir_plant.robot.sheet import robot


def reaches() -> list[Reach]:
    """Return those of joints 1-5 of the robot as the project states it."""
    return [reach(linkage) for linkage in robot().linkages]


def as_text(found: list[Reach]) -> str:
    """Return a table in the form of Markdown."""
    lines = [
        "| joint | stroke h, m | angle, deg | dh/dalpha, m | dead points, deg |",
        "| --- | --- | --- | --- | --- |",
    ]
    for joint, of in enumerate(found, start=1):
        angles = f"{math.degrees(of.angle_low):.1f} ... {math.degrees(of.angle_high):.1f}"
        dead = ", ".join(f"{math.degrees(point.angle):.1f}" for point in of.dead_points)
        lines.append(
            f"| {joint} | {of.stroke_low:.3f} ... {of.stroke_high:.3f} | {angles}"
            f" | {of.ratio_low:.2f} ... {of.ratio_high:.2f} | {dead} |"
        )
    return "\n".join(lines)


def as_json(found: list[Reach]) -> list[dict[str, Any]]:
    """Return the same as plain values, SI units."""
    return [
        {
            "joint": joint,
            "stroke": [of.stroke_low, of.stroke_high],
            "angle": [of.angle_low, of.angle_high],
            "ratio": [of.ratio_low, of.ratio_high],
            "dead_points": [{"angle": p.angle, "meaning": p.meaning} for p in of.dead_points],
        }
        for joint, of in enumerate(found, start=1)
    ]
