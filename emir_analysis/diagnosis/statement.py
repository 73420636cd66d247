"""What a diagnosis has found, in words."""

import math
from collections.abc import Sequence

import numpy as np

from emir_analysis.diagnosis.balances import BALANCES, level
from emir_analysis.diagnosis.diagnose import Findings, loudest
from emir_analysis.diagnosis.experiment import COMMAND_STEP, Experiment
from emir_analysis.diagnosis.foresight import parting
from emir_analysis.diagnosis.friction_laws import sticks
from emir_analysis.diagnosis.judged import Judged, carries
from emir_analysis.diagnosis.judgement import judgement
from emir_analysis.diagnosis.load_course import has_course
from emir_analysis.diagnosis.moments import Moments, moments
from emir_analysis.diagnosis.mounting import spring_in_series
from emir_analysis.diagnosis.remainder import remainder
from emir_analysis.diagnosis.run_errors import free_run_errors, mean_square
from emir_analysis.diagnosis.select import EXPLAINED, HELPS, at_noise
from emir_analysis.diagnosis.telling import movement
from emir_analysis.diagnosis.trial import Trial
from emir_analysis.root_mean_square import rms
from emir_common.parameter_tree import declared

NAMING = {"found", "ambiguous"}  # verdicts that name effects
MANY = 0.1  # share of the samples
ATMOSPHERE = 101325.0  # Pa
ALIKE = 0.05  # relative
DRIFTED = 3.0  # times the noise, over a second
CLOCK = 0.02  # s, more than the same transducers and filters make of two pressures


def verdict(findings: Findings, judged: Judged) -> str:
    """Return the verdict: nothing is not missing where the judge recordings show something.

    They show nothing where other parameters inside the tolerances explain them, too. Nor is found
    what explains the recordings that were fitted alone.
    """
    surprised = judged.surprising and not judged.reconciled
    if findings.verdict == "nothing_missing" and surprised:
        return "unexplained"
    if findings.verdict in NAMING and not carries(findings, judged):
        return "unexplained"
    return findings.verdict


def statement(findings: Findings, judged: Judged) -> str:
    """Return the verdict in words, and what the judge recordings say of it."""
    words = _of_findings(findings)
    if findings.verdict == "nothing_missing" and judged.surprising:
        words = f"of {findings.evidence.name}, {words}"
    if findings.verdict in NAMING and not carries(findings, judged):
        words = f"in {findings.evidence.name} alone explained by {words}"
    return words + judgement(findings, judged) + _stopped(findings)


def _stopped(findings: Findings) -> str:
    """Return that the search was over before its end, where that may matter."""
    if findings.stopped is None or findings.verdict == "nothing_missing":
        return ""
    return (
        f"; the search was stopped after {findings.stopped:g} s, before all was tried: with more"
        " --time-limit it may find more"
    )


def _of_findings(findings: Findings) -> str:
    if findings.verdict == "nothing_missing":
        return _of_parameters(findings)
    left_over = remainder(findings)
    if findings.verdict == "unexplained":
        left = left_over or f"{_quiet(findings)} the free run drifts away{_from(findings)}"
        if findings.misstated:
            return f"{left}; {_misstated(findings)}"
        known = "" if findings.rejected is None else _rejected(findings.rejected, findings)
        return known + left + of_stamps(findings.evidence.experiments)
    names = " and ".join(findings.chosen.effects)
    if findings.verdict == "ambiguous":
        names += " or " + " or ".join(rival.name for rival in findings.rivals)
        names += ", which this recording cannot tell apart"
    left = f"; {left_over}" if left_over else ""
    more = other_reasons(findings.chosen) + _undecided(findings) + _unforeseeable(findings)
    if has_course(findings.chosen):
        more = _of_course(findings) + more
    return names + left + more


def _of_parameters(findings: Findings) -> str:
    if at_noise(findings.chosen, findings.evidence):
        return "parameters inside the tolerances bring every balance and the free run to the noise"
    left = math.sqrt(mean_square(findings.chosen, findings.evidence))
    return (
        "parameters inside the tolerances bring every balance to the noise and the free run to"
        f" {left:.1f} times it, which no effect explains better"
    )


def other_reasons(chosen: Trial) -> str:
    """Return what else shows so: gauges, another clock, a leaning base."""
    effects = chosen.machine.effects
    bias, delay = effects.sensor_bias, effects.sensor_delay
    biases = np.array([bias.pressure_lifting, bias.pressure_lowering])
    if np.all(np.abs(biases + ATMOSPHERE) < ALIKE * ATMOSPHERE):
        return "; both pressures read an atmosphere less, as gauges do that do not read absolutely"
    if {"sensor_bias", "linkage_error"} <= set(chosen.effects) and bias.angle:
        return "; a machine that is not level shows the same"
    late = np.array([delay.pressure_lifting, delay.pressure_lowering])
    if late.min() > CLOCK and np.ptp(late) < ALIKE * late.max():
        return "; both pressures come equally late, as by another clock"
    return ""


def _of_course(findings: Findings) -> str:
    """Return what is known of a load of any course."""
    course = findings.chosen.machine.unnamed_load.course
    left = math.sqrt(mean_square(findings.chosen, findings.evidence))
    return (
        f"; a load that follows no formula, {min(course):.3g} to {max(course):.3g} N as at the TCP,"
        " and that nothing in the machine foretells, as wind or pushes: with it the free run of"
        f" {findings.evidence.name} is {left:.2f} times the noise off"
    )


def _undecided(findings: Findings) -> str:
    """Return which shares recordings leave open, and by which movement they would tell.

    Where no movement tells, it does not matter.
    """
    words = ""
    for path, other in findings.undecided.items():
        about, value = declared(findings.chosen.machine)[path]
        best, apart = movement([findings.chosen, other], findings.evidence)
        if apart >= EXPLAINED:
            share = path.removeprefix("effects.")
            words += (
                f"; whether {share} ({about.meaning}) is 0 or 1 the recording does not tell, and"
                f" {value:.0f} is taken: in {best} they differ by {apart:.0f} times the noise"
            )
    return words


def _misstated(findings: Findings) -> str:
    """Return which value of the data sheet explains all of it if it is another."""
    said = []
    for trial in findings.misstated:
        about, value = trial.unknowns.members[-1], float(trial.x[-1])
        unit = "" if about.unit == "1" else f" {about.unit}"
        said.append(f"{about.path} = {about.value(value):.4g}{unit} for {about.origin:.4g}{unit}")
    left = math.sqrt(mean_square(findings.misstated[0], findings.evidence))
    return (
        f"what explains it is no effect but another value in the data sheet: {' or '.join(said)},"
        f" with which the free run of {findings.evidence.name} is {left:.2f} times the noise off"
    )


def _quiet(findings: Findings) -> str:
    """Return that the balances are quiet, and at which moments they are not."""
    said = []
    for column, (name, balance) in enumerate(BALANCES.items()):
        noise = float(findings.floor[column])
        residual = findings.residuals["refitted"][:, column]
        seldom = moments(residual, noise, findings.evidence.time)
        if seldom is not None:
            said.append(
                f"{name} lacks up to {seldom.size:.3g} {balance.unit}"
                f" ({seldom.size / noise:.0f} times its noise) at {_times(seldom, findings)}"
            )
    if not said:
        return "the balances are quiet, but"
    return f"the balances are quiet but for moments: {'; '.join(said)}; and"


def _times(seldom: Moments, findings: Findings) -> str:
    places = [findings.evidence.place(time) for time in seldom.times]
    several = len(findings.evidence.experiments) > 1
    said = [f"{time:.1f} s of {name}" if several else f"{time:.1f} s" for name, time in places]
    return ", ".join(said) + (f" and {seldom.more} more" if seldom.more else "")


def _from(findings: Findings) -> str:
    """Return from when on the free run of parameters alone is off, as quiet balances have them.

    What acts seldom has led those that were fitted to the free run astray, from the start.
    """
    evidence = findings.evidence
    each = free_run_errors(findings.balanced.machine, evidence)
    for experiment, errors in zip(evidence.experiments, each, strict=True):
        second = max(1, round(1.0 / experiment.period))
        blocks = [rms(errors[k : k + second].ravel()) for k in range(0, len(errors), second)]
        off = np.flatnonzero(np.array(blocks) > DRIFTED)
        if off.size:
            when = float(experiment.time[int(off[0]) * second])
            since = f"{when:.0f} s" if when else "the start"
            return f" from {since} of {experiment.name} on"
    return ""


def of_stamps(experiments: Sequence[Experiment]) -> str:
    """Return what of the sensors' stamps may be the reason why nothing explains recordings.

    A sample taken 3 ms beside its stamp is off by several times the noise where the boom moves,
    and what is interpolated over several lost samples no less.
    """
    scatter = max(each.stamps.scatter for each in experiments)
    if scatter > COMMAND_STEP:
        return (
            f"; the sensors' stamps scatter by {1e3 * scatter:.1f} ms about a steady period: if"
            " they are not the times of measurement, record again with those"
        )
    lost = max(each.stamps.lost for each in experiments)
    if lost > MANY:
        return f"; {100 * lost:.0f} % of a sensor's samples are missing: record again with all"
    return ""


def _unforeseeable(findings: Findings) -> str:
    """Return that no model follows a machine to the end, where what no sensor tells decides."""
    if not sticks(findings.chosen):
        return ""
    apart = math.sqrt(2.0 * parting(findings.chosen.machine, findings.evidence))
    if apart <= 1.0:
        return ""
    return (
        f"; it cannot be foreseen to the end: where it sticks, two of its runs that begin within a"
        f" step of the resolver part by {apart:.1f} times the noise"
    )


def at_end(findings: Findings) -> tuple[str, ...]:
    """Return the parameters of a model that stand at an end: it may explain by the wrong means."""
    return _ends(findings.chosen)


def _ends(chosen: Trial) -> tuple[str, ...]:
    """Return what stands at an end of what is allowed; what shapes an effect ends in a limit."""
    together = zip(chosen.unknowns.members, chosen.x, strict=True)
    return tuple(u.path for u, x in together if u.at_end(float(x)) and not u.shapes)


def _rejected(rejected: Trial, findings: Findings) -> str:
    """Return what comes closest, how far it is off, and that what follows is said without it.

    Nothing where it hardly helps.
    """
    left, plain = (
        math.sqrt(mean_square(trial, findings.evidence)) for trial in (rejected, findings.refitted)
    )
    if left > HELPS * plain:
        return ""
    off = f"{left:.1f} times the noise in the free run, parameters alone {plain:.1f}"
    residuals = findings.evidence.residuals([rejected.machine])[0]
    speaking = loudest(residuals, findings.floor, findings.limit)
    if left <= EXPLAINED and speaking is not None:
        loudness = dict(zip(BALANCES, level(residuals) / findings.floor, strict=True))
        off += f", but {loudness[speaking]:.1f} in the balance {speaking}"
    off = f" ({off})" if math.isfinite(left + plain) else ""
    spring = spring_in_series(rejected, findings.evidence)
    if spring is not None:
        return (
            f"{' and '.join(rejected.effects)} come{'s' if len(rejected.effects) == 1 else ''}"
            f" closest{off}, but what yields does so in proportion to the force: a spring of"
            f" {spring:.3g} N/m between piston and joint, such as a mount or a pin that bends, not"
            " play; without it "
        )
    them = "them" if len(rejected.effects) > 1 else "it"
    return f"{closest(rejected)}{off}; without {them} "


def closest(rejected: Trial) -> str:
    """Return what comes closest, and which of its own parameters are as large as they can be."""
    values = declared(rejected.machine)
    ends = [path for path in _ends(rejected) if path.startswith("effects.")]
    said = [f"{path} = {values[path][1]:.3g} {values[path][0].unit}" for path in ends]
    led = f", {' and '.join(said)} at the end of what is looked for," if said else ""
    s = "" if len(rejected.effects) > 1 else "s"
    return f"{' and '.join(rejected.effects)} come{s} closest{led} but leave{s} too much"


def tell_apart(findings: Findings) -> str | None:
    """Return which movement would tell rivals apart, where there are any."""
    if findings.verdict != "ambiguous":
        return None
    trials = [findings.chosen, *findings.rivals]
    best, apart = movement(trials, findings.evidence)
    if apart < 1.0:
        return (
            f"no movement that is known tells them apart: in {best}, where they differ most, by"
            f" {apart:.1f} times the noise"
        )
    often = " only: repeat it" if apart < EXPLAINED else ""
    return (
        f"to tell them apart record {best}: they then differ by {apart:.1f} times the noise{often}"
    )
