# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
# mypy: disable-error-code="no-untyped-def"
"""Random draws from a world's own generator: SplitMix64 (Steele et al. 2014)."""

from __future__ import annotations

import numpy as np

from dsse_ros.compiled.jit import part


def word_of_seed(seed: int) -> np.uint64:
    """Return the state that a seed, an integer >= 0, gives the generator of a world."""
    word: np.uint64 = np.random.SeedSequence(seed).generate_state(1, np.uint64)[0]
    return word


@part
def draw_bits(world):
    """Return the next 64 random bits of a world."""
    world.rng += np.uint64(0x9E3779B97F4A7C15)
    z = world.rng
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return z ^ (z >> np.uint64(31))


@part
def draw_below(world, n):
    """Return a random integer from 0 to n - 1, n < 2^32."""
    return np.int64(((draw_bits(world) >> np.uint64(32)) * np.uint64(n)) >> np.uint64(32))


@part
def draw_unit(world):
    """Return a random float in [0, 1)."""
    return np.float64(draw_bits(world) >> np.uint64(11)) * 2.0**-53
