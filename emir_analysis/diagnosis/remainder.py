"""What the balances keep that nothing explains, in words."""

import math
from collections.abc import Mapping, Sequence

from emir_analysis.diagnosis.balances import BALANCES, level
from emir_analysis.diagnosis.diagnose import Findings
from emir_analysis.diagnosis.drift import Drift
from emir_analysis.diagnosis.shape import PREDICTED_SHARE, Shape
from emir_analysis.diagnosis.swing import Swing
from emir_analysis.diagnosis.where import LOCATED, Where

DEFLECTION = "tip_deflection_angle"
VELOCITY = "piston_velocity"
FLOWS = frozenset({"lifting_chamber", "lowering_chamber"})
SHORT = 0.5  # of the recordings: a stretch of time that is named


def remainder(findings: Findings) -> str:
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
    when = _when(lies, findings)
    keeps += f"; {_described(shape, findings.swing, lies)}{when}"
    by_force = speaking == "force" and FLOWS.isdisjoint(others)  # which no load disturbs
    bent = shape.predictor == DEFLECTION  # as any force at the TCP bends the boom
    passes = when and not (shape.by_direction or shape.predictor == VELOCITY)  # as no friction does
    if by_force and (bent or passes or _is_untold(shape, findings.swing, lies)):
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


def _drifting(drift: Drift) -> str:
    unit = "" if drift.unit == "1" else f" {drift.unit}"
    return (
        f"{drift.path.removeprefix('effects.')} that goes from {drift.begin:.3g} to"
        f" {drift.end:.3g}{unit} along the recording makes {100 * drift.share:.0f} % of what the"
        " balances lack"
    )


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
