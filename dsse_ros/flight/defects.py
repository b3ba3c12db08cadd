# SPDX-License-Identifier: Apache-2.0
"""Exceptions that nobody expected: each kind is logged once, with its traceback."""

from __future__ import annotations

import logging
import traceback

_logger = logging.getLogger(__name__)


class Defects:
    """What has gone wrong in one place of the program, so that the rest of it can go on.

    Args:
        name: Whose defects they are, for the log.
    """

    def __init__(self, name: str) -> None:
        self._name = name
        self._logged: set[tuple[type, str, int | None]] = set()

    def log(self, error: Exception) -> None:
        """Log an exception if it is new."""
        if self.is_new(error):
            _logger.error("%s: %s", self._name, describe(error), exc_info=error)

    def is_new(self, error: Exception) -> bool:
        """Return whether no exception of its type has come from the same line before."""
        frames = traceback.extract_tb(error.__traceback__)
        file, line = (frames[-1].filename, frames[-1].lineno) if frames else ("", 0)
        kind = (type(error), file, line)
        new = kind not in self._logged
        self._logged.add(kind)
        return new


def describe(error: Exception) -> str:
    """Return type and text of an exception."""
    return f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
