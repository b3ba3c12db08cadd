# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Where optional dependencies and pages come from; this module imports none of them."""

from __future__ import annotations

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
    try:
        noted = metadata.distribution("dsse_ros").read_text("direct_url.json")
        url = str(json.loads(noted or "{}")["url"])
    except (metadata.PackageNotFoundError, KeyError, ValueError):
        url = ""
    folder = Path(unquote(urlsplit(url).path)) if url.startswith("file:") else None
    return str(folder) if folder and (folder / "setup.py").is_file() else "/path/to/the/clone"
