# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A rollout buffer that contains only the transitions of drones that act."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from sb3_contrib.common.maskable.buffers import (
    MaskableRolloutBuffer,
    MaskableRolloutBufferSamples,
)


class ActingRolloutBuffer(MaskableRolloutBuffer):
    """A rollout buffer of MaskablePPO without the transitions that allow no action.

    Pass it as `MaskablePPO(..., rollout_buffer_class=ActingRolloutBuffer)` for a `DroneVecEnv`.
    Drones that have left the search then affect neither losses nor the scale of the advantages.
    """

    def get(  # type: ignore[override]
        self, batch_size: int | None = None
    ) -> Iterator[MaskableRolloutBufferSamples]:
        """Yield the transitions in random order, in batches of about the same size.

        Args:
            batch_size: Largest size of a batch; None for one batch.
        """
        if not self.generator_ready:
            # This flattens the arrays for `_get_samples`.
            next(super().get(1))
        indices: NDArray[np.int64] = np.flatnonzero(self.action_masks.any(axis=1))
        np.random.shuffle(indices)
        # Batches of equal size, because a last batch of one would have no deviation.
        count = 1 if batch_size is None else -(-len(indices) // batch_size)
        for part in np.array_split(indices, max(count, 1)):
            if len(part):
                yield self._get_samples(part)
