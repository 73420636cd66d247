"""The simulated runs as recordings: to be looked at beside the measured one with any tool."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from mcap.writer import Writer

from emir_analysis.diagnosis.experiment import OUTPUTS, Experiment
from emir_analysis.diagnosis.judged import STAGES, Judged
from emir_analysis.errors import InputError
from emir_analysis.signals import Array
from emir_common.quantity import ParameterError

TYPE = "std_msgs/msg/Float64"
SCHEMA = b"float64 data\n"


def write_predictions(folder: Path, judged: Judged) -> None:
    """Write one MCAP recording for each judge recording and stage into the folder.

    In each, the topics /STAGE/SIGNAL and /measured/SIGNAL, stamped by the log time from 0, in SI
    units. Raises InputError for what cannot be written.
    """
    names = [Path(experiment.name).name for experiment in judged.evidence.experiments]
    stems = [name.removesuffix(".mcap") for name in names]
    for k, experiment in enumerate(judged.evidence.experiments):
        begin = stems[k] if stems.count(stems[k]) == 1 else f"{stems[k]}_{k + 1}"
        for stage in STAGES:
            signals = {"measured": experiment.outputs, stage: judged.runs[stage][k]}
            name = f"{begin}_{stage}"
            try:
                _write(folder / f"{name}.mcap", signals, experiment)
            except (OSError, ParameterError) as error:
                raise InputError(f"{folder / name}: {error}") from None


def _write(file: Path, signals: Mapping[str, Array], experiment: Experiment) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    with file.open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="ros2", library="emir")
        schema = writer.register_schema(name=TYPE, encoding="ros2msg", data=SCHEMA)
        channels = [
            (writer.register_channel(f"/{group}/{name}", "cdr", schema), outputs[:, column])
            for group, outputs in signals.items()
            for column, name in enumerate(OUTPUTS)
            if not np.all(np.isnan(outputs[:, column]))
        ]
        for k, time in enumerate(experiment.time):
            stamp = round(float(time) * 1e9)
            for channel, column in channels:
                # CDR, little endian: four bytes of header, then the number
                data = b"\x00\x01\x00\x00" + np.float64(column[k]).tobytes()
                writer.add_message(channel, stamp, data, stamp)
        writer.finish()  # type: ignore[no-untyped-call]  # mcap's, untyped
