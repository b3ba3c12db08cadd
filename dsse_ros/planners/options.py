# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Options of the planners: their names, values and defaults, stated once as data.

They are checked wherever they come from: Python, the command line, ROS parameters or a campaign.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from dsse_ros.base.fields import FieldError, Spec, check_all, check_known, field, specs
from dsse_ros.planners.patterns import SearchPattern

if TYPE_CHECKING:
    from typing_extensions import Self

    from dsse_ros.world.scenario.scenario import Scenario


@dataclass(frozen=True, kw_only=True)
class Options:
    """The options of a planner; none by default.

    Raises:
        FieldError: If a value is not allowed.
    """

    def __post_init__(self) -> None:
        check_all(self)

    @classmethod
    def specs(cls) -> dict[str, Spec]:
        """Return what each option allows, by its name."""
        return specs(cls)

    @classmethod
    def checked(cls, planner: str, values: Mapping[str, Any]) -> Self:
        """Return the options of a planner.

        Args:
            planner: Its name.
            values: Values by name; the others have their defaults.

        Raises:
            FieldError: If a name is unknown or a value is not allowed.
        """
        check_known(f"planner {planner}", values, cls.specs(), noun="an option")
        return cls._made(planner, values)

    @classmethod
    def _made(cls, planner: str, values: Mapping[str, Any]) -> Self:
        return cls(**values)


PATTERNS: Mapping[str, str] = MappingProxyType(
    {"sweep": "PS", "creeping_line": "CS", "sector": "VS", "expanding_square": "SS"}
)
"""The `SearchPattern` that a planner flies if it has options."""


_NEEDED: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        **dict.fromkeys(("PS", "CS"), ("track_spacing", "length", "width")),
        "SS": ("track_spacing", "length"),
        "VS": ("length",),
    }
)
"""Options that each `SearchPattern` needs."""


@dataclass(frozen=True, kw_only=True)
class PatternOptions(Options):
    """Options of the planners of `PATTERNS`: the fields of `SearchPattern`, and its datum.

    Attributes:
        pattern: The pattern; None without options, for routes over the whole grid.
    """

    datum: tuple[int, int] | None = field(
        "cell", "Cell of the pattern's datum; by default the most probable cell at the first "
        "observation.", None,
    )  # fmt: skip
    pattern: SearchPattern | None = None

    @classmethod
    def specs(cls) -> dict[str, Spec]:
        """See `Options.specs`."""
        fields = {**specs(cls), **specs(SearchPattern)}
        del fields["pattern"]
        return fields

    @classmethod
    def _made(cls, planner: str, values: Mapping[str, Any]) -> Self:
        if not values:
            return cls()
        fields = {**values, "pattern": PATTERNS[planner]}
        needed = _NEEDED[fields["pattern"]]
        if missing := [name for name in needed if name not in values]:
            raise FieldError(
                f"a pattern of planner {planner} must have {', '.join(needed)}, got no "
                f"{', '.join(missing)}"
            )
        datum = fields.pop("datum", None)
        return cls(datum=datum, pattern=SearchPattern(**fields))


@dataclass(frozen=True, kw_only=True)
class BeliefOptions(Options):
    """Options of the planners on a belief."""

    learn_drift: bool = field(
        "bool", "Whether to learn the drift if the observed map is not the expected one.", True
    )


POS, POS_ALIVE = "pos", "pos_alive"
SAMPLES, OF_PARTICLES = 2048, 4096
"""Default of `BeamOptions.samples`, and for an ensemble: with fewer of its particles, plans are
worse."""


@dataclass(frozen=True, kw_only=True)
class BeamOptions(BeliefOptions):
    """Options of the beam search."""

    samples: int | None = field(
        "int", f"Scenarios drawn from the belief; by default {SAMPLES}, or {OF_PARTICLES} of an "
        "ensemble.", None,
        low=1, high=10**6,
    )  # fmt: skip
    horizon: int | None = field(
        "int", "Steps planned; by default 15, or 10 if each person has its own drift.", None,
        low=1, high=1000,
    )  # fmt: skip
    width: int = field("int", "Nodes kept at each step.", 32, low=1, high=10**5)
    gamma: float = field("float", "Discount of a find per step.", 0.95, low=0, high=1)
    kappa: float = field(
        "float", "Weight of the scenarios left at the end of a plan.", 0.2, low=0, high=1e6
    )
    maximise: str = field(
        "str", "What plans are for: the POS, or the probability to find the person alive, by the "
        "survival of the incident.", POS, choices=(POS, POS_ALIVE),
    )  # fmt: skip
    budget_ms: float | None = field(
        "float", "Wall time of a step after which no further drone plans; the others continue "
        "their last plans. The same seed then need not give the same mission.", None, low=0,
        high=1e9, unit="ms",
    )  # fmt: skip
    plan: str = field(
        "str", "File `plan.json` of a search plan, in metres: drones with the name of a unit fly "
        "its track, the others plan around what all units will have searched.", "",
    )  # fmt: skip

    def living(self, scenario: Scenario) -> bool:
        """Return whether only persons who are alive count, see `EnsembleBelief.of_living`.

        Raises:
            FieldError: If the incident has no survival curve for that.
        """
        incident = scenario.incident
        if self.maximise == POS_ALIVE and (incident is None or incident.survival is None):
            raise FieldError(
                f"maximise must be {POS} without a survival of the incident, got {POS_ALIVE!r}"
            )
        return self.maximise == POS_ALIVE


@dataclass(frozen=True, kw_only=True)
class OnnxOptions(Options):
    """Options of a trained policy."""

    model: str = field("str", "ONNX file, by default the model of this package.", "")
