# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
# mypy: disable-error-code="no-untyped-def"
"""Random draws from a world's own generator: SplitMix64 (Steele et al. 2014)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.compiled.jit import part


def word_of_seed(seed: int) -> np.uint64:
    """Return the state that a seed, an integer >= 0, gives the generator of a world."""
    word: np.uint64 = np.random.SeedSequence(seed).generate_state(1, np.uint64)[0]
    return word


def words_of_seed(
    seed: int | Sequence[int | None] | np.random.SeedSequence | None, count: int
) -> tuple[NDArray[np.uint64], NDArray[np.bool_]]:
    """Return the states that a seed gives the generators of B worlds.

    Args:
        seed: A number s seeds world b with s + b. A sequence has one number per world; a world
            with None is not seeded. A `SeedSequence` gives every world one of its words. None
            does so with the system's entropy.
        count: B.

    Returns:
        The states (B,), and the worlds (B,) that are seeded.
    """
    every = np.ones(count, np.bool_)
    if seed is None:
        seed = np.random.SeedSequence()
    if isinstance(seed, np.random.SeedSequence):
        return np.asarray(seed.generate_state(count, np.uint64), np.uint64), every
    if isinstance(seed, int | np.integer):
        return np.array([word_of_seed(int(seed) + b) for b in range(count)], np.uint64), every
    words = [0 if number is None else word_of_seed(number) for number in seed]
    return np.array(words, np.uint64), np.array([number is not None for number in seed])


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
