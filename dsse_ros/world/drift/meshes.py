# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Unstructured meshes, resampled once on a regular grid by linear interpolation in triangles.

The spacing of the grid is a quarter of the median distance of neighbouring points in the area.
"""

from __future__ import annotations

import numpy as np

from dsse_ros.world.drift.coordinates import Place
from dsse_ros.world.drift.grids import Mesh, elsewhere, lookup_axes
from dsse_ros.world.drift.kernels import degrees_per_metre
from dsse_ros.world.drift.netcdf import MAX_AT_ONCE, Unfit
from dsse_ros.world.drift.shore import Box

MAX_POINTS = 500_000
"""Points of a mesh in the area at most."""
NEIGHBOURS = 6
"""Points around a point of a mesh."""
LONGEST_SIDE = 4.0
"""Sides of a triangle at most, in distances of its points to the last of their neighbours: longer
ones cross land that the mesh does not hold."""


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
