"""The diagnosis of an actuator's recordings in files, as `emir diagnose` calls it."""

from dataclasses import replace
from pathlib import Path

from emir_analysis.diagnosis.actuator.curves import measured
from emir_analysis.diagnosis.actuator.fitting import Fitting
from emir_analysis.diagnosis.actuator.misstated import misstated
from emir_analysis.diagnosis.actuator.noise_size import NOISE, as_left
from emir_analysis.diagnosis.actuator.page import write_page
from emir_analysis.diagnosis.actuator.record import (
    PRESSURE,
    ActuatorRecord,
    open_judge,
    open_record,
)
from emir_analysis.diagnosis.actuator.result import (
    ActuatorDiagnosis,
    diagnosis,
    judged_runs,
    noise_floor,
    stages,
)
from emir_analysis.diagnosis.actuator.search import (
    Progress,
    Search,
    parameters_only,
    search,
)
from emir_analysis.diagnosis.actuator.verdict import verdict
from emir_analysis.diagnosis.result import write_json
from emir_analysis.diagnosis.select import AT_NOISE
from emir_analysis.errors import IncompleteError, InputError
from emir_analysis.import_command import write_signals
from emir_analysis.outputs import check_outputs, write_all
from emir_analysis.signals import Array, SignalMap, Source, read_signal_map
from emir_common.parameter_tree import with_values
from emir_plant.actuator import SAMPLE, ActuatorSheet, load_actuator, write_actuator


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
    ParameterError, one line each, for anything that cannot be used; IncompleteError, with the
    result, where the judge recording or an output cannot.
    """
    check_outputs([json, html, model_out], predictions, [datasheet, signals, bag, judge])
    sheet = load_actuator(datasheet)
    if judge is not None and not judge.exists():
        raise InputError(f"{judge}: no such recording")
    signal_map = read_signal_map(signals)
    progress(f"reading {bag}")
    opened = open_record(bag, signal_map)
    _tell(opened.left_out, progress)
    counted = opened.period if sheet.time_unit == SAMPLE else 1.0
    record = opened.in_samples(counted)
    sheet, found = _found(sheet, record, progress)
    machines = stages(sheet, found)
    # frozen before the judge is opened
    as_found = _as_found(sheet, found)
    failed = write_all([(model_out, lambda file: write_actuator(file, as_found))])
    judged, useless = _judge(judge, signal_map, opened, progress)
    judged = judged and judged.in_samples(counted)
    failed += useless
    runs = judged_runs(machines, record, judged)
    shown = record if judged is None else judged
    result = diagnosis(sheet, found, record, judged, runs)
    failed += write_all(
        [
            (json, lambda file: write_json(file, result)),
            (html, lambda file: write_page(file, result, shown, runs)),
            (predictions, lambda folder: _write_runs(folder, shown, runs)),
        ]
    )
    if failed:
        raise IncompleteError(result, failed)
    return result


def _found(
    sheet: ActuatorSheet, record: ActuatorRecord, progress: Progress
) -> tuple[ActuatorSheet, Search]:
    """Return the fits of all sets of effects, and what else there is where none explains all.

    And the sheet, with the noise as measured where that is more than stated.
    """
    fitting = Fitting(sheet, record, noise_floor(sheet, record))
    found = _searched(fitting, progress)
    if found.misstated or verdict(sheet, found, fitting.noise) != "unexplained":
        return sheet, found
    sheet, line = as_left(sheet, found.chosen, record)
    _tell(line, progress)
    fitting = Fitting(sheet, record, noise_floor(sheet, record))
    if verdict(sheet, found, fitting.noise) != "unexplained":
        return sheet, found
    if line:  # beside more noise a value of the sheet may explain all
        found = replace(found, misstated=misstated(fitting, found.plain))
    if found.misstated is None:
        progress("measuring what has no name")
        found = replace(found, curve=measured(fitting, found))
    return sheet, found


def _searched(fitting: Fitting, progress: Progress) -> Search:
    """Return the fits of sets of effects, and another value of the sheet where only that explains.

    Where one value does, one effect may do so too; more of them are no rivals.
    """
    progress("parameters only")
    plain = parameters_only(fitting)
    if plain.rms <= AT_NOISE * fitting.noise:
        return search(fitting, plain, progress)
    progress("other values in the data sheet")
    wrong = misstated(fitting, plain)
    if wrong is None:
        return search(fitting, plain, progress)
    found = search(fitting, plain, progress, most=1)
    if verdict(fitting.sheet, found, fitting.noise) != "unexplained":
        return found
    return replace(found, misstated=wrong)


def _as_found(sheet: ActuatorSheet, found: Search) -> ActuatorSheet:
    """Return the sheet of the machine that was found; a value that was misstated has no range."""
    noise = {NOISE: sheet.machine.sensor.pressure_noise}  # as measured
    wrong = () if found.misstated is None else (found.misstated.path,)
    ranges = {path: ends for path, ends in sheet.ranges.items() if path not in wrong}
    return replace(sheet, machine=with_values(found.last.machine, noise), ranges=ranges)


def _judge(
    path: Path | None, signal_map: SignalMap, record: ActuatorRecord, progress: Progress
) -> tuple[ActuatorRecord | None, list[InputError]]:
    """Return the judge recording, if there is one that can be used, or why it cannot."""
    if path is None:
        return None, []
    progress(f"judging on {path}")
    try:
        opened = open_judge(path, signal_map, record)
    except InputError as error:
        return None, [InputError(f"{error}; what was found is judged on the same recording")]
    _tell(opened.left_out, progress)
    return opened, []


def _tell(line: str, progress: Progress) -> None:
    if line:
        progress(line)


def _write_runs(folder: Path, shown: ActuatorRecord, runs: dict[str, Array]) -> None:
    values = {"measured": shown.pressure} | runs
    sources = {name: Source(f"/{PRESSURE}/{name}", "position[0]", shown.unit) for name in values}
    write_signals(folder, shown.time, values, sources, {"made by": "emir diagnose"})
