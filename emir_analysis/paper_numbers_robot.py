"""What the whole robot shows: its bodies, and how close it comes to joint 1's own model.

Stretched, 45 deg, empty, joints 2-5 and the base locked. Needs the extra `robot`.
"""

import math
from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import NDArray

from emir_analysis.paper_number import NOT_MEASURED, Number, judged
from emir_plant.core import Truth
from emir_plant.linearize import linearize
from emir_plant.plant import REST_PRESSURE, Plant
from emir_plant.transfer import mechanics

Array = NDArray[np.float64]

FORTY_FIVE = math.radians(45.0)
CLOSE = 0.05  # share within which the robot counts as the same
PERIOD = 8e-3  # s
RIGID = 0.1  # Hz, below which a mode is the rigid one, which only the weight holds
MOVES = ((0.2, 0.0), (1.8, 0.5), (0.6, 0.0), (1.0, -0.6), (0.8, 0.0))  # s, y2
NEEDS_ROBOT = "needs the extra robot: pip install 'emir_ros[robot]'"
WHY = (
    "the linkages' parts are not spread evenly over the boom; shear and rotary inertia of the box;"
    " equilibrium in the deflected posture"
)
ROWS = {  # number in the paper, what
    "counts": (2, "main parts, bodies, DOF", "24, 39, 96"),
    "bending": (4, "slowest mode, whole robot", "as joint 1's own model"),
    "sag": (5, "static deflection, whole robot", "as joint 1's own model"),
    "oil": (7, "dominant mode, whole robot", "as joint 1's own model"),
    "response": (11, "response, whole robot", "as joint 1's own model"),
}


def measure() -> list[Number]:
    """Return the numbers; not measured, and saying so, where Pinocchio is not installed."""
    if find_spec("pinocchio") is None:
        return [Number(*row, "", "in the robot's model", NOT_MEASURED, NEEDS_ROBOT)
                for row in ROWS.values()]  # fmt: skip
    from emir_plant.robot.plant import RobotPlant  # noqa: PLC0415 (needs the extra)
    from emir_plant.robot.sheet import robot  # noqa: PLC0415 (needs the extra)

    plant = RobotPlant(robot(), locked=(0.0, math.nan, 0.0, 0.0, 0.0, 0.0))
    chain = Plant(plant.robot.main)
    return [_counts(plant.mechanics), *_at_rest(plant.mechanics, chain), _response(plant, chain)]


def _counts(found: Any) -> Number:
    bodies = [name for name in found.topology.bodies if name != "column"]
    # an arm's sections are one part
    parts = {name.partition("_section")[0] for name in bodies}
    ours = len(parts), len(bodies), found.size
    return Number(
        *ROWS["counts"], ", ".join(map(str, ours)), "counted in the robot's model",
        judged(ours == (24, 39, 96)), "the turning column is a fortieth body",
    )  # fmt: skip


def _at_rest(found: Any, chain: Plant) -> list[Number]:
    from emir_plant.robot.posture import deflection, rest  # noqa: PLC0415 (needs the extra)

    posture = np.array([0.0, FORTY_FIVE, 0.0, 0.0, 0.0, 0.0])
    still = rest(found, posture).coordinates
    start = chain.initial(FORTY_FIVE, REST_PRESSURE)
    p = chain.record[0]
    poles = np.linalg.eigvals(mechanics(chain, FORTY_FIVE).state_space()[0])
    bending = float(np.min(abs(poles[poles.imag > 1.0]))) / (2.0 * math.pi)
    oil = float(linearize(chain, start).modes()[0][0])
    sag = -chain.outputs(start).tcp_deflection
    up = np.array([-math.sin(FORTY_FIVE), 0.0, math.cos(FORTY_FIVE)])
    stroke = chain.outputs(start).stroke
    volumes = (
        p["volume_lifting_0"] + p["area_lifting"] * stroke,
        p["volume_lowering_0"] - p["area_lowering"] * stroke,
    )
    areas = p["area_lifting"], p["area_lowering"]
    spring = sum(p["beta"] * a * a / v for a, v in zip(areas, volumes, strict=True))
    arm = float(found.ratios(still)[0])
    pairs = {
        "bending": (_in_plane(found, still, 0.0), bending, "Hz", "piston force held"),
        "sag": (
            -float(deflection(found, still).position @ up) * 1e2, sag * 1e2, "cm", "at rest",
        ),
        "oil": (_in_plane(found, still, spring * arm**2), oil, "Hz", "valve shut"),
    }  # fmt: skip
    return [
        Number(
            *ROWS[name], f"{ours:.2f} against {theirs:.2f} {unit}",
            f"joints 2-5 locked, stretched, 45 deg, empty, {how}; within {CLOSE:.0%}",
            judged(abs(ours / theirs - 1.0) < CLOSE), WHY,
        )
        for name, (ours, theirs, unit, how) in pairs.items()
    ]  # fmt: skip


def _in_plane(found: Any, still: Array, spring: float) -> float:
    """Return the slowest oscillation in the boom's plane, Hz, with a spring on joint 1, N m/rad."""
    from emir_plant.robot.posture import modes  # noqa: PLC0415 (needs the extra)

    springs = np.full(6, math.inf)
    springs[1] = spring
    swinging = modes(found, still, springs)
    lateral, pitch = (abs(swinging.shapes[found.topology.cuts[:, k]]).max(axis=0) for k in (3, 4))
    rising = swinging.frequency > RIGID
    return float(swinging.frequency[rising & (pitch > lateral)][0])


def _response(plant: Any, chain: Plant) -> Number:
    commands = np.concatenate([np.full(round(s / PERIOD), y) for s, y in MOVES])
    x = plant.initial(np.array([0.0, FORTY_FIVE, 0.0, 0.0, 0.0, 0.0]), REST_PRESSURE)
    run = chain.simulate(chain.initial(FORTY_FIVE, REST_PRESSURE), commands, PERIOD)[1:]
    fields = ("stroke", "pressure_lifting", "tcp_deflection")
    theirs = run[:, [Truth._fields.index(name) for name in fields]]
    ours = np.empty_like(theirs)
    for k, y in enumerate(commands):
        x, shown = plant.step(x, y * np.eye(6)[1], PERIOD)
        up = np.array([-math.sin(shown.angle[1]), 0.0, math.cos(shown.angle[1])])
        ours[k] = shown.stroke[1], shown.pressure_lifting[1], shown.deflection @ up
    off = np.sqrt(np.mean((ours - theirs) ** 2, axis=0)) / np.ptp(theirs, axis=0)
    return Number(
        *ROWS["response"], f"stroke {off[0]:.1%}, p_H {off[1]:.1%}, deflection {off[2]:.1%} apart",
        f"lifting and lowering in {commands.size * PERIOD:.1f} s, rms over the range; stroke within"
        f" {CLOSE:.0%}", judged(bool(off[0] < CLOSE)),
        "the slower mode's phase falls behind from swing to swing; " + WHY,
    )  # fmt: skip
