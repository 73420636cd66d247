"""Physical effects that a machine may have beyond the basic model, one in each file.

`Effects` is the registry, the only list of them: a new effect is a file here, a field below,
and its term in `terms.py` (or, for a changed parameter, in `record.py`; for one that a sensor
makes, in `sensors.py`).
"""

from dataclasses import dataclass
from typing import get_type_hints

from emir_plant.effects.backlash import Backlash
from emir_plant.effects.base import Effect
from emir_plant.effects.command_delay import CommandDelay
from emir_plant.effects.coulomb_friction import CoulombFriction
from emir_plant.effects.entrained_air import EntrainedAir
from emir_plant.effects.external_leakage import ExternalLeakage
from emir_plant.effects.external_load import ExternalLoad
from emir_plant.effects.flow_gain_drift import FlowGainDrift
from emir_plant.effects.internal_leakage import InternalLeakage
from emir_plant.effects.linkage_error import LinkageError
from emir_plant.effects.logic_block_fault import LogicBlockFault
from emir_plant.effects.payload import Payload
from emir_plant.effects.pressure_dependent_friction import PressureDependentFriction
from emir_plant.effects.sensor_bias import SensorBias
from emir_plant.effects.sensor_delay import SensorDelay
from emir_plant.effects.sensor_gain import SensorGain
from emir_plant.effects.stribeck_friction import StribeckFriction
from emir_plant.effects.supply_pressure_droop import SupplyPressureDroop
from emir_plant.effects.valve_dead_zone_error import ValveDeadZoneError
from emir_plant.effects.valve_gain_asymmetry import ValveGainAsymmetry
from emir_plant.effects.valve_hysteresis import ValveHysteresis
from emir_plant.effects.valve_null_offset import ValveNullOffset
from emir_plant.effects.vessel_compliance import VesselCompliance
from emir_plant.effects.viscous_friction import ViscousFriction

__all__ = ["REGISTRY", "Effect", "Effects"]


@dataclass(frozen=True)
class Effects:
    """All effects by name; each is off by default."""

    coulomb_friction: CoulombFriction = CoulombFriction()
    stribeck_friction: StribeckFriction = StribeckFriction()
    viscous_friction: ViscousFriction = ViscousFriction()
    pressure_dependent_friction: PressureDependentFriction = PressureDependentFriction()
    payload: Payload = Payload()
    external_load: ExternalLoad = ExternalLoad()
    linkage_error: LinkageError = LinkageError()
    internal_leakage: InternalLeakage = InternalLeakage()
    external_leakage: ExternalLeakage = ExternalLeakage()
    entrained_air: EntrainedAir = EntrainedAir()
    vessel_compliance: VesselCompliance = VesselCompliance()
    supply_pressure_droop: SupplyPressureDroop = SupplyPressureDroop()
    valve_null_offset: ValveNullOffset = ValveNullOffset()
    valve_gain_asymmetry: ValveGainAsymmetry = ValveGainAsymmetry()
    valve_dead_zone_error: ValveDeadZoneError = ValveDeadZoneError()
    valve_hysteresis: ValveHysteresis = ValveHysteresis()
    command_delay: CommandDelay = CommandDelay()
    flow_gain_drift: FlowGainDrift = FlowGainDrift()
    logic_block_fault: LogicBlockFault = LogicBlockFault()
    backlash: Backlash = Backlash()
    sensor_bias: SensorBias = SensorBias()
    sensor_gain: SensorGain = SensorGain()
    sensor_delay: SensorDelay = SensorDelay()


REGISTRY: dict[str, type[Effect]] = get_type_hints(Effects)
