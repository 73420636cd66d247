"""The hydraulic drive as a controller knows it, and its inverse with the pressures as measured.

The force F = p_H A_H - p_S A_S of the piston obeys

    dF/dt = k_h (u - v),    k_h = beta (A_H^2 / V_H + A_S^2 / V_S)

with v the piston's velocity and u what both flows together would move it with at a constant F,

    u = (A_H Q_H / V_H - A_S Q_S / V_S) beta / k_h.

`Actuator.opening` is the valve's opening that makes u what it should be.
"""

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

from emir_common.quantity import check_ranges, quantity
from emir_control.prefilter import PrefilterParameters, piston_force

LAMINAR = 1e5  # Pa, below which a drop's square root turns into a straight line
LEAST_OPEN = 0.05  # logic block: what the inverse reckons with at least
TOLERANCE = 1e-5  # of the opening
ITERATIONS = 30


@dataclass(frozen=True, kw_only=True)
class ActuatorParameters:
    """The controller's picture of pump, valve, logic block and chambers; the machine's values."""

    static: PrefilterParameters = field(default_factory=PrefilterParameters)
    volume_lifting_0: float = quantity("m^3", 1e-5, 1.0, "V_H at stroke 0", default=0.020)
    volume_lowering_0: float = quantity(
        "m^3", 1e-5, 1.0, "V_S at stroke 0", default=0.03865132500073891
    )
    beta: float = quantity("Pa", 1e7, 3e9, "stiffness of oil and vessels", default=5e8)
    supply: float = quantity("Pa", 1e6, 5e7, "p_0, pump", default=2e7)
    tank: float = quantity("Pa", 0.0, 5e6, "p_T", default=2e5)
    balance: float = quantity("Pa", 1e5, 5e6, "drop over the metering edge", default=8e5)
    pump_line: float = quantity("Pa s^2/m^6", 1e6, 1e16, "into a chamber", default=6.3e10)
    return_line: float = quantity("Pa s^2/m^6", 1e6, 1e16, "valve to tank", default=2.7e10)
    block_out: float = quantity("Pa s^2/m^6", 1e6, 1e16, "logic block, out", default=2.7e10)
    edge_lifting: float = quantity(
        "Pa s^2/m^6", 1e6, 1e16, "return edge over o^2, lifting", default=1.12546875e12
    )
    edge_lowering: float = quantity(
        "Pa s^2/m^6", 1e6, 1e16, "return edge over o^2, lowering", default=1.35e12
    )
    threshold: float = quantity("Pa", 0.0, 5e7, "p_H that opens the block", default=4e6)
    opening_time: float = quantity("s", 1e-3, 1.0, "logic block", default=0.02)
    closing_time: float = quantity("s", 1e-3, 5.0, "logic block", default=0.3)
    spool_frequency: float = quantity("rad/s", 10.0, 2000.0, "natural", default=60.0 * math.pi)
    spool_damping: float = quantity("1", 0.05, 5.0, "of critical", default=0.8)

    def __post_init__(self) -> None:
        check_ranges(self)


class Oil(NamedTuple):
    """What the drive's inverse has to know: stroke, m, pressures, Pa, logic block's opening."""

    stroke: float
    lifting: float
    lowering: float
    logic: float = 1.0

    def with_open_block(self) -> "Oil":
        """Return the oil with a logic block that is not shut, as the drive's inverse wants it."""
        return self._replace(logic=max(self.logic, LEAST_OPEN))


@dataclass(frozen=True)
class Actuator:
    """Flows and forces of the drive. softness: factor on the stated stiffness."""

    parameters: ActuatorParameters
    softness: float = 1.0

    @cached_property
    def lag(self) -> float:
        """The time, s, by which the spool trails a ramp."""
        p = self.parameters
        return 2.0 * p.spool_damping / p.spool_frequency

    @cached_property
    def _beta(self) -> float:
        """The stiffness of oil and vessels that is reckoned with, Pa."""
        return self.softness * self.parameters.beta

    def stiffness(self, stroke: float) -> float:
        """Return k_h, N/m, at a stroke, m."""
        lifting, lowering = self._shares(stroke)
        s = self.parameters.static
        return self._beta * (lifting * s.area_lifting + lowering * s.area_lowering)

    def compression(self, stroke: float) -> float:
        """Return by how far the piston goes down on a shut lifting chamber, m/Pa."""
        return 1.0 / (self._beta * self._shares(stroke)[0])

    def force(self, lifting: float, lowering: float) -> float:
        """Return F, N, of the chambers' pressures, Pa."""
        return piston_force(lifting, lowering, self.parameters.static)

    def velocity(self, opening: float, oil: Oil) -> float:
        """Return u, m/s, of an opening in [-1, 1] of the metering edges."""
        lifting, lowering = self._shares(oil.stroke)
        into_lifting, into_lowering = self.flows(opening, oil)
        driven = self._beta * (lifting * into_lifting - lowering * into_lowering)
        return driven / self.stiffness(oil.stroke)

    def opening(self, wanted: float, oil: Oil) -> float:
        """Return the opening whose u is as wanted, m/s, or the full one that comes next to it.

        u grows with the opening: secants between brackets (Illinois).
        """
        if wanted == 0.0:
            return 0.0
        end = math.copysign(1.0, wanted)
        near, far = 0.0, end
        at_near, at_far = -wanted, self.velocity(end, oil) - wanted
        if at_near * at_far >= 0.0:
            return end
        last = 0
        for _ in range(ITERATIONS):
            middle = (near * at_far - far * at_near) / (at_far - at_near)
            missing = self.velocity(middle, oil) - wanted
            if abs(missing) < TOLERANCE * abs(wanted) or abs(far - near) < TOLERANCE:
                break
            if missing * at_far > 0.0:
                far, at_far = middle, missing
                at_near *= 0.5 if last == 1 else 1.0
                last = 1
            else:
                near, at_near = middle, missing
                at_far *= 0.5 if last == -1 else 1.0
                last = -1
        return middle

    def command(self, opening: float) -> float:
        """Return the valve command y2 of an opening: beyond the dead zone."""
        if opening == 0.0:
            return 0.0
        zone = self.parameters.static.dead_zone
        return math.copysign(zone + (1.0 - zone) * abs(opening), opening)

    def flows(self, opening: float, oil: Oil) -> tuple[float, float]:
        """Return Q_H and Q_S, m^3/s, into the chambers."""
        p, o = self.parameters, abs(opening)
        if o == 0.0:
            return 0.0, 0.0
        if opening > 0.0:
            resistance = p.edge_lifting / (o * o) + p.return_line
            out = _turbulent(oil.lowering - p.tank, resistance)
            return self._pumped(o * p.static.flow_lifting, oil.lifting), -out
        out = 0.0
        if oil.logic > 0.0:
            resistance = p.edge_lowering / (o * o) + p.return_line
            resistance += p.block_out / (oil.logic * oil.logic)
            out = _turbulent(oil.lifting - p.tank, resistance)
        return -out, self._pumped(o * p.static.flow_lowering, oil.lowering)

    def ahead(self, oil: Oil, opening: float, velocity: float, dt: float) -> Oil:
        """Return the oil dt, s, later, with an opening and a piston velocity, m/s (midpoint)."""
        middle = self._changed(oil, oil, opening, velocity, 0.5 * dt)
        return self._changed(oil, middle, opening, velocity, dt)

    def _changed(self, oil: Oil, at: Oil, opening: float, velocity: float, dt: float) -> Oil:
        """Return the oil after dt, s, at the rates of another instant's."""
        s, beta = self.parameters.static, self._beta
        lifting, lowering = self._shares(at.stroke)
        into_lifting, into_lowering = self.flows(opening, at)
        up = beta * lifting * (into_lifting / s.area_lifting - velocity)
        down = beta * lowering * (into_lowering / s.area_lowering + velocity)
        return Oil(
            oil.stroke + velocity * dt,
            max(oil.lifting + up * dt, 0.0),
            max(oil.lowering + down * dt, 0.0),
            self.next_logic(oil.logic, at.lifting, dt),
        )

    def supply_needed(self, force: float, velocity: float) -> float:
        """Return the pump's pressure, Pa, that a steady motion takes with the valve fully open.

        force: on the piston, N. velocity: m/s; at rest the shut valve holds, and it is 0.
        """
        p, s = self.parameters, self.parameters.static
        if velocity == 0.0:
            return 0.0
        into, out, edge, flow = s.area_lifting, s.area_lowering, p.edge_lifting, s.flow_lifting
        if velocity < 0.0:
            into, out, edge, flow = out, into, p.edge_lowering + p.block_out, s.flow_lowering
        back = p.tank + (edge + p.return_line) * (out * velocity) ** 2
        pushed = ((force if velocity > 0.0 else -force) + back * out) / into
        return pushed + (p.pump_line + p.balance / flow**2) * (into * velocity) ** 2

    def pumped(self, velocity: float) -> float:
        """Return what the pump has to give for a velocity, m/s, in steady motion, m^3/s."""
        s = self.parameters.static
        return velocity * s.area_lifting if velocity > 0.0 else -velocity * s.area_lowering

    @cached_property
    def fastest(self) -> float:
        """What the fully open valve gives the piston, lifting, m/s."""
        return self.parameters.static.speeds[1]

    def next_logic(self, logic: float, lifting: float, dt: float) -> float:
        """Return the logic block's opening dt, s, later, p_H being the pressure, Pa."""
        p = self.parameters
        if lifting > p.threshold:
            return 1.0 + (logic - 1.0) * math.exp(-dt / p.opening_time)
        return logic * math.exp(-dt / p.closing_time)

    def _pumped(self, wanted: float, pressure: float) -> float:
        """Return the pump's flow, m^3/s, into a chamber at a pressure, Pa; see paper 2.2."""
        p = self.parameters
        resistance = p.pump_line + p.balance / (wanted * wanted)
        return min(wanted, max(_turbulent(p.supply - pressure, resistance), 0.0))

    def _shares(self, stroke: float) -> tuple[float, float]:
        """Return A_H / V_H and A_S / V_S, 1/m."""
        p, s = self.parameters, self.parameters.static
        return (
            s.area_lifting / (p.volume_lifting_0 + s.area_lifting * stroke),
            s.area_lowering / (p.volume_lowering_0 - s.area_lowering * stroke),
        )


def _turbulent(drop: float, resistance: float) -> float:
    return drop / math.sqrt(math.sqrt(drop * drop + LAMINAR * LAMINAR) * resistance)
