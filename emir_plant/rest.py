"""What acts on the machine at rest.

In one function for each question: from Python a compiled one takes 1 us with an array of records,
50 us with a record out of it, and a diagnosis asks for tens of thousands of machines at rest.
"""

from typing import Any, NamedTuple

from numpy.typing import NDArray

from emir_plant import linkage
from emir_plant.effects import backlash, external_load, linkage_error
from emir_plant.hydraulics import logic_block
from emir_plant.jit import compiled
from emir_plant.unnamed import force as unnamed_force
from emir_plant.unnamed import load as unnamed_load


class Acting(NamedTuple):
    """What acts at rest at a boom angle, and how the piston stands to the boom there."""

    lowest: float  # boom angle within the linkage's reach, rad
    highest: float  # the same
    at_tip: float  # across the boom at the TCP, N, up positive
    about_joint: float  # from outside, N m, upward positive
    on_piston: float  # from outside, N
    unnamed: float  # on the piston, without a name, N
    stroke: float  # m
    lever_arm: float  # m


@compiled
def acting(angle: float, parameters: NDArray[Any]) -> Acting:
    """Return what acts at a boom angle, rad, at t = 0. parameters: (1,) the machine's record."""
    p = parameters[0]
    lowest, highest = linkage.reach(p)
    load, any_load = external_load.force(0.0, p), unnamed_load.course(0.0, p)
    stroke = linkage_error.stroke(angle, p)
    return Acting(
        lowest,
        highest,
        external_load.at_tip(load, angle, p) + unnamed_load.at_tip(any_load, p),
        external_load.about_joint(load, p) + unnamed_load.about_joint(any_load, p),
        external_load.on_piston(load, p),
        unnamed_force.along(0.0, stroke, p),
        stroke,
        linkage_error.lever_arm(angle, p),
    )


@compiled
def seated(
    lifting: float, lowering: float, force: float, parameters: NDArray[Any]
) -> tuple[float, float]:
    """Return how far the logic block is open and where the piston rests in its play, m.

    lifting, lowering: pressures, Pa. force: of the oil, N. parameters: (1,) the machine's record.
    """
    p = parameters[0]
    pilot = logic_block.pilot_pressure(lifting, lowering, p)
    return logic_block.settled(pilot, p), backlash.flank(force, p)
