# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Drift of objects at sea: leeway, wind and current, the shore, and tracks of many particles.

`tracks` drifts particles by `leeway` and a `Flow` of wind and of current until they reach the
`shore`; `track_files` reads those of OpenDrift. `flow_files` reads a `Flow` from forecasts, in four
steps:

1. open a file: `forecast_files`, by `netcdf` or `grib`;
2. find the pair: `velocity_pairs`, by `flow_names.csv`, `coordinates` and `levels`;
3. bring it to a grid: `flow_grids`, by `flow_times`, `projections`, `curvilinear` and `meshes`,
   which share `grids`; `units` are converted and `gaps` filled;
4. interpolate: `kernels`.
"""
