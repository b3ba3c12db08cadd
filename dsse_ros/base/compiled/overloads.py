# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Calls of a compiled function that look up the types of their arguments only once.

Numba looks them up in each call. For the tuples of a step that takes twice as long as the step of a
small world.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import typeof


def overload_of(function: Callable[..., Any], *arguments: Any) -> Callable[..., Any]:
    """Return a compiled function for arguments of the types of these.

    Args:
        function: What `kernel` returned.
        arguments: Examples. Those of a call must have the same types, data types and memory
            layouts; Numba does not check these.
    """
    # Numba does not document this method; without it each call looks up the types as usual.
    if not hasattr(function, "get_overload"):
        return function
    signature = tuple(typeof(argument) for argument in arguments)
    function.compile(signature)  # type: ignore[attr-defined]
    overload: Callable[..., Any] = function.get_overload(signature)
    return overload


class Specialized:
    """A compiled function for the types of its first call; see `overload_of` for those of others.

    Args:
        function: What `kernel` returned.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function
        self._overload: Callable[..., Any] | None = None

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), (self._function,)

    def __call__(self, *arguments: Any) -> Any:
        """Call the function."""
        if self._overload is None:
            self._overload = overload_of(self._function, *arguments)
        return self._overload(*arguments)
