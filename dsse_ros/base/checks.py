# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The check of a number against its limits."""

from __future__ import annotations


def check_number(
    name: str, value: float, least: float, most: float, *, exclusive: bool = False
) -> None:
    """Check that a number is within its limits; NaN never is.

    Args:
        name: Name of the number, for the error.
        value: The number.
        least: Lower limit.
        most: Upper limit, which is allowed.
        exclusive: Whether the number must be greater than the lower limit.

    Raises:
        ValueError: If it is not.
    """
    if not least <= value <= most or (exclusive and value == least):
        limits = f"> {least:g} and <= {most:g}" if exclusive else f"{least:g} to {most:g}"
        raise ValueError(f"{name} must be {limits}, got {value!r}")
