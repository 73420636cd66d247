"""The controllers against what the boom allows: R over random draws of the machine.

R is the largest dynamic deflection of the TCP in a run, divided by the smallest that any command
could reach for the same stroke, time, payload and posture (`limit.py`). The dynamic deflection is
the TCP's off the line of the first section, less what it is at rest in the posture of that
instant, in proportion to cos(alpha). The stroke is what is left of it when the move starts: a
controller that begins before gains nothing by that.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from importlib.util import find_spec
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from emir_analysis.closed_loop import ClosedLoop
from emir_analysis.compare import Run, dynamic_deflection
from emir_analysis.control_protocols import Stepping
from emir_analysis.limit import PAPER_MOVE, Move, least
from emir_analysis.machine_model import actuator, boom_table
from emir_analysis.node_controls import (
    CascadeControl,
    LqgControl,
    MpcControl,
    PfcControl,
    PfcTipControl,
    ShapedControl,
)
from emir_common.parameter_tree import with_values
from emir_control import pfc_file
from emir_control.cascade import Cascade, CascadeParameters
from emir_control.lqg import Lqg, LqgParameters
from emir_control.mpc import Mpc
from emir_control.pfc import Pfc
from emir_control.pfc_file import STROKE, TIP_ANGLE
from emir_control.regulator import RegulatorParameters
from emir_control.shaping import ShapedCascade, ShapedParameters, Shaper
from emir_control.tip import Tip
from emir_control.trajectory import AwayAndBack, TrajectoryParameters, named
from emir_msgs_py.topics import CONTROL_PERIOD, PLANT_PERIOD, TICKS
from emir_plant import linkage
from emir_plant.parameters import Machine
from emir_plant.plant import REST_PRESSURE, Plant, SimulationError

Array = NDArray[np.float64]

SETTLING = 1.0  # s after the stop
WATCHED = 4.0  # s after the stop
STARTED = 0.02  # of the stroke: from there to as much before the end lasts the time taken
AIM_RATIO, AIM_DEFLECTION, AIM_POSITION = 1.20, 5e-3, 45e-3  # 1, m, m
AIM_HARD = 1.35
FAILED = math.inf  # R of a run that left the range of the model


@dataclass(frozen=True)
class Range:
    """What is drawn, each evenly between low and high.

    angle: rad. payload: kg. stiffness, edges: factors on beta and on each return edge's k.
    friction: N. hysteresis: width of the spool's play. delay: s. supply, threshold: Pa.
    directions: 1 lifts, -1 lowers. wait: s, at rest before the move.
    """

    angle: tuple[float, float] = (math.radians(30.0), math.radians(75.0))
    payload: tuple[float, float] = (0.0, 1500.0)
    stiffness: tuple[float, float] = (0.8, 1.2)
    edges: tuple[float, float] = (0.7, 1.3)
    friction: tuple[float, float] = (0.0, 7e3)
    hysteresis: float = 0.01
    delay: float = CONTROL_PERIOD
    supply: float = 320e5
    threshold: float = 40e5
    directions: tuple[int, ...] = (1, -1)
    wait: float = 1.024


EVERYDAY = Range()
HARD = Range(
    angle=(math.radians(60.0), math.radians(75.0)),
    payload=(0.0, 0.0),
    threshold=80e5,
    directions=(-1,),
    wait=8.0,
)


@dataclass(frozen=True)
class Draw:
    """One machine and what it shall do. angle: rad, at the start; stroke: m."""

    machine: Machine
    angle: float
    stroke: float


def draws(machine: Machine, count: int, seed: int, among: Range = EVERYDAY) -> Iterator[Draw]:
    """Yield random draws; the same seed gives the same."""
    for k in range(count):
        rng = np.random.default_rng((seed, k))
        values = {
            "geometry.payload": rng.uniform(*among.payload),
            "cylinder.beta": machine.cylinder.beta * rng.uniform(*among.stiffness),
            "resistances.k_meter_out_lifting": machine.resistances.k_meter_out_lifting
            * rng.uniform(*among.edges),
            "resistances.k_meter_out_lowering": machine.resistances.k_meter_out_lowering
            * rng.uniform(*among.edges),
            "effects.coulomb_friction.force": rng.uniform(*among.friction),
            "effects.valve_hysteresis.width": among.hysteresis,
            "effects.command_delay.delay": among.delay,
            "sensors.seed": int(rng.integers(2**31 - 1)),
        }
        angle = rng.uniform(*among.angle)
        stroke = PAPER_MOVE.distance * int(rng.choice(among.directions))
        yield Draw(with_values(_stated(machine, among), values), angle, stroke)


def _stated(machine: Machine, among: Range) -> Machine:
    """Return the machine with what every draw has and every controller knows."""
    values = {"supply.p0": among.supply, "logic_block.threshold": among.threshold}
    return with_values(machine, values)


def controllers(machine: Machine, among: Range = EVERYDAY) -> dict[str, Stepping]:
    """Return what is compared, by name; each knows the machine as stated and the delay."""
    joint = pfc_file.load(pfc_file.default_file(STROKE), STROKE)
    tip = pfc_file.load(pfc_file.default_file(TIP_ANGLE), TIP_ANGLE)
    lqg = LqgParameters(
        boom=boom_table(machine),
        actuator=actuator(_stated(machine, among)),
        regulator=RegulatorParameters(delay=among.delay),
        hysteresis=among.hysteresis,
    )
    conventional = Cascade(CascadeParameters())
    shapers = {
        name: ShapedControl(
            ShapedCascade(ShapedParameters(boom=lqg.boom, cascade=conventional, shaper=name))
        )
        for name in get_args(Shaper)
    }
    others = {"mpc": MpcControl(Mpc(lqg))} if find_spec("osqp") else {}
    return {
        "cascade": CascadeControl(),
        **shapers,
        "pfc": PfcControl(Pfc(joint)),
        "pfc_tip": PfcTipControl(Tip(Pfc(tip))),
        **others,
        "lqg": LqgControl(Lqg(lqg)),
    }


@dataclass(frozen=True)
class Score:
    """Figures of one run.

    ratio: R. settled: m, largest dynamic deflection from 1 s after the stop on. position: m,
    largest error of the TCP from then on. taken: s, between 2 and 98 % of the stroke.
    """

    ratio: float
    settled: float
    position: float
    taken: float

    def meets(self, ratio: float = AIM_RATIO) -> bool:
        """Tell whether the run meets the aim with this R."""
        return (
            self.ratio <= ratio and self.settled <= AIM_DEFLECTION and self.position <= AIM_POSITION
        )


FAILURE = Score(FAILED, FAILED, FAILED, FAILED)


def trajectory(draw: Draw, wait: float) -> AwayAndBack:
    """Return the paper's move, begun after a wait, s, with a long rest after it."""
    parameters = replace(TrajectoryParameters(), delay=wait, pause=2.0 * WATCHED)
    return named("lift-lower" if draw.stroke > 0.0 else "lower-lift", parameters)


def run(draw: Draw, outer: Stepping, among: Range = EVERYDAY) -> Run:
    """Return the signals of a run. Raises SimulationError where the machine cannot do it."""
    loop = ClosedLoop(Plant(draw.machine), trajectory(draw, among.wait), outer)
    return loop.run(draw.angle, REST_PRESSURE, among.wait + PAPER_MOVE.duration + WATCHED)


def smallest(draw: Draw) -> float:
    """Return the smallest dynamic deflection, m, that any command could reach."""
    return least(draw.machine, Move(draw.angle, draw.stroke, PAPER_MOVE.duration)).largest


def score(draw: Draw, outer: Stepping, limit: float, among: Range = EVERYDAY) -> Score:
    """Return the figures of a run, against the limit, m."""
    try:
        signals = run(draw, outer, among)
    except SimulationError:
        return FAILURE
    bending = dynamic_deflection(signals)
    stroke = signals["true_stroke"]
    start = round(among.wait / PLANT_PERIOD)
    left = 1.0 - float(stroke[start] - stroke[0]) / draw.stroke
    after = round((among.wait + PAPER_MOVE.duration + SETTLING) / PLANT_PERIOD)
    return Score(
        ratio=float(abs(bending).max() / (limit * left)),
        settled=float(abs(bending[after:]).max()),
        position=float(abs(tcp_error(draw.machine, signals)[after // TICKS :]).max()),
        taken=_taken(stroke, draw.stroke),
    )


def tcp_error(machine: Machine, signals: Run) -> Array:
    """Return how far the TCP is across the boom from its place, m, in each control period.

    Its place is at the joint angle of the reference stroke, the boom bent as at rest there.
    """
    return turned_off(machine, signals) + dynamic_deflection(signals)[::TICKS]


def turned_off(machine: Machine, signals: Run) -> Array:
    """Return the part of `tcp_error` that the joint's angle makes, m."""
    p = Plant(machine).record[0]
    wanted = np.array([linkage.angle(h, p) for h in signals["reference_stroke"]])
    return np.asarray(machine.geometry.boom_length * (signals["true_angle"][::TICKS] - wanted))


def _taken(stroke: Array, wanted: float) -> float:
    share = (stroke - stroke[0]) / wanted
    started = int(np.argmax(share > STARTED))
    away = np.flatnonzero(abs(share - 1.0) > STARTED)
    return float((away[-1] + 1 - started) * PLANT_PERIOD) if away.size else 0.0
