# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Tables in the pages of the documentation, each between two comments."""

from __future__ import annotations

import re


def with_table(text: str, name: str, table: str) -> str:
    """Return a page with a Markdown table between the comments `name` and `end`."""
    place = re.compile(rf"(<!-- {re.escape(name)} -->\n).*?(<!-- end -->\n)", re.DOTALL)
    return place.sub(lambda found: f"{found[1]}\n{table.rstrip()}\n\n{found[2]}", text)
