# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A specialized function does what the function does, without a look at its arguments' types."""

from __future__ import annotations

import functools
import pickle
from typing import Any

import numpy as np
from numba import njit

from dsse_ros.base.compiled.overloads import Specialized, overload_of
from dsse_ros.search.step.kernels import refresh_worlds


@functools.cache
def summed() -> Any:
    """Return a compiled function of an array and a number."""
    return njit(lambda values, factor: values.sum() * factor)


def test_a_specialized_function_looks_up_no_types() -> None:
    values = np.arange(3.0)
    call = Specialized(summed())
    assert call(values, 2) == summed()(values, 2) == 6.0
    values[0] = 1.0
    assert call(values, 2) == 8.0
    assert call._overload is overload_of(summed(), values, 3)
    assert call._overload is summed().get_overload(summed().signatures[0])


def test_what_has_no_overloads_is_called_as_it_is() -> None:
    assert overload_of(max, 3, 1) is max
    assert Specialized(max)(3, 5) == 5


def test_a_specialized_function_can_be_pickled_before_and_after_a_call() -> None:
    call = Specialized(max)
    for _ in range(2):
        assert pickle.loads(pickle.dumps(call))(3, 5) == call(3, 5) == 5
    pickle.loads(pickle.dumps(Specialized(refresh_worlds)))
