"""The diagnosis of an actuator's recordings in files, as `emir diagnose` calls it."""

from dataclasses import replace
from pathlib import Path

from emir_analysis.diagnosis.actuator.page import write_page
from emir_analysis.diagnosis.actuator.record import PRESSURE, ActuatorRecord, open_record
from emir_analysis.diagnosis.actuator.result import (
    ActuatorDiagnosis,
    diagnosis,
    judged_runs,
    noise_floor,
    stages,
)
from emir_analysis.diagnosis.actuator.search import Progress, search
from emir_analysis.diagnosis.result import write_json
from emir_analysis.errors import InputError
from emir_analysis.import_command import write_signals
from emir_analysis.outputs import check_outputs
from emir_analysis.signals import Array, Source, read_signal_map
from emir_plant.actuator import load_actuator, write_actuator


def command(  # noqa: PLR0913 - the options of the command, one by one
    bag: Path,
    datasheet: Path,
    signals: Path,
    judge: Path | None,
    *,
    json: Path | None = None,
    html: Path | None = None,
    model_out: Path | None = None,
    predictions: Path | None = None,
    progress: Progress,
) -> ActuatorDiagnosis:
    """Find out from the recording `bag` what the data sheet's actuator lacks.

    judge: recording on which the errors are stated, opened when everything is fitted and
    chosen; `bag` itself when not given. model_out: data sheet with the effects to write.
    predictions: folder for the simulated runs beside the measured. Raises InputError or
    ParameterError, one line each, for anything that cannot be used.
    """
    check_outputs([json, html, model_out], predictions, [datasheet, signals, bag, judge])
    sheet = load_actuator(datasheet)
    if not sheet.ranges:
        raise InputError(f"{datasheet}: no parameter has a range, nothing to fit")
    if judge is not None and not judge.exists():
        raise InputError(f"{judge}: no such recording")
    signal_map = read_signal_map(signals)
    progress(f"reading {bag}")
    record = open_record(bag, signal_map)
    found = search(sheet, record, noise_floor(sheet, record), progress)
    machines = stages(sheet, found)
    if model_out is not None:  # frozen before the judge is opened
        write_actuator(model_out, replace(sheet, machine=found.chosen.machine))
    judged = None
    if judge is not None:
        progress(f"judging on {judge}")
        judged = open_record(judge, signal_map)
    runs = judged_runs(machines, record, judged)
    shown = record if judged is None else judged
    result = diagnosis(sheet, found, record, judged, runs)
    if json is not None:
        write_json(json, result)
    if html is not None:
        write_page(html, result, shown, runs)
    if predictions is not None:
        _write_runs(predictions, shown, runs)
    return result


def _write_runs(folder: Path, shown: ActuatorRecord, runs: dict[str, Array]) -> None:
    values = {"measured": shown.pressure} | runs
    sources = {name: Source(f"/{PRESSURE}/{name}", "position[0]", shown.unit) for name in values}
    write_signals(folder, shown.time, values, sources, {"made by": "emir diagnose"})
