# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The field of a scenario for where the truth about the persons comes from."""

from __future__ import annotations

from dataclasses import dataclass

from dsse_ros.base.fields import FieldError, field
from dsse_ros.world.scenario.rules import Rules

SIMULATED, NONE = "simulated", "none"
LIVE_POD = 0.5
"""POD of a look in a live search that states none: of 1, a look that finds nobody would exclude a
place, whatever was detected there."""


@dataclass(frozen=True, kw_only=True)
class TruthFields:
    """Whether the search simulates the persons."""

    truth: str = field(
        "str", "Where the persons are: simulated, or none for a live search, whose finds come from "
        "outside.", SIMULATED, choices=(SIMULATED, NONE),
    )  # fmt: skip

    @property
    def has_persons(self) -> bool:
        """Whether the search simulates the persons."""
        return self.truth == SIMULATED

    def pod_of(self, stated: float | None) -> float:
        """Return the POD of a look that is stated, or the default one."""
        if stated is not None:
            return stated
        return 1.0 if self.has_persons else LIVE_POD

    def check_truth(self, rules: Rules) -> None:
        """Check that the rules have persons who may be missing.

        Raises:
            FieldError: If there is no truth and the task is coverage.
        """
        if rules.covers and not self.has_persons:
            raise FieldError(
                f"truth must be {SIMULATED} with rules {rules.profile}, which have no persons, got "
                f"{self.truth!r}"
            )
