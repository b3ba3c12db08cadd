# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Seeds of many worlds at once."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

# The constants of `numpy.random.SeedSequence`, whose output NumPy does not change (NEP 19).
INIT_A, MULT_A = 0x43B0D7E5, 0x931E8875
INIT_B, MULT_B = 0x8B51F9DD, 0x58F38DED
MIX_L, MIX_R = 0xCA01F9DD, 0x4973F715
POOL_SIZE = 4
SHIFT = 16
MASK = 0xFFFFFFFF


def words_of_seeds(seeds: Sequence[int]) -> NDArray[np.uint64]:
    """Return `SeedSequence(seed).generate_state(1, np.uint64)[0]` of each seed, (B,).

    Args:
        seeds: Integers >= 0; faster, as one array, if all are below 2^64.
    """
    try:
        return _first_words(np.array(seeds, np.uint64))
    except OverflowError:
        words = [np.random.SeedSequence(seed).generate_state(1, np.uint64)[0] for seed in seeds]
        return np.array(words, np.uint64)


def _first_words(seeds: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Return the first words of seeds (B,), by the algorithm of `SeedSequence` on arrays."""
    constant = INIT_A

    def hashed(value: NDArray[np.uint32]) -> NDArray[np.uint32]:
        nonlocal constant
        value = value ^ np.uint32(constant)
        constant = constant * MULT_A & MASK
        value *= np.uint32(constant)
        return value ^ (value >> np.uint32(SHIFT))

    def mixed(x: NDArray[np.uint32], y: NDArray[np.uint32]) -> NDArray[np.uint32]:
        value = x * np.uint32(MIX_L) - y * np.uint32(MIX_R)
        return value ^ (value >> np.uint32(SHIFT))

    entropy = [seeds.astype(np.uint32), (seeds >> np.uint64(32)).astype(np.uint32)]
    entropy += [np.zeros_like(entropy[0])] * (POOL_SIZE - len(entropy))
    pool = [hashed(word) for word in entropy]
    for source in range(POOL_SIZE):
        for target in range(POOL_SIZE):
            if source != target:
                pool[target] = mixed(pool[target], hashed(pool[source]))
    words = []
    constant = INIT_B
    for value in pool[:2]:
        value = value ^ np.uint32(constant)
        constant = constant * MULT_B & MASK
        value *= np.uint32(constant)
        words.append((value ^ (value >> np.uint32(SHIFT))).astype(np.uint64))
    return words[0] | words[1] << np.uint64(32)
