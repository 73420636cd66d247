"""A linear model of machine and force loop from a recording of a run in closed loop.

The model is an integrator and a rational part whose poles and zeros are fitted by the iteration
of Steiglitz and McBride (1965): least squares of the simulated output, which noise and rounding
of the sensors bias less than those of the equation. Slow changes are filtered off both signals
first: they come from gains that differ between lifting and lowering, not from the dynamics.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import linalg
from scipy.signal import lfilter

from emir_analysis.errors import InputError
from emir_analysis.graph_topics import GraphTopics, graph_topics
from emir_analysis.signals import Source, load
from emir_common.quantity import ParameterError
from emir_control import design
from emir_control.internal_model import InternalModel
from emir_control.pfc_file import STROKE
from emir_msgs_py.topics import (
    BOOM_DEFLECTION,
    CONTROL_PERIOD,
    CYLINDER_STATES,
    JOINT_STATES,
    VELOCITY_COMMAND,
    Topic,
)

Array = NDArray[np.float64]

SLOW = 0.97  # pole of the filter that takes slow changes off: 1 rad/s
FIRST_POLE = 0.85  # where the iteration begins
OUTERMOST = 0.98  # no pole beside the integrator is slower
ROUNDS = 40
SHORTEST = 8.0  # s
LEAST_MOTION = 1e-3  # m or rad, rms behind the filter


@dataclass(frozen=True)
class Identified:
    """A model and how much of the filtered output it explains: 1 - rms(error) / rms(output)."""

    model: InternalModel
    fit: float


def from_recording(bag: Path, output: str, order: int) -> Identified:
    """Return the model from velocity command to `stroke`, m, or `tip_angle`, rad, of an order.

    Raises InputError for a recording that lacks a topic, is short or shows no motion,
    ParameterError for an order that makes no sense.
    """
    topics = (CYLINDER_STATES,) if output == STROKE else (JOINT_STATES, BOOM_DEFLECTION)
    there = graph_topics(bag)
    sources: dict[str, Source] = {}
    for topic in (VELOCITY_COMMAND, *topics):
        sources |= _sources(topic, there)
    recording = load(bag, sources)
    given = recording["velocity_command"]
    length = given.time[-1] - given.time[0]
    if length < SHORTEST:
        raise InputError(f"{bag}: {length:.1f} s: at least {SHORTEST:g} s are needed")
    time = np.arange(given.time[0], given.time[-1], CONTROL_PERIOD)
    command = given.value[
        np.searchsorted(given.time, time + 0.5 * CONTROL_PERIOD, side="right") - 1
    ]
    names = ("stroke",) if output == STROKE else ("angle", "deflection")
    shown = sum(np.interp(time, recording[name].time, recording[name].value) for name in names)
    try:
        return identify(command, np.asarray(shown), order)
    except InputError as error:
        raise InputError(f"{bag}: {error}") from None


def _sources(topic: Topic, there: GraphTopics) -> dict[str, Source]:
    name = there.needed(topic)
    return {signal: Source(name, at.path, at.unit) for signal, at in topic.fields.items()}


def identify(command: Array, output: Array, order: int) -> Identified:
    """Return the model of an order from command and output, (n,) each, a control period apart.

    Raises InputError where nothing moves, ParameterError for an order below 2.
    """
    if order < 2:  # noqa: PLR2004 (an integrator and one state at least)
        raise ParameterError(f"order = {order}: at least 2")
    driven = _fast(np.concatenate([[0.0], np.cumsum(command)[:-1]]))  # behind the integrator
    wanted = _fast(output - output[0])
    if np.std(wanted) < LEAST_MOTION / 10.0:
        raise InputError("nothing moves in it")
    poles: Array = np.asarray(np.poly(np.full(order - 1, FIRST_POLE)), dtype=np.float64)
    best: tuple[float, Array, Array] | None = None
    for _ in range(ROUNDS):
        poles = _next_poles(poles, driven, wanted)
        zeros, error = _zeros(poles, driven, wanted)
        if best is None or error < best[0]:
            best = error, poles, zeros
    assert best is not None  # noqa: S101 (there were rounds)
    error, poles, zeros = best
    companion = linalg.companion(np.convolve(poles, [1.0, -1.0]))  # the integrator put back
    model = InternalModel(companion, np.eye(order)[0], zeros, CONTROL_PERIOD)
    return Identified(design.reduced(model, order), 1.0 - error / float(np.std(wanted)))


def _fast(signal: Array) -> Array:
    """Return a signal without its slow changes."""
    high_pass = [1.0, -1.0], [1.0, -SLOW]
    return np.asarray(lfilter(*high_pass, lfilter(*high_pass, signal)))


def _next_poles(poles: Array, driven: Array, wanted: Array) -> Array:
    """Return the denominator that least squares finds behind the filter 1 / (the last one)."""
    order = poles.size - 1
    x, y = lfilter([1.0], poles, driven), lfilter([1.0], poles, wanted)
    columns = [-_delayed(y, k) for k in range(1, order + 1)]
    columns += [_delayed(x, k) for k in range(order + 1)]
    found = np.linalg.lstsq(np.array(columns).T, y, rcond=None)[0]
    roots = np.roots(np.concatenate([[1.0], found[:order]])).astype(complex)
    far = np.abs(roots) > OUTERMOST
    roots[far] *= OUTERMOST / np.abs(roots[far])
    return np.real(np.poly(roots))


def _zeros(poles: Array, driven: Array, wanted: Array) -> tuple[Array, float]:
    """Return the numerator that simulates best with a denominator, and the rms error."""
    x = lfilter([1.0], poles, driven)
    columns = np.array([_delayed(x, k) for k in range(poles.size)]).T
    zeros = np.linalg.lstsq(columns, wanted, rcond=None)[0]
    return zeros, float(np.std(wanted - columns @ zeros))


def _delayed(signal: Array, samples: int) -> Array:
    return np.concatenate([np.zeros(samples), signal[: signal.size - samples]])


def difference(one: InternalModel, other: InternalModel, frequencies: Sequence[float]) -> Array:
    """Return |G_1 - G_2| / |G_2| at frequencies, Hz."""
    first, second = (m.frequency_response(np.array(frequencies)) for m in (one, other))
    return np.asarray(np.abs(first - second) / np.abs(second))
