"""Every controller over a grid of posture, payload, size of the move, direction and model error.

A controller is told none of these; a model error is a machine that is not what it was made for.
"""

import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from emir_analysis.compare import MoveFigures, Run, direction, figures, moves, run
from emir_analysis.control_protocols import Stepping
from emir_analysis.design_pfc import OperatingPoint
from emir_analysis.errors import InputError
from emir_analysis.margin import gain_margin, linear_machine
from emir_common.parameter_tree import declared, with_values
from emir_common.quantity import quantities
from emir_control.trajectory import AwayAndBack, TrajectoryParameters, named
from emir_plant.parameters import Machine
from emir_plant.plant import SimulationError

ERRORS: dict[str, dict[str, float]] = {  # factors on parameters; or values, where it is 0 else
    "none": {},
    "oil -20%": {"cylinder.beta": 0.8},
    "oil +20%": {"cylinder.beta": 1.2},
    "return +30%": {
        "resistances.k_meter_out_lifting": 1.3,
        "resistances.k_meter_out_lowering": 1.3,
    },
    "return -30%": {
        "resistances.k_meter_out_lifting": 0.7,
        "resistances.k_meter_out_lowering": 0.7,
    },
    "friction 5 kN": {"effects.coulomb_friction.force": 5e3},
    "hysteresis 1%": {"effects.valve_hysteresis.width": 0.01},
}


@dataclass(frozen=True)
class Case:
    """One point of the grid. angle: deg. payload: kg. size: mm of stroke. error: of ERRORS."""

    angle: float = 45.0
    payload: float = 0.0
    size: float = 63.75
    error: str = "none"

    def __str__(self) -> str:
        """Return the case in words."""
        where = f"{self.angle:g} deg, {self.payload:g} kg, {self.size:g} mm"
        return f"{where}, model error {self.error}"

    @property
    def start(self) -> float:
        """Return the boom's angle at the start, rad."""
        return math.radians(self.angle)

    def machine(self, base: Machine) -> Machine:
        """Return the machine of this case."""
        table = declared(base)
        values: dict[str, float] = {"geometry.payload": self.payload}
        for path, factor in ERRORS[self.error].items():
            usual = table[path][1]
            values[path] = usual * factor if usual else factor
        return with_values(base, values)


WHOLE: dict[str, list[Any]] = {  # unless told otherwise
    "angle": [45.0, 60.0],
    "payload": [0.0, 750.0, 1500.0],
    "size": [20.0, 63.75],
    "error": ["none", "oil -20%", "friction 5 kN"],
}
NOMINAL: dict[str, list[Any]] = {name: [value] for name, value in asdict(Case()).items()}


def grid(axes: Mapping[str, Sequence[Any]]) -> list[Case]:
    """Return all combinations of the values by the names of Case's fields, in its order.

    Raises InputError for a model error that is not known, a move of no size or an angle that no
    boom has.
    """
    reach = quantities(OperatingPoint)["angle"]
    low, high = math.degrees(reach.low), math.degrees(reach.high)
    for angle in axes["angle"]:
        if not low <= angle <= high:
            raise InputError(f"angle = {angle:g} deg: outside {low:.1f} ... {high:.1f} deg")
    for error in axes["error"]:
        if error not in ERRORS:
            raise InputError(f"model error {error!r}: there are {'; '.join(ERRORS)}")
    for size in axes["size"]:
        if not 0.0 < size <= 1000.0:  # noqa: PLR2004 (1 m, what a trajectory allows)
            raise InputError(f"size = {size:g} mm: outside 0 ... 1000 mm")
    return [Case(*point) for point in itertools.product(*axes.values())]


@dataclass(frozen=True)
class Result:
    """A move of a controller in a case. direction: lift or lower. margin: see `gain_margin`."""

    controller: str
    case: Case
    direction: str
    figures: MoveFigures
    margin: float


def results(
    base: Machine,
    controllers: Mapping[str, Stepping],
    cases: Sequence[Case],
    progress: Callable[[str], None],
    trajectory: str,
) -> tuple[list[Result], list[str]]:
    """Return each move of each controller in each case that the machine can do with all of them.

    Also, in words, the cases that it cannot do. Raises InputError where it can do none.
    """
    found: list[Result] = []
    left_out = []
    margins: dict[tuple[object, ...], dict[str, float]] = {}
    for k, case in enumerate(cases, 1):
        progress(f"{k} of {len(cases)}: {case}")
        of_case: list[Result] = []
        try:
            for name, outer in controllers.items():
                same = name, case.angle, case.payload, case.error  # whatever the size
                if same not in margins:
                    margins[same] = _margins(case, base, outer)
                signals = run(case.machine(base), _moves(trajectory, case), outer, case.start)
                of_case += _results(signals, name, case, margins[same])
        except SimulationError as error:
            progress(f"  left out: {error}")
            left_out.append(f"{case}: {error}")
        else:
            found += of_case
    if not found:
        raise InputError(f"no case that the machine can do; the first: {left_out[0]}")
    return found, left_out


def _moves(trajectory: str, case: Case) -> AwayAndBack:
    ramp = 0.75 * min(1.0, math.sqrt(case.size / 63.75))  # s: a short move is a quick one
    return named(trajectory, TrajectoryParameters(distance=case.size * 1e-3, ramp=ramp))


def _results(signals: Run, name: str, case: Case, margins: Mapping[str, float]) -> Iterator[Result]:
    velocity = signals["reference_velocity"]
    for move, found in zip(moves(velocity), figures(signals), strict=True):
        way = direction(velocity[move])
        yield Result(name, case, way, found, margins[way])


def _margins(case: Case, base: Machine, outer: Stepping) -> dict[str, float]:
    """Return the gain margin of each direction; nan where the machine has no such slow motion."""
    found = {}
    for way, velocity in (("lift", 0.01), ("lower", -0.01)):
        point = OperatingPoint(angle=case.start, payload=case.payload, velocity=velocity)
        try:
            found[way] = gain_margin(linear_machine(case.machine(base), point), outer)
        except SimulationError:
            found[way] = math.nan
    return found
