"""The plots of runs of the graph, one or several laid over each other; zoomed all at once."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from emir_analysis.signals import Recording
from emir_analysis.thinning import thinned

ROW_HEIGHT = 210  # pixels
COLORS = ("#0b6bb5", "#d1622b", "#2e8b57", "#8e44ad", "#b8860b", "#c2185b", "#00838f", "#5d4037")
WANTED = "#8a939c"


@dataclass(frozen=True)
class Line:
    """A signal in a plot. names: the first that is recorded is drawn; held: as steps."""

    names: tuple[str, ...]
    label: str
    factor: float
    dash: str = "solid"
    held: bool = False


@dataclass(frozen=True)
class Row:
    """A plot of several lines over time."""

    title: str
    lines: tuple[Line, ...]
    limits: tuple[float, float] | None = None  # of the axis; None: what the lines need


MOTION = (
    Row("stroke / mm", (
        Line(("reference_stroke",), "stroke wanted", 1e3, "dot"),
        Line(("true_stroke", "stroke"), "stroke", 1e3),
    )),
    Row("velocity / mm/s", (
        Line(("reference_velocity",), "velocity wanted", 1e3, "dot"),
        Line(("true_velocity",), "velocity", 1e3),
    )),
    Row("deflection / cm", (Line(("tcp_deflection",), "TCP off the straight boom", 1e2),)),
)  # fmt: skip
HYDRAULICS = (
    Row("valve / %", (Line(("valve_command",), "command y2", 100.0, held=True),)),
    Row("pressure / bar", (
        Line(("pressure_lifting",), "lifting chamber", 1e-5),
        Line(("pressure_lowering",), "lowering chamber", 1e-5, "dash"),
    )),
    Row("open / %", (Line(("logic_block",), "logic block y4", 100.0),), (-5.0, 105.0)),
)  # fmt: skip


def plot(rows: Sequence[Row], runs: Mapping[str, Recording]) -> go.Figure:
    """Return the rows under each other with one time axis; each run has its colour."""
    figure = make_subplots(len(rows), 1, shared_xaxes=True, vertical_spacing=0.05)
    for (name, run), color in zip(runs.items(), _colors(len(runs)), strict=True):
        for number, row in enumerate(rows, start=1):
            for line in row.lines:
                trace = _trace(run, line, color)
                if trace is not None:
                    trace.name = line.label if len(runs) == 1 else f"{name}: {line.label}"
                    figure.add_trace(trace, row=number, col=1)
    for number, row in enumerate(rows, start=1):
        figure.update_yaxes(title_text=row.title, range=row.limits, row=number, col=1)
    figure.update_xaxes(title_text="time / s", row=len(rows), col=1)
    figure.update_layout(
        template="plotly_white",
        height=ROW_HEIGHT * len(rows) + 60,
        margin={"l": 60, "r": 10, "t": 20, "b": 40},
        hovermode="x unified",
        legend={"orientation": "h", "y": -0.12},
    )
    return figure


def _colors(count: int) -> list[str]:
    return [COLORS[k % len(COLORS)] for k in range(count)]


def _trace(run: Recording, line: Line, color: str) -> go.Scatter | None:
    name = next((name for name in line.names if name in run.signals), None)
    if name is None:
        return None
    time, value = thinned(run[name].time, run[name].value)
    return go.Scatter(
        x=time.astype(np.float32),  # a screen has no more digits, the file half the size
        y=(value * line.factor).astype(np.float32),
        mode="lines",
        line={
            "color": WANTED if name.startswith("reference") else color,
            "dash": line.dash,
            "width": 1.5,
            "shape": "hv" if line.held else "linear",
        },
    )
