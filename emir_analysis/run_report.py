"""The figures of runs of the graph: as text, JSON, CSV and an HTML report with plots."""

import csv
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from emir_analysis import bags
from emir_analysis.errors import InputError
from emir_analysis.machine_record import PLANT
from emir_analysis.metrics import Metric, metrics
from emir_analysis.outputs import write_picture, write_text, written
from emir_analysis.recorded_parameters import recorded_parameters
from emir_analysis.report import Block, Heading, Plot, Table, Text, write_html
from emir_analysis.robot_metrics import robot_metrics
from emir_analysis.robot_picture import path_picture
from emir_analysis.robot_report import headline as robot_headline
from emir_analysis.robot_report import robot_plots
from emir_analysis.run_plots import HYDRAULICS, MOTION, plot
from emir_analysis.run_signals import is_robot, load_run
from emir_analysis.signals import Recording

# how people in the field read them
SHOWN = {"m": ("cm", 100.0), "Pa": ("bar", 1e-5), "rad": ("deg", math.degrees(1.0))}


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
    if is_robot(recording):
        figures = robot_metrics(recording)
    else:
        length = recorded_parameters(bag, PLANT).get("geometry.boom_length")
        figures = metrics(recording, length)
    return RunAnalysis(bag, bags.metadata(bag).get("emir", {}), recording, figures)


def check_alike(runs: Sequence[RunAnalysis]) -> None:
    """Raise InputError where runs of joint 1 and of the whole robot are to stand side by side."""
    for run in runs:
        if is_robot(run.recording) != is_robot(runs[0].recording):
            raise InputError(f"{run.bag}: another model than {runs[0].bag}: analyze it by itself")


def text(run: RunAnalysis) -> str:
    """Return the figures of one run as lines of text."""
    rows = [(m.name, *_shown(m), m.meaning) for m in run.metrics]
    wide = max(len(row[0]) for row in rows)
    lines = [
        f"  {name:{wide}}  {value:>9} {unit:4} {meaning}" for name, value, unit, meaning in rows
    ]
    return "\n".join([f"figures of {run.bag}:", *lines])


def comparison(runs: Sequence[RunAnalysis]) -> str:
    """Return the figures of several runs side by side as lines of text."""
    names = _names(runs)
    wide = max(len(m.name) for m in runs[0].metrics)
    columns = [max(9, len(name)) for name in names]
    title = "  ".join(f"{name:>{w}}" for name, w in zip(names, columns, strict=True))
    lines = [f"  {'':{wide}}  {title}"]
    for of_all in zip(*(run.metrics for run in runs), strict=True):
        cells = [_shown(m)[0] for m in of_all]
        values = "  ".join(f"{cell:>{w}}" for cell, w in zip(cells, columns, strict=True))
        lines.append(f"  {of_all[0].name:{wide}}  {values} {_shown(of_all[0])[1]}")
    return "\n".join(lines)


def write_json(runs: Sequence[RunAnalysis], file: Path) -> None:
    """Write figures and descriptions as JSON: of one run, or `runs` with one entry each.

    Raises InputError when that fails.
    """
    entries: list[dict[str, Any]] = [
        {
            "bag": str(run.bag),
            "about": run.about,
            "metrics": {
                m.name: {k: v for k, v in asdict(m).items() if k != "name"} for m in run.metrics
            },
        }
        for run in runs
    ]
    content = entries[0] if len(entries) == 1 else {"runs": entries}
    write_text(file, json.dumps(content, indent=2) + "\n")


def write_csv(runs: Sequence[RunAnalysis], file: Path) -> None:
    """Write one line a run: bag, its description, figures as `name [unit]` in SI units.

    Raises InputError when that fails.
    """
    told = sorted({key for run in runs for key in run.about} - {"parameters"})
    figures = [f"{m.name} [{m.unit}]" for m in runs[0].metrics]
    with written(file), file.open("w", encoding="utf-8", newline="") as stream:
        table = csv.writer(stream)
        table.writerow(["bag", *told, *figures])
        for run in runs:
            about = [run.about.get(key, "") for key in told]
            table.writerow([run.bag, *about, *(m.value for m in run.metrics)])


def write_report(runs: Sequence[RunAnalysis], file: Path) -> None:
    """Write the HTML report, several runs in the same plots. Raises InputError when that fails."""
    names = _names(runs)
    recordings = {name: run.recording for name, run in zip(names, runs, strict=True)}
    blocks: list[Block] = [
        *(_headline(runs[0]) if len(runs) == 1 else ()),
        *(robot_plots(recordings) if is_robot(runs[0].recording) else _joint1_plots(recordings)),
        Heading("Figures"),
        _figures(names, runs),
    ]
    for name, run in zip(names, runs, strict=True):
        blocks.append(Heading(f"About {name}" if len(runs) > 1 else "About this recording"))
        told = list(run.about.items())
        blocks.append(Table(("", ""), told) if told else Text("It says nothing."))
    write_html(file, f"EMIR run: {', '.join(names)}", blocks)


def write_path(runs: Sequence[RunAnalysis], file: Path) -> None:
    """Write the picture of the robot's TCP on its way. Raises InputError for runs of joint 1."""
    if not is_robot(runs[0].recording):
        raise InputError("--picture: is of the whole robot, this is a run of joint 1")
    recordings = (run.recording for run in runs)
    write_picture(file, path_picture(dict(zip(_names(runs), recordings, strict=True))))


def _names(runs: Sequence[RunAnalysis]) -> list[str]:
    """Return a name for each run: its folder's, or its path where folders are alike."""
    short = [run.bag.resolve().name for run in runs]
    return short if len(set(short)) == len(short) else [str(run.bag) for run in runs]


def _figures(names: Sequence[str], runs: Sequence[RunAnalysis]) -> Table:
    rows = [
        (of_all[0].name, *(_shown(m)[0] for m in of_all), _shown(of_all[0])[1], of_all[0].meaning)
        for of_all in zip(*(run.metrics for run in runs), strict=True)
    ]
    values = names if len(runs) > 1 else ["value"]
    return Table(("figure", *values, "unit", "meaning"), rows)


def _joint1_plots(recordings: Mapping[str, Recording]) -> list[Block]:
    return [
        Plot(plot(MOTION, recordings), "Piston and TCP. The paper's Fig. 9 shows the lower two."),
        Plot(plot(HYDRAULICS, recordings), "Valve, chamber pressures and safety logic block."),
    ]


def _shown(metric: Metric) -> tuple[str, str]:
    """Return value and unit as text, in the unit people use."""
    unit, factor = SHOWN.get(metric.unit, (metric.unit, 1.0))
    if metric.value is None:
        return "-", unit
    digits = max(0, 2 - math.floor(math.log10(abs(metric.value * factor) or 1.0)))
    return f"{metric.value * factor:.{min(digits, 3)}f}", unit


def _headline(run: RunAnalysis) -> tuple[Text]:
    if is_robot(run.recording):
        shown = {m.name: " ".join(_shown(m)) for m in run.metrics}
        return (Text(robot_headline(shown), lead=True),)
    by_name = {m.name: m for m in run.metrics}

    def say(name: str) -> str:
        return " ".join(_shown(by_name[name]))

    said = (
        f"The stroke follows its reference with at most {say('tracking_error_peak')} of error"
        f" ({say('lag_plateau')} of delay at constant velocity). The TCP bends"
        f" {say('tcp_deflection_up')} up and {say('tcp_deflection_down')} down about"
        f" {say('tcp_deflection_static')} at rest."
    )
    return (Text(said, lead=True),)
