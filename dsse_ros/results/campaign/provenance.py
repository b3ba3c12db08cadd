# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Versions of libraries and hashes of files, which also affect a campaign's results."""

from __future__ import annotations

import hashlib
from collections.abc import Collection, Iterator, Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from dsse_ros.base.registry import entries_of
from dsse_ros.planners.registry import LOADED_PLANNERS

LIBRARIES = ("dsse_ros", "numpy", "numba")
"""Libraries that every campaign uses."""


def versions(used: Collection[str]) -> dict[str, str | None]:
    """Return the versions of the libraries that missions use; None if not installed.

    Args:
        used: Names of planners, sensors, kinds of drones and target models.
    """
    names = {*LIBRARIES}
    for planner in LOADED_PLANNERS.keys() & {*used}:
        names |= {*LOADED_PLANNERS[planner].libraries}
    for noun in ("planner", "sensor", "searcher", "motion", "ensemble"):
        found = (entry.dist for entry in entries_of(noun) if entry.name in used)
        names |= {dist.metadata["Name"] for dist in found if dist is not None}
    return {name: _version(name) for name in sorted(names)}


def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None


def files(planner: str, options: Mapping[str, Any]) -> dict[str, str]:
    """Return the SHA-256 of each file that an option of the planner names, by the option.

    Raises:
        OSError: If one cannot be read.
    """
    return {
        name: hashlib.sha256(path.read_bytes()).hexdigest()
        for name, path in _paths(planner, options)
    }


def _paths(planner: str, options: Mapping[str, Any]) -> Iterator[tuple[str, Path]]:
    if planner == "onnx" and not options.get("model"):
        # Without the extra, the campaign would have been refused already.
        from dsse_ros.planners.onnx import SHIPPED

        yield "model", SHIPPED
    for name, value in options.items():
        if isinstance(value, str) and value and (path := Path(value).expanduser()).is_file():
            yield name, path


def difference(name: str, there: Any, here: Any) -> str:
    """Return the differences in a part of a campaign's definition as text."""
    if name not in ("files", "versions") or not isinstance(there, dict):
        return name
    keys = [key for key in {**there, **here} if there.get(key) != here.get(key)]
    if name == "versions":
        return "versions: " + ", ".join(
            f"{key} {here.get(key)} in place of {there.get(key)}" for key in keys
        )
    return "files: " + ", ".join(keys)
