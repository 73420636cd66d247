"""The paper's order of merit of its controllers, held against a grid of cases."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields

from emir_analysis.compare_grid import Case, Result


@dataclass(frozen=True)
class Claim:
    """That one controller is better than another: has less of something. where: directions."""

    text: str
    better: str
    than: str
    value: Callable[[Result], float]
    where: tuple[str, ...] = ("lift", "lower")


# Paper 3.3, of the design made empty at 45 deg and of that which follows posture and payload.
CLAIMS = (
    Claim(
        "PFC of the joint is smoother than conventional control (rms dv/dt)",
        "pfc, preview", "cascade", lambda r: r.figures.roughness,
    ),
    Claim(
        "The same, scheduled",
        "pfc, scheduled", "cascade", lambda r: r.figures.roughness,
    ),
    Claim(
        "PFC of the joint bends the boom less than conventional control",
        "pfc, preview", "cascade", lambda r: r.figures.bending,
    ),
    Claim(
        "The same, scheduled", "pfc, scheduled", "cascade", lambda r: r.figures.bending,
    ),
    Claim(
        "PFC that follows the load leaves less 1 s after the stop than the one made empty",
        "pfc, scheduled", "pfc, preview", lambda r: r.figures.settled,
    ),
    Claim(
        "PFC of the tip bends the boom less than PFC of the joint, lifting",
        "pfc_tip, preview", "pfc, preview", lambda r: r.figures.bending, ("lift",),
    ),
    Claim(
        "The same, scheduled",
        "pfc_tip, scheduled", "pfc, scheduled", lambda r: r.figures.bending, ("lift",),
    ),
    Claim(
        "PFC of the tip leaves less 1 s after the stop than PFC of the joint",
        "pfc_tip, preview", "pfc, preview", lambda r: r.figures.settled,
    ),
    Claim(
        "The same, scheduled",
        "pfc_tip, scheduled", "pfc, scheduled", lambda r: r.figures.settled,
    ),
)  # fmt: skip


def order_of_merit(found: Sequence[Result]) -> str:
    """Return in how many cases each of the paper's claims holds, and where."""
    by_key = {(r.controller, r.case, r.direction): r for r in found}
    lines = []
    for claim in CLAIMS:
        holds = {}
        for (name, case, way), result in by_key.items():
            other = by_key.get((claim.than, case, way))
            if name == claim.better and other is not None and way in claim.where:
                holds[case, way] = claim.value(result) < claim.value(other)
        if holds:
            lines.append(f"- {claim.text}: in {sum(holds.values())} of {len(holds)} moves.")
            lines += [f"  {line}" for line in _by_axis(holds)]
    return "\n".join(lines)


def _by_axis(holds: Mapping[tuple[Case, str], bool]) -> Iterator[str]:
    """Yield how often it holds by each value of an axis that has several."""
    units = {"angle": " deg", "payload": " kg", "size": " mm", "error": ""}
    axes: dict[str, Callable[[Case, str], object]] = {
        f.name: lambda case, _, name=f.name: getattr(case, name)  # type: ignore[misc]
        for f in fields(Case)
    }
    axes["move"] = lambda _, way: way
    for axis, value in axes.items():
        split: dict[object, list[bool]] = {}
        for key, held in holds.items():
            split.setdefault(value(*key), []).append(held)
        if len(split) > 1:
            told = (f"{v}{units.get(axis, '')} {sum(h)}/{len(h)}" for v, h in split.items())
            yield f"{axis}: {', '.join(told)}"
