# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A belief as a function of the looks of all steps and of what is known beside them.

Each step starts from the belief after the step before, so that a late report takes up the belief
at its own time and does the looks after it again. The result does not depend on the order in which
reports came, bit for bit.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

from dsse_ros.live.step_looks import AnyBelief, StepLooks

KEPT_BYTES = 1 << 25
"""Memory of the beliefs that are kept to start from."""
MOST_KEPT = 100


class Effects(Protocol):
    """What is known beside the looks."""

    def before(self, step: int, belief: AnyBelief) -> None:
        """Apply to a belief after `step` steps what was reported for then."""
        ...

    def look(self, step: int, belief: AnyBelief, done: StepLooks) -> None:
        """Apply the looks of the next step after `step` steps, before the sea advances."""
        ...


class Chain:
    """A belief that follows the steps.

    Args:
        start: Returns the belief at the start of the mission.
        steps: The looks of all steps so far; the caller appends to it.
        effects: What is known beside them.

    Attributes:
        belief: The belief now.
    """

    def __init__(
        self, start: Callable[[], AnyBelief], steps: Sequence[StepLooks], effects: Effects
    ) -> None:
        self._steps, self._effects = steps, effects
        belief = start()
        self._most = max(min(MOST_KEPT, KEPT_BYTES // max(belief.mass.layers.nbytes, 1)), 2)
        self._stride = 1
        # Beliefs after a number of steps, before what was reported for then; 0 is always there.
        self._kept = {0: belief}
        self.belief = belief
        self.update(0)

    def update(self, step: int) -> None:
        """Compute the belief again from this step, or from there on if there are further steps."""
        for later in [kept_step for kept_step in self._kept if kept_step > step]:
            del self._kept[later]
        begin = max(self._kept)
        belief = self._kept[begin].copy()
        for done in range(begin, len(self._steps)):
            self._effects.before(done, belief)
            self._effects.look(done, belief, self._steps[done])
            belief.advance()
            if (done + 1) % self._stride == 0 or done + 1 == len(self._steps):
                self._keep(done + 1, belief)
        self._effects.before(len(self._steps), belief)
        self.belief = belief

    def _keep(self, step: int, belief: AnyBelief) -> None:
        """Keep the latest belief, and some before it."""
        self._kept = {
            number: kept for number, kept in self._kept.items() if number % self._stride == 0
        }
        self._kept[step] = belief.copy()
        while len(self._kept) > self._most:
            self._stride *= 2
            self._kept = {
                number: kept
                for number, kept in self._kept.items()
                if number % self._stride == 0 or number == step
            }
