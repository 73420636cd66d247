"""`emir bench diagnosis`: what general identification tools make of the same recordings.

PySINDy (sparse regression of the state's derivative), with polynomials and with terms of the
machine's physics, and SysIdentPy (polynomial NARX by forward regression), trained on the first
recording of each machine, simulated freely over the second one, beside what `emir diagnose`
has written as JSON. Needs the extra `identification`, in an environment of its own: these
packages hold numpy back.
"""

import argparse
import json
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from emir_analysis.diagnosis.actuator.record import PRESSURE, open_record
from emir_analysis.errors import InputError
from emir_analysis.root_mean_square import rms
from emir_analysis.signals import Array, load, read_signal_map

PERIOD = 0.01  # s, of the boom's sensors
EVERY = 5  # samples from one to the next of a difference equation: 20 Hz
LAGS, DEGREE = 4, 2
TERMS = (4, 6, 8, 11, 15)  # of a difference equation, chosen on the last third of the training
SEEN = 2.0 / 3.0
THRESHOLDS = (0.0, 0.001, 0.003, 0.01, 0.03, 0.1, 0.3)  # of sparse regression, chosen as TERMS is
DIVERGED = 1e3  # times the spread of a signal
NOISE = {"piston_stroke": 7e-5, "pressure_lifting": 0.2e5, "pressure_lowering": 0.2e5,
         "tip_deflection_angle": 2e-5}  # fmt: skip
COMMAND = "valve_command"
P0, PT, BAR, DEAD_ZONE, CREEP = 200e5, 2e5, 1e5, 0.1, 1e-3

Term = Callable[..., Array]


@dataclass(frozen=True)
class Data:
    """Signals on one grid. outputs: (n, k), command: (n,)."""

    outputs: Array
    command: Array
    period: float


@dataclass(frozen=True)
class Row:
    """errors: RMS over the noise by output, None where it diverged. named: effects it points at."""

    method: str
    errors: list[float | None]
    named: str


def command(words: Sequence[str], write: Callable[[str], None]) -> None:
    """Write the table as Markdown. Raises InputError for what is missing."""
    parser = argparse.ArgumentParser(
        prog="emir bench diagnosis",
        description="PySINDy and SysIdentPy on the recordings of emir diagnose, beside its results."
        " Needs the extra `identification`, in an environment of its own"
        " (docs/identification.md).",
    )
    parser.add_argument(
        "recordings", type=Path, metavar="RECORDINGS",
        help="folder with, of each machine, NAME_a to learn from and NAME_b to be judged on, and"
        " with signals.yaml",
    )  # fmt: skip
    parser.add_argument(
        "--machines", nargs="+", required=True, metavar="NAME", help="of the recordings"
    )
    parser.add_argument(
        "--diagnoses", type=Path, required=True, metavar="DIR",
        help="folder with what emir diagnose --json wrote of each machine, as NAME.json",
    )  # fmt: skip
    options = parser.parse_args(words)
    signals = read_signal_map(options.recordings / "signals.yaml")
    boom = COMMAND in signals
    noise = NOISE if boom else {PRESSURE: 1.0}
    read = _boom if boom else _actuator
    write("| machine | method | " + " | ".join(noise) + " | names |")
    write("|---|---|" + "---|" * (len(noise) + 1))
    for machine in options.machines:
        bags = [options.recordings / f"{machine}_{part}" for part in ("a", "b")]
        seen, unseen = (read(bag, signals) for bag in bags)
        diagnosed = _diagnosed(_read(options.diagnoses / f"{machine}.json"), noise)
        others = rows(seen, unseen, list(noise.values()), PHYSICS if boom else ACTUATOR_PHYSICS)
        for row in (diagnosed, *others):
            figures = ("diverged" if e is None else f"{e:.3g}" for e in row.errors)
            write(f"| {machine} | {row.method} | {' | '.join(figures)} | {row.named} |")


def rows(seen: Data, unseen: Data, noise: list[float], physics: dict[str, Term]) -> list[Row]:
    """Return what each tool makes of two recordings of a machine. Raises InputError without."""
    try:
        import pysindy  # noqa: F401, PLC0415 - wanted by this benchmark alone
        import sysidentpy  # noqa: F401, PLC0415 - as above
    except ImportError:
        raise InputError("needs pip install 'emir_ros[identification]'") from None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # theirs, about terms that do not matter
        return [
            _sindy(seen, unseen, noise, None),
            _sindy(seen, unseen, noise, physics),
            _narx(seen, unseen, noise),
        ]


def _opening(y: Array) -> Array:
    return np.sign(y) * np.maximum(np.abs(y) - DEAD_ZONE, 0.0) / (1.0 - DEAD_ZONE)


def _root(drop: Array) -> Array:
    return drop / np.sqrt(np.sqrt(drop**2 + BAR**2))


# State: stroke, p_H, p_S, deflection, their rates (velocity first); last the command.
PHYSICS: dict[str, Term] = {
    "1": lambda h, a, b, d, v, da, db, dd, y: np.ones_like(h),
    "stroke": lambda h, a, b, d, v, da, db, dd, y: h,
    "deflection": lambda h, a, b, d, v, da, db, dd, y: d,
    "deflection rate": lambda h, a, b, d, v, da, db, dd, y: dd,
    "velocity": lambda h, a, b, d, v, da, db, dd, y: v,
    "p_H rate": lambda h, a, b, d, v, da, db, dd, y: da,
    "p_S rate": lambda h, a, b, d, v, da, db, dd, y: db,
    "p_H": lambda h, a, b, d, v, da, db, dd, y: a,
    "p_S": lambda h, a, b, d, v, da, db, dd, y: b,
    "pump to H": lambda h, a, b, d, v, da, db, dd, y: np.maximum(_opening(y), 0) * _root(P0 - a),
    "H to tank": lambda h, a, b, d, v, da, db, dd, y: np.minimum(_opening(y), 0) * _root(a - PT),
    "pump to S": lambda h, a, b, d, v, da, db, dd, y: np.minimum(_opening(y), 0) * _root(P0 - b),
    "S to tank": lambda h, a, b, d, v, da, db, dd, y: np.maximum(_opening(y), 0) * _root(b - PT),
    "coulomb_friction": lambda h, a, b, d, v, da, db, dd, y: np.tanh(v / CREEP),
    "internal_leakage": lambda h, a, b, d, v, da, db, dd, y: a - b,
    "entrained_air": lambda h, a, b, d, v, da, db, dd, y: v * (BAR / np.maximum(b, BAR)) ** 2,
    "pressure_dependent_friction": lambda h, a, b, d, v, da, db, dd, y: (
        np.abs(a - 0.49 * b) * np.tanh(v / CREEP)
    ),
}
# State: the pressure and its rate; last the opening. Limits and pressures are of order one.
ACTUATOR_PHYSICS: dict[str, Term] = {
    "1": lambda p, dp, u: np.ones_like(p),
    "pressure": lambda p, dp, u: p,
    "rate": lambda p, dp, u: dp,
    "opening": lambda p, dp, u: u,
    "flow_limit": lambda p, dp, u: np.clip(u, -0.5, 0.6),
    "coulomb_friction": lambda p, dp, u: np.tanh(dp / 0.03),
    "pump orifice": lambda p, dp, u: np.maximum(u, 0.0) * np.sqrt(np.abs(4.0 + p)),
    "tank orifice": lambda p, dp, u: np.minimum(u, 0.0) * np.sqrt(np.abs(4.0 - p)),
    "turbulent_resistance": lambda p, dp, u: p * np.abs(p),
    "quadratic damping": lambda p, dp, u: dp * np.abs(dp),
}
NAMES = {
    "flow_limit",
    "turbulent_resistance",
    "coulomb_friction",
    "internal_leakage",
    "entrained_air",
    "pressure_dependent_friction",
}


def _sindy(seen: Data, unseen: Data, noise: list[float], physics: dict[str, Term] | None) -> Row:
    """State: the outputs and their rates. The threshold is chosen on the last third."""
    cut = int(SEEN * seen.command.size)
    head, tail = _part(seen, slice(0, cut)), _part(seen, slice(cut, None))

    def held_back(threshold: float) -> float:
        error = _sindy_run(_sparse(head, physics, threshold), tail) - tail.outputs
        relative = np.nan_to_num(error / seen.outputs.std(axis=0), nan=DIVERGED)
        return float(np.mean(np.clip(relative, -DIVERGED, DIVERGED) ** 2))

    model = _sparse(seen, physics, min(THRESHOLDS, key=held_back))
    named = "polynomials"
    if physics is not None:
        used = np.any(np.abs(model.coefficients) > 0.0, axis=0)
        chosen = [name for name, on in zip(physics, used, strict=True) if on and name in NAMES]
        named = f"{int(used.sum())} terms, with {', '.join(chosen) or 'no effect'}"
    method = "PySINDy" if physics is None else "PySINDy, physics"
    return Row(method, _errors(_sindy_run(model, unseen), unseen.outputs, noise, seen), named)


@dataclass(frozen=True)
class _Sparse:
    """A derivative as a sum of terms. scale: of states and command. powers: None with physics."""

    coefficients: Array
    scale: Array
    terms: list[Term]
    powers: Array | None

    def rate(self, x: Array, u: float) -> Array:
        """Return the state's derivative: as PySINDy's predict, in a tenth of the time."""
        z = np.append(x, u)
        if self.powers is None:
            values = np.array([float(term(*z)) for term in self.terms])
        else:
            values = np.prod((z / self.scale) ** self.powers, axis=1)
        return np.asarray(self.coefficients @ values * self.scale[:-1])


def _sparse(seen: Data, physics: dict[str, Term] | None, threshold: float) -> _Sparse:
    import pysindy as ps  # noqa: PLC0415 - wanted by this benchmark alone

    states = _states(seen)
    scale = np.append(states.std(axis=0), seen.command.std())
    terms = list((physics or {}).values())
    library: Any = ps.PolynomialLibrary(degree=DEGREE)
    if physics is not None:
        names = [lambda *_, name=name: name for name in physics]
        library = ps.CustomLibrary(terms, names, interaction_only=True)
    derivative = ps.SmoothedFiniteDifference()(states, t=seen.period) / scale[:-1]
    given = np.ones_like(scale) if physics is not None else scale
    model = ps.SINDy(
        # columns are normalised to length 1: a coefficient grows with the root of their number
        optimizer=ps.STLSQ(
            threshold=threshold * np.sqrt(len(states)), alpha=1e-6, normalize_columns=True
        ),
        feature_library=library,
    )
    model.fit(
        states / given[:-1],
        t=seen.period,
        x_dot=derivative,
        u=(seen.command / given[-1])[:, None],
    )
    powers = None if physics is not None else np.asarray(library.powers_)
    return _Sparse(np.asarray(model.coefficients()), scale, terms, powers)


def _sindy_run(model: _Sparse, data: Data) -> Array:
    states = _states(data)
    run = _integrated(model.rate, states[0], data, states.std(axis=0))
    return run[:, : data.outputs.shape[1]]


def _part(data: Data, part: slice) -> Data:
    return Data(data.outputs[part], data.command[part], data.period)


def _states(data: Data) -> Array:
    from scipy.signal import savgol_filter  # noqa: PLC0415 - with the rest of this benchmark

    smooth = savgol_filter(data.outputs, 15, 3, axis=0)
    rates = savgol_filter(data.outputs, 15, 3, deriv=1, delta=data.period, axis=0)
    return np.hstack([smooth, rates])


def _integrated(
    rate: Callable[[Array, float], Array], start: Array, data: Data, spread: Array
) -> Array:
    run = np.full((data.command.size, start.size), np.nan)
    x, h = start, data.period
    for k, u in enumerate(data.command):
        run[k] = x
        a = rate(x, u)
        b = rate(x + 0.5 * h * a, u)
        c = rate(x + 0.5 * h * b, u)
        x = x + h / 6.0 * (a + 2.0 * b + 2.0 * c + rate(x + h * c, u))
        if not np.all(np.abs(x - start) < DIVERGED * spread):
            break
    return run


def _narx(seen: Data, unseen: Data, noise: list[float]) -> Row:
    """One model for each output, from the command alone, started from its first measured values."""
    errors = []
    every = EVERY if seen.outputs.shape[0] > 1000 * EVERY else 1
    for k, one in enumerate(noise):
        found = _narx_error(seen, unseen, k, every)
        errors.append(None if found is None else found / one)
    return Row("SysIdentPy NARX", errors, "polynomials")


def _narx_error(seen: Data, unseen: Data, k: int, every: int) -> float | None:
    from sysidentpy.basis_function import Polynomial  # noqa: PLC0415 - as above
    from sysidentpy.model_structure_selection import FROLS  # noqa: PLC0415
    from sysidentpy.parameter_estimation import LeastSquares  # noqa: PLC0415

    mean, spread = seen.outputs[:, k].mean(), seen.outputs[:, k].std()

    def run(given: Array, u: Array, start: Array, v: Array, terms: int) -> Array:
        model: Any = FROLS(
            ylag=LAGS, xlag=LAGS, n_terms=terms, order_selection=False,
            basis_function=Polynomial(degree=DEGREE), estimator=LeastSquares(),
        )  # fmt: skip
        model.fit(X=u[:, None], y=given)
        with np.errstate(all="ignore"):
            try:
                return np.asarray(model.predict(X=v[:, None], y=start[: model.max_lag]))[:, 0]
            except (OverflowError, ValueError):
                return np.full(v.size, np.inf)

    y, u = (seen.outputs[::every, k : k + 1] - mean) / spread, seen.command[::every]
    cut = int(SEEN * u.size)

    def held_back(terms: int) -> float:
        error = run(y[:cut], u[:cut], y[cut:], u[cut:], terms) - y[cut:, 0]
        return float(np.mean(np.clip(np.nan_to_num(error, nan=DIVERGED), -DIVERGED, DIVERGED) ** 2))

    measured = (unseen.outputs[::every, k : k + 1] - mean) / spread
    best = min(TERMS, key=held_back)
    error = run(y, u, measured, unseen.command[::every], best) - measured[:, 0]
    if not np.all(np.abs(error) < DIVERGED):
        return None
    return float(rms(error) * spread)


def _errors(run: Array, measured: Array, noise: list[float], seen: Data) -> list[float | None]:
    found: list[float | None] = []
    for k, one in enumerate(noise):
        error = run[:, k] - measured[:, k]
        good = bool(np.all(np.abs(error) < DIVERGED * seen.outputs[:, k].std()))
        found.append(float(np.sqrt(np.mean(error**2)) / one) if good else None)
    return found


def _boom(bag: Path, signals: Any) -> Data:
    recording = load(bag, {name: signals[name] for name in (*NOISE, COMMAND)})
    sensors = [recording[name] for name in NOISE]
    begin = max(s.time[0] for s in sensors)
    time = np.arange(begin, min(s.time[-1] for s in sensors), PERIOD)
    outputs = np.stack([np.interp(time, s.time, s.value) for s in sensors], 1)
    held = recording[COMMAND]
    latest = np.maximum(np.searchsorted(held.time, time + 1e-6, side="right") - 1, 0)
    return Data(outputs, held.value[latest], PERIOD)


def _actuator(bag: Path, signals: Any) -> Data:
    record = open_record(bag, signals)
    return Data(record.pressure[:, None], record.opening, record.period)


def _read(file: Path) -> dict[str, Any]:
    try:
        content: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, json.JSONDecodeError) as error:
        raise InputError(f"{file}: {error}") from None
    return content


def _diagnosed(found: dict[str, Any], noise: dict[str, float]) -> Row:
    errors = [found["signals"][name]["with_effect"] / one for name, one in noise.items()]
    names = ", ".join(effect["name"] for effect in found["effects"])
    return Row("emir diagnose", errors, f"{found['verdict']} {names}".strip())
