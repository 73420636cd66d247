"""Physical effects that a machine may have beyond the basic model, one in each file.

`Effects` is the registry, the only list of them: a new effect is a file here, a field below,
and its term in `terms.py` (or, for a changed parameter, in `record.py`).
"""

from dataclasses import dataclass
from typing import get_type_hints

from emir_plant.effects.base import Effect
from emir_plant.effects.coulomb_friction import CoulombFriction
from emir_plant.effects.entrained_air import EntrainedAir
from emir_plant.effects.internal_leakage import InternalLeakage
from emir_plant.effects.payload import Payload
from emir_plant.effects.stribeck_friction import StribeckFriction

__all__ = ["REGISTRY", "Effect", "Effects"]


@dataclass(frozen=True)
class Effects:
    """All effects by name; each is off by default."""

    coulomb_friction: CoulombFriction = CoulombFriction()
    stribeck_friction: StribeckFriction = StribeckFriction()
    payload: Payload = Payload()
    internal_leakage: InternalLeakage = InternalLeakage()
    entrained_air: EntrainedAir = EntrainedAir()


REGISTRY: dict[str, type[Effect]] = get_type_hints(Effects)
