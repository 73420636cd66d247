"""Sine, cosine and exponential as code that is compiled into whoever uses them.

A call of the C library's keeps a loop over machines from running in vector lanes. The
polynomials are those of fdlibm (Sun Microsystems 1993: k_sin.c, k_cos.c, e_exp.c), good to a unit
in the last place.
"""

import math

import numpy as np

from emir_plant.jit import compiled, power_of_two

PER_QUARTER = 2.0 / math.pi  # 1/rad
QUARTER = 1.57079632673412561417  # rad, a quarter turn's first 33 bits: times a whole number exact
QUARTER_LEFT = 6.07710050650619224932e-11  # rad, what is left of it
PER_DOUBLING = 1.0 / math.log(2.0)
DOUBLING = 6.93147180369123816490e-01  # log(2), its first 32 bits
DOUBLING_LEFT = 1.90821492927058770002e-10  # what is left of it
LARGEST = 708.0  # of a number whose exponential and its inverse are of normal size


@compiled
def sine(angle: float) -> float:
    """Return the sine of an angle, rad; within 1e5 rad off by less than the angle is rounded."""
    return _sine(angle, 0.0)


@compiled
def cosine(angle: float) -> float:
    """Return the cosine of an angle, rad, as exact as `sine`."""
    return _sine(angle, 1.0)


@compiled
def exponential(number: float) -> float:
    """Return e to a number; beyond LARGEST and below -LARGEST as there."""
    bounded = min(max(number, -LARGEST), LARGEST)
    doublings = np.floor(bounded * PER_DOUBLING + 0.5)
    high, low = bounded - doublings * DOUBLING, doublings * DOUBLING_LEFT
    rest = high - low
    square = rest * rest
    p = 4.13813679705723846039e-08
    p = p * square - 1.65339022054652515390e-06
    p = p * square + 6.61375632143793436117e-05
    p = p * square - 2.77777777770155933842e-03
    p = p * square + 1.66666666666666019037e-01
    c = rest - square * p
    grown: float = 1.0 - ((low - rest * c / (2.0 - c)) - high)
    return grown * power_of_two(doublings)


@compiled
def _sine(angle: float, ahead: float) -> float:
    """Return the sine of an angle, rad, and a whole number of quarter turns ahead of it."""
    quarters = np.floor(angle * PER_QUARTER + 0.5)
    rest = (angle - quarters * QUARTER) - quarters * QUARTER_LEFT
    turned = quarters + ahead
    odd = turned - 2.0 * np.floor(0.5 * turned) > 0.0
    back = turned - 4.0 * np.floor(0.25 * turned) > 1.0
    sine_there, cosine_there = _sine_near_0(rest), _cosine_near_0(rest)
    value = cosine_there if odd else sine_there
    return -value if back else value


@compiled
def _sine_near_0(angle: float) -> float:
    """Return the sine of an angle, rad, of an eighth of a turn at most."""
    square = angle * angle
    p = 1.58969099521155010221e-10
    p = p * square - 2.50507602534068634195e-08
    p = p * square + 2.75573137070700676789e-06
    p = p * square - 1.98412698298579493134e-04
    p = p * square + 8.33333333332248946124e-03
    p = p * square - 1.66666666666666324348e-01
    return angle + angle * square * p


@compiled
def _cosine_near_0(angle: float) -> float:
    """Return the cosine of an angle, rad, of an eighth of a turn at most."""
    square = angle * angle
    p = -1.13596475577881948265e-11
    p = p * square + 2.08757232129817482790e-09
    p = p * square - 2.75573143513906633035e-07
    p = p * square + 2.48015872894767294178e-05
    p = p * square - 1.38888888888741095749e-03
    p = p * square + 4.16666666666666019037e-02
    half = 0.5 * square
    first = 1.0 - half
    return first + ((1.0 - first - half) + square * square * p)
