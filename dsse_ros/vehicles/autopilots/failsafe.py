# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The failsafes by which an autopilot takes its vehicle over."""

from __future__ import annotations

from enum import Enum


class Failsafe(Enum):
    """Why an autopilot flies its vehicle itself; the value is the word on topics and in texts."""

    BATTERY = "battery"
    """The battery is nearly empty."""
    GCS = "gcs"
    """It hears no ground station."""
    RADIO = "radio"
    """It hears no remote control."""
    EKF = "ekf"
    """It does not trust its estimate of the position."""
    GPS = "gps"
    """Its GPS is unhealthy."""
    MOTORS = "motors"
    """A motor has failed."""
    FENCE = "fence"
    """The vehicle has left its own fence."""
    OFFBOARD = "offboard"
    """Setpoints are missing: see `ModeWatch`."""
    CRITICAL = "critical"
    """One that it does not name."""
