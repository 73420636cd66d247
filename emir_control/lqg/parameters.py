"""What the LQG control knows of the machine, and its tuning."""

from dataclasses import dataclass, field

from emir_common.quantity import check_ranges, quantity
from emir_control.actuator import ActuatorParameters
from emir_control.boom import BoomTable
from emir_control.filling import FillParameters
from emir_control.limits import LimitParameters
from emir_control.regulator import RegulatorParameters


@dataclass(frozen=True, kw_only=True)
class LqgParameters:
    """Model and tuning.

    boom: with its payloads. period: s, of control.
    """

    boom: BoomTable
    period: float = 0.032
    actuator: ActuatorParameters = field(default_factory=ActuatorParameters)
    regulator: RegulatorParameters = field(default_factory=RegulatorParameters)
    limits: LimitParameters = field(default_factory=LimitParameters)
    softness: float = quantity(
        "1", 0.1, 2.0, "of the stated k_h, what is reckoned with; see softness.py", default=0.86
    )
    allowance: float = quantity(
        "1", 0.0, 1.0, "of the plan's deflection over the smallest, for less travel", default=0.03
    )
    friction: float = quantity("N", 0.0, 1e5, "expected at the move's start", default=3e3)
    hysteresis: float = quantity("1", 0.0, 0.1, "width of the spool's play", default=0.01)
    standstill: float = quantity(
        "m/s", 0.0, 0.01, "below, the valve stays shut while moving", default=5e-4
    )
    rest_standstill: float = quantity("m/s", 0.0, 0.01, "the same at rest", default=3e-3)
    rest_deflection: float = quantity("m", 0.0, 1.0, "left alone at rest", default=2.5e-3)
    rest_position: float = quantity("m", 0.0, 1.0, "of the TCP left alone at rest", default=2e-2)
    lead: float = quantity("s", 0.1, 10.0, "before the move, when it is planned", default=0.6)
    fill: FillParameters = field(default_factory=FillParameters)
    reading_time: float = quantity(
        "s", 0.032, 10.0, "over which force and bending at rest are averaged", default=1.0
    )
    settling: float = quantity(
        "s", 0.0, 10.0, "from a move's end to the rest after it", default=1.0
    )
    other_load: float = quantity(
        "N", 1.0, 1e6, "force at rest off what it was: the payload is read anew", default=3e4
    )

    def __post_init__(self) -> None:
        check_ranges(self)
