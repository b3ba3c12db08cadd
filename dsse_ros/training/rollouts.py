# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a learner sees of a rollout: the transitions in which drones act."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from sb3_contrib.common.maskable.buffers import (
    MaskableRolloutBuffer,
    MaskableRolloutBufferSamples,
)


class ActingRolloutBuffer(MaskableRolloutBuffer):
    """A rollout buffer of MaskablePPO that hands out no transition without an allowed action.

    `MaskablePPO(..., rollout_buffer_class=ActingRolloutBuffer)` on a `DroneVecEnv`: drones that are
    out of the search take no part in losses, nor in the mean and deviation of the advantages.
    """

    def get(  # type: ignore[override]
        self, batch_size: int | None = None
    ) -> Iterator[MaskableRolloutBufferSamples]:
        """Yield the transitions in random order, in batches of about the same size.

        Args:
            batch_size: The most of a batch; None for all at once.
        """
        if not self.generator_ready:
            # It makes of all arrays what `_get_samples` reads.
            next(super().get(1))
        indices: NDArray[np.int64] = np.flatnonzero(self.action_masks.any(axis=1))
        np.random.shuffle(indices)
        # Of equal size: of a last batch of one the deviation would be none.
        count = 1 if batch_size is None else -(-len(indices) // batch_size)
        for part in np.array_split(indices, max(count, 1)):
            if len(part):
                yield self._get_samples(part)
