# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A specialized function does what the function does, without a look at its arguments' types."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
from numba import njit

from dsse_ros.compiled.overloads import specialized


@functools.cache
def summed() -> Any:
    """Return a compiled function of an array and a number."""
    return njit(lambda values, factor: values.sum() * factor)


def test_a_specialized_function_looks_up_no_types() -> None:
    values = np.arange(3.0)
    double = specialized(summed(), (values,), (1,))
    assert double(2) == summed()(values, 2) == 6.0
    values[0] = 1.0
    assert double(2) == 8.0
    assert double.func is summed().get_overload(summed().signatures[0])


def test_what_has_no_overloads_is_called_as_it_is() -> None:
    assert specialized(max, (3,), (1,))(5) == 5
