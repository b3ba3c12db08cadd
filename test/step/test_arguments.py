# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Compiled functions take the fields of the tuples that Python has, in their order."""

from __future__ import annotations

import inspect
from typing import Any

import pytest

from dsse_ros.belief import follow_kernels
from dsse_ros.step import kernels

OF_STEP = (*kernels.Sea._fields, *kernels.Crew._fields, *kernels.Scratch._fields)
OF_FOLLOWER = tuple(
    field
    for fields in ("Followed", "Tables", "Beliefs", "Scratch")
    for field in getattr(follow_kernels, fields)._fields
)
FUNCTIONS = [
    (kernels.step_worlds, OF_STEP),
    (kernels.reset_worlds, OF_STEP),
    (kernels.refresh_worlds, kernels.Sea._fields),
    (follow_kernels.follow_worlds, OF_FOLLOWER),
]


@pytest.mark.parametrize(
    ("function", "fields"), FUNCTIONS, ids=lambda one: getattr(one, "__name__", "")
)
def test_arguments_begin_with_the_fields_of_the_tuples(
    function: Any, fields: tuple[str, ...]
) -> None:
    names = tuple(inspect.signature(function.py_func).parameters)
    assert names[: len(fields)] == fields
