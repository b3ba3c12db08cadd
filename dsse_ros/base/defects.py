# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Exceptions: what they say, and which unexpected ones are new."""

from __future__ import annotations

import traceback

_MOST = 200
"""Characters of a text that are shown."""


class Defects:
    """Unexpected exceptions in one part of a program, so that each kind is logged once."""

    def __init__(self) -> None:
        self._known: set[tuple[type, str, int | None]] = set()

    def is_new(self, error: Exception) -> bool:
        """Return whether no exception of its type has come from the same line before."""
        frames = traceback.extract_tb(error.__traceback__)
        file, line = (frames[-1].filename, frames[-1].lineno) if frames else ("", 0)
        kind = (type(error), file, line)
        new = kind not in self._known
        self._known.add(kind)
        return new


def reason_of(error: Exception) -> str:
    """Return the text of an exception on one line; its type if it has none."""
    return " ".join(str(error).split())[:_MOST] or type(error).__name__


def describe(error: Exception) -> str:
    """Return type and text of an exception on one line."""
    kind, reason = type(error).__name__, reason_of(error)
    return reason if reason == kind else f"{kind}: {reason}"
