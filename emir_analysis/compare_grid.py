"""Every controller over a grid of posture, payload, size of the move, direction and model error.

A controller is told none of these; a model error is a machine that is not what it was made for.
"""

import csv
import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from emir_analysis.compare import MoveFigures, Run, direction, figures, moves, run
from emir_analysis.control_protocols import Stepping
from emir_analysis.design_pfc import OperatingPoint
from emir_analysis.errors import InputError
from emir_analysis.margin import gain_margin, linear_machine
from emir_analysis.outputs import written
from emir_analysis.report import new_figure
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


COLUMNS: tuple[tuple[str, Callable[[Result], float]], ...] = (
    ("error rms / mm", lambda r: r.figures.error_rms * 1e3),
    ("error peak / mm", lambda r: r.figures.error * 1e3),
    ("lag / s", lambda r: r.figures.lag),
    ("bending / cm", lambda r: r.figures.bending * 1e2),
    ("1 s after / cm", lambda r: r.figures.settled * 1e2),
    ("settling / s", lambda r: r.figures.settling),
    ("dv/dt / mm/s2", lambda r: r.figures.roughness * 1e3),
    ("valve travel", lambda r: r.figures.travel),
    ("oil / l", lambda r: r.figures.oil * 1e3),
    ("gain margin", lambda r: r.margin),
)
BIG_IS_GOOD = ("gain margin",)


def as_text(found: Sequence[Result]) -> str:
    """Return median and worst of each controller and direction, in the form of Markdown."""
    lines = ["| controller | move | " + " | ".join(title for title, _ in COLUMNS) + " |"]
    lines.append("| --- | --- |" + " ---: |" * len(COLUMNS))
    for (name, way), group in _grouped(found):
        cells = [_cell(title, [value(r) for r in group]) for title, value in COLUMNS]
        lines.append(f"| {name} | {way} | {' | '.join(cells)} |")
    return "\n".join(lines)


def _grouped(found: Sequence[Result]) -> Iterator[tuple[tuple[str, str], list[Result]]]:
    for name in dict.fromkeys(r.controller for r in found):
        for way in ("lift", "lower"):
            yield (
                (name, way),
                [r for r in found if (r.controller, r.direction) == (name, way)],
            )


def _cell(title: str, values: Sequence[float]) -> str:
    """Return median and worst."""
    there = [value for value in values if not math.isnan(value)] or [math.nan]
    worst = min(there) if title in BIG_IS_GOOD else max(there, key=abs)
    return f"{_number(float(np.median(there)))} / {_number(worst)}"


def _number(value: float) -> str:
    return f"{value:.2f}" if math.isfinite(value) else "-"


@dataclass(frozen=True)
class Claim:
    """That one controller is better than another: has less of something. where: directions."""

    text: str
    better: str
    than: str
    value: Callable[[Result], float]
    where: tuple[str, ...] = ("lift", "lower")


# Paper 3.3, of the design made empty at 45 deg and of that which follows posture and payload.
CLAIMS = (
    Claim(
        "PFC of the joint is smoother than conventional control (rms dv/dt)",
        "pfc, preview", "cascade", lambda r: r.figures.roughness,
    ),
    Claim(
        "The same, scheduled",
        "pfc, scheduled", "cascade", lambda r: r.figures.roughness,
    ),
    Claim(
        "PFC of the joint bends the boom less than conventional control",
        "pfc, preview", "cascade", lambda r: r.figures.bending,
    ),
    Claim(
        "The same, scheduled", "pfc, scheduled", "cascade", lambda r: r.figures.bending,
    ),
    Claim(
        "PFC that follows the load leaves less 1 s after the stop than the one made empty",
        "pfc, scheduled", "pfc, preview", lambda r: r.figures.settled,
    ),
    Claim(
        "PFC of the tip bends the boom less than PFC of the joint, lifting",
        "pfc_tip, preview", "pfc, preview", lambda r: r.figures.bending, ("lift",),
    ),
    Claim(
        "The same, scheduled",
        "pfc_tip, scheduled", "pfc, scheduled", lambda r: r.figures.bending, ("lift",),
    ),
    Claim(
        "PFC of the tip leaves less 1 s after the stop than PFC of the joint",
        "pfc_tip, preview", "pfc, preview", lambda r: r.figures.settled,
    ),
    Claim(
        "The same, scheduled",
        "pfc_tip, scheduled", "pfc, scheduled", lambda r: r.figures.settled,
    ),
)  # fmt: skip


def order_of_merit(found: Sequence[Result]) -> str:
    """Return in how many cases each of the paper's claims holds, and where."""
    by_key = {(r.controller, r.case, r.direction): r for r in found}
    lines = []
    for claim in CLAIMS:
        holds = {}
        for (name, case, way), result in by_key.items():
            other = by_key.get((claim.than, case, way))
            if name == claim.better and other is not None and way in claim.where:
                holds[case, way] = claim.value(result) < claim.value(other)
        if holds:
            lines.append(f"- {claim.text}: in {sum(holds.values())} of {len(holds)} moves.")
            lines += [f"  {line}" for line in _by_axis(holds)]
    return "\n".join(lines)


def _by_axis(holds: Mapping[tuple[Case, str], bool]) -> Iterator[str]:
    """Yield how often it holds by each value of an axis that has several."""
    units = {"angle": " deg", "payload": " kg", "size": " mm", "error": ""}
    axes: dict[str, Callable[[Case, str], object]] = {
        f.name: lambda case, _, name=f.name: getattr(case, name)  # type: ignore[misc]
        for f in fields(Case)
    }
    axes["move"] = lambda _, way: way
    for axis, value in axes.items():
        split: dict[object, list[bool]] = {}
        for key, held in holds.items():
            split.setdefault(value(*key), []).append(held)
        if len(split) > 1:
            told = (f"{v}{units.get(axis, '')} {sum(h)}/{len(h)}" for v, h in split.items())
            yield f"{axis}: {', '.join(told)}"


def picture(found: Sequence[Result]) -> Figure:
    """Return each figure of every move: a column a controller, a colour a payload."""
    shown = [c for c in COLUMNS if not c[0].startswith(("lag", "oil"))]
    figure = new_figure(11.0)
    panels = figure.subplots(4, 2, sharex=True).ravel()
    names = list(dict.fromkeys(r.controller for r in found))
    payloads = sorted({r.case.payload for r in found})
    for axis, (title, value) in zip(panels, shown, strict=True):
        for k, payload in enumerate(payloads):
            for way, marker in (("lift", "^"), ("lower", "v")):
                group = [r for r in found if (r.case.payload, r.direction) == (payload, way)]
                places = [names.index(r.controller) + 0.22 * (k - 1) for r in group]
                axis.scatter(
                    places, [value(r) for r in group], s=14, marker=marker, color=f"C{k}",
                    alpha=0.7, linewidths=0, label=f"{payload:g} kg, {way}",
                )  # fmt: skip
        axis.set(ylabel=title, yscale="log")
        axis.grid(visible=True, axis="y", alpha=0.3)
    for axis in panels[-2:]:
        axis.set_xticks(range(len(names)), names, rotation=30, ha="right", fontsize="small")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(
        handles, labels, loc="outside upper center", ncols=3, frameon=False, fontsize="small"
    )
    return figure


def write_csv(found: Sequence[Result], file: Path) -> None:
    """Write every move, one line each, SI units. Raises InputError where that is not possible."""
    rows = [
        {
            "controller": r.controller,
            **{f"case_{name}": value for name, value in asdict(r.case).items()},
            "move": r.direction,
        }
        | asdict(r.figures)
        | {"bending": r.figures.bending, "gain_margin": r.margin}
        for r in found
    ]
    with written(file), file.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.DictWriter(stream, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)


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


WHOLE: dict[str, list[Any]] = {  # unless told otherwise
    "angle": [45.0, 60.0],
    "payload": [0.0, 750.0, 1500.0],
    "size": [20.0, 63.75],
    "error": ["none", "oil -20%", "friction 5 kN"],
}
NOMINAL: dict[str, list[Any]] = {name: [value] for name, value in asdict(Case()).items()}
