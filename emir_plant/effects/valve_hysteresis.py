"""Play of the valve: the opening lags behind on every reversal."""

from dataclasses import dataclass
from typing import Any, ClassVar

from emir_common.quantity import quantity
from emir_plant.effects.base import Balance, Effect
from emir_plant.jit import compiled


@dataclass(frozen=True)
class ValveHysteresis(Effect):
    """Play operator: what follows rests until what leads has moved by half the width to a side.

    Between the spool and its metering edges or, for command_share of the width, between the
    command and the spool (of the magnet). A state w remembers where what follows is; what leads, at
    y, puts it to w limited to y - width/2 ... y + width/2, which w becomes at the end of each
    integration step.
    """

    balance: ClassVar[Balance] = "valve"
    sizes: ClassVar[tuple[str, ...]] = ("width",)
    source: ClassVar[str] = "spool hysteresis 1-3 %"
    trial: ClassVar[dict[str, float]] = {"width": 0.02, "command_share": 0.5}

    width: float = quantity("1", 0.0, 0.5, "of the loop, as a share of full stroke", default=0.0)
    command_share: float = quantity("1", 0.0, 1.0, "of it, ahead of the spool", default=0.0)


@compiled
def edges(spool: float, memory: float, p: Any) -> float:
    """Return the position of the metering edges for a spool position and the remembered one."""
    share = 1.0 - p.valve_hysteresis_command_share
    return _followed(spool, memory, share * p.valve_hysteresis_width)


@compiled
def played(command: float, memory: float, p: Any) -> float:
    """Return the command that the spool follows, for the one given and the remembered one."""
    share = p.valve_hysteresis_command_share
    return _followed(command, memory, share * p.valve_hysteresis_width)


@compiled
def _followed(leading: float, memory: float, width: float) -> float:
    if width == 0.0:
        return leading
    return min(max(memory, leading - 0.5 * width), leading + 0.5 * width)
