# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Versions of libraries and hashes of files, which also affect a campaign's results."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Mapping
from importlib.metadata import PackageNotFoundError, entry_points, version
from pathlib import Path
from typing import Any

from dsse_ros.planners.registry import GROUP, LOADED_PLANNERS

LIBRARIES = ("dsse_ros", "numpy", "numba")
"""Libraries that every campaign uses."""


def versions(planners: Iterable[str]) -> dict[str, str | None]:
    """Return the versions of the libraries that these planners use; None if not installed."""
    names = {*LIBRARIES}
    for planner in planners:
        if planner in LOADED_PLANNERS:
            names |= {*LOADED_PLANNERS[planner].libraries}
        found = (entry.dist for entry in entry_points(group=GROUP, name=planner))
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
