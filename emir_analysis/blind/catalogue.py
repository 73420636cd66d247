"""The effects that the blind test hides: those of the simulator's registry, written a second time.

Where the simulator has a smoothed law, another smoothing stands here; where it has a lag, the same
differential equation.
"""

from emir_analysis.blind.hidden import Hidden
from emir_analysis.blind.hidden_mechanics import (
    Backlash,
    CoulombFriction,
    ExternalLoad,
    LinkageError,
    Payload,
    PressureDependentFriction,
    StribeckFriction,
    ViscousFriction,
)
from emir_analysis.blind.hidden_oil import (
    EntrainedAir,
    ExternalLeakage,
    InternalLeakage,
    LogicBlockFault,
    SupplyPressureDroop,
    VesselCompliance,
)
from emir_analysis.blind.hidden_sensors import SensorBias, SensorDelay, SensorGain
from emir_analysis.blind.hidden_valve import (
    CommandDelay,
    FlowGainDrift,
    ValveDeadZoneError,
    ValveGainAsymmetry,
    ValveHysteresis,
    ValveNullOffset,
)

CATALOGUE: tuple[type[Hidden], ...] = (
    CoulombFriction,
    StribeckFriction,
    ViscousFriction,
    PressureDependentFriction,
    Payload,
    ExternalLoad,
    LinkageError,
    InternalLeakage,
    ExternalLeakage,
    EntrainedAir,
    VesselCompliance,
    SupplyPressureDroop,
    ValveNullOffset,
    ValveGainAsymmetry,
    ValveDeadZoneError,
    ValveHysteresis,
    CommandDelay,
    FlowGainDrift,
    LogicBlockFault,
    Backlash,
    SensorBias,
    SensorGain,
    SensorDelay,
)
