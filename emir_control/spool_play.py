"""The spool's play, taken up ahead: metering edges turn round only behind it."""

import math
from typing import NamedTuple


class Sent(NamedTuple):
    """demand: y2 at which the metering edges are to be. command: y2 that leads them there."""

    demand: float
    command: float


SHUT = Sent(0.0, 0.0)


def taken_up(demand: float, last: Sent, width: float) -> Sent:
    """Return what leads the edges to a demand, y2, from the last one, through play of a width, y2.

    A demand that stays leaves the command as it is; a shut valve is one without command. Within
    what a valve can be told: at its ends no play is taken up.
    """
    if demand == last.demand:
        return last
    if demand == 0.0:
        return SHUT
    command = demand + math.copysign(0.5 * width, demand - last.demand)
    return Sent(demand, min(max(command, -1.0), 1.0))
