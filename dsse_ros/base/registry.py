# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Things by name: those of this package, and those that other packages register.

A package registers planners, sensors, searchers, motions and ensembles with entry points of the
groups `dsse_ros.planners`, `dsse_ros.sensors` and so on. In its setup.py, for example:

    entry_points={"dsse_ros.sensors": ["my_sensor = my_package.my_module:MY_SENSOR"]}
"""

from __future__ import annotations

import functools
import hashlib
import importlib.util
from collections.abc import Iterator, Mapping, MutableMapping
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any, Generic, TypeVar

from dsse_ros.base.defects import describe
from dsse_ros.base.fields import FieldError

T = TypeVar("T")


@functools.cache
def _installed() -> Any:
    """Read the metadata of all installed packages once: it takes a tenth of a second."""
    return entry_points()


def entries_of(noun: str) -> list[EntryPoint]:
    """Return what other packages register, such as each "planner", in the order of the names."""
    entries = _installed().select(group=f"dsse_ros.{noun}s")
    return sorted(entries, key=lambda entry: (entry.name, entry.value))


@functools.cache
def sources_of(noun: str) -> str:
    """Return the SHA-256 of what other packages register, with the code of their packages."""
    digest = hashlib.sha256()
    for entry in entries_of(noun):
        digest.update(f"{entry.name}={entry.value}\n".encode())
        spec = importlib.util.find_spec(entry.module.partition(".")[0])
        folders = (spec and spec.submodule_search_locations) or ()
        files = [file for folder in folders for file in sorted(Path(folder).rglob("*.py"))]
        for file in files or ([Path(spec.origin)] if spec and spec.origin else []):
            digest.update(file.read_bytes())
    return digest.hexdigest()


class Registry(MutableMapping[str, T], Generic[T]):
    """Things of one kind by name, those of this package first.

    A thing with an entry point is loaded when it is first asked for, so that a defective package
    concerns only those who use it. Other packages cannot replace what this one has.
    """

    def __init__(self, noun: str, kind: type, own: Mapping[str, T | EntryPoint]) -> None:
        """Read what is registered.

        Args:
            noun: What one is called, such as planner; the group has its plural.
            kind: The class of all of them.
            own: The things of this package.
        """
        self._noun = noun
        self._kind = kind
        others: dict[str, list[EntryPoint]] = {}
        for entry in entries_of(noun):
            if entry.name not in own:
                others.setdefault(entry.name, []).append(entry)
        self._things: dict[str, T | list[EntryPoint]] = {
            **{
                name: [thing] if isinstance(thing, EntryPoint) else thing
                for name, thing in own.items()
            },
            **others,
        }

    def __getitem__(self, name: str) -> T:
        """Return the thing of a name.

        Raises:
            KeyError: If there is none of that name.
            FieldError: If it is defective, or several packages register the name.
        """
        thing = self._things[name]
        if not isinstance(thing, list):
            return thing
        loaded = self._things[name] = self._load(name, thing)
        return loaded

    def _load(self, name: str, entries: list[EntryPoint]) -> Any:
        where = f"{self._noun}: {name!r}"
        if len(entries) > 1:
            values = ", ".join(entry.value for entry in entries)
            raise FieldError(f"{where} is registered more than once: {values}")
        (entry,) = entries
        try:
            found: Any = entry.load()
        except Exception as error:  # Third-party code may raise anything.
            raise FieldError(f"{where} cannot be loaded: {describe(error)}") from error
        if not isinstance(found, self._kind):
            names = f"{type(found).__name__}, not {self._kind.__name__}"
            raise FieldError(f"{where} cannot be loaded: {entry.value} is of the type {names}")
        return found

    def loaded(self) -> dict[str, T]:
        """Return all but the defective ones."""
        found = {}
        for name in self:
            try:
                found[name] = self[name]
            except FieldError:
                continue
        return found

    def __contains__(self, name: object) -> bool:
        return name in self._things

    def __iter__(self) -> Iterator[str]:
        return iter(self._things)

    def __len__(self) -> int:
        return len(self._things)

    def __setitem__(self, name: str, thing: T) -> None:
        self._things[name] = thing

    def __delitem__(self, name: str) -> None:
        del self._things[name]
