"""What takes up a spool's play ahead, against the play itself."""

import numpy as np
import pytest

from emir_control.spool_play import SHUT, Sent, taken_up

WIDTH = 0.01


def _edges(commands: list[float]) -> list[float]:
    """Return where edges with play are that a spool pushes along, as a pusher does."""
    place, places = 0.0, []
    for command in commands:
        place = min(max(place, command - 0.5 * WIDTH), command + 0.5 * WIDTH)
        places.append(place)
    return places


def _commands(demands: list[float]) -> list[float]:
    sent, commands = SHUT, []
    for demand in demands:
        sent = taken_up(demand, sent, WIDTH)
        commands.append(sent.command)
    return commands


def test_edges_are_where_they_are_wanted() -> None:
    """Up and down again, over pauses and over turns."""
    demands = [0.2, 0.4, 0.4, 0.4, 0.3, 0.3, -0.5, -0.5, -0.45, 0.6]
    assert _edges(_commands(demands)) == pytest.approx(demands, abs=1e-12)


def test_a_demand_that_stays_leaves_the_valve_at_rest() -> None:
    commands = _commands([0.5] * 20)
    assert np.ptp(commands) == 0.0


def test_no_command_is_more_than_a_valve_can_be_told() -> None:
    assert taken_up(1.0, Sent(0.5, 0.5), WIDTH).command == 1.0
    assert taken_up(-1.0, Sent(0.5, 0.5), WIDTH).command == -1.0


def test_a_shut_valve_gets_no_command() -> None:
    assert taken_up(0.0, Sent(0.3, 0.305), WIDTH) == SHUT
