"""What a model-based controller is told about a machine: its boom and its drive, as stated."""

import math
from dataclasses import replace

from emir_common.parameter_tree import with_values
from emir_control.actuator import ActuatorParameters
from emir_control.boom import Boom, BoomTable
from emir_control.lqg import LqgParameters
from emir_control.prefilter import PrefilterParameters
from emir_plant.parameters import Machine
from emir_plant.record import record

PAYLOADS = (0.0, 250.0, 500.0, 750.0, 1000.0, 1250.0, 1500.0)  # kg


def boom(machine: Machine) -> Boom:
    """Return the boom with the machine's payload."""
    p = record(machine)[0]
    return Boom(
        stiffness=p["mode_stiffness"],
        damping=p["mode_damping"],
        joint=p["mode_joint"],
        tip_angle=p["mode_tip_angle"],
        weight=p["mode_weight"],
        deflection=p["mode_deflection"],
        tip=p["mode_tip"],
    )


def lqg_parameters(machine: Machine) -> LqgParameters:
    """Return the parameters of an LQG control that knows the machine as stated."""
    return LqgParameters(boom=boom_table(machine), actuator=actuator(machine))


def boom_table(machine: Machine) -> BoomTable:
    """Return the boom with each of PAYLOADS."""
    loaded = (with_values(machine, {"geometry.payload": load}) for load in PAYLOADS)
    return BoomTable(PAYLOADS, tuple(boom(each) for each in loaded))


def actuator(machine: Machine) -> ActuatorParameters:
    """Return the drive's parameters."""
    c, v, r, g = machine.cylinder, machine.valve, machine.resistances, machine.geometry
    return ActuatorParameters(
        static=replace(
            PrefilterParameters(),
            area_lifting=c.area_lifting,
            area_lowering=c.area_lowering,
            flow_lifting=v.flow_nominal,
            flow_lowering=v.flow_nominal * v.flow_ratio_lowering,
            dead_zone=v.dead_zone,
            triangle_a=g.triangle_a,
            triangle_b=g.triangle_b,
            triangle_gamma0=g.triangle_gamma0,
        ),
        volume_lifting_0=c.volume_lifting_0,
        volume_lowering_0=c.volume_lowering_0,
        beta=c.beta,
        supply=machine.supply.p0,
        tank=machine.supply.pT,
        balance=v.balance_pressure,
        pump_line=r.k_pump_line + r.k_block_in,
        return_line=r.k_return_line,
        block_out=r.k_block_out,
        edge_lifting=r.k_meter_out_lifting,
        edge_lowering=r.k_meter_out_lowering,
        threshold=machine.logic_block.threshold,
        opening_time=machine.logic_block.time_constant_opening,
        closing_time=machine.logic_block.time_constant_closing,
        spool_frequency=v.natural_frequency,
        spool_damping=v.damping,
    )


def joint_rates(machine: Machine, turn: float, stroke: float) -> tuple[float, float]:
    """Return the lowest and highest joint rate, rad/s, that the valve's flow gives in a move.

    turn: rad, of the joint in the move; stroke: m, of the piston in it.
    """
    arm = abs(stroke / turn) if turn else math.inf
    low, high = actuator(machine).static.speeds
    return low / arm, high / arm
