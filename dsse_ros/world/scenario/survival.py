# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""How long people are expected to survive: a curve of the share alive, as planning aid.

No table is built in: published tables by water temperature state expected times or ranges of them,
and no share of people who are alive after some hours.
"""

from __future__ import annotations

import csv
import os
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.fields import FieldError, Spec, check_known, shown

NAME = "incident.survival"
ALLOWED = (
    "a CSV file with the columns hours and alive, or a mapping of both to lists: hours that "
    "increase from 0 or later, shares from 0 to 1 that never increase"
)
MOST_ROWS = 10_000
_COLUMNS = ("hours", "alive")


@dataclass(frozen=True)
class Survival:
    """The share of people who are alive some time after a particle's own time.

    It is 1 at first, changes evenly between the rows, and stays as it is after the last one.

    Attributes:
        hours: Increasing times.
        alive: The share alive at each; never greater than before.
    """

    hours: tuple[float, ...]
    alive: tuple[float, ...]

    @classmethod
    def read(cls, value: Any, folder: str = "") -> Survival:
        """Return the curve from a file, or from lists `hours` and `alive`.

        Args:
            value: As in YAML.
            folder: Folder to which the path is relative.

        Raises:
            FieldError: If it is neither.
        """
        stated = _of_file(os.path.join(folder, value)) if isinstance(value, str) else value
        if not isinstance(stated, Mapping):
            raise _refusal(value)
        check_known(NAME, stated, _COLUMNS)
        floats = Spec("floats", "")
        hours, alive = (floats.check(f"{NAME}.{name}", stated.get(name)) for name in _COLUMNS)
        fits = 1 <= len(hours) == len(alive) <= MOST_ROWS and hours[0] >= 0
        if not fits or min(alive) < 0 or max(alive) > 1:
            raise _refusal(value)
        if (np.diff(hours) <= 0).any() or (np.diff(alive) > 0).any():
            raise _refusal(value)
        return cls(hours, alive)

    def to_json(self) -> dict[str, list[float]]:
        """Return the lists `hours` and `alive`."""
        return {"hours": list(self.hours), "alive": list(self.alive)}

    def at(self, hours: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the share alive after these hours."""
        return np.interp(hours, *self._curve())

    def draw_s(self, count: int, rng: np.random.Generator) -> NDArray[np.float64]:
        """Return the seconds after which each of `count` people dies, infinite for survivors.

        Each share of the curve gets its people, rounded up or down, in a random order.
        """
        shares = rng.permutation((np.arange(count) + rng.random()) / count)
        hours, alive = self._curve()
        dies_h = np.interp(shares, alive[::-1], hours[::-1])
        return np.where(shares < alive[-1], np.inf, np.where(shares > alive[0], 0.0, dies_h * 3600))

    def _curve(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        hours, alive = np.array(self.hours), np.array(self.alive)
        if hours[0] > 0:
            hours, alive = np.insert(hours, 0, 0.0), np.insert(alive, 0, 1.0)
        return hours, alive


def _of_file(path: str) -> dict[str, list[float]]:
    try:
        with open(path, newline="", encoding="utf-8-sig") as file:
            rows = csv.DictReader(file, skipinitialspace=True)
            if [name.strip() for name in rows.fieldnames or ()] != list(_COLUMNS):
                raise _refusal(path)
            found = [[float(row[name]) for name in rows.fieldnames or ()] for row in rows]
    except OSError as error:
        raise FieldError(f"{NAME} must be {ALLOWED}, got {path!r}: {error.strerror}") from None
    except FieldError:
        raise
    except (TypeError, ValueError, csv.Error):
        raise _refusal(path) from None
    return {name: [row[column] for row in found] for column, name in enumerate(_COLUMNS)}


def _refusal(value: Any) -> FieldError:
    return FieldError(f"{NAME} must be {ALLOWED}, got {shown(value)}")
