"""The machine's parameters: frozen dataclasses, SI units, every field with unit and range.

The values stand in YAML files (data/joint1.yaml, or a maker's data sheet); see `sheet.py`.
Group and field names are those of the data sheet.
"""

import dataclasses
from dataclasses import dataclass, field
from typing import Any

from emir_common.quantity import ParameterError, check_ranges, quantity
from emir_plant.effects import Effects
from emir_plant.unnamed import (
    UNNAMED,
    UnnamedCompliance,
    UnnamedForce,
    UnnamedLeakage,
    UnnamedLoad,
    UnnamedOpening,
)

GRAVITY = 9.81  # m/s^2
RATED_PAYLOAD = 1500.0  # kg, paper 1


@dataclass(frozen=True, kw_only=True)
class Geometry:
    """Boom, payload and the cylinder triangle of joint 1 (paper 2.1, Fig. 2, 3)."""

    boom_length: float = quantity("m", 1.0, 100.0, "joint 1 to TCP, stretched")
    boom_mass: float = quantity("kg", 10.0, 1e5, "uniform along the boom")
    section_spring: float = quantity("N m/rad", 1e5, 1e12, "bending spring between sections")
    triangle_a: float = quantity("m", 0.05, 20.0, "joint to cylinder foot")
    triangle_b: float = quantity("m", 0.05, 20.0, "joint to rod eye")
    triangle_gamma0: float = quantity("rad", 0.0, 3.1, "angle foot-joint-rod eye at alpha = 0")
    arms: int = quantity("1", 1, 20, "elastic arms, joined rigidly", default=5)
    sections_per_arm: int = quantity("1", 2, 20, "rigid sections of an arm", default=4)
    modes_kept: int = quantity("1", 2, 16, "rigid mode and bending modes", default=5)
    modal_damping: float = quantity("1", 0.0, 0.5, "of critical, bending modes", default=0.01)
    modal_frequency: float = quantity("1", 0.5, 2.0, "factor on bending frequencies", default=1.0)
    payload: float = quantity("kg", 0.0, 3000.0, "point mass at the TCP", default=0.0)

    @property
    def sections(self) -> int:
        """How many rigid sections the boom has."""
        return self.arms * self.sections_per_arm

    @property
    def section_length(self) -> float:
        """Of each section, m."""
        return self.boom_length / self.sections


@dataclass(frozen=True, kw_only=True)
class Cylinder:
    """Piston areas and chambers, paper equations (5)-(8)."""

    area_lifting: float = quantity("m^2", 1e-5, 1.0, "A_H")
    area_lowering: float = quantity("m^2", 1e-5, 1.0, "A_S")
    volume_lifting_0: float = quantity("m^3", 1e-5, 1.0, "V_H0, at h = 0, lines included")
    volume_lowering_0: float = quantity("m^3", 1e-5, 1.0, "V_S0, at h = 0, lines included")
    beta: float = quantity("Pa", 1e7, 3e9, "stiffness of oil and vessels together")
    relief_pressure: float = quantity(
        "Pa", 1e6, 1e9, "at which a chamber's relief valve opens; 1e9: none", default=1e9
    )
    relief_slope: float = quantity(
        "m^3/(s Pa)", 0.0, 1e-8, "relief flow per pressure above that", default=1e-9
    )


@dataclass(frozen=True, kw_only=True)
class Supply:
    """Pump and tank."""

    p0: float = quantity("Pa", 1e6, 5e7, "pump pressure, absolute")
    pT: float = quantity("Pa", 0.0, 5e6, "tank pressure, absolute")  # noqa: N815 (paper's name)


@dataclass(frozen=True, kw_only=True)
class Valve:
    """Proportional 4/3 solenoid valve with pressure balance, paper 2.2."""

    flow_nominal: float = quantity("m^3/s", 1e-6, 0.1, "Q_n, into the lifting chamber, fully open")
    flow_ratio_lowering: float = quantity("1", 0.01, 5.0, "pump flow when lowering / Q_n")
    natural_frequency: float = quantity("rad/s", 10.0, 2000.0, "of the spool")
    balance_pressure: float = quantity("Pa", 1e5, 5e6, "drop held over the metering edge")
    dead_zone: float = quantity("1", 0.0, 0.5, "overlap as a share of full stroke", default=0.10)
    damping: float = quantity("1", 0.05, 5.0, "of critical, of the spool", default=0.8)
    balance_lowering: int = quantity(
        "1", 0, 1, "pressure balance when lowering: 0 in the inlet, 1 in the return", default=0
    )
    limit_lowering: float = quantity(
        "Pa", 1e5, 1e9, "highest pressure fed to the lowering chamber; 1e9: none", default=1e9
    )


@dataclass(frozen=True, kw_only=True)
class Resistances:
    """Turbulent resistances dp = k Q|Q| of pump line, valve, logic block, return line (Fig. 4)."""

    k_pump_line: float = quantity("Pa s^2/m^6", 1e6, 1e16, "pump to valve")
    k_block_in: float = quantity("Pa s^2/m^6", 1e6, 1e16, "logic block, into the chamber")
    k_return_line: float = quantity("Pa s^2/m^6", 1e6, 1e16, "valve to tank")
    k_block_out: float = quantity("Pa s^2/m^6", 1e6, 1e16, "logic block, out; over y4^2")
    k_meter_out_lifting: float = quantity("Pa s^2/m^6", 1e6, 1e16, "return edge; over o^2")
    k_meter_out_lowering: float = quantity("Pa s^2/m^6", 1e6, 1e16, "return edge; over o^2")


@dataclass(frozen=True, kw_only=True)
class LogicBlock:
    """Safety logic block: stops the oil leaving the lifting chamber at low pressure."""

    threshold: float = quantity("Pa", 0.0, 5e7, "opens while the pilot pressure is above")
    time_constant_opening: float = quantity("s", 1e-3, 1.0, "very fast")
    time_constant_closing: float = quantity("s", 1e-3, 5.0, "slow")
    pilot: int = quantity("1", 0, 1, "pilot chamber: 0 lifting (p_H), 1 lowering (p_S)", default=0)


@dataclass(frozen=True, kw_only=True)
class Sensors:
    """Resolver, pressure transducers and strain gauge."""

    resolver_bits: int = quantity("1", 4, 24, "resolution of the joint resolver", default=12)
    resolver_span: float = quantity("rad", 0.1, 6.2832, "angle of the full count")
    pressure_noise: float = quantity("Pa", 0.0, 1e6, "standard deviation")
    pressure_noise_lowering: float = quantity("Pa", 0.0, 1e6, "of p_S; 0: the same", default=0.0)
    deflection_noise: float = quantity("rad", 0.0, 1e-2, "standard deviation")
    own_stroke: int = quantity("1", 0, 1, "stroke: 0 by the angle, 1 measured", default=0)
    command_period: float = quantity("s", 0.0, 1.0, "of valve commands; 0: unknown", default=0.0)
    seed: int = quantity("1", 0, 2**31 - 1, "of the noise", default=0)

    @property
    def pressure_noises(self) -> tuple[float, float]:
        """Standard deviations of p_H and p_S, Pa."""
        return self.pressure_noise, self.pressure_noise_lowering or self.pressure_noise

    @property
    def resolver_step(self) -> float:
        """Angle, rad, between two counts of the resolver."""
        return self.resolver_span / 2.0**self.resolver_bits


@dataclass(frozen=True, kw_only=True)
class Machine:
    """All parameters of EMIR's main joint.

    Raises ParameterError, with group and field named, when a value is outside its range.
    """

    geometry: Geometry
    cylinder: Cylinder
    supply: Supply
    valve: Valve
    resistances: Resistances
    logic_block: LogicBlock
    sensors: Sensors
    unnamed_force: UnnamedForce = UnnamedForce()
    unnamed_opening: UnnamedOpening = UnnamedOpening()
    unnamed_leakage: UnnamedLeakage = UnnamedLeakage()
    unnamed_compliance: UnnamedCompliance = UnnamedCompliance()
    unnamed_load: UnnamedLoad = UnnamedLoad()
    effects: Effects = field(default_factory=Effects)

    @property
    def payload(self) -> float:
        """The mass that is carried, kg: the stated payload and that of the effect."""
        return self.geometry.payload + self.effects.payload.mass

    def __post_init__(self) -> None:
        for path, group in groups(self).items():
            check_ranges(group, path + ".")
        for name in UNNAMED:
            curve = getattr(self, name)
            if curve.over and curve.last <= curve.first:
                raise ParameterError(
                    f"{name}.last = {curve.last:g}: not above {name}.first = {curve.first:g}"
                )


def cautions(machine: Machine) -> list[str]:
    """Return a line for each value that is allowed but beyond what the machine is made for."""
    if machine.payload <= RATED_PAYLOAD:
        return []
    rated = f"the machine is made for {RATED_PAYLOAD:g} kg"
    return [f"warning: payload = {machine.payload:g} kg: {rated}"]


def groups(machine: Machine) -> dict[str, Any]:
    """Return the parameter groups by dotted path, each effect being a group."""
    found = {f.name: getattr(machine, f.name) for f in dataclasses.fields(machine)}
    effects = found.pop("effects")
    for effect in dataclasses.fields(effects):
        found[f"effects.{effect.name}"] = getattr(effects, effect.name)
    return found
