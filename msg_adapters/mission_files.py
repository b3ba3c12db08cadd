# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Missions and their files, gathered from the modules that each have one part of them."""

from __future__ import annotations

from msg_adapters.mission_items import FIRMWARES, Home, Mission, MissionItem
from msg_adapters.plan_files import Plan, parse_plan, plan_text
from msg_adapters.track_missions import track_items, track_mission
from msg_adapters.waypoint_files import parse_qgc_wpl, qgc_wpl

__all__ = [
    "FIRMWARES",
    "Home",
    "Mission",
    "MissionItem",
    "Plan",
    "parse_plan",
    "parse_qgc_wpl",
    "plan_text",
    "qgc_wpl",
    "track_items",
    "track_mission",
]
