"""What the outcomes of a blind test come to: confusion matrix, rates, errors before and after."""

from collections import Counter
from collections.abc import Sequence

import numpy as np

from emir_analysis.blind.trial import Outcome

EXPLAINED = 2.0  # times the sensor noise: what a model that explains a signal comes to
AT_NOISE = 1.1  # times the sensor noise: what a model that lacks nothing comes to
STAGES = {"nominal": "as stated", "refitted": "re-fitted", "with_effect": "with the effect"}


def report(outcomes: Sequence[Outcome]) -> str:
    """Return confusion matrix, rates and errors as text."""
    parts = [_confusion(outcomes), _rates(outcomes), _errors(outcomes), _intervals(outcomes)]
    failed = [o for o in outcomes if o.failure]
    parts += [f"machine {o.machine}: {o.failure}" for o in failed]
    return "\n\n".join(part for part in parts if part)


def said(outcome: Outcome) -> str:
    """Return the diagnosis's answer: effects named, or its verdict."""
    if outcome.verdict in ("found", "ambiguous") and outcome.named:
        doubt = " (ambiguous)" if outcome.verdict == "ambiguous" else ""
        return " + ".join(sorted(outcome.named)) + doubt
    return outcome.verdict


def right(outcome: Outcome) -> bool:
    """Tell whether the answer is what was hidden: by name, nothing, or unexplained."""
    if outcome.kind == "foreign":
        return outcome.verdict == "unexplained"
    if outcome.kind == "none":
        return outcome.verdict == "nothing_missing"
    return outcome.verdict == "found" and set(outcome.named) == set(outcome.hidden)


def right_among(outcome: Outcome) -> bool:
    """Tell whether what was hidden is the answer or, where it is ambiguous, one of the answers."""
    if right(outcome):
        return True
    answers = [set(outcome.named), *(set(rival.split(" + ")) for rival in outcome.rivals)]
    return outcome.verdict == "ambiguous" and set(outcome.hidden) in answers


def _confusion(outcomes: Sequence[Outcome]) -> str:
    """Return a line for each that was hidden: how often it was answered by what."""
    hidden = {o.kind + " ".join(sorted(o.hidden)): o for o in outcomes}
    lines = [f"{'hidden':50}answers"]
    for key in sorted(hidden, key=lambda k: (hidden[k].kind, k)):
        same = [o for o in outcomes if o.kind + " ".join(sorted(o.hidden)) == key]
        answers = Counter(said(o) for o in same).most_common()
        name = " + ".join(sorted(hidden[key].hidden)) or "nothing"
        if hidden[key].kind == "foreign":
            name += " (foreign)"
        told = ", ".join(f"{count} {answer}" for answer, count in answers)
        lines.append(f"{name + '  ':50}{told}")
    return "\n".join(lines)


def _rates(outcomes: Sequence[Outcome]) -> str:
    def share(label: str, members: list[Outcome], hits: int) -> str:
        return f"{label:50}{hits:4d} of {len(members)}" if members else ""

    one, two, healthy, foreign = (
        [o for o in outcomes if o.kind == kind] for kind in ("one", "two", "none", "foreign")
    )
    hidden = one + two
    lines = [
        share("one effect, named", one, sum(map(right, one))),
        share("  or among the ambiguous", one, sum(map(right_among, one))),
        share("two effects, both named", two, sum(map(right, two))),
        share("  one of them, and no other", two, sum(_half(o) for o in two)),
        share("an effect of the catalogue called unexplained", hidden,
              sum(o.verdict == "unexplained" for o in hidden)),
        share("an effect of the catalogue called nothing", hidden,
              sum(o.verdict == "nothing_missing" for o in hidden)),
        share("a wrong effect named", hidden, sum(_wrong(o) for o in hidden)),
        share("healthy machine, false alarm", healthy,
              sum(o.verdict != "nothing_missing" for o in healthy)),
        share("foreign effect, unexplained", foreign, sum(map(right, foreign))),
        share("  and yet modelled, within twice the noise", foreign,
              sum(map(_modelled, foreign))),
    ]  # fmt: skip
    return "\n".join(line for line in lines if line)


def _modelled(o: Outcome) -> bool:
    """Tell whether the machine is explained though what it has got no name."""
    errors = o.errors.get("with_effect", {}).values()
    return right(o) and bool(errors) and max(errors) <= EXPLAINED


def _half(o: Outcome) -> bool:
    return o.verdict == "found" and 0 < len(o.named) < len(o.hidden) and not _wrong(o)


def _wrong(o: Outcome) -> bool:
    return o.verdict == "found" and not set(o.named) <= set(o.hidden)


def _errors(outcomes: Sequence[Outcome]) -> str:
    """Return the free-run errors of the machines of which the hidden was found."""
    found = [o for o in outcomes if o.hidden and o.kind != "foreign" and right(o) and o.errors]
    if not found:
        return ""
    names = list(dict.fromkeys(name for o in found for name in o.errors["nominal"]))
    lines = ["free-run error over sensor noise on the judge recording, where found: median (worst)"]
    lines.append(" " * 24 + "".join(f"{label:>24}" for label in STAGES.values()))
    for name in names:
        cells = []
        for stage in STAGES:
            values = [o.errors[stage][name] for o in found if name in o.errors[stage]]
            cells.append(f"{np.median(values):10.2f} ({max(values):.2f})")
        lines.append(f"{name:24}" + "".join(f"{cell:>24}" for cell in cells))
    down = sum(max(o.errors["with_effect"].values()) <= AT_NOISE for o in found)
    lines.append(f"every signal within {AT_NOISE} times the noise: {down} of {len(found)}")
    return "\n".join(lines)


def _intervals(outcomes: Sequence[Outcome]) -> str:
    """Return how many numbers of the machines that were understood lie inside their intervals."""
    understood = [o for o in outcomes if o.kind != "foreign" and right(o)]
    told = [interval for o in understood for interval in o.intervals.values()]
    if not told:
        return ""
    inside = sum(low <= built <= high for built, low, high in told)
    label = "numbers of the machine inside their intervals"
    return f"{label:50}{inside:4d} of {len(told)}"
