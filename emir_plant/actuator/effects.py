"""What an actuator may have beyond valve, oil and mass, in normalised units.

`REGISTRY` has those that have a name: each is off by default, a search tries them all. Names are
those of the boom's effects where the physics is the same. A flow counts as lifting where it raises
the pressure. The terms stand in `equations.py`.
"""

from dataclasses import dataclass
from typing import ClassVar, get_type_hints

from emir_common.quantity import quantity
from emir_plant.actuator.unnamed import (
    CURVES,
    UnnamedFlow,
    UnnamedForce,
    UnnamedFriction,
    UnnamedLeakage,
)
from emir_plant.effects.base import Balance, Effect

LIGHT = 0.05  # share of the mass on a piston, below which it counts as none
# A piston with a share s of the mass beside an elastic arm and a mass that carries (1 - s) / s
# times itself on a rope are the same equations: which of both it is goes by the sizes.
MOST_ON_PISTON = 0.4
MOST_HANGING = 1.5  # (1 - s) / s
OF_ORDER_ONE = "signals are scaled to the order of one, and so is what makes them"


@dataclass(frozen=True)
class CommandDelay(Effect):
    """The spool follows the opening of a while ago."""

    balance: ClassVar[Balance] = "valve"
    sizes: ClassVar[tuple[str, ...]] = ("delay",)
    source: ClassVar[str] = "pilot stage and electronics, a few samples"
    trial: ClassVar[dict[str, float]] = {"delay": 1.0}

    delay: float = quantity("time", 0.0, 20.0, "pure delay", default=0.0)


@dataclass(frozen=True)
class ValveNullOffset(Effect):
    """The valve is shut at another opening than zero, so that at zero the piston creeps."""

    balance: ClassVar[Balance] = "valve"
    sizes: ClassVar[tuple[str, ...]] = ("offset",)
    source: ClassVar[str] = "null adjustment, some percent of the stroke"
    trial: ClassVar[dict[str, float]] = {"offset": 0.02, "creeping": 0.5}

    offset: float = quantity("1", -0.3, 0.3, "added to the opening", default=0.0)
    creeping: float = quantity(
        "1", 0.0, 1.0, "of the steady velocity, at the recording's start", default=0.0
    )


@dataclass(frozen=True)
class ValveDeadZoneError(Effect):
    """Overlap: no flow until the spool has passed it, in each direction."""

    balance: ClassVar[Balance] = "valve"
    sizes: ClassVar[tuple[str, ...]] = ("lifting", "lowering")
    source: ClassVar[str] = "overlap of closed-centre spools, 5-20 % of the stroke"
    trial: ClassVar[dict[str, float]] = {"lifting": 0.05, "lowering": 0.05}

    lifting: float = quantity("1", 0.0, 0.8, "opening below which nothing lifts", default=0.0)
    lowering: float = quantity("1", 0.0, 0.8, "opening below which nothing lowers", default=0.0)


@dataclass(frozen=True)
class ValveGainAsymmetry(Effect):
    """Lowering opens the valve by another factor than lifting."""

    balance: ClassVar[Balance] = "valve"
    sizes: ClassVar[tuple[str, ...]] = ("lowering",)
    source: ClassVar[str] = "areas of a differential cylinder, up to 1:2"
    trial: ClassVar[dict[str, float]] = {"lowering": 0.3}

    lowering: float = quantity("1", -0.8, 4.0, "relative excess while lowering", default=0.0)


@dataclass(frozen=True)
class ValveHysteresis(Effect):
    """Play ahead of the spool, towards the command, or behind it, towards the metering edges."""

    balance: ClassVar[Balance] = "valve"
    sizes: ClassVar[tuple[str, ...]] = ("play",)
    source: ClassVar[str] = "friction of the spool, some percent of the stroke"
    trial: ClassVar[dict[str, float]] = {"play": 0.02, "command_share": 0.5}

    play: float = quantity("1", 0.0, 0.5, "half the width of the loop", default=0.0)
    command_share: float = quantity("1", 0.0, 1.0, "of it, ahead of the spool", default=1.0)


@dataclass(frozen=True)
class FlowGainDrift(Effect):
    """The valve's gain changes with time, in proportion to it."""

    balance: ClassVar[Balance] = "valve"
    sizes: ClassVar[tuple[str, ...]] = ("rate",)
    source: ClassVar[str] = "oil that warms up, some percent in minutes"
    trial: ClassVar[dict[str, float]] = {"rate": 2e-4}

    rate: float = quantity("1/time", -0.01, 0.01, "relative change of the gain", default=0.0)


@dataclass(frozen=True)
class FlowLimit(Effect):
    """The pump gives no more than so much, whatever the valve asks; 0: no limit."""

    balance: ClassVar[Balance] = "supply"
    sizes: ClassVar[tuple[str, ...]] = ("lifting", "lowering")
    source: ClassVar[str] = "displacement of the pump, or a flow regulator"
    trial: ClassVar[dict[str, float]] = {"lifting": 1.5, "lowering": 1.5}

    lifting: float = quantity("pressure/time", 0.0, 100.0, "greatest flow lifting", default=0.0)
    lowering: float = quantity("pressure/time", 0.0, 100.0, "greatest flow lowering", default=0.0)


@dataclass(frozen=True)
class SupplyPressureDroop(Effect):
    """Turbulent flow through the valve's orifice from a supply of finite pressure."""

    balance: ClassVar[Balance] = "supply"
    sizes: ClassVar[tuple[str, ...]] = ("lifting", "lowering")
    source: ClassVar[str] = "Q = c o sqrt(dp): the load takes part of the supply pressure"
    trial: ClassVar[dict[str, float]] = {"lifting": 0.1, "lowering": 0.1}

    lifting: float = quantity(
        "1/pressure", 0.0, 1.0, "one over the pressure at which lifting stalls", default=0.0
    )
    lowering: float = quantity(
        "1/pressure", 0.0, 1.0, "one over the pressure at which lowering stalls", default=0.0
    )


@dataclass(frozen=True)
class ReliefValve(Effect):
    """Relief and anti-cavitation valves let flow beyond a pressure on either side; 0: no valve."""

    balance: ClassVar[Balance] = "chambers"
    sizes: ClassVar[tuple[str, ...]] = ("high", "low")
    source: ClassVar[str] = OF_ORDER_ONE
    trial: ClassVar[dict[str, float]] = {"high": 3.0, "low": 3.0, "conductance": 2.0}

    high: float = quantity("pressure", 0.0, 100.0, "opens above", default=0.0)
    low: float = quantity("pressure", 0.0, 100.0, "feeds below minus this", default=0.0)
    conductance: float = quantity("1/time", 0.05, 10.0, "flow per pressure beyond", default=5.0)


@dataclass(frozen=True)
class LoadHoldingValve(Effect):
    """A check valve on the cylinder that opens for lifting alone: shut, less oil is the spring."""

    balance: ClassVar[Balance] = "chambers"
    sizes: ClassVar[tuple[str, ...]] = ("line",)
    source: ClassVar[str] = "cranes must hold their load when a hose breaks (EN 12999)"
    trial: ClassVar[dict[str, float]] = {"line": 0.3}

    line: float = quantity("1", 0.0, 0.9, "share of the oil beyond the valve", default=0.0)


@dataclass(frozen=True)
class InternalLeakage(Effect):
    """Oil leaks past the piston, in proportion to the pressure or, turbulent, to its root."""

    balance: ClassVar[Balance] = "chambers"
    sizes: ClassVar[tuple[str, ...]] = ("conductance", "orifice")
    source: ClassVar[str] = OF_ORDER_ONE
    trial: ClassVar[dict[str, float]] = {"conductance": 0.1, "orifice": 0.1}

    conductance: float = quantity("1/time", 0.0, 2.0, "leakage flow per pressure", default=0.0)
    orifice: float = quantity(
        "pressure^0.5/time", 0.0, 2.0, "leakage flow per root of the pressure", default=0.0
    )


@dataclass(frozen=True)
class LineResistance(Effect):
    """The transducer sits on the valve's side of a line and sees its loss, too."""

    balance: ClassVar[Balance] = "chambers"
    sizes: ClassVar[tuple[str, ...]] = ("coefficient", "laminar")
    source: ClassVar[str] = "dp = k Q|Q| + k_l Q"
    trial: ClassVar[dict[str, float]] = {"coefficient": 0.3, "laminar": 0.1}

    coefficient: float = quantity("time^2/pressure", 0.0, 20.0, "k", default=0.0)
    laminar: float = quantity("time", 0.0, 10.0, "k_l", default=0.0)


@dataclass(frozen=True)
class CoulombFriction(Effect):
    """Dry friction, the same at every speed but near standstill, where it comes gradually."""

    balance: ClassVar[Balance] = "force"
    sizes: ClassVar[tuple[str, ...]] = ("force",)
    source: ClassVar[str] = OF_ORDER_ONE
    trial: ClassVar[dict[str, float]] = {
        "force": 0.1,
        "smoothing_speed": 0.03,
        "gradual_share": 0.5,
    }

    force: float = quantity("pressure", 0.0, 10.0, "F_c over the area", default=0.0)
    smoothing_speed: float = quantity("pressure/time", 0.0005, 0.5, "v_0", default=0.03)
    gradual_share: float = quantity("1", 0.0, 1.0, "of v/sqrt(v^2 + v_0^2)", default=0.0)


@dataclass(frozen=True)
class StribeckFriction(Effect):
    """Dry friction that is larger near standstill: F_c + (F_s - F_c) exp(-(v / v_s)^2)."""

    balance: ClassVar[Balance] = "force"
    sizes: ClassVar[tuple[str, ...]] = ("force", "breakaway")
    source: ClassVar[str] = "seals that stick; break-away up to twice the dry friction"
    trial: ClassVar[dict[str, float]] = {
        "force": 0.1,
        "breakaway": 0.1,
        "velocity": 0.1,
        "smoothing_speed": 0.03,
        "gradual_share": 0.5,
    }

    force: float = quantity("pressure", 0.0, 5.0, "F_c over the area", default=0.0)
    breakaway: float = quantity("pressure", 0.0, 5.0, "F_s - F_c over the area", default=0.0)
    velocity: float = quantity("pressure/time", 0.02, 5.0, "v_s", default=0.1)
    smoothing_speed: float = quantity("pressure/time", 0.0005, 0.5, "v_0", default=0.03)
    gradual_share: float = quantity("1", 0.0, 1.0, "of v/sqrt(v^2 + v_0^2)", default=0.0)


@dataclass(frozen=True)
class PressureDependentFriction(Effect):
    """Dry friction that grows with the load on the seals, mu |p + p_rest|."""

    balance: ClassVar[Balance] = "force"
    sizes: ClassVar[tuple[str, ...]] = ("coefficient",)
    source: ClassVar[str] = "seals and bearings, some percent of the force"
    trial: ClassVar[dict[str, float]] = {
        "coefficient": 0.05,
        "rest": 1.0,
        "smoothing_speed": 0.03,
        "gradual_share": 0.5,
    }

    coefficient: float = quantity("1", 0.0, 0.5, "mu", default=0.0)
    rest: float = quantity("pressure", 0.0, 10.0, "p_rest, at which p is 0", default=1.0)
    smoothing_speed: float = quantity("pressure/time", 0.0005, 0.5, "v_0", default=0.03)
    gradual_share: float = quantity("1", 0.0, 1.0, "of v/sqrt(v^2 + v_0^2)", default=0.0)


@dataclass(frozen=True)
class TurbulentResistance(Effect):
    """A loss that grows with the square of the velocity: return line and meter-out edge."""

    balance: ClassVar[Balance] = "force"
    sizes: ClassVar[tuple[str, ...]] = ("coefficient",)
    source: ClassVar[str] = "dp = k Q|Q|"
    trial: ClassVar[dict[str, float]] = {"coefficient": 0.3}

    coefficient: float = quantity("time^2/pressure", 0.0, 20.0, "k", default=0.0)


@dataclass(frozen=True)
class ExternalLoad(Effect):
    """A constant force, and one that grows with the way the piston has moved."""

    balance: ClassVar[Balance] = "force"
    sizes: ClassVar[tuple[str, ...]] = ("force", "gradient")
    source: ClassVar[str] = "weight, and its lever arm that changes with the position"
    trial: ClassVar[dict[str, float]] = {"force": 0.1, "gradient": 0.001}

    force: float = quantity("pressure", -10.0, 10.0, "over the area", default=0.0)
    gradient: float = quantity("1", -0.1, 0.1, "force per way, over the area", default=0.0)


@dataclass(frozen=True)
class ElasticBoom(Effect):
    """The mass, but for the piston's share, moves behind a spring, an elastic arm, and play."""

    balance: ClassVar[Balance] = "force"
    sizes: ClassVar[tuple[str, ...]] = ("compliance",)
    source: ClassVar[str] = "first bending mode; slender arms are softer than the oil; worn pins"
    trial: ClassVar[dict[str, float]] = {
        "compliance": 1.0,
        "damping": 0.1,
        "play": 0.1,
        "piston_share": 0.2,
    }
    none_or_above: ClassVar[dict[str, float]] = {"piston_share": LIGHT}

    compliance: float = quantity("1", 0.0, 20.0, "of the arm over that of the oil", default=0.0)
    damping: float = quantity("1", 0.02, 0.5, "of critical, of mass and arm", default=0.1)
    play: float = quantity("pressure", 0.0, 5.0, "half, as the oil that fills it", default=0.0)
    piston_share: float = quantity(
        "1", 0.0, MOST_ON_PISTON, "of the mass, on the piston", default=0.0
    )


@dataclass(frozen=True)
class SwingingLoad(Effect):
    """A mass hangs on what moves and swings; air_share of what damps it does not act back."""

    balance: ClassVar[Balance] = "force"
    sizes: ClassVar[tuple[str, ...]] = ("mass_ratio",)
    source: ClassVar[str] = "load on a rope: sqrt(g/l), damped by air alone"
    trial: ClassVar[dict[str, float]] = {
        "mass_ratio": 0.05,
        "frequency": 0.2,
        "damping": 0.005,
        "air_share": 0.5,
    }

    mass_ratio: float = quantity("1", 0.0, MOST_HANGING, "load over what carries it", default=0.0)
    frequency: float = quantity("rad/time", 0.01, 20.0, "of the pendulum", default=0.2)
    damping: float = quantity("1", 1e-4, 0.3, "of critical", default=0.005)
    air_share: float = quantity("1", 0.0, 1.0, "of the damping, by air", default=0.0)


@dataclass(frozen=True)
class Effects:
    """All effects of an actuator by name; each is off by default."""

    command_delay: CommandDelay = CommandDelay()
    valve_null_offset: ValveNullOffset = ValveNullOffset()
    valve_dead_zone_error: ValveDeadZoneError = ValveDeadZoneError()
    valve_gain_asymmetry: ValveGainAsymmetry = ValveGainAsymmetry()
    valve_hysteresis: ValveHysteresis = ValveHysteresis()
    flow_gain_drift: FlowGainDrift = FlowGainDrift()
    flow_limit: FlowLimit = FlowLimit()
    supply_pressure_droop: SupplyPressureDroop = SupplyPressureDroop()
    relief_valve: ReliefValve = ReliefValve()
    load_holding_valve: LoadHoldingValve = LoadHoldingValve()
    internal_leakage: InternalLeakage = InternalLeakage()
    line_resistance: LineResistance = LineResistance()
    coulomb_friction: CoulombFriction = CoulombFriction()
    stribeck_friction: StribeckFriction = StribeckFriction()
    pressure_dependent_friction: PressureDependentFriction = PressureDependentFriction()
    turbulent_resistance: TurbulentResistance = TurbulentResistance()
    external_load: ExternalLoad = ExternalLoad()
    elastic_boom: ElasticBoom = ElasticBoom()
    swinging_load: SwingingLoad = SwingingLoad()
    unnamed_flow: UnnamedFlow = UnnamedFlow()
    unnamed_leakage: UnnamedLeakage = UnnamedLeakage()
    unnamed_friction: UnnamedFriction = UnnamedFriction()
    unnamed_force: UnnamedForce = UnnamedForce()


KNOWN: dict[str, type[Effect]] = get_type_hints(Effects)
REGISTRY = {name: kind for name, kind in KNOWN.items() if name not in CURVES}
