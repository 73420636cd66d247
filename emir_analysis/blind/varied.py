"""Other machines: of another size, with another oil, valve, sampling and fewer sensors.

A machine is drawn around a similar one: what its size decides follows by the laws of similarity,
so that pressures, times and angles of rest stay of the order of the first; then each number is
varied by itself.
"""

from dataclasses import replace

from emir_analysis.blind.hidden import Random, between
from emir_analysis.blind.numbers import Numbers, Stated

SIZE = (0.4, 1.3)  # times the boom's length
RATES = (50.0, 100.0, 100.0, 200.0)  # 1/s, of the sensors
COMMAND_PERIODS = (0.02, 0.032, 0.05)  # s
RESOLVER_BITS = (12, 13, 14, 16)
MISSING: tuple[tuple[str, ...], ...] = (  # sensors that a machine does without
    (),
    (),
    (),
    ("tip_deflection_angle",),
    ("pressure_lowering",),
    ("joint_angle",),
    ("piston_stroke",),
    ("tip_deflection_angle", "pressure_lowering"),
)


def varied(stated: Stated, random: Random) -> Stated:
    """Return another maker's sheet, drawn around one."""
    n = _resized(stated.numbers, random)
    n = _other_hydraulics(n, random)
    n = _other_sensors(n, random)
    strict = random.uniform(0.5, 1.5)
    tolerances = {name: strict * tol for name, tol in stated.tolerances.items()}
    return Stated(n, tolerances, MISSING[random.integers(len(MISSING))])


def _resized(n: Numbers, random: Random) -> Numbers:
    """Return a machine of another length, mass, pump pressure and number of arms.

    Its cylinder carries the boom at about the same share of the pump's pressure and moves it
    through its range in about the same time; its boom swings the slower the longer it is.
    """
    size = between(random, *SIZE)
    mass = size**2 * random.uniform(0.7, 1.4)
    frequency = random.uniform(0.8, 1.3) / size
    arms = int(random.integers(3, 7))
    p0 = random.uniform(150e5, 320e5)
    area = mass * random.uniform(0.85, 1.2) * n.p0 / p0
    ratio = random.uniform(0.4, 0.7)  # of the cylinder's areas
    flow = area * size * random.uniform(0.8, 1.3)
    lowering = ratio * area * n.area_lifting
    filled = n.volume_lowering_0 / n.area_lowering * size * random.uniform(1.05, 1.3)
    # springs in series: the boom's compliance is that of all arms together
    spring = mass * size**2 * frequency**2 * arms / n.arms
    return replace(
        n,
        boom_length=size * n.boom_length,
        boom_mass=mass * n.boom_mass,
        arms=arms,
        section_spring=spring * n.section_spring,
        triangle_a=size * n.triangle_a,
        triangle_b=size * n.triangle_b * random.uniform(0.9, 1.1),
        area_lifting=area * n.area_lifting,
        area_lowering=lowering,
        volume_lifting_0=area * size * random.uniform(0.5, 1.5) * n.volume_lifting_0,
        volume_lowering_0=lowering * filled,
        p0=p0,
        flow_nominal=flow * n.flow_nominal,
        flow_ratio_lowering=1.1 * ratio,
        **{
            name: value * p0 / n.p0 / flow**2 * random.uniform(0.7, 1.4)
            for name, value in vars(n).items()
            if name.startswith("k_")
        },
    )


def _other_hydraulics(n: Numbers, random: Random) -> Numbers:
    return replace(
        n,
        modal_damping=random.uniform(0.005, 0.03),
        beta=between(random, 4e8, 1.4e9),
        dead_zone=random.uniform(0.04, 0.2),
        natural_frequency=n.natural_frequency * random.uniform(0.4, 1.5),
        damping=random.uniform(0.6, 1.0),
        threshold=n.threshold * random.uniform(0.7, 1.2),
        time_constant_closing=n.time_constant_closing * random.uniform(0.5, 1.5),
    )


def _other_sensors(n: Numbers, random: Random) -> Numbers:
    return replace(
        n,
        resolver_bits=int(random.choice(RESOLVER_BITS)),
        pressure_noise=between(random, 0.05e5, 0.5e5),
        deflection_noise=between(random, 1e-5, 6e-5),
        rate=float(random.choice(RATES)),
        command_period=float(random.choice(COMMAND_PERIODS)),
    )
