# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Hostile messages on all topics while vehicles fly; node_fuzz.py can go on for longer."""

from __future__ import annotations

import pytest
from node_fuzz import attacks
from rig import Rig


@pytest.mark.slow
def test_no_message_ends_a_node_or_keeps_the_bridge_from_answering(rig: Rig) -> None:
    for attack in attacks(rig, seed=0):
        attack.run(600)
