# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Compilation of the search: Numba's options and the dependencies of its cache.

Numba recompiles a function when its own module has changed, but not when a module has changed from
which it has a function that it calls or a constant. The functions compiled here depend on all
modules of this package that their own module imports, directly or not, and on the motions of other
packages, which are compiled in.

Numba's cache identifies a named tuple by its class, but compiled code finds its fields by position:
here the names of the fields, in order, are part of the key.

Processes that write to Numba's cache at once can store the code of one signature under the name of
another, and from then on all processes load the wrong code. A lock prevents that.
"""

from __future__ import annotations

import contextlib
import fcntl
import functools
import hashlib
import os
import re
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, Protocol, TypeVar

from numba import njit, types
from numba.core import config
from numba.core.config import reload_config

from dsse_ros.base.registry import sources_of as sources_of_packages
from dsse_ros.base.temporary import temporary_folder

_PACKAGE = Path(__file__).parents[2]

_IMPORT = re.compile(rb"^ *from dsse_ros((?:\.\w+)*) import (\([^)]*\)|[^\n]*)", re.MULTILINE)


def _modules(folder: Path, names: bytes) -> list[Path]:
    """Return the modules that an import from a module or package of this name reads."""
    if not folder.is_dir():
        return [folder.with_suffix(".py")]
    found = [folder / f"{name.decode()}.py" for name in re.findall(rb"\w+", names)]
    return [file if file.is_file() else folder / "__init__.py" for file in found]


@functools.cache
def _read(file: Path) -> tuple[bytes, list[Path]]:
    """Return the SHA-256 of a module and the modules of this package that it imports."""
    content = file.read_bytes()
    imported = [
        module
        for dotted, names in _IMPORT.findall(content)
        for module in _modules(_PACKAGE.joinpath(*dotted.decode().split(".")), names)
    ]
    return hashlib.sha256(content).digest(), imported


@functools.cache
def modules_of(file: Path) -> frozenset[Path]:
    """Return a module and all modules of this package that it imports, directly or not."""
    reached, new = {file}, [file]
    while new:
        new = [module for module in _read(new.pop())[1] if module not in reached] + new
        reached.update(new)
    return frozenset(reached)


@functools.cache
def sources_of(file: Path) -> str:
    """Return the SHA-256 of `modules_of` a module."""
    digests = [_read(module)[0] for module in sorted(modules_of(file))]
    return hashlib.sha256(b"".join(digests)).hexdigest()


def _locked(call: Callable[..., Any], folder: Path, kind: int) -> Callable[..., Any]:
    @functools.wraps(call)
    def locked(*args: Any) -> Any:
        folder.mkdir(parents=True, exist_ok=True)
        with open(folder / "dsse_ros.lock", "ab") as lock:
            fcntl.flock(lock, kind)
            return call(*args)

    return locked


def _tolerant(load_index: Callable[[], dict[Any, str]]) -> Callable[[], dict[Any, str]]:
    """Return a loader that treats an index with renamed classes as empty."""

    @functools.wraps(load_index)
    def load() -> dict[Any, str]:
        try:
            return load_index()
        except (AttributeError, ImportError):
            return {}

    return load


def fields_of(kinds: Iterable[Any]) -> tuple[Any, ...]:
    """Return the names of the fields of the named tuples among types, also of nested ones."""
    tuples: list[Any] = [kind for kind in kinds if isinstance(kind, types.BaseTuple)]
    return tuple((getattr(kind, "fields", ()), fields_of(kind.types)) for kind in tuples)


_Function = TypeVar("_Function", bound=Callable[..., Any])


class Compile(Protocol):
    """A decorator that compiles a function, which keeps its types."""

    def __call__(self, function: _Function, /) -> _Function:
        """Return the compiled function."""


def compiled(**options: Any) -> Compile:
    """Return a decorator that compiles a function once, and again when `modules_of` it change.

    Args:
        options: Options of `numba.njit` besides `cache` and `nogil`.
    """

    def compile_function(function: Callable[..., Any]) -> Any:
        # What is compiled here cannot be interpreted: records have no attributes in NumPy.
        disabled, config.DISABLE_JIT = config.DISABLE_JIT, 0  # type: ignore[attr-defined]
        try:
            return njit(cache=True, nogil=True, **options)(function)
        finally:
            config.DISABLE_JIT = disabled  # type: ignore[attr-defined]

    def decorate(function: Callable[..., Any]) -> Any:
        try:
            dispatcher = compile_function(function)
        except RuntimeError:
            # Numba can write neither beside the function nor below the user's home.
            os.environ["NUMBA_CACHE_DIR"] = str(temporary_folder() / "numba")
            reload_config()
            dispatcher = compile_function(function)
        # Numba has no option for this; without these attributes its cache works as usual.
        with contextlib.suppress(AttributeError):
            file = dispatcher._cache._cache_file
            folder = Path(dispatcher._cache.cache_path)
            file._load_index = _tolerant(file._load_index)
            file.load = _locked(file.load, folder, fcntl.LOCK_SH)
            file.save = _locked(file.save, folder, fcntl.LOCK_EX)
            sources = sources_of(Path(function.__code__.co_filename))
            motions = sources_of_packages("motion")
            file._source_stamp = (file._source_stamp, sources, motions)
            key_of = dispatcher._cache._index_key
            dispatcher._cache._index_key = lambda kinds, codegen: (
                *key_of(kinds, codegen),
                fields_of(kinds),
            )
        return dispatcher

    return decorate


# Without Numba's runtime (NRT) a function cannot make arrays and does not count references to them;
# counting took a third of the time of a small world.
_KERNEL: dict[str, Any] = {"_nrt": False}
_PART: dict[str, Any] = {**_KERNEL, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}

kernel = compiled(**_KERNEL)
"""Compiles functions that Python calls."""
part = compiled(**_PART)
"""Compiles functions that only compiled functions call, without the wrappers, which compile slowly.

One that returns arrays is for kernels and parts only, see `expanded`."""
inlined = compiled(**_PART, forceinline=True)
"""Inlines a function into its callers if calls would be slow."""
expanded = compiled(**_PART, inline="always")
"""Writes a function into its callers.

A function needs this if it returns a tuple with records, which Numba cannot return, or returns
arrays to a function with NRT, which would count references that nobody has counted before."""
