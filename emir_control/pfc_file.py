"""A predictive controller's design as a YAML file: what made it, tuning, internal model."""

import dataclasses
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from emir_common.quantity import ParameterError, quantities
from emir_common.yaml_file import read_map
from emir_control.internal_model import InternalModel
from emir_control.pfc import PfcParameters
from emir_control.schedule import Schedule

STROKE, TIP_ANGLE = "stroke", "tip_angle"  # what is controlled, m or rad
ARRAYS = ("A", "B", "C", "observer")
SCHEDULED = "scheduled"  # name of the design that comes with the project and follows the payload
GRID = ("strokes", "payloads", "forces")  # of a schedule


def default_file(output: str) -> Path:
    """Return the design that comes with the project, for `stroke` or `tip_angle`."""
    return _own(f"pfc_{output}.yaml")


def find(name: str, output: str) -> Path:
    """Return the file of a design: a path, `scheduled` or nothing for those of the project."""
    if name == SCHEDULED:
        return _own(f"pfc_{output}_{SCHEDULED}.yaml")
    return Path(name) if name else default_file(output)


def _own(name: str) -> Path:
    """Return a file that comes with the project."""
    return Path(str(files("emir_control") / "data" / name))


def load(file: Path, output: str) -> PfcParameters:
    """Read a design for the output, `stroke` or `tip_angle`.

    Raises ParameterError, naming the file, for what cannot be read, is missing, unknown, out of
    range or made for another output.
    """
    content = read_map(file, what="design")
    try:
        return _parameters(content, output)
    except ParameterError as error:
        raise ParameterError(f"{file}: {error}") from None


def save(file: Path, parameters: PfcParameters, output: str, made_by: Mapping[str, Any]) -> None:
    """Write a design. made_by: what a reader needs to make it again. Raises ParameterError."""
    model = {"output": output, "period": parameters.model.period} | _arrays(parameters.model)
    tuning = {f.name: getattr(parameters, f.name) for f in dataclasses.fields(parameters)}
    del tuning["model"], tuning["schedule"]
    tuning["coincidence"] = list(parameters.coincidence)
    content = {"made_by": dict(made_by), "tuning": tuning, "model": model}
    if parameters.schedule is not None:
        content["schedule"] = _written(parameters.schedule)
    text = yaml.safe_dump(content, sort_keys=False, default_flow_style=None, width=100)
    try:
        file.write_text(text, encoding="utf-8")
    except OSError as error:
        raise ParameterError(f"{file}: {error.strerror}") from None


def _parameters(content: dict[Any, Any], output: str) -> PfcParameters:
    tuning = dict(_group(content, "tuning", {f.name for f in dataclasses.fields(PfcParameters)}))
    for name, about in quantities(PfcParameters).items():
        if name in tuning:
            about.check(name, tuning[name])
    points = tuning.pop("coincidence", None)
    if not isinstance(points, list) or not all(type(point) is int for point in points):
        raise ParameterError(f"tuning: coincidence = {points!r}: not a list of whole numbers")
    model = _group(content, "model", {"output", "period", *ARRAYS})
    if model.get("output") != output:
        raise ParameterError(f"made for {model.get('output')}, wanted is one for {output}")
    own, schedule = _model(model), None
    if "schedule" in content:
        schedule = _schedule(_group(content, "schedule", {*GRID, "models"}), own.period)
    return PfcParameters(model=own, coincidence=tuple(points), schedule=schedule, **tuning)


def _arrays(model: InternalModel) -> dict[str, Any]:
    values = {name: getattr(model, name) for name in ARRAYS}
    return {name: None if value is None else value.tolist() for name, value in values.items()}


def _written(schedule: Schedule) -> dict[str, Any]:
    grid: dict[str, Any] = {name: getattr(schedule, name).tolist() for name in GRID}
    grid["models"] = [[_arrays(model) for model in row] for row in schedule.models]
    return grid


def _schedule(entries: dict[str, Any], period: float) -> Schedule:
    try:
        grid = {name: np.array(entries[name], dtype=float) for name in GRID}
        models = tuple(
            tuple(_model({**model, "period": period}) for model in row) for row in entries["models"]
        )
    except KeyError as error:
        raise ParameterError(f"schedule: {error.args[0]}: missing") from None
    except (TypeError, ValueError) as error:
        if isinstance(error, ParameterError):
            raise
        raise ParameterError("schedule: not arrays of numbers and rows of models") from None
    return Schedule(models=models, **grid)


def _group(content: dict[str, Any], name: str, known: set[str]) -> dict[str, Any]:
    group = content.get(name)
    if not isinstance(group, dict):
        raise ParameterError(f"{name}: missing")
    for key in group:
        if key not in known:
            raise ParameterError(f"{name}: {key}: there is no such entry")
    return group


def _model(entries: dict[str, Any]) -> InternalModel:
    arrays = {}
    for name in ARRAYS:
        values = entries.get(name)
        if values is None:
            if name != "observer":
                raise ParameterError(f"model: {name}: missing")
            continue
        try:
            arrays[name] = np.array(values, dtype=float)
        except (TypeError, ValueError):
            raise ParameterError(f"model: {name}: not an array of numbers") from None
    period = entries.get("period")
    if not isinstance(period, float):
        raise ParameterError(f"model: period = {period!r}: not a number of seconds")
    return InternalModel(period=period, **arrays)
