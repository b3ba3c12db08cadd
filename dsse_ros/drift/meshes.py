# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Unstructured meshes, resampled once on a regular grid by linear interpolation in triangles.

The spacing of the grid is a quarter of the median distance of neighbouring points in the area.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.drift.coordinates import Place
from dsse_ros.drift.grids import elsewhere, lookup_axes
from dsse_ros.drift.kernels import degrees_per_metre
from dsse_ros.drift.netcdf import MAX_AT_ONCE, Unfit
from dsse_ros.drift.shore import Box

MAX_POINTS = 500_000
"""Points of a mesh in the area at most."""
NEIGHBOURS = 6
"""Points around a point of a mesh."""
LONGEST_SIDE = 4.0
"""Sides of a triangle at most, in distances of its points to the last of their neighbours: longer
ones cross land that the mesh does not hold."""

Array = NDArray[np.float64]


class Mesh(NamedTuple):
    """The part of a mesh in an area, and its places on a regular grid.

    Attributes:
        points: (N,) indices in the file, increasing.
        lats_deg: (Y,) latitudes of the grid.
        lons_deg: (X,) longitudes of the grid.
        corners: (Y, X, 3) numbers among `points`.
        weights: (Y, X, 3) weights of the corners; NaN off the mesh.
        all_lats_deg: Latitudes of the whole file.
        all_lons_deg: Its longitudes.
    """

    points: NDArray[np.int64]
    lats_deg: Array
    lons_deg: Array
    corners: NDArray[np.int64]
    weights: Array
    all_lats_deg: Array
    all_lons_deg: Array

    def resampled(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return values (N,) at the points as values (Y, X) on the grid."""
        return (values[self.corners] * self.weights).sum(axis=-1).astype(np.float32)


def mesh_of(place: Place, box: Box) -> Mesh:
    """Return the part of a mesh that holds a box.

    Raises:
        Unfit: If its points are too many, or it holds nothing of the box.
    """
    from scipy.spatial import Delaunay, QhullError, cKDTree

    if place.lat.size > MAX_AT_ONCE:
        raise Unfit(f"{place.lat.name} must have at most {MAX_AT_ONCE} values")
    lat, lon = (np.asarray(coordinate.values, np.float64) for coordinate in (place.lat, place.lon))
    (middle, centre), turned = box.middle_deg, box.turned(lon)
    # Triangles at the edge of the box have points beyond it.
    rows, cols = (0.2 * (high - low) for low, high in (box[:2], box[2:]))
    inside = (np.abs(lat - middle) < rows * 3.5) & (np.abs(turned - centre) < cols * 3.5)
    points = np.flatnonzero(inside)
    if len(points) < 4:
        raise elsewhere(box, lat, lon)
    if len(points) > MAX_POINTS:
        raise Unfit(f"mesh must have at most {MAX_POINTS} points in the area, got {len(points)}")
    scales = np.array(degrees_per_metre(middle))
    metres = (np.stack([lat[points], turned[points]], axis=-1) - [lat[points[0]], centre]) / scales
    near = cKDTree(metres).query(metres, k=min(NEIGHBOURS + 1, len(points)))[0]
    lats, lons = lookup_axes(box, max(float(np.median(near[:, 1:])) / 4, 1.0))
    try:
        triangles = Delaunay(metres)
    except (QhullError, ValueError):
        raise Unfit("mesh must have latitudes and longitudes that differ") from None
    wanted = np.stack(np.meshgrid(lats, lons, indexing="ij"), axis=-1)
    wanted = (wanted - [lat[points[0]], centre]) / scales
    number = triangles.find_simplex(wanted)
    affine = triangles.transform[number]
    two = np.einsum("...ij,...j->...i", affine[..., :2, :], wanted - affine[..., 2, :])
    weights = np.concatenate([two, 1.0 - two.sum(axis=-1, keepdims=True)], axis=-1)
    corners = triangles.simplices[number].astype(np.int64)
    sides = metres[corners] - np.roll(metres[corners], 1, axis=-2)
    longest = np.hypot(sides[..., 0], sides[..., 1]).max(axis=-1)
    off = (number < 0) | (longest > LONGEST_SIDE * near[corners, -1].max(axis=-1))
    if off.all():
        raise elsewhere(box, lat, lon)
    weights[off] = np.nan
    return Mesh(points, lats, lons, corners, weights, lat, lon)
