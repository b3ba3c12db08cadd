# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Where optional dependencies and pages come from; this module imports none of them."""

from __future__ import annotations

import contextlib
import json
import shlex
import sys
from importlib import metadata
from pathlib import Path
from urllib.parse import unquote, urlsplit


def pip_install(extra: str) -> str:
    """Return the command that installs an extra of this package for the running Python."""
    return f"{shlex.quote(sys.executable)} -m pip install '{_clone()}[{extra}]'"


def page(name: str) -> str:
    """Return the path of a page of the documentation, which is not installed."""
    return f"{_clone()}/docs/{name}"


def _clone() -> str:
    """Return the folder that pip installed the package from, or a placeholder for it.

    The package's name alone would install whatever somebody uploads to PyPI under it.
    """
    # A clone in which setup.py was called has metadata too, which come first there.
    for found in metadata.distributions(name="dsse_ros"):
        with contextlib.suppress(KeyError, ValueError):
            url = urlsplit(str(json.loads(found.read_text("direct_url.json") or "{}")["url"]))
            folder = Path(unquote(url.path))
            if url.scheme == "file" and (folder / "setup.py").is_file():
                return str(folder)
    return "/path/to/the/clone"
