# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""An array of a scenario, given in Python or as a file, and its reference by path and digest."""

from __future__ import annotations

import csv
import hashlib
import os
import stat
from abc import abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.defects import reason_of
from dsse_ros.base.fields import FieldError, shown
from dsse_ros.base.grid_shape import GridShape
from dsse_ros.world.scenario.rules import Rules
from dsse_ros.world.targets.registry import ENSEMBLES, MOTIONS, TargetModel

if TYPE_CHECKING:
    from typing_extensions import Self

    from dsse_ros.world.scenario.geodesy import Origin


OF_COVERAGE = ("probability_matrix",)
"""Arrays that a coverage task reads."""


@dataclass(frozen=True)
class ScenarioArray:
    """An array of numbers; arrays with the same digest are equal.

    Attributes:
        sha256: Digest of the given values in C order, float64, little-endian.
        path: Path of the file, "" for an array.
        values: float64, read-only.
    """

    sha256: str
    path: str = field(compare=False)
    values: NDArray[np.float64] = field(compare=False, repr=False)

    IN_MESSAGE: ClassVar[str] = "an object with path and sha256"
    IS_FILE: ClassVar[bool] = True

    NAME: ClassVar[str]
    """The field of the scenario."""
    ALLOWED: ClassVar[str]
    """The allowed values, for errors."""
    READERS: ClassVar[Mapping[str, Callable[[str], tuple[Any, ...]]]]
    """By suffix of the file: returns the arguments of `_made` after the path."""

    @classmethod
    def read(cls, value: Any) -> Self:
        """Return the array from an array, a file, or its `to_json`.

        Raises:
            FieldError: If the value is none of these, or the file cannot be read or has changed.
        """
        if isinstance(value, cls):
            return value
        try:
            if isinstance(value, Mapping):
                if value.keys() != {"path", "sha256"} or not value["path"]:
                    raise ValueError
                array = cls.read(str(value["path"]))
                if array.sha256 != value["sha256"]:
                    raise FieldError(
                        f"{cls.NAME} must be {array.path!r} with the SHA-256 "
                        f"{shown(value['sha256'])}, got a file with {array.sha256}"
                    )
                return array
            if isinstance(value, str | os.PathLike):
                path = os.path.abspath(os.fspath(value))
                if not stat.S_ISREG(os.stat(path).st_mode):
                    # Opening a pipe or a device, which a message may name, can take forever.
                    raise FieldError(f"{cls.NAME} must be a regular file, got {path!r}")
                reader = cls.READERS.get(suffix := Path(path).suffix.lower())
                if reader is None:
                    raise ValueError(f"its name ends in {suffix!r}")
                return cls._made(path, *reader(path))
            return cls._made("", np.asarray(value))
        except OSError as error:
            reason = error.strerror or "it cannot be read"
            raise FieldError(
                f"{cls.NAME} must be {cls.ALLOWED}, got {_named(value)}: {reason}"
            ) from None
        except FieldError:
            raise
        except (EOFError, MemoryError, OverflowError, TypeError, ValueError, csv.Error) as error:
            reason = f": {reason_of(error)}" if str(error) else ""
            raise FieldError(
                f"{cls.NAME} must be {cls.ALLOWED}, got {_named(value)}{reason}"
            ) from None

    @classmethod
    @abstractmethod
    def _made(cls, path: str, array: NDArray[Any]) -> Self:
        """Return the checked array."""

    @classmethod
    def may_be_sent(cls, value: Any) -> bool:
        """Return that a message may have a file, whose digest it states."""
        return True

    @property
    def identity(self) -> str:
        """The digest."""
        return self.sha256

    def to_text(self) -> str:
        """Return the path."""
        return self.path

    def to_json(self) -> dict[str, str]:
        """Return the path and the digest."""
        return {"path": self.path, "sha256": self.sha256}

    @property
    def grid(self) -> GridShape:
        """The shape of the grid that the array fits."""
        rows, columns = self.values.shape[:2]
        return GridShape(columns, rows)

    def on_grid(self, grid: GridShape, cell_size_m: float, origin: Origin) -> Self:
        """Return the array on the cells of a grid.

        Args:
            grid: Its shape.
            cell_size_m: Side of a cell.
            origin: The grid's south-west corner.

        Raises:
            FieldError: If it has another number of cells.
        """
        if self.grid != grid:
            raise FieldError(
                f"{self.NAME} must have {grid} cells, columns x rows as grid_size, got "
                f"{self.source} of {self.grid}"
            )
        return self

    @property
    def source(self) -> str:
        """The file, or "an array", for errors."""
        return shown(self.path) if self.path else "an array"


def check_use(name: str, rules: Rules) -> None:
    """Raise unless the rules have a use for an array.

    Args:
        name: Its field of the scenario.
        rules: The rules.

    Raises:
        FieldError: If they have none.
    """
    models: dict[str, TargetModel] = {**MOTIONS, **ENSEMBLES.loaded()}
    users = [motion for motion, model in models.items() if name in model.reads]
    covers = name in OF_COVERAGE
    if rules.person_motion in users or (covers and rules.covers):
        return
    allowed, got = f"person_motion {' or '.join(users)}", rules.person_motion
    if covers:
        allowed += " or the rules of a coverage task"
        got += f" in rules {rules.profile}"
    raise FieldError(f"{name} must come with {allowed}, got {got}")


def frozen(array: NDArray[Any]) -> tuple[str, NDArray[np.float64]]:
    """Return the digest of an array and a read-only copy of its values."""
    values = array.astype("<f8", order="C")
    values.flags.writeable = False
    return hashlib.sha256(values.data).hexdigest(), values


def _named(value: Any) -> str:
    """Return a value for a message, with the whole path of a file."""
    return repr(os.fspath(value)) if isinstance(value, str | os.PathLike) else shown(value)
