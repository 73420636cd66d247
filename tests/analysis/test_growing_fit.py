"""A fit to a free run is led along beginnings that grow: what swings is not lost on the way."""

import math

import numpy as np
import pytest
import recorded
from operated import operated, without

from emir_analysis.diagnosis.evidence import Evidence
from emir_analysis.diagnosis.fitting import fit_free_run
from emir_analysis.diagnosis.run_errors import mean_square
from emir_analysis.diagnosis.select import AT_NOISE
from emir_analysis.diagnosis.trial import trial
from emir_common.parameter_tree import with_values
from emir_plant.sheet import Sheet, joint1

TOLERANCES = {"cylinder.beta": 0.15, "valve.flow_nominal": 0.03}
HANDLER = {  # a material handler of 15 m, which drifts further than EMIR in the same time
    "geometry.boom_length": 15.0,
    "geometry.boom_mass": 4200.0,
    "geometry.section_spring": 115350000.0,
    "geometry.triangle_a": 1.7,
    "geometry.triangle_b": 0.62,
    "geometry.triangle_gamma0": 0.62,
    "cylinder.area_lifting": 0.0380133,
    "cylinder.area_lowering": 0.0226195,
    "cylinder.volume_lifting_0": 0.0121642,
    "cylinder.volume_lowering_0": 0.0220601,
    "cylinder.beta": 8e8,
    "cylinder.relief_pressure": 1e9,
    "supply.p0": 3e7,
    "valve.flow_nominal": 1.80906e-3,
    "valve.flow_ratio_lowering": 0.654545,
    "valve.dead_zone": 0.06,
    "valve.natural_frequency": 125.664,
    "resistances.k_pump_line": 1.22223e11,
    "resistances.k_block_in": 9.16675e10,
    "resistances.k_return_line": 9.16675e10,
    "resistances.k_block_out": 9.16675e10,
    "resistances.k_meter_out_lifting": 1.12187e12,
    "resistances.k_meter_out_lowering": 4.58337e11,
    "logic_block.threshold": 3.5e6,
    "sensors.resolver_bits": 13,
    "sensors.resolver_span": math.pi / 2.0,
    "sensors.command_period": 0.02,
}
OFFSET, LOAD = "effects.valve_null_offset.offset", "effects.external_load."
HIDDEN = {
    OFFSET: 0.0056,
    LOAD + "force": 500.0,
    LOAD + "frequency": 0.21,
    LOAD + "phase": math.pi / 2.0,
    LOAD + "start": 0.0,
    LOAD + "duration": 1e5,
}
NEARLY = {
    OFFSET: 0.005768,
    LOAD + "force": 485.0,
    LOAD + "mean": 25.0,
    LOAD + "frequency": 0.20937,
}


@pytest.mark.parametrize("seed", [5, 6])
def test_a_load_that_swings_is_followed_to_the_end(seed: int) -> None:
    """Known to a few percent, as by its first ten seconds; a pressure is not measured."""
    handler = with_values(joint1(), HANDLER)
    command = 0.5 * recorded.moves(60.0, seed)
    run = operated(with_values(handler, HIDDEN), command, angle=0.6)
    evidence = Evidence([without(run, "pressure_lifting")], handler)
    start = trial(Sheet(handler, TOLERANCES, {}, ()), ("valve_null_offset", "external_load"))
    values = start.unknowns.values(start.x) | HIDDEN | NEARLY
    begun = start.at(np.array([u.at(values[u.path]) for u in start.unknowns.members]))
    assert mean_square(begun, evidence) > 100.0
    assert mean_square(fit_free_run(begun, evidence), evidence) < AT_NOISE**2
