"""The figures of a run of the graph: as text, JSON and an HTML report with pictures."""

import json
import math
from dataclasses import asdict, dataclass
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from emir_analysis import bags
from emir_analysis.errors import InputError
from emir_analysis.metrics import Metric, metrics
from emir_analysis.report import Block, Heading, Picture, Table, Text, new_figure, write_html
from emir_analysis.robot_metrics import robot_metrics
from emir_analysis.robot_report import joints_picture, tcp_picture
from emir_analysis.run_signals import is_robot, load_run
from emir_analysis.signals import Recording

SHOWN = {
    "m": ("cm", 100.0),
    "Pa": ("bar", 1e-5),
    "rad": ("deg", math.degrees(1.0)),
}  # how people in the field read them


@dataclass(frozen=True)
class RunAnalysis:
    """A run of the graph and its figures. about: the recording's own description."""

    bag: Path
    about: dict[str, str]
    recording: Recording
    metrics: list[Metric]


def analyze(bag: Path) -> RunAnalysis:
    """Compute the figures of a recording of the graph. Raises InputError as `load_run`."""
    recording = load_run(bag)
    figures = robot_metrics(recording) if is_robot(recording) else metrics(recording)
    return RunAnalysis(bag, bags.metadata(bag).get("emir", {}), recording, figures)


def text(run: RunAnalysis) -> str:
    """Return the figures as lines of text."""
    rows = [(m.name, *_shown(m), m.meaning) for m in run.metrics]
    wide = max(len(row[0]) for row in rows)
    lines = [
        f"  {name:{wide}}  {value:>9} {unit:4} {meaning}" for name, value, unit, meaning in rows
    ]
    return "\n".join([f"figures of {run.bag}:", *lines])


def write_json(run: RunAnalysis, file: Path) -> None:
    """Write figures and description as JSON. Raises InputError when that fails."""
    content = {
        "bag": str(run.bag),
        "about": run.about,
        "metrics": {m.name: {k: v for k, v in asdict(m).items() if k != "name"}
                    for m in run.metrics},
    }  # fmt: skip
    try:
        file.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")
    except OSError as error:
        raise InputError(f"{file}: {error.strerror}") from None


def write_report(run: RunAnalysis, file: Path) -> None:
    """Write the HTML report. Raises InputError when that fails."""
    figures = [(m.name, *_shown(m), m.meaning) for m in run.metrics]
    blocks: list[Block] = [
        *(_robot_pictures(run) if is_robot(run.recording) else _joint1_pictures(run)),
        Heading("Figures"),
        Table(("figure", "value", "unit", "meaning"), figures),
        Heading("About this recording"),
        Table(("", ""), list(run.about.items())) if run.about else Text("It says nothing."),
    ]
    write_html(file, f"EMIR run: {run.bag.name}", blocks)


def _joint1_pictures(run: RunAnalysis) -> list[Block]:
    return [
        Text(_headline(run), lead=True),
        Picture(_motion(run.recording), "Piston and TCP. The paper's Fig. 9 shows these two."),
        Picture(_hydraulics(run.recording), "Valve, chamber pressures and safety logic block."),
    ]


def _robot_pictures(run: RunAnalysis) -> list[Block]:
    by_name = {m.name: " ".join(_shown(m)) for m in run.metrics}
    return [
        Text(
            f"The TCP stays within {by_name['tcp_path_error_peak']} of its path and ends"
            f" {by_name['tcp_error_end']} and {by_name['tcp_tilt_end']} from its reference.",
            lead=True,
        ),
        Picture(tcp_picture(run.recording), "The TCP: error, deflection and turn by bending."),
        Picture(joints_picture(run.recording), "All joints, the base first."),
    ]


def _shown(metric: Metric) -> tuple[str, str]:
    """Return value and unit as text, in the unit people use."""
    unit, factor = SHOWN.get(metric.unit, (metric.unit, 1.0))
    if metric.value is None:
        return "-", unit
    digits = max(0, 2 - math.floor(math.log10(abs(metric.value * factor) or 1.0)))
    return f"{metric.value * factor:.{min(digits, 3)}f}", unit


def _headline(run: RunAnalysis) -> str:
    by_name = {m.name: m for m in run.metrics}

    def say(name: str) -> str:
        return " ".join(_shown(by_name[name]))

    return (
        f"The stroke follows its reference with at most {say('tracking_error_peak')} of error"
        f" ({say('lag_plateau')} of delay at constant velocity). The TCP bends"
        f" {say('tcp_deflection_up')} up and {say('tcp_deflection_down')} down about"
        f" {say('tcp_deflection_static')} at rest."
    )


def _motion(run: Recording) -> Figure:
    figure = new_figure(7.0)
    stroke, velocity, tcp = figure.subplots(3, 1, sharex=True)
    _line(stroke, run, "reference_stroke", 1e3, "wanted")
    _line(stroke, run, "true_stroke" if "true_stroke" in run.signals else "stroke", 1e3, "piston")
    stroke.set_ylabel("stroke / mm")
    _line(velocity, run, "reference_velocity", 1e3, "wanted")
    _line(velocity, run, "true_velocity", 1e3, "piston")
    velocity.set_ylabel("velocity / mm/s")
    _line(tcp, run, "tcp_deflection", 1e2, "TCP off the straight boom")
    tcp.set_ylabel("deflection / cm")
    return _finished(figure)


def _hydraulics(run: Recording) -> Figure:
    figure = new_figure(6.0)
    valve, pressure, logic = figure.subplots(3, 1, sharex=True, height_ratios=(2, 2, 1))
    _line(valve, run, "valve_command", 100.0, "command y2")
    valve.lines[-1].set_drawstyle("steps-post")  # held from one message to the next
    valve.set_ylabel("valve / %")
    _line(pressure, run, "pressure_lifting", 1e-5, "lifting chamber")
    _line(pressure, run, "pressure_lowering", 1e-5, "lowering chamber")
    pressure.set_ylabel("pressure / bar")
    _line(logic, run, "logic_block", 100.0, "logic block y4")
    logic.set_ylabel("open / %")
    logic.set_ylim(-5.0, 105.0)
    return _finished(figure)


def _line(axes: Axes, run: Recording, name: str, factor: float, label: str) -> None:
    if name in run.signals:
        color = "0.5" if name.startswith("reference") else None
        axes.plot(run[name].time, run[name].value * factor, label=label, color=color, lw=1.2)


def _finished(figure: Figure) -> Figure:
    for axes in figure.axes:
        axes.grid(visible=True, alpha=0.3)
        if axes.lines:
            axes.legend(
                loc="lower right",
                bbox_to_anchor=(1.0, 0.98),  # above the axes, where nothing is hidden
                ncols=len(axes.lines),
                frameon=False,
                fontsize="small",
            )
    figure.axes[-1].set_xlabel("time / s")
    return figure
