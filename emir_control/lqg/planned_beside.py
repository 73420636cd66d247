"""The LQG control in real time: a move is planned in a thread while the machine is held at rest.

A plan takes several control periods, and longer than inputs stay fresh: made in a step, it would
keep all that runs in the same process from its work.
"""

from concurrent.futures import Future, ThreadPoolExecutor

from emir_control.least_bending import NoMotionError
from emir_control.lqg.law import Lqg
from emir_control.lqg.parameters import LqgParameters
from emir_control.lqg.standing_by import TO_JOIN
from emir_control.lqg.state import LqgInputs, LqgOutputs, LqgState, are_numbers
from emir_control.trajectory import NO_MOVE


class PlannedBeside:
    """A control law with its plans made beside; see `Lqg`.

    A move that the drive cannot make is not made: `refused` says why, for as long as it is asked
    for. Nor is one made whose plan comes within TO_JOIN of its end.
    """

    def __init__(self, law: Lqg) -> None:
        self._law = law
        self._threads = ThreadPoolExecutor(1, "planning")
        self._asked: tuple[float, float] | None = None  # distance, m, and duration, s
        self._planned: Future[LqgState]
        self.refused = ""

    @property
    def parameters(self) -> LqgParameters:
        """Return the law's parameters."""
        return self._law.parameters

    @property
    def is_planning(self) -> bool:
        """Tell whether a plan is being made."""
        return self._asked is not None

    def initial(self, inputs: LqgInputs) -> LqgState:
        """Return the state of a machine that rests with what is measured now, all numbers."""
        return self._law.initial(inputs)

    def stand_by(self, state: LqgState, inputs: LqgInputs) -> tuple[LqgState, bool]:
        """Return the next state while another one drives, and whether this one may take over."""
        return self._law.stand_by(state, inputs)

    def step(self, state: LqgState, inputs: LqgInputs, dt: float) -> tuple[LqgState, LqgOutputs]:
        """Return the valve command of this control period of dt, s."""
        law, resting = self._law, inputs._replace(move=NO_MOVE)
        if not are_numbers(inputs):
            return law.step(state, inputs, dt)
        if not self._is_wanted(state, inputs):
            self._asked, self.refused = None, ""
            return law.step(state, inputs, dt)
        asked = (inputs.move.distance, inputs.move.duration)
        if asked != self._asked:
            self._asked, self.refused = asked, ""
            self._planned = self._threads.submit(law.planned, state, inputs)
        if not self._planned.done():
            return law.step(state, resting, dt)
        try:
            planned = self._planned.result()
        except NoMotionError as error:
            self.refused = str(error)
            return law.step(state, resting, dt)
        self._asked = None
        return law.step(law.continued(planned, state, inputs), inputs, dt)

    def _is_wanted(self, state: LqgState, inputs: LqgInputs) -> bool:
        """Tell whether a move is to be planned, or has begun meanwhile with time to join it."""
        move = inputs.move
        in_time = self.refused or move.since < move.duration - TO_JOIN
        waits = self.is_planning and in_time and self._law.is_asked(state, inputs)
        return bool(waits) or self._law.plans(state, inputs)
