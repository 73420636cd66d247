"""Noise that a seed and a sample's number determine: a run can be repeated from any point.

Every sample has a generator of its own, that of `numpy.random.default_rng((seed, sample))`, number
for number. Hashing the two is compiled here, by the algorithm of numpy.random.SeedSequence, which
takes longer for it than all else that is done for a reading.
"""

from typing import Any

import numpy as np
from numpy.random import PCG64, Generator
from numpy.random.bit_generator import ISeedSequence
from numpy.typing import NDArray

from emir_plant.jit import compiled

# M. E. O'Neill, "Developing a seed_seq Alternative", pcg-random.org (2015), as numpy has it
POOL_INITIAL, POOL_FACTOR = 0x43B0D7E5, 0x931E8875
WORD_INITIAL, WORD_FACTOR = 0x8B51F9DD, 0x58F38DED
MIX_LEFT, MIX_RIGHT = 0xCA01F9DD, 0x4973F715
BITS = 0xFFFFFFFF


def generator(seed: int, sample: int) -> Generator:
    """Return the generator of a sample; seed and sample: below 2^32."""
    begin: Any = _Hashed(seed, sample)  # numpy's stubs know SeedSequence itself alone
    return Generator(PCG64(begin))


class _Hashed(ISeedSequence):
    """What begins a PCG64, by numpy's interface."""

    def __init__(self, seed: int, sample: int) -> None:
        self._words = words(seed, sample)

    def generate_state(self, n_words: int, dtype: Any = np.uint64) -> NDArray[np.uint64]:
        """Return the words that PCG64 asks for, (4,)."""
        return self._words


@compiled
def words(seed: int, sample: int) -> NDArray[np.uint64]:
    """Return SeedSequence((seed, sample)).generate_state(4, uint64)."""
    pool = np.array([seed, sample, 0, 0], dtype=np.uint32)
    constant = POOL_INITIAL
    for k in range(4):
        pool[k], constant = _hash(pool[k], constant, POOL_FACTOR)
    for source in range(4):
        for target in range(4):
            if source != target:
                hashed, constant = _hash(pool[source], constant, POOL_FACTOR)
                mixed = (pool[target] * MIX_LEFT - hashed * MIX_RIGHT) & BITS
                pool[target] = mixed ^ (mixed >> 16)
    result = np.empty(8, dtype=np.uint32)
    constant = WORD_INITIAL
    for k in range(8):
        result[k], constant = _hash(pool[k % 4], constant, WORD_FACTOR)
    return result.view(np.uint64)


@compiled
def _hash(value: int, constant: int, factor: int) -> tuple[int, int]:
    """Return the value hashed, 32 bits, and the constant of the next one."""
    following = constant * factor & BITS
    product = (value ^ constant) * following & BITS
    return product ^ (product >> 16), following
