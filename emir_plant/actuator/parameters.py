"""What describes an actuator; every value is fitted unless its data sheet says otherwise."""

from dataclasses import dataclass, fields

from emir_common.quantity import check_ranges, quantity
from emir_plant.actuator.effects import Effects


@dataclass(frozen=True)
class Valve:
    """A spool of first order, whose opening meters a flow.

    gain: negative where a positive opening lowers the pressure.
    """

    gain: float = quantity("pressure/time", -100.0, 100.0, "flow per opening")
    time_constant: float = quantity("time", 0.1, 100.0, "of the spool")


@dataclass(frozen=True)
class Load:
    """A mass on the oil's spring."""

    frequency: float = quantity("rad/time", 1e-3, 20.0, "of the mass on the oil, valve shut")
    viscous_friction: float = quantity("time", 0.0, 50.0, "pressure per velocity", default=0.0)


@dataclass(frozen=True)
class Sensor:
    """The pressure transducer; 0: nobody knows its noise."""

    pressure_noise: float = quantity("pressure", 0.0, 10.0, "standard deviation", default=0.0)


@dataclass(frozen=True)
class Actuator:
    """A hydraulic actuator in normalised units."""

    valve: Valve
    load: Load
    sensor: Sensor = Sensor()
    effects: Effects = Effects()

    def __post_init__(self) -> None:
        for name in ("valve", "load", "sensor"):
            check_ranges(getattr(self, name), f"{name}.")
        for field in fields(self.effects):
            check_ranges(getattr(self.effects, field.name), f"effects.{field.name}.")
