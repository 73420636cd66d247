"""The verdict on an actuator, in a word and in a sentence."""

from emir_analysis.diagnosis.actuator.curves import CurveResult
from emir_analysis.diagnosis.actuator.fitting import Fitted
from emir_analysis.diagnosis.actuator.search import MUCH, Search
from emir_analysis.diagnosis.result import MisstatedResult
from emir_analysis.diagnosis.select import AT_NOISE
from emir_plant.actuator import ActuatorSheet

BALANCE = "oil"  # the only one that opening and pressure allow


def verdict(sheet: ActuatorSheet, found: Search, noise: float) -> str:
    """Return the verdict. noise: of the pressure, as stated or as the recording shows it."""
    if not found.chosen.effects:
        return "nothing_missing" if found.plain.rms <= AT_NOISE * noise else "unexplained"
    if not _explained(sheet, found, noise):
        return "unexplained"
    return "ambiguous" if found.rivals else "found"


def _explained(sheet: ActuatorSheet, found: Search, noise: float) -> bool:
    """Tell whether the chosen effects come to the noise, or do much where nobody has stated it."""
    if found.chosen.rms <= AT_NOISE * noise:
        return True
    plain, chosen = (found.unseen[f.name] for f in (found.plain, found.chosen))
    return not sheet.machine.sensor.pressure_noise and chosen <= MUCH * plain


def statement(
    word: str, found: Search, noise: float, instead: CurveResult | MisstatedResult | None
) -> str:
    """Return what a verdict means, in numbers. instead: what explains more than effects do."""
    plain, chosen = (found.unseen[f.name] for f in (found.plain, found.chosen))
    if word == "nothing_missing":
        return "parameters inside their ranges bring the free run to the noise"
    left = (
        f"{found.chosen.rms:.3g} is left, {found.chosen.rms / noise:.1f} times the noise, and"
        f" {chosen:.3g} on parts left out of the fit, {plain:.3g} with parameters only"
    )
    if word == "unexplained":
        come = "come" if len(found.chosen.effects) > 1 else "comes"
        closest = f"{found.chosen.name} {come} closest; " if found.chosen.effects else ""
        speaks = (
            f"the balance of the {BALANCE}, the only one that opening and pressure allow, speaks"
        )
        if isinstance(instead, MisstatedResult):
            return f"{speaks}; {_another(instead, found.last.rms, noise)}"
        told = _told(instead) if instead else ""
        return f"{closest}{left}: {speaks}, and no known effect says why{told}"
    names = found.chosen.name
    if word == "ambiguous":
        rivals = " or ".join(_instead(rival, found.chosen) for rival in found.rivals)
        names += f" ({rivals} would do as well: this recording cannot tell)"
    rest = "" if found.chosen.rms <= AT_NOISE * noise else ": they do much, and something is left"
    return f"{names}; {left}{rest}"


def _instead(rival: Fitted, chosen: Fitted) -> str:
    added = [name for name in rival.effects if name not in chosen.effects]
    missing = [name for name in chosen.effects if name not in rival.effects]
    return f"{' and '.join(added)} in place of {' and '.join(missing)}"


def _another(found: MisstatedResult, left: float, noise: float) -> str:
    return (
        f"what explains it is no effect but another value in the data sheet: {found.name} ="
        f" {found.wanted.value:.4g} for {found.stated:.4g}, with which {left:.3g} is left,"
        f" {left / noise:.1f} times the noise"
    )


def _told(curve: CurveResult) -> str:
    return (
        f"; measured as a curve, a {curve.what} over the {curve.over} that the model lacks leaves"
        f" {curve.left:.3g}"
    )
