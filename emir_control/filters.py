"""First-order filters, exact for inputs held over a control period."""

import math


def low_pass(state: float, value: float, time_constant: float, dt: float) -> float:
    """Return the next output of 1/(1 + T s); state is the last one, T and dt in s."""
    return value + (state - value) * math.exp(-dt / time_constant)


def before_low_pass(output: float, value: float, time_constant: float, dt: float) -> float:
    """Return the state from which `low_pass` gives the output."""
    return value + (output - value) * math.exp(dt / time_constant)
