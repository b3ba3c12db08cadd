# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A domain, and a dashboard in it."""

from __future__ import annotations

import os
import re

import pytest
from browsers import browser, page  # noqa: F401
from rig import ENVIRONMENT, Rig, rig_of_module  # noqa: F401

os.environ.update(ENVIRONMENT)


@pytest.fixture(scope="module")
def address(rig: Rig) -> str:
    """Address of a page that shows the missions of the domain, with its token."""
    process = rig.start("dashboard", {"port": 0})
    served = rig.until(lambda: re.search(r"page at (\S+)", process.output), "a page")
    assert served is not None
    return served[1]


@pytest.fixture(scope="module")
def url(address: str) -> str:
    """The address without the token."""
    return address.partition("?")[0]
