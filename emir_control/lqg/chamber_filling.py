"""The lowering chamber filled before lowering, by a small opening, and the move from there on."""

from dataclasses import dataclass

from emir_control.actuator import Oil
from emir_control.filling import Filled
from emir_control.lqg.beginning import Beginning
from emir_control.lqg.state import LqgInputs, LqgOutputs, LqgState
from emir_control.prefilter import joint_angle
from emir_control.spool_play import Sent
from emir_control.trajectory import NO_MOVE


@dataclass(frozen=True)
class ChamberFilling:
    """What comes before a lowering where the logic block is shut; see `filling.py`."""

    beginning: Beginning

    def is_due(self, state: LqgState, inputs: LqgInputs) -> bool:
        """Tell whether the lowering chamber has to be filled before the move that comes."""
        p = self.beginning.parameters
        move, fill = inputs.move, p.fill
        if state.moving or move.distance >= 0.0 or not -fill.lead <= move.since < 0.0:
            return False
        if state.filled.over:
            return False
        missing = p.actuator.threshold + fill.margin - inputs.pressure_lifting
        return missing > 0.0 or state.filled.velocity > 0.0

    def step(self, state: LqgState, inputs: LqgInputs, dt: float) -> tuple[LqgState, LqgOutputs]:
        """Return a small opening, for dt, s, that lets the pump fill the lowering chamber."""
        p, drive = self.beginning.parameters, self.beginning.drive
        stroke = inputs.reference + state.filled.moved
        oil = Oil(stroke, inputs.pressure_lifting, inputs.pressure_lowering, 0.0)
        missing = p.actuator.threshold + p.fill.margin - inputs.pressure_lifting
        velocity = p.fill.velocity(state.filled, missing, drive, stroke, dt)
        given = max(velocity + p.fill.damping * self._pushed(state, inputs, stroke), 0.0)
        demand = drive.command(drive.opening(-given, oil))
        sent = Sent(demand, demand - (0.5 * p.hysteresis if given else 0.0))
        logic = drive.next_logic(state.logic, inputs.pressure_lifting, dt)
        filled = Filled(state.filled.moved - given * dt, velocity)
        outputs = LqgOutputs(sent.command, -velocity, -given, 0.0, 0.0, state.payload, 0.0)
        rest = state.rest._replace(periods=0)
        return state._replace(sent=sent, logic=logic, filled=filled, rest=rest), outputs

    def ended(self, state: LqgState, inputs: LqgInputs) -> LqgState:
        """Return the state that rests where the filling has ended: the boom swings from it."""
        rest = state.rest._replace(angle=inputs.angle)
        filled = state.filled._replace(over=True)
        here = inputs._replace(move=NO_MOVE)
        return self.beginning.begun(rest, here, state.logic, state.sent, filled)

    def onward(self, state: LqgState, inputs: LqgInputs) -> LqgState:
        """Return the state at the start of a move from where the chamber was filled.

        What is known of the swing and of what is under way stays known.
        """
        rest = state.rest._replace(angle=float(state.plan.angle[-1]))
        begun = self.beginning.begun(rest, inputs, state.logic, state.sent, state.filled)
        return begun._replace(
            estimate=state.estimate, past=state.past, openings=state.openings, rest=state.rest
        )

    def _pushed(self, state: LqgState, inputs: LqgInputs, stroke: float) -> float:
        """Return the deviation of the force from that at rest, over the oil's stiffness, m."""
        drive, weight = self.beginning.drive, self.beginning.weight
        force = drive.force(inputs.pressure_lifting, inputs.pressure_lowering)
        before = joint_angle(inputs.reference, self.beginning.parameters.actuator.static)
        heavier = weight(inputs.angle) / weight(before)
        return (force - heavier * state.rest.force) / drive.stiffness(stroke)
