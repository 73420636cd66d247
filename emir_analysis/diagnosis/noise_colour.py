"""How much of a sensor's noise stays from one sample to the next, by what it shows at rest.

The noise of a filtered sensor adds up over a window as white noise does not. It is taken as a
first-order process (AR(1), Box and Jenkins 1970) of the stated standard deviation.
"""

import numpy as np
from scipy.signal import detrend, lfilter

from emir_analysis.diagnosis.experiment import Experiment, noise, samples_at_rest
from emir_analysis.signals import Array
from emir_plant.parameters import Machine

FEWEST = 25  # samples at rest, by which a colour is told
TOLD = 3.0  # standard deviations of what white noise has of it
WITHIN = 2.0  # standard deviations, within which a variance is the stated one
DISTINCT = 0.5  # share of the samples: fewer values are a coarse sensor's steps, no noise


def colours(experiment: Experiment, machine: Machine) -> Array:
    """Return the correlation of successive samples' noise, (4,) in the order of OUTPUTS, 0 to 1.

    0 where the time at rest before the first move is too short to tell it from white noise, and
    where the changes are those of white noise of the stated size: what is slow is then the
    machine, as a load that swings, not its sensor.
    """
    stated = noise(machine)
    columns = experiment.outputs[: samples_at_rest(experiment, machine)].T
    return np.array([_colour(column, s) for column, s in zip(columns, stated, strict=True)])


def _colour(shown: Array, stated: float) -> float:
    """Return the colour of one sensor's readings at rest, (n,), by its stated deviation."""
    count = shown.size
    if stated == 0.0 or count < FEWEST or np.unique(shown).size < DISTINCT * count:
        return 0.0
    left = detrend(shown)
    variance = float(np.mean(np.square(left)))
    fresh = float(np.mean(np.square(np.diff(left)))) / 2.0
    least = TOLD / np.sqrt(count)
    if fresh >= (1.0 - least) * variance:  # where nothing varies, too
        return 0.0
    seen = 1.0 - fresh / variance
    # the fewer samples are independent, the less well the time at rest tells the variance
    independent = count * (1.0 - seen) / (1.0 + seen)
    most = variance * (1.0 + WITHIN * np.sqrt(2.0 / independent))
    colour = float(1.0 - fresh / min(most, stated**2))
    return colour if colour > least else 0.0


def coloured(white: Array, colour: Array) -> Array:
    """Return white noise of variance 1, (n, c), as one whose successive samples correlate, (c,)."""
    result = white.copy()
    for k, share in enumerate(colour):
        if share > 0.0:
            fresh = np.sqrt(1.0 - share**2)
            before = [share * white[0, k]]
            result[1:, k] = lfilter([fresh], [1.0, -share], white[1:, k], zi=before)[0]
    return result
