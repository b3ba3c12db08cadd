# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Tracks of another model, which an incident may have instead of its own drift."""

from __future__ import annotations

import base64
import os
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.fields import FieldError, shown
from dsse_ros.world.drift.flow import digest_of
from dsse_ros.world.drift.track_files import read_tracks


@dataclass(frozen=True, eq=False)
class ModelTracks:
    """Tracks of particles that another model has made.

    Attributes:
        times_s: (T,) float64, increasing, in seconds since 1970-01-01 UTC.
        lats_deg: (T, M) float32, WGS84.
        lons_deg: (T, M) float32.
    """

    times_s: NDArray[np.float64]
    lats_deg: NDArray[np.float32]
    lons_deg: NDArray[np.float32]

    def __eq__(self, other: object) -> bool:
        return isinstance(other, ModelTracks) and self.sha256 == other.sha256

    def __hash__(self) -> int:
        return hash(self.sha256)

    @cached_property
    def sha256(self) -> str:
        """Digest of the arrays; tracks with the same one are equal."""
        return digest_of((self.times_s, self.lats_deg, self.lons_deg))

    def to_dict(self) -> dict[str, Any]:
        """Return times as numbers, and positions row by row, little-endian, in base64."""
        positions = {"lats_deg": self.lats_deg, "lons_deg": self.lons_deg}
        return {"times_s": self.times_s.tolist()} | {
            name: base64.b64encode(values.astype("<f4").tobytes()).decode()
            for name, values in positions.items()
        }

    @classmethod
    def read(cls, value: Any, folder: str) -> ModelTracks:
        """Return the tracks of a file, or those of `to_dict`.

        Raises:
            ValueError: If the value is neither.
        """
        if isinstance(value, str):
            read = read_tracks(os.path.join(folder, value))
            return cls(
                read.times_s, read.lats_deg.astype(np.float32), read.lons_deg.astype(np.float32)
            )
        try:
            times_s = np.array(value["times_s"], np.float64)
            lats, lons = (
                np.frombuffer(base64.b64decode(value[name], validate=True), "<f4")
                .astype(np.float32)
                .reshape(len(times_s), -1)
                for name in ("lats_deg", "lons_deg")
            )
            fits = lats.shape == lons.shape and lats.size and (np.diff(times_s) > 0).all()
            fits = fits and np.isfinite(times_s).all() and np.isfinite(lats + lons).all()
        except (KeyError, TypeError, ValueError):
            fits = False
        if not fits:
            raise FieldError(
                f"incident.tracks must be a NetCDF file of OpenDrift, got {shown(value)}"
            )
        return cls(times_s, lats, lons)
