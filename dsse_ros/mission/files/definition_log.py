# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The file beside a mission log that states the search and the seed of each mission.

It is JSON Lines: a line for each mission, with `mission`, its number, `seed` and, where it is
another one than that of the line before, `definition`: `rules` and `scenario` as in the topic
`agents`. If a mission has several lines, the last one counts.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

from dsse_ros.base.json_reader import read_json
from dsse_ros.mission.run.mission import Mission
from dsse_ros.world.scenario.agents import definition_values
from dsse_ros.world.scenario.definition import SearchDefinition
from dsse_ros.world.scenario.json_keys import Keys


def definition_file(path: str | os.PathLike[str]) -> Path:
    """Return the file beside a log."""
    return Path(f"{os.fspath(path)}.jsonl")


class DefinitionLog:
    """Appends a line for each mission, before its first row is in the log.

    Raises:
        OSError: If it cannot be written.
    """

    def __init__(self, path: str | os.PathLike[str], *, resume: bool) -> None:
        self._path = definition_file(path)
        self._file = self._path.open("a+b" if resume else "w+b")
        self._last: dict[str, Any] = {}
        self._definition: SearchDefinition | None = None
        if resume:
            self._take_up()

    def _take_up(self) -> None:
        """Note the last whole line; drop one that was cut off."""
        self._file.seek(0)
        complete, _, _ = self._file.read().rpartition(b"\n")
        self._file.truncate(len(complete) + bool(complete))
        for line in complete.splitlines():
            # What cannot be read is written again.
            try:
                self._last = {**self._last, **read_json(line, self._path.name)}
            except (ValueError, TypeError):
                self._last = {}

    def write(self, mission: Mission) -> None:
        """Append the line of a mission, unless it is there already.

        Raises:
            OSError: If it cannot be written.
        """
        line: dict[str, Any] = {"mission": mission.number, "seed": mission.seed}
        definition = SearchDefinition(mission.env.rules, mission.env.mission_scenario)
        if definition != self._definition:
            self._definition = definition
            values = json.loads(json.dumps(definition_values(definition), allow_nan=False))
            if values != self._last.get("definition"):
                line["definition"] = values
        if any(self._last.get(name) != value for name, value in line.items()):
            text = json.dumps(line, sort_keys=True, allow_nan=False)
            self._file.write(text.encode() + b"\n")
            self._file.flush()
        self._last.update(line)

    def sync(self) -> None:
        """Flush the file to disk."""
        os.fsync(self._file.fileno())

    def close(self) -> None:
        """Close the file."""
        self._file.close()


def read_definitions(path: str | os.PathLike[str]) -> dict[int, tuple[Keys, int]]:
    """Return the definition and the seed of each mission of a log by its number.

    Raises:
        OSError: If the file beside it cannot be read.
        ValueError: If a line is not as in the module; one line that names it.
    """
    file = definition_file(path)
    found: dict[int, tuple[Keys, int]] = {}
    definition: Keys | None = None
    for number, text in enumerate(file.read_text(encoding="utf-8").splitlines(keepends=True), 1):
        if not text.endswith("\n"):
            # It was cut off before any row of its mission was written.
            break
        where = f"{file.name}, line {number}"
        keys = Keys(read_json(text, where), where)
        if definition is None or keys.has("definition"):
            definition = keys.inner("definition")
        found[keys.integer("mission", 1)] = definition, keys.integer("seed", 0)
    return found
