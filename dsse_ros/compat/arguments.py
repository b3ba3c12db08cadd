# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Arguments under their published names."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from operator import index
from typing import Any, TypeVar

from dsse_ros.base.fields import FieldError

T = TypeVar("T")


def with_names(names: Mapping[str, str], make: Callable[[], T]) -> T:
    """Return the result of `make`; its errors name arguments as the caller knows them.

    Args:
        names: Our name, by published name.
        make: Raises a `FieldError` for a value that is not allowed.

    Raises:
        FieldError: As `make` does.
    """
    try:
        return make()
    except FieldError as error:
        published = {ours: name for name, ours in names.items()}
        # The message begins with the name of the field.
        raise FieldError(
            re.sub(r"^\w+", lambda field: published.get(field[0], field[0]), str(error))
        ) from None


def joint_action(actions: Mapping[str, Any], agents: list[str], count: int) -> list[int]:
    """Return the numbers of the actions of these agents.

    Raises:
        FieldError: If one is missing or not from 0 to count - 1.
    """
    numbers = []
    for agent in agents:
        if agent not in actions:
            raise FieldError(f"Missing action for {agent}")
        try:
            number = index(actions[agent])
        except TypeError:
            number = -1
        if not 0 <= number < count:
            raise FieldError(
                f"Invalid action for {agent}: {actions[agent]!r} is not from 0 to {count - 1}"
            )
        numbers.append(number)
    return numbers
