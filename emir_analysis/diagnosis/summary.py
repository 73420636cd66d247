"""The result of a diagnosis as lines for a terminal."""

import math

from emir_analysis.diagnosis.curves import BY_TIME
from emir_analysis.diagnosis.result import (
    BalanceResult,
    Diagnosis,
    EffectResult,
    SignalResult,
    parameter_line,
)
from emir_analysis.diagnosis.select import EXPLAINED

ROUNDING = 1e-6  # relative
DELAY = "command_delay"
LOUD = (
    ". Look for the cause in the parts of the machine whose balances speak below, at the values and"
    " times that the pictures of them show."
)
QUIET = (
    ". The balances are quiet nearly all of the time: the cause acts seldom, or by hardly more than"
    " their noise. Look at what happened at the moments that are named, or else when the simulated"
    " signals depart from the measured ones."
)
INTERVALS = "intervals: what the sensors' noise leaves open, not what a law is wrong by"


def summary(result: Diagnosis) -> str:
    """Return the result as lines for a terminal."""
    lines = [f"{result.verdict}: {result.statement}"]
    lines += cautions(result)
    lines += [line for effect in result.effects for line in _sizes(effect)]
    lines += [INTERVALS] if result.effects else []
    lines += [parameter_line(m.name, m.wanted, m.wanted.unit) for m in result.misstated]
    lines += ["", f"{'balance':24}{'noise':>11}{'before':>11}{'refitted':>11}{'after':>11}"]
    for name, b in told_balances(result).items():
        figures = (b.noise, b.before, b.refitted, b.after)
        lines.append(f"{name:24}" + "".join(f"{f:11.3g}" for f in figures) + f"  {b.unit}")
    lines += ["", f"free-run error on {result.judged_on}, times the sensor noise"]
    heads = ("noise", "nominal", "refitted", "with effect", "black box")
    lines.append(f"{'signal':24}" + "".join(f"{head:>12}" for head in heads))
    for name, s in result.signals.items():
        lines.append(f"{name:24}{s.noise:12.3g}" + _ratios(s) + f"  RMS, noise in {s.unit}")
        lines.append(f"{'':36}" + _ratios(result.block_medians[name]) + "  median of 15 s blocks")
    lines += [added] if (added := nothing_added(result)) else []
    if result.control:
        lines += ["", "predictive control of the machine as found, designed before and after"]
    for name, c in result.control.items():
        lines.append(f"{name:24}stroke {1e3 * c.tracking:.1f} mm, TCP {1e2 * c.tcp:.1f} cm")
    return "\n".join(lines)


def nothing_added(result: Diagnosis) -> str:
    """Return that the machine with effect has none, where that is so."""
    if result.effects or result.misstated or result.curve is not None:
        return ""
    return "Nothing was added: the machine with effect is the re-fitted one."


def _sizes(effect: EffectResult) -> list[str]:
    """Return an effect's parameters with their intervals, a line for each."""
    return [parameter_line(f"{effect.name}.{n}", p, p.unit) for n, p in effect.parameters.items()]


def told_balances(result: Diagnosis) -> dict[str, BalanceResult]:
    """Return the balances that tell something: not that of a stroke computed from the angle."""
    return {
        name: b
        for name, b in result.balances.items()
        if name != "linkage" or max(b.before, b.refitted, b.after) > ROUNDING * b.noise
    }


def cautions(result: Diagnosis) -> list[str]:
    """Return what a reader has to know beside the statement, a line for each."""
    lines = [result.tell_apart] if result.tell_apart else []
    is_model = result.verdict != "unexplained" or result.curve or result.misstated
    if result.at_end and is_model:  # else what is missing has led the parameters there
        lines.append(
            f"at the end of what is allowed: {_ends(result)}; if this machine cannot be there,"
            " something else is missing"
        )
    if any(effect.name == DELAY for effect in result.effects):
        lines.append(
            f"{DELAY}: in a recording the same as sensors that are all stamped late by as much; see"
            " that one clock stamps command and sensors"
        )
    return lines + list(result.untold.values())


def _ends(result: Diagnosis) -> str:
    """Return the parameters that stand at an end of what is allowed, with what they are there."""
    known = result.parameters
    return ", ".join(
        f"{path} = {known[path].value:.4g} {known[path].unit}" if path in known else path
        for path in result.at_end
    )


def in_short(result: Diagnosis) -> str:
    """Return what the errors come to, and what to do with what was found."""
    worst = {stage: _worst(result, stage) for stage in ("nominal", "refitted", "with_effect")}
    came, refitted, after = (f"{error:.3g}" for error in worst.values())
    errors = f"Largest free-run error of a signal on {result.judged_on}, times its noise"
    if result.effects:
        errors += f": {came} by the data sheet, {refitted} with its parameters fitted, {after} with"
        if result.curve is not None and result.curve.over == BY_TIME:
            return (
                f"{errors} what was found, but for the load: that one is of {result.recording}"
                " alone. --model-out writes the machine with it, emir run --params simulates that."
            )
        if worst["with_effect"] > EXPLAINED:
            return (
                f"{errors} what was found. That recording shows more: diagnose both together before"
                " anything is mended."
            )
        return (
            f"{errors} what was found. Mend the machine, or go on with it as it is: --model-out"
            " writes it, emir run --params simulates it and emir design --from designs for it."
        )
    if result.verdict == "nothing_missing":
        return (
            f"{errors}: {came} by the data sheet, {after} with its parameters fitted. Take these,"
            " below, in place of the stated ones; --model-out writes them."
        )
    if result.misstated:
        names = " or ".join(m.name for m in result.misstated)
        return (
            f"{errors}: {came} by the data sheet, {refitted} with its parameters fitted, {after}"
            f" with {result.misstated[0].name} as below. Check {names} on the machine, and mend the"
            " data sheet; --model-out writes the machine with it."
        )
    return (
        f"{errors}: {came} by the data sheet, {refitted} with its parameters fitted"
        + (f", {after} with the curve that was measured" if result.curve is not None else "")
        + (QUIET if result.shape is None else LOUD)
    )


def _worst(result: Diagnosis, stage: str) -> float:
    errors = [getattr(s, stage) / s.noise for s in result.signals.values()]
    return max(errors, default=math.nan)


def _ratios(s: SignalResult) -> str:
    figures = (s.nominal, s.refitted, s.with_effect, s.black_box)
    return "".join(f"{figure / s.noise:12.2f}" for figure in figures)
