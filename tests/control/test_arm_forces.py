"""The torques of a moving arm against the work that they do, and the payload read off them."""

import dataclasses

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from emir_control.arm import GRAVITY, Arm, ArmParameters
from emir_control.arm_forces import holding_torques, torques_along, weighed

P = ArmParameters(
    height=2.5, arm_length=4.5, arm_mass=1000.0, section_spring=1.839e8, payload=700.0, sag=0
)
RIGID, BENT = Arm(P), Arm(dataclasses.replace(P, sag=1))
START = np.radians([0.0, 45.0, -10.0, -10.0, -15.0, -15.0])
END = np.radians([40.0, 60.0, -30.0, 15.0, -20.0, 5.0])


def _energy(arm: Arm, before: np.ndarray, after: np.ndarray, dt: float) -> float:
    """Return kinetic and potential energy between two postures dt apart: uniform rods, a point."""

    def ends(joints: np.ndarray) -> np.ndarray:
        forward, up = arm.ends(joints)
        return np.stack((forward * np.cos(joints[0]), forward * np.sin(joints[0]), up), axis=1)

    places, rates = 0.5 * (ends(before) + ends(after)), (ends(after) - ends(before)) / dt
    near, far = rates[:-1], rates[1:]
    mass = arm.parameters.arm_mass / arm.parameters.sections
    moving = mass / 6.0 * float(np.sum(near * near + near * far + far * far))
    moving += 0.5 * arm.parameters.payload * float(rates[-1] @ rates[-1])
    heights = 0.5 * (places[:-1, 2] + places[1:, 2])
    weight = mass * heights.sum() + arm.parameters.payload * places[-1, 2]
    return moving + GRAVITY * float(weight)


def test_torques_do_the_work_that_the_energy_takes() -> None:
    ways = np.linspace(0.0, 1.0, 81)
    curve = CubicSpline([0.0, 0.5, 1.0], np.stack((START, 0.4 * START + 0.6 * END, END)))
    terms = CubicSpline(ways, torques_along(RIGID, ways, curve(ways)))

    def way(time: float) -> float:  # fast enough for inertia to matter
        return 0.5 + 0.4 * np.sin(3.0 * time)

    step = 1e-3
    for time in np.linspace(0.0, 2.0, 17):
        rate, change = 1.2 * np.cos(3.0 * time), -3.6 * np.sin(3.0 * time)
        torque = np.array([1.0, rate * rate, change]) @ terms(way(time))
        power = torque @ curve(way(time), 1) * rate
        half = [
            _energy(RIGID, curve(way(t - 0.5 * step)), curve(way(t + 0.5 * step)), step)
            for t in (time - 0.5 * step, time + 0.5 * step)
        ]
        size = np.abs(torque).max()
        assert power == pytest.approx((half[1] - half[0]) / step, abs=2e-3 * size)


@pytest.mark.parametrize("arm", [RIGID, BENT], ids=["rigid", "bent"])
def test_payload_is_what_the_torques_hold(arm: Arm) -> None:
    for payload in (0.0, 300.0, 1500.0):
        loaded = Arm(dataclasses.replace(arm.parameters, payload=payload))
        for joints in (START, END):
            found = weighed(arm, joints, holding_torques(loaded, joints))
            assert found == pytest.approx(payload, abs=1.0 + 5e-3 * payload)
