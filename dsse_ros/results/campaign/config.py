# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The missions of a campaign: planners x scenarios x seeds, from one YAML file."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar

from dsse_ros.base.fields import FieldError, check_all, check_known, field, shown, specs
from dsse_ros.mission.files.scenario_files import find_scenario
from dsse_ros.planners.registry import load_planner
from dsse_ros.results.campaign.provenance import files, versions
from dsse_ros.world.scenario.definition import SearchDefinition
from dsse_ros.world.scenario.limits import MAX_SEED
from dsse_ros.world.scenario.rules import AUTO, Rules
from dsse_ros.world.scenario.scenario import FILES, ResolvedScenario, Scenario, scenario_and_rules
from dsse_ros.world.scenario.scenario_identity import identity_of, plain
from dsse_ros.world.scenario.truth_fields import SIMULATED
from dsse_ros.world.scenario.yaml_file import read_yaml

MAX_MISSIONS = 10**8
T = TypeVar("T", "PlannerEntry", "Case")


@dataclass(frozen=True)
class PlannerEntry:
    """A planner of a campaign.

    Attributes:
        options: Options of the planner.
    """

    planner: str = field("str", "Planner of this package, or of one that registers it.")
    name: str = field("str", "Name in the results; by default the planner's.", "")
    planner_seeds: int | None = field(
        "int",
        "Number of planner seeds, which missions use in turn; by default each mission has its own. "
        "Missions that share a seed are fast, but count as one in the intervals.",
        None, low=1, high=MAX_MISSIONS,
    )  # fmt: skip
    options: Mapping[str, Any] = dataclasses.field(default_factory=dict)

    def __post_init__(self) -> None:
        check_all(self)
        object.__setattr__(self, "name", self.name or self.planner)
        if not isinstance(self.options, Mapping):
            raise FieldError(f"options must be names and values, got {shown(self.options)}")
        check_known("the options", [k for k in self.options if not isinstance(k, str)], ())
        for name, value in self.options.items():
            try:
                plain(value)
            except (TypeError, ValueError):
                raise FieldError(
                    f"option {name} must be a number, a text, an array, or lists or mappings of "
                    f"them, got {shown(value)}"
                ) from None


@dataclass(frozen=True)
class Case:
    """A scenario of a campaign, with its derived values.

    Attributes:
        name: Name in the results.
        scenario: The scenario.
        rules: Rules of the search.
    """

    name: str
    scenario: ResolvedScenario
    rules: Rules

    @property
    def limit_s(self) -> float:
        """The mission time at the step limit."""
        return self.scenario.timestep_limit * self.scenario.step_duration_s


@dataclass(frozen=True)
class CampaignSettings:
    """The single values of a campaign's file."""

    name: str = field("str", "Title of the report.", "Campaign")
    seed: int = field("int", "Seed of the first mission.", 0, low=0, high=MAX_SEED)
    missions: int = field(
        "int", "Missions of each planner in each scenario.", 1000,
        low=1, high=MAX_MISSIONS,
    )  # fmt: skip
    chunk: int = field(
        "int", "Missions to play and write together.", 500, low=1, high=MAX_MISSIONS,
    )  # fmt: skip
    engine: str = field("str", "Local processes, or Ray.", "local", choices=("local", "ray"))
    workers: int = field(
        "int", "Number of local processes; 0 for one per core.", 0, low=0, high=4096
    )
    address: str = field(
        "str", "Ray cluster, `host:port`; `auto` for that of this machine.", "auto"
    )
    horizon_s: float | None = field(
        "float", "Horizon of the restricted time to detection; by default the step limit.",
        None, above=0, unit="s",
    )  # fmt: skip
    pos_at_s: tuple[float, ...] | None = field(
        "floats", "Times of the POS; by default quarters of the step limit.", None,
        above=0, unit="s",
    )  # fmt: skip
    confidence: float = field(
        "float", "Confidence level of the intervals.", 0.95, low=0.5, high=0.9999
    )

    def __post_init__(self) -> None:
        check_all(self)


ENTRIES = ("planners", "scenarios")
_OF_RESULTS = ("seed", "missions", "chunk")
"""Settings that decide which missions are played and in which chunks."""


@dataclass(frozen=True)
class Chunk:
    """Missions that are played and written together.

    Attributes:
        number: Number of the chunk, from 0.
        planner: Number of the planner in the campaign.
        case: Number of the case in the campaign.
        first: Number of the first mission of that planner in that case.
        count: Number of missions.
    """

    number: int
    planner: int
    case: int
    first: int
    count: int


@dataclass(frozen=True)
class Campaign:
    """Planners x scenarios x seeds."""

    settings: CampaignSettings
    planners: tuple[PlannerEntry, ...]
    cases: tuple[Case, ...]

    @classmethod
    def from_yaml(cls, path: str | os.PathLike[str]) -> Campaign:
        """Return the campaign of a YAML file; its paths are relative to its folder.

        Raises:
            FieldError: If the file cannot be read, is not YAML, or does not fit.
        """
        try:
            values = read_yaml(path)
            return cls.from_dict({} if values is None else values, Path(path).parent)
        except FieldError as error:
            raise FieldError(f"campaign {os.fspath(path)!r}: {error}") from None

    @classmethod
    def from_dict(cls, values: Any, folder: Path = Path()) -> Campaign:
        """Return the campaign with these fields.

        Args:
            values: As in the YAML file.
            folder: Folder that paths of scenarios are relative to.

        Raises:
            FieldError: If a field is unknown or a value is not allowed.
        """
        if not isinstance(values, Mapping):
            raise FieldError("a campaign must be a mapping of field names to values")
        check_known("a campaign", values, [*specs(CampaignSettings), *ENTRIES])
        single = {k: v for k, v in values.items() if k not in ENTRIES}
        campaign = cls(
            CampaignSettings(**single),
            _entries(values, "planners", _planner_of),
            _entries(values, "scenarios", lambda value: _case_of(value, folder)),
        )
        for number, case in enumerate(campaign.cases):
            search = SearchDefinition(case.rules, case.scenario)
            for entry in campaign.planners:
                try:
                    load_planner(entry.planner)(search, seed=0, **entry.options)
                except (TypeError, ValueError) as error:
                    where = f"planners: {entry.name!r} in scenarios[{number}] {case.name!r}"
                    raise FieldError(f"{where}: {error}") from None
        return campaign

    def chunks(self) -> list[Chunk]:
        """Return all chunks, in the order of the results."""
        missions, size = self.settings.missions, self.settings.chunk
        places = [
            (planner, case, first, min(size, missions - first))
            for case in range(len(self.cases))
            for planner in range(len(self.planners))
            for first in range(0, missions, size)
        ]
        return [Chunk(number, *place) for number, place in enumerate(places)]

    def _used(self) -> set[str]:
        """Return the names of what other packages may have registered."""
        used = {entry.planner for entry in self.planners}
        for case in self.cases:
            sensors = {kind.sensor for kind in case.scenario.kinds if kind.sensor is not None}
            used |= {case.rules.person_motion, *case.scenario.searchers, *sensors}
        return used

    @cached_property
    def definition(self) -> dict[str, Any]:
        """Everything that determines the results, as JSON values."""
        values: dict[str, Any] = {
            "versions": versions(self._used()),
            "files": {
                f"{name} of {entry.name}": digest
                for entry in self.planners
                for name, digest in files(entry.planner, entry.options).items()
            },
            **{name: getattr(self.settings, name) for name in _OF_RESULTS},
            "planners": [dataclasses.asdict(entry) for entry in self.planners],
            "scenarios": [
                {
                    "name": case.name,
                    "cells": _digest_of_area(case.scenario),
                    **identity_of(case.scenario, case.rules),
                }
                for case in self.cases
            ],
        }
        definition: dict[str, Any] = plain(values)
        return definition

    @property
    def digest(self) -> str:
        """SHA-256 of `definition`."""
        text = json.dumps(self.definition, sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()


def _digest_of_area(scenario: ResolvedScenario) -> str | None:
    mask = scenario.area_mask
    return None if mask is None else hashlib.sha256(mask.tobytes()).hexdigest()


def _entries(values: Mapping[str, Any], key: str, make: Callable[[Any], T]) -> tuple[T, ...]:
    """Return the entries of a list in the file, which must have unique names."""
    items = values.get(key)
    if not isinstance(items, Sequence) or isinstance(items, str) or not items:
        raise FieldError(f"{key} must be a list of one or more, got {shown(items)}")
    entries: list[T] = []
    for number, item in enumerate(items):
        try:
            entry = make(item)
            if entry.name in [other.name for other in entries]:
                raise FieldError(f"name must be unique, got {entry.name!r} twice")
        except FieldError as error:
            raise FieldError(f"{key}[{number}]: {error}") from None
        entries.append(entry)
    return tuple(entries)


def _planner_of(value: Any) -> PlannerEntry:
    if not isinstance(value, Mapping):
        value = {"planner": value}
    check_known("a planner", value, [field.name for field in dataclasses.fields(PlannerEntry)])
    if "planner" not in value:
        raise FieldError("planner is missing")
    load_planner(value["planner"])
    return PlannerEntry(**value)


def _case_of(value: Any, folder: Path) -> Case:
    """Return a scenario: a name or a file, or fields with `scenario` and `rules` among them."""
    fields = dict(value) if isinstance(value, Mapping) else {"scenario": value}
    source, rules = fields.pop("scenario", None), fields.pop("rules", AUTO)
    check_known("a scenario", [k for k in fields if not isinstance(k, str)], specs(Scenario))
    path = None
    if source is not None:
        if not isinstance(source, str):
            raise FieldError(f"scenario must be a YAML file or a name, got {shown(source)}")
        beside = folder / source
        path = beside.resolve() if beside.is_file() else find_scenario(source)
    for name in FILES:
        if isinstance(fields.get(name), str) and fields[name]:
            fields[name] = str(folder / fields[name])
    scenario, chosen = scenario_and_rules(path, rules, **fields)
    resolved = scenario.resolve(chosen)
    if not resolved.has_persons:
        raise FieldError(f"truth must be {SIMULATED} in a campaign, got {resolved.truth!r}")
    columns, rows = resolved.grid_size
    named = f"{columns}" if columns == rows else f"{columns}x{rows}"
    name = resolved.name or (path.stem if path else f"{chosen.profile}_{named}")
    return Case(name, resolved, chosen)
