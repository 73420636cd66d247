"""The diagnosis of recordings in files, as the `emir diagnose` command calls it."""

import math
from collections.abc import Sequence
from pathlib import Path

from emir_analysis.bags import files, is_finished
from emir_analysis.diagnosis.control import before_and_after
from emir_analysis.diagnosis.diagnose import diagnose
from emir_analysis.diagnosis.experiment import (
    SIGNALS,
    Experiment,
    check_signal_map,
    open_experiment,
)
from emir_analysis.diagnosis.graph_signals import graph_signals
from emir_analysis.diagnosis.judged import judged
from emir_analysis.diagnosis.model_file import write_model
from emir_analysis.diagnosis.noise_size import as_measured
from emir_analysis.diagnosis.page import write_page
from emir_analysis.diagnosis.predictions import write_predictions
from emir_analysis.diagnosis.result import Diagnosis, diagnosis, write_json
from emir_analysis.diagnosis.whole import Progress
from emir_analysis.diagnosis.wiring import check_wiring
from emir_analysis.errors import IncompleteError, InputError
from emir_analysis.outputs import check_outputs, write_all
from emir_analysis.signals import SignalMap, read_signal_map
from emir_plant.parameters import Machine
from emir_plant.sheet import data, load_sheet

Bags = Path | Sequence[Path]


def command(  # noqa: PLR0913, PLR0917 - the options of the command, one by one
    bag: Bags,
    datasheet: Path | None,
    signals: Path | None,
    judge: Bags | None,
    json: Path | None,
    html: Path | None,
    progress: Progress,
    *,
    model_out: Path | None = None,
    predictions: Path | None = None,
    time_limit: float = math.inf,
) -> Diagnosis:
    """Find out from the recordings `bag` what the data sheet's machine lacks.

    datasheet: EMIR's joint 1 as the project states it when not given. signals: YAML map from
    signals to topics, the graph's when not given. judge: recordings on which the errors are stated,
    opened when everything is fitted; `bag` itself when not given. json, html: files to write.
    model_out: file for the machine as found; a controller designed before and after is then
    compared on it. predictions: folder for the simulated runs. time_limit: s, after which the
    search ends with the best that was found. Raises InputError or
    ParameterError, one line each, for anything that cannot be used; IncompleteError, with the
    result, where a judge recording or an output cannot.
    """
    bags, judges = _several(bag), _several(judge)
    inputs = [datasheet, signals, *bags, *judges]
    check_outputs([json, model_out, html], predictions, inputs)
    sheet = load_sheet(datasheet or data("joint1.yaml"))
    _check_recordings(bags, judges, progress)
    signal_map = None if signals is None else _checked_map(signals)
    _tell_unread(datasheet, sheet.ignored, progress)
    _tell_unread(signals, [name for name in signal_map or () if name not in SIGNALS], progress)
    experiments = [_opened(each, signal_map, sheet.machine, progress) for each in bags]
    sheet, noisier = as_measured(sheet, experiments)
    for line in noisier:
        progress(line)
    findings = diagnose(experiments, sheet, progress, time_limit)
    progress(f"judging on {', '.join(map(str, judges)) or 'the same'}")
    opened, failed = _judges(judges, signal_map, sheet.machine, progress)
    judgement = judged(findings, opened or experiments)
    control = None
    if model_out is not None:
        progress("designing a controller before and after")
        control = before_and_after(findings.sheet.machine, findings.chosen.machine, progress)
    result = diagnosis(findings, judgement, control)
    failed += write_all(
        [
            (json, lambda file: write_json(file, result)),
            (model_out, lambda file: write_model(file, findings.chosen.machine, result.recording)),
            (predictions, lambda folder: write_predictions(folder, judgement)),
            (html, lambda file: write_page(file, findings, result, judgement)),
        ]
    )
    if failed:
        raise IncompleteError(result, failed)
    return result


def _check_recordings(bags: Sequence[Path], judges: Sequence[Path], progress: Progress) -> None:
    missing = [path for path in judges if not path.exists()]
    if missing:
        raise InputError(f"{missing[0]}: no such recording")
    learned = {path.resolve() for path in bags}
    if len(learned) < len(bags):
        raise InputError(f"{', '.join(map(str, bags))}: the same recording twice")
    for path in judges:
        if path.resolve() in learned:
            progress(f"{path}: judged on what was learned from: no measure of other recordings")


def _tell_unread(file: Path | None, unread: Sequence[str], progress: Progress) -> None:
    if unread:
        progress(f"{file}: not used: {', '.join(unread)}")


def _checked_map(signals: Path) -> SignalMap:
    signal_map = read_signal_map(signals)
    try:
        check_signal_map(signal_map)
    except InputError as error:
        raise InputError(f"{signals}: {error}") from None
    return signal_map


def _judges(
    paths: Sequence[Path], signal_map: SignalMap | None, machine: Machine, progress: Progress
) -> tuple[list[Experiment], list[InputError]]:
    """Return the judge recordings that can be used, and why others cannot."""
    opened: list[Experiment] = []
    useless: list[InputError] = []
    for path in paths:
        try:
            opened.append(_opened(path, signal_map, machine, progress))
        except InputError as error:
            useless.append(error)
    on = "the others" if opened else "the same recordings"
    return opened, [InputError(f"{error}; what was found is judged on {on}") for error in useless]


def _opened(
    path: Path, signal_map: SignalMap | None, machine: Machine, progress: Progress
) -> Experiment:
    progress(f"reading {path}")
    known = graph_signals(path) if signal_map is None else signal_map
    opened = open_experiment(path, known, machine)
    check_wiring(opened, machine)
    for line in opened.mended:
        progress(line)
    for file in files(path):
        if not is_finished(file):
            end = float(opened.time[-1])
            progress(f"{file}: was cut off; read as far as it goes, {end:.1f} s")
    return opened


def _several(paths: Bags | None) -> list[Path]:
    if paths is None:
        return []
    return [paths] if isinstance(paths, Path) else list(paths)
