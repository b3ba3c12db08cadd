# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""How to install what is optional; nothing is imported that may be missing."""

from __future__ import annotations

import json
from importlib import metadata
from pathlib import Path
from urllib.parse import unquote, urlsplit


def pip_install(extra: str) -> str:
    """Return the command that installs an extra of this package."""
    return f"pip install '{_clone()}[{extra}]'"


def _clone() -> str:
    """Return the folder that pip has installed the package from, or one that says which it is.

    Its name alone would be that of whatever somebody puts on PyPI.
    """
    try:
        noted = metadata.distribution("dsse_ros").read_text("direct_url.json")
        url = str(json.loads(noted or "{}")["url"])
    except (metadata.PackageNotFoundError, KeyError, ValueError):
        url = ""
    folder = Path(unquote(urlsplit(url).path)) if url.startswith("file:") else None
    return str(folder) if folder and (folder / "setup.py").is_file() else "/path/to/the/clone"
