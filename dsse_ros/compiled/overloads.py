# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Calls of a compiled function that skip Numba's look at the types of their arguments."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import Any

from numba import typeof


def specialized(
    function: Callable[..., Any], given: Sequence[Any], others: Sequence[Any]
) -> Callable[..., Any]:
    """Return a compiled function with its first arguments given, for one list of types.

    Numba looks up the types of all arguments in each call. For 25 of them that takes a tenth of the
    step of a small world.

    Args:
        function: What `kernel` returned.
        given: The first arguments.
        others: Examples of the other arguments. Those of a call must have the same types, data
            types and memory layouts; Numba no longer checks these.
    """
    # Numba does not document this method; without it each call looks up the types as usual.
    if hasattr(function, "get_overload"):
        signature = tuple(typeof(argument) for argument in (*given, *others))
        function.compile(signature)  # type: ignore[attr-defined]
        function = function.get_overload(signature)
    return functools.partial(function, *given)
