# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A belief as a function of the looks of all steps and of what is known beside them.

Each step starts from the belief after the step before, so that a late report takes up the belief
at its own time and does the looks after it again. The result does not depend on the order in which
reports came, bit for bit.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from dsse_ros.mission.live.step_looks import AnyBelief, StepLooks
from dsse_ros.search.belief.ensemble_belief import EnsembleBelief

KEPT_BYTES = 1 << 25
"""Memory of the beliefs that are kept to start from."""
MOST_KEPT = 100
LEAST_PART = 1e-200
"""Probability of a contact below which it is 0: less could not be scaled to 1."""


@dataclass
class Posterior:
    """A belief, divided by the contact that is the person.

    Attributes:
        belief: The belief.
        parts: By contact, the probability of each place, as in the belief's density, together with
            the contact being the person; by None, with all detections being false alarms. They add
            up to the belief, and are empty before the first detection.
    """

    belief: AnyBelief
    parts: dict[str | None, NDArray[np.float64]] = field(default_factory=dict)

    def copy(self) -> Posterior:
        """Return an independent copy."""
        return Posterior(
            self.belief.copy(), {name: part.copy() for name, part in self.parts.items()}
        )

    def advance(self) -> None:
        """Advance the sea by one step."""
        for name, part in self.parts.items():
            total = part.sum()
            if isinstance(self.belief, EnsembleBelief):
                continue
            if total < LEAST_PART:
                self.parts[name] = np.zeros_like(part)
            else:
                moved = self.belief.copy()
                moved.density = part
                moved.advance()
                self.parts[name] = moved.density * total
        self.belief.advance()

    @property
    def nbytes(self) -> int:
        """Its memory."""
        return self.belief.mass.components.nbytes * (1 + len(self.parts))


class Effects(Protocol):
    """What is known beside the looks."""

    def before(self, step: int, posterior: Posterior) -> None:
        """Apply to a belief after `step` steps what was reported for then."""
        ...

    def look(self, step: int, posterior: Posterior, done: StepLooks) -> None:
        """Apply the looks of the next step after `step` steps, before the sea advances."""
        ...


class Chain:
    """A belief that follows the steps.

    It is computed when it is asked for, and again as far as it was invalidated.

    Args:
        start: Returns the belief at the start of the mission.
        steps: The looks of all steps so far; the caller appends to it.
        effects: What is known beside them.
    """

    def __init__(
        self, start: Callable[[], AnyBelief], steps: Sequence[StepLooks], effects: Effects
    ) -> None:
        self._start, self._steps, self._effects = start, steps, effects
        self.forget()

    def forget(self) -> None:
        """Free the memory: the belief is computed from the start when it is asked for again."""
        self._stride = 1
        # Beliefs after a number of steps, before what was reported for then.
        self._kept: dict[int, Posterior] = {}
        self._posterior: Posterior | None = None

    def invalidate(self, step: int) -> None:
        """Have the belief computed again from this step on."""
        self._posterior = None
        for later in [kept_step for kept_step in self._kept if kept_step > step]:
            del self._kept[later]

    @property
    def posterior(self) -> Posterior:
        """The belief now.

        Raises:
            ValueError: If its particles cannot be drawn.
        """
        if self._posterior is None:
            self._posterior = self._computed()
        return self._posterior

    def _computed(self) -> Posterior:
        if not self._kept:
            self._kept[0] = Posterior(self._start())
        begin = max(self._kept)
        posterior = self._kept[begin].copy()
        for done in range(begin, len(self._steps)):
            self._effects.before(done, posterior)
            self._effects.look(done, posterior, self._steps[done])
            posterior.advance()
            if (done + 1) % self._stride == 0 or done + 1 == len(self._steps):
                self._keep(done + 1, posterior)
        self._effects.before(len(self._steps), posterior)
        return posterior

    def _keep(self, step: int, posterior: Posterior) -> None:
        """Keep the latest belief, and some before it."""
        self._kept = {
            number: kept for number, kept in self._kept.items() if number % self._stride == 0
        }
        self._kept[step] = posterior.copy()
        most = max(min(MOST_KEPT, KEPT_BYTES // max(posterior.nbytes, 1)), 2)
        while len(self._kept) > most:
            self._stride *= 2
            self._kept = {
                number: kept
                for number, kept in self._kept.items()
                if number % self._stride == 0 or number == step
            }
