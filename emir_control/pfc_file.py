"""A predictive controller's design as a YAML file: what made it, tuning, internal model."""

import dataclasses
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from emir_common.quantity import ParameterError, quantities
from emir_common.yaml_file import read_map
from emir_control.internal_model import InternalModel
from emir_control.pfc import PfcParameters

STROKE, TIP_ANGLE = "stroke", "tip_angle"  # what is controlled, m or rad
ARRAYS = ("A", "B", "C", "observer")


def default_file(output: str) -> Path:
    """Return the design that comes with the project, for `stroke` or `tip_angle`."""
    return Path(str(files("emir_control") / "data" / f"pfc_{output}.yaml"))


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


def save(file: Path, parameters: PfcParameters, output: str, made_by: dict[str, Any]) -> None:
    """Write a design. made_by: what a reader needs to make it again. Raises ParameterError."""
    model = {"output": output, "period": parameters.model.period}
    for name in ARRAYS:
        values = getattr(parameters.model, name)
        model[name] = None if values is None else values.tolist()
    tuning = {f.name: getattr(parameters, f.name) for f in dataclasses.fields(parameters)}
    del tuning["model"]
    tuning["coincidence"] = list(parameters.coincidence)
    content = {"made_by": made_by, "tuning": tuning, "model": model}
    text = yaml.safe_dump(content, sort_keys=False, default_flow_style=None, width=100)
    try:
        file.write_text(text, encoding="utf-8")
    except OSError as error:
        raise ParameterError(f"{file}: {error.strerror}") from None


def _parameters(content: Any, output: str) -> PfcParameters:
    if not isinstance(content, dict):
        raise ParameterError("no design in it")
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
    return PfcParameters(model=_model(model), coincidence=tuple(points), **tuning)


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
