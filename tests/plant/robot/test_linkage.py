"""The linkages against geometry done another way: loop closure, circles, finite differences."""

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import fsolve

from emir_common.quantity import ParameterError
from emir_plant import linkage as triangle
from emir_plant.plant import Plant
from emir_plant.robot import linkage
from emir_plant.robot.parameters import Linkage
from emir_plant.robot.reach import PostureError, check, dead_points, reach, record
from emir_plant.robot.sheet import load_robot, robot
from emir_plant.sheet import joint1

LINKAGES = dict(enumerate(robot().linkages, start=1))
FOUR_BARS = [2, 3, 4, 5]
ALL = [1, *FOUR_BARS]


def _angles(geometry: Linkage) -> np.ndarray:
    of = reach(geometry)
    return np.linspace(of.angle_low, of.angle_high, 23)


def _closed_loop(angle: float, g: Linkage, start: np.ndarray) -> tuple[np.ndarray, float]:
    """Solve the two vector loops with a general solver: unknown directions, unknown length."""

    def at(length: float, direction: float) -> np.ndarray:
        return length * np.array([math.cos(direction), math.sin(direction)])

    def error(unknown: np.ndarray) -> np.ndarray:
        lever, bar, cylinder, length = unknown
        rod_eye = at(g.ground_link, g.ground_direction) + at(g.lever, lever)
        arm_pin = at(g.arm_link, angle + g.arm_link_direction)
        foot = at(g.ground_link, g.ground_direction) + at(g.foot, g.foot_direction)
        return np.concatenate(
            (rod_eye + at(g.thrust_bar, bar) - arm_pin, foot + at(length, cylinder) - rod_eye)
        )

    found, _, flag, _ = fsolve(error, start, full_output=True, xtol=1e-13)
    assert flag == 1
    return found, float(found[3])


@pytest.mark.parametrize("number", FOUR_BARS)
def test_four_bar_closes_its_loops(number: int) -> None:
    geometry = LINKAGES[number]
    p = record(geometry)[0]
    rest = _closed_loop(0.0, geometry, linkage.motion(0.0, p)[:, 0] + 0.01)[1]
    for angle in _angles(geometry):
        parts = linkage.motion(angle, p)[:, 0]
        found, length = _closed_loop(angle, geometry, parts + 0.01)
        assert np.exp(1j * found[:3]) == pytest.approx(np.exp(1j * parts[:3]), abs=1e-9)
        assert linkage.stroke(angle, p) == pytest.approx(length - rest, abs=1e-9)


@pytest.mark.parametrize("number", ALL)
def test_derivatives_are_those_of_finite_differences(number: int) -> None:
    p, d = record(LINKAGES[number])[0], 1e-5
    for angle in _angles(LINKAGES[number]):
        here, ahead, behind = (linkage.motion(angle + k * d, p) for k in (0, 1, -1))
        assert here[:, 1:] == pytest.approx((ahead - behind)[:, :2] / (2 * d), abs=2e-8)
        slope = (linkage.stroke(angle + d, p) - linkage.stroke(angle - d, p)) / (2 * d)
        assert linkage.ratio(angle, p) == pytest.approx(slope, abs=1e-9)
        assert linkage.ratio_slope(angle, p) == here[linkage.LENGTH, 2]


@pytest.mark.parametrize("number", ALL)
def test_angle_and_stroke_are_inverse_and_grow_together(number: int) -> None:
    p = record(LINKAGES[number])[0]
    of = reach(LINKAGES[number])
    assert linkage.stroke(0.0, p) == 0.0
    assert of.ratio_low > 0.0
    for angle in _angles(LINKAGES[number]):
        assert linkage.angle(linkage.stroke(angle, p), p) == pytest.approx(angle, abs=1e-9)
    assert of.stroke_high - of.stroke_low == pytest.approx(LINKAGES[number].stroke)


def test_joint_1_is_the_main_joints_triangle() -> None:
    p, main = record(LINKAGES[1])[0], Plant(joint1()).record[0]
    for angle in np.radians(np.linspace(0.0, 95.0, 20)):
        assert linkage.stroke(angle, p) == pytest.approx(triangle.stroke(angle, main), abs=1e-12)
        assert linkage.ratio(angle, p) == pytest.approx(triangle.lever_arm(angle, main), abs=1e-12)


@pytest.mark.parametrize(
    ("number", "low", "high"), [(2, 0.24, 0.67), (3, 0.19, 0.52), (4, 0.15, 0.43), (5, 0.12, 0.33)]
)
def test_ratios_are_those_of_a_real_cranes_knuckle(number: int, low: float, high: float) -> None:
    of = reach(LINKAGES[number])
    assert of.ratio_low == pytest.approx(low, abs=0.01)
    assert of.ratio_high == pytest.approx(high, abs=0.015)


@pytest.mark.parametrize("number", ALL)
def test_dead_points_transmit_nothing_and_lie_outside_the_stroke(number: int) -> None:
    geometry = LINKAGES[number]
    p, of = record(geometry)[0], reach(geometry)
    assert of.dead_points
    for point in of.dead_points:
        assert point.meaning.startswith("cylinder in line")  # shortest link fixed: none other
        assert abs(linkage.ratio(point.angle, p)) < 1e-9
        assert not of.angle_low < point.angle < of.angle_high
    if number in FOUR_BARS:  # one just beyond the folded end
        assert np.degrees(of.angle_low - max(d.angle for d in of.dead_points if d.angle < 0)) < 11


def test_loop_opens_where_bar_and_lever_are_in_line() -> None:
    """With a long ground link the loop does not close all round."""
    geometry = dataclasses.replace(LINKAGES[5], ground_link=0.75)
    p = record(geometry)[0]
    ends = [d.angle for d in dead_points(geometry) if "in line with lever: the arm" in d.meaning]
    assert len(ends) == 2
    for end in ends:
        inside, outside = sorted(
            (end - 1e-6, end + 1e-6), key=lambda a: abs(a - _opposite(geometry))
        )
        assert math.isnan(linkage.stroke(inside, p))
        assert abs(linkage.motion(outside, p)[linkage.LEVER, 1]) > 100.0  # runs away


def _opposite(geometry: Linkage) -> float:
    """Return the joint angle at which arm-side pin and lever pivot are farthest apart."""
    return geometry.ground_direction - math.pi - geometry.arm_link_direction


def test_bad_posture_and_geometry_are_refused_in_one_line() -> None:
    reaches = tuple(reach(g) for g in LINKAGES.values())
    check(np.zeros(5), reaches)
    with pytest.raises(PostureError, match=r"joint 3: 80.0 deg is outside .* -61.1 ... 72.6 deg"):
        check(np.radians([45.0, 0.0, 80.0, 0.0, 0.0]), reaches)
    with pytest.raises(PostureError, match="beyond the linkage"):
        reach(dataclasses.replace(LINKAGES[2], stroke=2.5))
    with pytest.raises(PostureError, match="does not close"):
        reach(dataclasses.replace(LINKAGES[2], thrust_bar=0.1))
    with pytest.raises(PostureError, match=r"a dead point lies within the strokes"):
        reach(
            dataclasses.replace(
                LINKAGES[5],
                ground_link=0.4,
                ground_direction=-1.57,
                arm_link_direction=1.93,
                assembly=1,
                length_retracted=1.288,
                stroke=0.438,
            )
        )
    with pytest.raises(PostureError, match="lowers the arm"):
        reach(dataclasses.replace(LINKAGES[5], arm_link_direction=2.4, length_retracted=1.1))


def test_a_wrong_sheet_is_refused_with_file_and_key(tmp_path: Path) -> None:
    from importlib.resources import files

    good = (files("emir_plant") / "data" / "robot.yaml").read_text()
    path = tmp_path / "robot.yaml"
    for change, message in [
        (("bore: {value: 0.2", "bore: {value: 7"), r"joint2.drive.bore = 7: outside 0.01 ... 1 m"),
        (("  wall:", "  wal:"), r"arm.wal: there is no such parameter"),
        (
            ("  height: {value: 2.5, unit: m", "  height: {value: 2.5, unit: mm"),
            r"base.height: in mm",
        ),
        (("    stroke: {value: 0.7", "    strok: {value: 0.7"), r"joint5.linkage.strok"),
        (("arm:\n", "arm: 3\nrest:\n"), "rest|arm: no parameters"),
        (("base:", "base: ["), "not YAML"),
    ]:
        assert change[0] in good
        path.write_text(good.replace(*change))
        with pytest.raises(ParameterError, match=message) as caught:
            load_robot(path, joint1())
        assert str(path) in str(caught.value)
        assert "\n" not in str(caught.value)
    with pytest.raises(ParameterError, match="No such file"):
        load_robot(tmp_path / "none.yaml", joint1())
