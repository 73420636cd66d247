"""What recordings show and no effect has a name for, as measured curves, one balance in each file.

What a diagnosis cannot name it can still measure. With the curve the machine can be simulated,
controlled and looked at; a name it has not. All are off by default.
"""

from emir_plant.unnamed.compliance import UnnamedCompliance
from emir_plant.unnamed.force import UnnamedForce
from emir_plant.unnamed.leakage import UnnamedLeakage
from emir_plant.unnamed.load import UnnamedLoad
from emir_plant.unnamed.opening import UnnamedOpening

__all__ = [
    "UNNAMED",
    "UnnamedCompliance",
    "UnnamedForce",
    "UnnamedLeakage",
    "UnnamedLoad",
    "UnnamedOpening",
]

UNNAMED = {  # groups of a machine's parameters, each on where its `over` is not 0
    "unnamed_force": UnnamedForce,
    "unnamed_opening": UnnamedOpening,
    "unnamed_leakage": UnnamedLeakage,
    "unnamed_compliance": UnnamedCompliance,
    "unnamed_load": UnnamedLoad,
}
