"""The whole robot's mechanics against Pinocchio's own algorithms, the beam and joint 1's chain."""

import dataclasses
import itertools
import math
import re

import numpy as np
import pytest

pin = pytest.importorskip("pinocchio", reason="Pinocchio is missing: pip install 'emir_ros[robot]'")

from emir_common.parameter_tree import with_values  # noqa: E402 (only with Pinocchio)
from emir_plant import linkage as triangle  # noqa: E402
from emir_plant.boom import boom_modes  # noqa: E402
from emir_plant.plant import Plant  # noqa: E402
from emir_plant.robot.dynamics import Mechanics  # noqa: E402
from emir_plant.robot.parameters import Parts, Robot  # noqa: E402
from emir_plant.robot.posture import deflection, modes, rest, rigid  # noqa: E402
from emir_plant.robot.reach import PostureError  # noqa: E402
from emir_plant.robot.sheet import robot  # noqa: E402
from emir_plant.robot.stiffness import box  # noqa: E402

GRAVITY = 9.81
LOCKED = np.full(6, np.inf)
ONLY_JOINT_1 = np.array([np.inf, 0.0, np.inf, np.inf, np.inf, np.inf])
STRETCHED = np.array([0.0, math.radians(45.0), 0.0, 0.0, 0.0, 0.0])
BENT = np.array([0.3, 0.7, -0.4, 0.5, -0.2, 0.3])
ROBOT = robot()
MECHANICS = Mechanics(ROBOT)
GEOMETRY = ROBOT.main.geometry


def _without_parts(machine: Robot) -> Robot:
    """Return the robot with the mass of all linkages in the arms, as joint 1's chain has it."""

    def light(parts: Parts) -> Parts:
        names = [f.name for f in dataclasses.fields(parts) if f.name.endswith("mass")]
        return dataclasses.replace(parts, **dict.fromkeys(names, 0.0))

    joints = {
        f"joint{n}": dataclasses.replace(joint, parts=light(joint.parts))
        for n, joint in enumerate(machine.four_bars, start=2)
    }
    main = dataclasses.replace(machine.joint1, parts=light(machine.joint1.parts))
    return dataclasses.replace(machine, joint1=main, **joints)


def _with_payload(machine: Robot, payload: float) -> Robot:
    geometry = dataclasses.replace(machine.main.geometry, payload=payload)
    return dataclasses.replace(machine, main=dataclasses.replace(machine.main, geometry=geometry))


CHAIN = Mechanics(_without_parts(ROBOT))


def _random_state(seed: int) -> tuple[np.ndarray, np.ndarray]:
    draw = np.random.default_rng(seed)
    q, v = draw.normal(size=96) * 0.01, draw.normal(size=96) * 0.3
    q[MECHANICS.topology.joints] = BENT
    return q, v


def test_bodies_and_freedoms_are_the_papers() -> None:
    assert MECHANICS.size == 96 == 15 * 6 + 6
    bodies = [name for name in MECHANICS.topology.bodies if name != "column"]
    assert len(bodies) == len(set(bodies)) == 39
    kinds = {
        kind: sum(bool(re.fullmatch(kind, name)) for name in bodies)
        for kind in (
            r"arm\d_section\d", r"joint\d_cylinder", r"joint\d_piston", r"joint\d_lever",
            r"joint\d_thrust_bar",
        )
    }  # fmt: skip
    assert list(kinds.values()) == [5 * 4, 5, 5, 5, 4]
    main_parts = 39 - 5 * 4 + 5
    assert main_parts == 24


def test_all_mass_is_there_and_the_boom_has_the_main_joints() -> None:
    machine = _with_payload(ROBOT, 700.0)
    total = pin.computeTotalMass(Mechanics(machine).topology.model)
    parts = ROBOT.joint1.parts
    carried = GEOMETRY.boom_mass + 700.0
    expected = carried + ROBOT.base.column_mass + parts.barrel_mass + parts.piston_mass
    assert total == pytest.approx(expected, rel=1e-12)


def test_springs_of_the_cuts_bend_as_the_main_joints_do() -> None:
    pitch = MECHANICS.topology.cuts[:, 4]
    found = np.diag(MECHANICS.stiffness)[pitch]
    assert found == pytest.approx(GEOMETRY.section_spring, rel=1e-4)
    assert pitch.size == 15


@pytest.mark.parametrize("seed", [1, 2])
def test_reduced_motion_is_that_of_pinocchios_loops(seed: int) -> None:
    """The loops closed by Pinocchio's constraints in place of our velocity maps."""
    q, v = _random_state(seed)
    torques = np.random.default_rng(seed).normal(size=6) * 1e4
    t = MECHANICS.topology
    z, rate, _, _ = MECHANICS.expand(q, v)
    load = np.zeros(t.model.nv)
    load[t.independent] = -MECHANICS.stiffness @ q - MECHANICS.damping @ v
    load[t.independent[t.joints]] += torques
    constraints, scratch = _loops(t.model)
    data = t.model.createData()
    pin.initConstraintDynamics(t.model, data, constraints, scratch)
    settings = pin.ProximalSettings(1e-12, 1e-10, 50)
    exact = pin.constraintDynamics(t.model, data, z, rate, load, constraints, scratch, settings)
    for loop in scratch:
        assert np.linalg.norm(loop.c1Mc2.translation) < 1e-12  # closed
    ours = MECHANICS.acceleration(q, v, torques)
    assert ours == pytest.approx(exact[t.independent], rel=1e-8, abs=1e-9 * np.abs(exact).max())


def _loops(model: pin.Model) -> tuple[pin.StdVec_RigidConstraintModel, object]:
    def pinned(one: str, at: np.ndarray, other: str, there: np.ndarray) -> object:
        return pin.RigidConstraintModel(
            pin.ContactType.CONTACT_3D,
            model,
            model.getJointId(one),
            pin.SE3(np.eye(3), at),
            model.getJointId(other),
            pin.SE3(np.eye(3), there),
            pin.ReferenceFrame.LOCAL,
        )

    constraints, here = pin.StdVec_RigidConstraintModel(), np.zeros(3)
    for n, g in enumerate(ROBOT.linkages, start=1):
        direction = g.arm_link_direction
        pin_on_arm = g.arm_link * np.array([math.cos(direction), 0.0, math.sin(direction)])
        if g.thrust_bar == 0.0:
            constraints.append(pinned(f"joint{n}_piston", here, f"joint{n}", pin_on_arm))
            continue
        end, bar_end = np.array([g.lever, 0.0, 0.0]), np.array([g.thrust_bar, 0.0, 0.0])
        constraints.append(pinned(f"joint{n}_piston", here, f"joint{n}_lever", end))
        constraints.append(pinned(f"joint{n}_thrust_bar", bar_end, f"joint{n}", pin_on_arm))
    scratch = pin.StdVec_RigidConstraintData()
    for constraint in constraints:
        scratch.append(constraint.createData())
    return constraints, scratch


def test_mass_and_bias_are_mujocos() -> None:
    """The chain without linkage parts, written for another rigid-body library."""
    mujoco = pytest.importorskip("mujoco", reason="MuJoCo is missing: pip install mujoco")
    from emir_analysis.bench.robot import massless_parts, mjcf

    machine = massless_parts(ROBOT)
    model = mujoco.MjModel.from_xml_string(mjcf(machine, 1e-3))
    data, (q, v) = mujoco.MjData(model), _random_state(5)
    data.qpos[:], data.qvel[:] = q, v
    mujoco.mj_forward(model, data)
    product = np.zeros(96)
    mujoco.mj_mulM(model, data, product, v)
    mass, bias = Mechanics(machine).mass_and_bias(q, v)
    assert mass @ v == pytest.approx(product, rel=1e-9, abs=1e-9 * np.abs(product).max())
    assert bias == pytest.approx(data.qfrc_bias, rel=1e-9, abs=1e-9 * np.abs(bias).max())


def test_mass_matrix_holds_the_kinetic_energy() -> None:
    q, v = _random_state(3)
    assert 0.5 * v @ MECHANICS.mass(q) @ v == pytest.approx(MECHANICS.energy(q, v)[0], rel=1e-12)


def test_weight_is_the_slope_of_the_potential() -> None:
    q, _ = _random_state(4)
    bias = MECHANICS.bias(q, np.zeros(96))
    for k in [*MECHANICS.topology.joints, *MECHANICS.topology.cuts[4]]:
        d = np.zeros(96)
        d[k] = 1e-4
        slope = MECHANICS.energy(q + d, d)[1] - MECHANICS.energy(q - d, d)[1]
        assert bias[k] == pytest.approx(slope / 2e-4, abs=1e-6 * np.abs(bias).max())


@pytest.mark.parametrize("posture", [STRETCHED, BENT])
def test_joint_torques_at_rest_are_weight_times_arm_by_hand(posture: np.ndarray) -> None:
    """Undeflected arms without linkage parts: five uniform rods and a payload."""
    mechanics = Mechanics(_with_payload(_without_parts(ROBOT), 700.0))
    q = rigid(mechanics, posture)
    torques = mechanics.bias(q, np.zeros(96))[mechanics.topology.joints]
    length, mass = GEOMETRY.boom_length / 5.0, GEOMETRY.boom_mass / 5.0
    reach_of = length * np.cos(np.cumsum(posture[1:]))  # horizontal extent of each arm
    for k in range(5):
        out = np.concatenate(([0.0], np.cumsum(reach_of[k:])))
        by_hand = sum(mass * 0.5 * (a + b) for a, b in itertools.pairwise(out))
        by_hand += 700.0 * out[-1]
        assert torques[k + 1] == pytest.approx(GRAVITY * by_hand, rel=1e-9)
    assert abs(torques[0]) < 1e-6


@pytest.mark.parametrize(("place", "arm", "along"), [(0.37, 1, 0.85), (1.0, 4, 1.0), (1.1, 4, 1.5)])
def test_a_mass_on_the_arms_pulls_at_the_joints_below_it(
    place: float, arm: int, along: float
) -> None:
    """An effect's payload at a place along the stretched arms, bent: weight times arm by hand."""
    there = {"main.effects.payload.mass": 300.0, "main.effects.payload.place": place}
    empty, loaded = Mechanics(ROBOT), Mechanics(with_values(ROBOT, there))
    q, still = rigid(empty, BENT), np.zeros(96)
    more = (loaded.bias(q, still) - empty.bias(q, still))[empty.topology.joints[1:]]
    level = GEOMETRY.boom_length / 5.0 * np.cos(np.cumsum(BENT[1:]))
    reach = [level[k:arm].sum() + along * level[arm] if k <= arm else 0.0 for k in range(5)]
    assert more == pytest.approx(300.0 * GRAVITY * np.array(reach), rel=1e-9, abs=1e-6)


def test_energy_is_kept_in_free_swing_without_damping() -> None:
    """Dropped from the stretched posture with all joints free: 0.15 s, classical Runge-Kutta."""
    still = dataclasses.replace(ROBOT, arm=dataclasses.replace(ROBOT.arm, damping_time=0.0))
    mechanics, free, h = Mechanics(still), np.zeros(6), 3.75e-5
    q, v = rest(mechanics, BENT).coordinates, np.zeros(96)
    v[mechanics.topology.joints] = [0.2, 0.1, -0.1, 0.2, -0.3, 0.4]
    start = np.array(mechanics.energy(q, v))

    def slope(q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return v, mechanics.acceleration(q, v, free)

    for _ in range(4000):
        a = slope(q, v)
        b = slope(q + 0.5 * h * a[0], v + 0.5 * h * a[1])
        c = slope(q + 0.5 * h * b[0], v + 0.5 * h * b[1])
        d = slope(q + h * c[0], v + h * c[1])
        q = q + h / 6.0 * (a[0] + 2.0 * b[0] + 2.0 * c[0] + d[0])
        v = v + h / 6.0 * (a[1] + 2.0 * b[1] + 2.0 * c[1] + d[1])
    end = np.array(mechanics.energy(q, v))
    moved = np.abs(end - start).max()
    assert moved > 500.0  # J: it has fallen and bent
    assert abs(end.sum() - start.sum()) < 1e-5 * moved


@pytest.mark.parametrize("direction", range(6))
def test_tip_yields_as_the_analytic_cantilever(direction: int) -> None:
    """A force or moment on the TCP of the stretched, horizontal, clamped boom."""
    model, data = MECHANICS.topology.model, MECHANICS.topology.model.createData()
    z, _, _, _ = MECHANICS.expand(np.zeros(96), np.zeros(96))
    frame = model.getFrameId("tcp")
    tree = pin.computeFrameJacobian(model, data, z, frame, pin.ReferenceFrame.LOCAL)
    cuts = MECHANICS.topology.cuts.ravel()
    jacobian = tree[:, MECHANICS.topology.independent][:, cuts]
    springs = MECHANICS.stiffness[np.ix_(cuts, cuts)]
    found = jacobian @ np.linalg.solve(springs, jacobian[direction])
    section, length = box(ROBOT.arm), GEOMETRY.boom_length
    e = ROBOT.arm.youngs_modulus
    g = e / (2.0 * (1.0 + ROBOT.arm.poisson_ratio))
    lateral, vertical = e * section.bending_lateral, e * section.bending_vertical
    expected = [
        length / (e * section.area),
        length**3 / (3.0 * lateral) + length / (g * section.shear_area_lateral),
        length**3 / (3.0 * vertical) + length / (g * section.shear_area_vertical),
        length / (g * section.torsion),
        length / vertical,
        length / lateral,
    ]
    assert found[direction] == pytest.approx(expected[direction], rel=0.005)


def _sag(mechanics: Mechanics) -> float:
    """Return the TCP's deflection across the stretched boom, down positive, m."""
    shown = deflection(mechanics, rest(mechanics, STRETCHED).coordinates)
    return float(shown.position @ [math.sin(STRETCHED[1]), 0.0, -math.cos(STRETCHED[1])])


def test_stretched_robot_sags_and_swings_as_the_main_joints_chain() -> None:
    """Joints 2-5 locked. Shear and the sections' height make the difference of about 1 %."""
    frequencies = modes(CHAIN, rigid(CHAIN, STRETCHED), ONLY_JOINT_1, weight=False)
    vertical = _vertical(CHAIN, frequencies)
    expected = boom_modes(GEOMETRY).frequency[1:3] / (2.0 * math.pi)
    assert vertical[1:3] == pytest.approx(expected, rel=0.03)
    assert vertical[1] == pytest.approx(expected[0], rel=0.01)
    plant = Plant(ROBOT.main)
    chain = -plant.outputs(plant.initial(STRETCHED[1])).tcp_deflection
    assert _sag(CHAIN) == pytest.approx(chain, rel=0.02)


def _vertical(mechanics: Mechanics, of: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """Return the frequencies of the modes that swing in the boom's plane."""
    pitch = mechanics.topology.cuts[:, 4]
    lateral = mechanics.topology.cuts[:, 3]
    in_plane = np.abs(of[1][pitch]).max(axis=0) > np.abs(of[1][lateral]).max(axis=0)
    rigid_mode = np.abs(of[1][mechanics.topology.joints[1]]) > 1e-3
    return of[0][in_plane | (rigid_mode & (of[0] < 0.01))]


def test_numbers_of_the_paper_with_all_parts() -> None:
    """Slowest mode of the mechanics 5.4 Hz, sag about 18 cm, 0.7 Hz on the oil; 45 deg, empty."""
    at_rest = rest(MECHANICS, STRETCHED).coordinates
    free = modes(MECHANICS, at_rest, ONLY_JOINT_1)
    assert _vertical(MECHANICS, free)[0:2].max() == pytest.approx(5.4, abs=0.15)
    assert _sag(MECHANICS) == pytest.approx(0.18, abs=0.01)
    oil = LOCKED.copy()
    oil[1] = _oil_spring(STRETCHED[1])
    assert modes(MECHANICS, at_rest, oil).frequency[0] == pytest.approx(0.7, abs=0.03)


def _oil_spring(angle: float) -> float:
    """Return joint 1's stiffness on its shut chambers by hand, N m/rad."""
    p, c = Plant(ROBOT.main).record[0], ROBOT.main.cylinder
    stroke, arm = triangle.stroke(angle, p), triangle.lever_arm(angle, p)
    lifting = c.area_lifting**2 / (c.volume_lifting_0 + c.area_lifting * stroke)
    lowering = c.area_lowering**2 / (c.volume_lowering_0 - c.area_lowering * stroke)
    return c.beta * (lifting + lowering) * arm**2


def test_orientation_of_the_deflected_tcp_is_consistent() -> None:
    at_rest = rest(MECHANICS, BENT).coordinates
    shown = deflection(MECHANICS, at_rest)
    _, axes = MECHANICS.tcp(at_rest)
    assert axes.T @ axes == pytest.approx(np.eye(3), abs=1e-12)
    turn = pin.exp3(shown.rotation) @ MECHANICS.tcp(rigid(MECHANICS, BENT))[1]
    assert turn == pytest.approx(axes, abs=1e-12)
    assert shown.axes == pytest.approx(axes - MECHANICS.tcp(rigid(MECHANICS, BENT))[1])
    assert 0.01 < np.linalg.norm(shown.position) < 0.3


def test_posture_out_of_reach_is_refused_in_one_line() -> None:
    with pytest.raises(PostureError, match=r"joint 1: 120.0 deg is outside .* 0.0 ... 96.1 deg"):
        rest(MECHANICS, np.radians([0.0, 120.0, 0.0, 0.0, 0.0, 0.0]))
    with pytest.raises(PostureError, match="6 finite joint angles"):
        rest(MECHANICS, np.array([0.0, np.nan, 0.0, 0.0, 0.0, 0.0]))
    weak = dataclasses.replace(ROBOT, arm=dataclasses.replace(ROBOT.arm, youngs_modulus=1e9))
    with pytest.raises(PostureError, match="does not come to rest"):
        rest(Mechanics(_with_payload(weak, 3000.0)), STRETCHED * 0.0)
