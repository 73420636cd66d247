"""Machines whose data sheet states a value wrongly, for `emir blind --foreign`.

No effect, so `unexplained`; which value, `misstated` of the answer says. A maker is sure of these
values: they stand without a tolerance.
"""

from typing import ClassVar

from emir_analysis.blind.hidden import Hidden, Random, between, either_sign
from emir_analysis.blind.machine import Sizes
from emir_analysis.blind.numbers import Numbers


class _Misstated(Hidden):
    """One number times a factor. number: as in `Numbers`."""

    number: ClassVar[str]
    grows = ("factor",)

    def changed(self, numbers: Numbers) -> Numbers:
        return super().changed(numbers).with_factors({self.number: self.sizes["factor"]})


class DampedBoom(_Misstated):
    """A boom of bolted sections: it damps far more than a welded one."""

    name = "damped_boom"
    number = "modal_damping"

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {"factor": between(random, 3.0, 8.0)}


class OtherRod(_Misstated):
    """A cylinder of the next series: the same bore, another rod."""

    name = "other_rod"
    number = "area_lowering"

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {"factor": 1.0 + either_sign(random, 0.05, 0.15)}


class HeavierBoom(_Misstated):
    """Paint, hoses and lamps that nobody weighed."""

    name = "heavier_boom"
    number = "boom_mass"

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {"factor": 1.0 + between(random, 0.03, 0.12)}


class OtherThrottle(_Misstated):
    """A spool with other return edges, as for another pump."""

    name = "other_throttle"
    number = "k_meter_out_lifting"

    @classmethod
    def draw(cls, random: Random) -> Sizes:
        return {"factor": between(random, 1.5, 4.0)}


FOREIGN = (DampedBoom, OtherRod, HeavierBoom, OtherThrottle)
