"""The diagnosis of recordings in files, as the `emir diagnose` command calls it."""

from pathlib import Path

from emir_analysis.diagnosis.diagnose import Progress, diagnose
from emir_analysis.diagnosis.experiment import open_experiment
from emir_analysis.diagnosis.page import write_page
from emir_analysis.diagnosis.result import Diagnosis, diagnosis, write_json
from emir_analysis.errors import InputError
from emir_analysis.signals import read_signal_map
from emir_plant.sheet import load_sheet


def command(  # noqa: PLR0913, PLR0917 - the options of the command, one by one
    bag: Path,
    datasheet: Path,
    signals: Path,
    judge: Path | None,
    json: Path | None,
    html: Path | None,
    progress: Progress,
) -> Diagnosis:
    """Find out from the recording `bag` what the data sheet's machine lacks.

    signals: YAML map from signals to topics. judge: recording on which the errors are stated,
    opened when everything is fitted; `bag` itself when not given. json, html: files to write.
    Raises InputError or ParameterError, one line each, for anything that cannot be used.
    """
    for file in (json, html):
        if file is not None and not file.parent.is_dir():
            raise InputError(f"{file}: no such folder {file.parent}")
    sheet = load_sheet(datasheet)
    if not sheet.tolerances:
        raise InputError(f"{datasheet}: no parameter has a tolerance, nothing to fit")
    if judge is not None and not judge.exists():
        raise InputError(f"{judge}: no such recording")
    signal_map = read_signal_map(signals)
    progress(f"reading {bag}")
    experiment = open_experiment(bag, signal_map, sheet.machine)
    findings = diagnose(experiment, sheet, progress)
    judged = experiment
    if judge is not None:
        progress(f"judging on {judge}")
        judged = open_experiment(judge, signal_map, sheet.machine)
    result = diagnosis(findings, judged)
    if json is not None:
        write_json(json, result)
    if html is not None:
        write_page(html, findings, result, judged)
    return result
