# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""How the search is compiled: the options of Numba, and what its cache depends on.

Numba compiles a function anew when its own module has changed, not when that of a function it calls
has. What is compiled here calls across modules, so that it depends on all of them.
"""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

from numba import njit

_PACKAGE = Path(__file__).parents[1]

_FOLDERS = ("belief", "compiled", "step", "targets")
"""Those with compiled functions, and with what they depend on."""

MODULES = tuple(sorted(file for name in _FOLDERS for file in (_PACKAGE / name).glob("*.py")))

SOURCES = hashlib.sha256(b"".join(file.read_bytes() for file in MODULES)).hexdigest()


def compiled(**options: Any) -> Callable[[Callable[..., Any]], Any]:
    """Return a decorator that compiles a function, once until one of `MODULES` changes.

    Args:
        options: Of `numba.njit`, beside `cache` and `nogil`.
    """
    compile_function = njit(cache=True, nogil=True, **options)

    def decorate(function: Callable[..., Any]) -> Any:
        dispatcher = compile_function(function)
        # Numba has no option for it; without these attributes its cache stays as it is.
        with contextlib.suppress(AttributeError):
            file = dispatcher._cache._cache_file
            file._source_stamp = (file._source_stamp, SOURCES)
        return dispatcher

    return decorate


# Without Numba's own memory (NRT) a function cannot make arrays, and counts no references to them:
# that took a third of the time of a small world.
_KERNEL: dict[str, Any] = {"_nrt": False}
_PART: dict[str, Any] = {**_KERNEL, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}

kernel = compiled(**_KERNEL)
"""Compiles what Python calls."""
part = compiled(**_PART)
"""Compiles what only kernels call, without the wrappers that the compiler would take long over."""
inlined = compiled(**_PART, forceinline=True)
"""Compiles a part into its callers, where the call itself would take long."""
