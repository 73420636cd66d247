"""What a diagnosis has found, in words."""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from emir_analysis.diagnosis.balances import BALANCES, level
from emir_analysis.diagnosis.curves import Curve, visited_by
from emir_analysis.diagnosis.diagnose import Findings, loudest
from emir_analysis.diagnosis.drift import Drift
from emir_analysis.diagnosis.experiment import COMMAND_STEP, OUTPUTS, Experiment
from emir_analysis.diagnosis.foresight import parting
from emir_analysis.diagnosis.friction_laws import sticks
from emir_analysis.diagnosis.judged import NOMINAL, REFITTED, STAGES, Judged, loudest_signal
from emir_analysis.diagnosis.loads import LOAD
from emir_analysis.diagnosis.moments import Moments, moments
from emir_analysis.diagnosis.mounting import spring_in_series
from emir_analysis.diagnosis.run_errors import free_run_errors, mean_square
from emir_analysis.diagnosis.select import EXPLAINED, at_noise
from emir_analysis.diagnosis.shape import PREDICTED_SHARE, Shape
from emir_analysis.diagnosis.swing import Swing
from emir_analysis.diagnosis.telling import movement
from emir_analysis.diagnosis.trial import Trial
from emir_analysis.diagnosis.where import LOCATED, Where
from emir_analysis.root_mean_square import rms
from emir_common.parameter_tree import declared

MANY = 0.1  # share of the samples
BEYOND = 0.05  # share of the judge recordings
HELPS = 0.9  # of what parameters alone leave: what leaves more does not come close
ATMOSPHERE = 101325.0  # Pa
ALIKE = 0.05  # relative
DRIFTED = 3.0  # times the noise, over a second
CLOCK = 0.02  # s, more than the same transducers and filters make of two pressures
PLACES = 3  # of the outputs: stroke and pressures, where a machine was
FLOWS = frozenset({"lifting_chamber", "lowering_chamber"})
SHORT = 0.5  # of the recordings: a stretch of time that is named
CURVE_PARTS = {  # of a curve, as they are called
    "along": "whatever the direction",
    "friction": "against the motion",
    "change": "of the opening as stated",
    "lifting": "of the lifting chamber",
    "lowering": "of the lowering chamber",
    "across": "across the piston",
}


def verdict(findings: Findings, judged: Judged) -> str:
    """Return the verdict: nothing is not missing where the judge recordings show something.

    They show nothing where other parameters inside the tolerances explain them, too.
    """
    surprised = judged.surprising and not judged.reconciled
    if findings.verdict == "nothing_missing" and surprised:
        return "unexplained"
    return findings.verdict


def statement(findings: Findings, judged: Judged) -> str:
    """Return the verdict in words, and what the judge recordings say of it."""
    words = _of_findings(findings)
    if findings.verdict == "nothing_missing" and judged.surprising:
        words = f"of {findings.evidence.name}, {words}"
    return words + _judgement(findings, judged)


def _of_findings(findings: Findings) -> str:
    if findings.verdict == "nothing_missing":
        return _of_parameters(findings)
    remainder = _remainder(findings)
    if findings.verdict == "unexplained":
        left = remainder or f"{_quiet(findings)} the free run drifts away{_from(findings)}"
        if findings.misstated:
            return f"{left}; {_misstated(findings)}"
        known = "" if findings.rejected is None else _rejected(findings.rejected, findings)
        return known + left + of_stamps(findings.evidence.experiments)
    names = " and ".join(findings.chosen.effects)
    if findings.verdict == "ambiguous":
        names += " or " + " or ".join(rival.name for rival in findings.rivals)
        names += ", which this recording cannot tell apart"
    left = f"; {remainder}" if remainder else ""
    more = other_reasons(findings.chosen) + _undecided(findings) + _unforeseeable(findings)
    return names + left + more


def _of_parameters(findings: Findings) -> str:
    if at_noise(findings.chosen, findings.evidence):
        return "parameters inside the tolerances bring every balance and the free run to the noise"
    left = math.sqrt(mean_square(findings.chosen, findings.evidence))
    return (
        "parameters inside the tolerances bring every balance to the noise and the free run to"
        f" {left:.1f} times it, which no effect explains better"
    )


def _remainder(findings: Findings) -> str:
    """Return which balance keeps how much, and of what that is a function; empty if none does."""
    speaking, shape, lies = findings.speaking, findings.shape, findings.where
    if speaking is None or shape is None or lies is None:
        return ""
    stage = "refitted" if findings.verdict == "unexplained" else "after"
    column = list(BALANCES).index(speaking)
    left = level(findings.residuals[stage])
    loudness = dict(zip(BALANCES, left / findings.floor, strict=True))
    over = left > findings.limit
    others = [name for name, loud in zip(BALANCES, over, strict=True) if loud and name != speaking]
    keeps = (
        f"the balance {speaking} keeps {left[column]:.3g} {BALANCES[speaking].unit}"
        f" ({loudness[speaking]:.1f} times its noise{_beside(speaking, others, loudness)})"
    )
    if findings.curve is not None or findings.misstated:
        return keeps
    if findings.drift is not None:
        return f"{keeps}; {_drifting(findings.drift)}"
    keeps += f"; {_described(shape, findings.swing, lies)}{_when(lies, findings)}"
    by_force = speaking == "force" and FLOWS.isdisjoint(others)  # which no load disturbs
    if by_force and _is_untold(shape, findings.swing, lies):
        keeps += (
            "; it may be a load from outside (wind, a push, a load that swings) of another"
            " course over time than those looked for"
        )
    return keeps


def _beside(speaking: str, others: Sequence[str], loudness: Mapping[str, float]) -> str:
    """Return which other balances speak, and the one sensor that only those read that do."""
    if not others:
        return ""
    speak = (speaking, *others)
    quiet = [name for name, size in loudness.items() if name not in speak and not math.isnan(size)]
    read = frozenset.intersection(*(BALANCES[name].signals for name in speak))
    heard = frozenset().union(*(BALANCES[name].signals for name in quiet))
    only = read - heard
    told = f"; they all read {', '.join(only)}, the quiet ones do not" if len(only) == 1 else ""
    return "; beside it " + ", ".join(f"{name} {loudness[name]:.1f}" for name in others) + told


def other_reasons(chosen: Trial) -> str:
    """Return what else shows as what was found does: gauges, another clock, a leaning base."""
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


def _drifting(drift: Drift) -> str:
    unit = "" if drift.unit == "1" else f" {drift.unit}"
    return (
        f"{drift.path.removeprefix('effects.')} that goes from {drift.begin:.3g} to"
        f" {drift.end:.3g}{unit} along the recording makes {100 * drift.share:.0f} % of what the"
        " balances lack"
    )


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


def _judgement(findings: Findings, judged: Judged) -> str:
    if findings.curve is not None:
        return _measured(findings.curve, findings, judged)
    if findings.misstated:
        return f", that of {judged.evidence.name} {judged.off(STAGES[-1]):.2f}"
    if findings.verdict == "unexplained":
        return _foreseen(findings, judged) + _further(findings, judged)
    if not judged.surprising:
        return ""
    off, judge = judged.off(STAGES[-1]), judged.evidence.name
    worse = ""
    if findings.chosen.effects and off > judged.off(REFITTED):
        worse = f", more than parameters alone ({judged.off(REFITTED):.1f})"
    more = f"shows more{_elsewhere(findings, judged)}"
    if judged.reconciled and findings.chosen.effects:
        more += (
            ", which the same effects and other parameters inside the tolerances explain as well"
        )
    elif judged.reconciled:
        more += ", which other parameters inside the tolerances explain as well"
    if LOAD in findings.chosen.effects:
        more += "; a load from outside may have come at other times there"
    return f"; but {judge}, {_off(findings, judged)}{worse}, {more}: diagnose from that too"


def _foreseen(findings: Findings, judged: Judged) -> str:
    """Return how far off other recordings are, and that the data sheet as it came does better."""
    off, stated = judged.off(REFITTED), judged.off(NOMINAL)
    if judged.evidence.name == findings.evidence.name or not off > EXPLAINED:
        return ""
    better = f", more than by the data sheet as it came ({stated:.1f})" if stated < off else ""
    together = f"all signals of {judged.evidence.name} together"
    return f"; {together} are {off:.1f} times the noise off{better}"


def _further(findings: Findings, judged: Judged) -> str:
    elsewhere = _elsewhere(findings, judged)
    return f"; {judged.evidence.name} goes further{elsewhere}" if elsewhere else ""


def _off(findings: Findings, judged: Judged) -> str:
    """Return how far off the judge recordings are, and in which signal most."""
    off = judged.off(STAGES[-1])
    if math.isnan(off):
        return "where it cannot even rest"
    name, alone = loudest_signal(findings.chosen.machine, judged.evidence)
    if off <= EXPLAINED:  # in one signal alone, then
        return f"where {name} is {alone:.1f} times its noise off"
    return f"all signals together {off:.1f} times the noise off, {name} {alone:.1f}"


def _elsewhere(findings: Findings, judged: Judged) -> str:
    """Return at which strokes and pressures only the judge recordings were, if at many."""
    known, shown = (
        np.concatenate([e.outputs for e in evidence.experiments])
        for evidence in (findings.evidence, judged.evidence)
    )
    found = []
    for k, name in enumerate(list(OUTPUTS)[:PLACES]):
        low, high = np.nanmin(known[:, k], initial=np.inf), np.nanmax(known[:, k], initial=-np.inf)
        outside = float(np.mean((shown[:, k] < low) | (shown[:, k] > high)))
        if outside >= BEYOND:
            found.append(f"{name} for {100 * outside:.0f} % of it")
    return f" (beyond what was learned from: {', '.join(found)})" if found else ""


def _measured(curve: Curve, findings: Findings, judged: Judged) -> str:
    effects = findings.chosen.machine.effects
    rejected = () if findings.rejected is None else findings.rejected.effects
    on = [name for name in rejected if getattr(effects, name).is_on]
    beside = f" beside {' and '.join(on)}" if on else ""
    sizes = " and ".join(_furthest(curve, name) for name in curve.parts)
    return (
        f"; measured as a curve{beside}, {curve.name} over {curve.over}, {sizes}, the free run of"
        f" {judged.evidence.name} is {judged.off(STAGES[-1]):.2f} times the noise off"
        f"{_beyond(curve, findings, judged)}"
    )


def _furthest(curve: Curve, name: str) -> str:
    """Return the point of a curve that is furthest from zero, with its sign.

    A compliance less than the vessels have, say, is not that chamber's: another has more.
    """
    at, value = max(zip(curve.signal, curve.parts[name], strict=True), key=lambda p: abs(p[1]))
    part_unit, unit = ("" if u == "1" else f" {u}" for u in (curve.part_unit, curve.unit))
    return f"as far as {value:.3g}{part_unit} {CURVE_PARTS[name]} at {at:.3g}{unit}"


def _beyond(curve: Curve, findings: Findings, judged: Judged) -> str:
    """Return that the judge recordings go where nothing was measured, if they do."""
    parts = zip(
        visited_by(curve, findings.evidence), visited_by(curve, judged.evidence), strict=True
    )
    outside = max(float(np.mean((s < np.nanmin(k)) | (s > np.nanmax(k)))) for k, s in parts)
    if outside < BEYOND:
        return ""
    return f", of which {100 * outside:.0f} % lie beyond what it was measured at"


def _when(lies: Where, findings: Findings) -> str:
    """Return the stretch of time that holds most of what is left, where that is short."""
    if lies.end - lies.begin > SHORT * findings.evidence.duration(1.0):
        return ""
    (first, begin), (last, end) = map(findings.evidence.place, (lies.begin, lies.end))
    if len(findings.evidence.experiments) == 1:
        return f" ({100 * LOCATED:.0f} % of it from {begin:.1f} to {end:.1f} s)"
    return f" ({100 * LOCATED:.0f} % of it from {begin:.1f} s of {first} to {end:.1f} s of {last})"


def _described(shape: Shape, swing: Swing | None, lies: Where) -> str:
    if swing is not None:
        what = f"a function of {swing.predictor}" if swing.predictor else "something"
        period, share = f"{swing.period:.3g} s", f"{100 * swing.share:.0f} %"
        return f"{what} that swings with a period of {period} predicts {share} of it"
    if shape.share < PREDICTED_SHARE and lies.level is not None:
        unit = "" if lies.unit == "1" else f" {lies.unit}"
        return f"nearly all of it lies where {lies.signal} is {lies.side} {lies.level:.3g}{unit}"
    if _is_untold(shape, swing, lies):
        return "no single signal predicts it"
    direction = " and the direction of motion" if shape.by_direction else ""
    return f"{shape.predictor or 'a constant'}{direction} predicts {100 * shape.share:.0f} % of it"


def _is_untold(shape: Shape, swing: Swing | None, lies: Where) -> bool:
    """Tell whether neither a signal nor time says anything of what is left."""
    return swing is None and lies.level is None and shape.share < PREDICTED_SHARE


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
