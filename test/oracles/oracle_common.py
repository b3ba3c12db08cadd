# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the two recorders share: checksums of a map, provenance, files that diff well."""

from __future__ import annotations

import hashlib
import importlib.metadata
import json
import platform
import time
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

Json = dict[str, Any]

STEPS = 60
WHOLE = (0, 1, 2, 5, 20, 59)
STATISTICS = (
    "sum",
    "max",
    "sum_of_squares",
    "mean_col",
    "mean_row",
    "mean_col_times_row",
    "probe",
    "cells_above_zero",
    "cells_above_zero_as_float32",
)

WHEELS = {
    "0.1.13": "af67a7ad43984016b81eb9f255edba11e9e1c7d835cf1d1aa88d20025ea0bb0c",
    "1.1.9": "431e0a800e89fd8e7a43ecafb306df83217fa685cce2bb377ce64623a0074b2e",
}


def statistics(p: np.ndarray) -> list[float]:
    """Checksums of a map `p[row, col]`, in the order of `STATISTICS`, in float64.

    `probe` is the sum of p * w with w[row, col] = ((31 row + 17 col) mod 101) / 101: unlike the
    moments it has no symmetry, so a transposed or mirrored map changes it.
    """
    q = p.astype(np.float64)
    row, col = np.indices(q.shape)
    weights = ((31 * row + 17 * col) % 101) / 101
    return [
        float(q.sum()),
        float(q.max()),
        float((q * q).sum()),
        float((q * col).sum()),
        float((q * row).sum()),
        float((q * col * row).sum()),
        float((q * weights).sum()),
        float((q > 0).sum()),
        float((q.astype(np.float32) > 0).sum()),
    ]


def provenance(version: str, wheel: Path, what: str) -> Json:
    """Where a data file comes from.

    Raises:
        SystemExit: the wheel is not the published one, or what is installed is not that wheel.
    """
    digest = hashlib.sha256(wheel.read_bytes()).hexdigest()
    if digest != WHEELS[version]:
        raise SystemExit(f"{wheel.name}: sha256 {digest}, published {WHEELS[version]}")
    installed = importlib.metadata.distribution("DSSE")
    with zipfile.ZipFile(wheel) as archive:
        for name in archive.namelist():
            if (
                name.endswith(".py")
                and archive.read(name) != Path(str(installed.locate_file(name))).read_bytes()
            ):
                raise SystemExit(f"the installed {name} is not that of {wheel.name}")
    libraries = ("numpy", "numba", "pettingzoo", "gymnasium")
    versions = {d.metadata["Name"].lower(): d.version for d in importlib.metadata.distributions()}
    return {
        "what": what,
        "package": f"DSSE {version} from PyPI",
        "wheel": wheel.name,
        "wheel_sha256": digest,
        "python": platform.python_version(),
        "machine": platform.machine(),
        **{name: versions[name] for name in libraries if name in versions},
        "recorded": time.strftime("%Y-%m"),
        "command": f"python test/oracles/record.py {version} {wheel.name} test/oracles/data",
    }


def write_maps(path: Path, source: Json, cases: list[tuple[Json, dict[str, np.ndarray]]]) -> None:
    """Write the map cases: arrays `NN/name`, and `meta`, a JSON text with provenance and cases."""
    meta = {
        "provenance": source,
        "statistics": STATISTICS,
        "whole_maps_at": WHOLE,
        "cases": [case for case, _ in cases],
    }
    arrays: dict[str, Any] = {
        f"{n:02d}/{name}": array
        for n, (_, data) in enumerate(cases)
        for name, array in data.items()
    }
    np.savez_compressed(path, meta=np.array(json.dumps(meta)), **arrays)


def write_drift(path: Path, source: Json, cases: list[Json], datums: np.ndarray) -> None:
    """Write the datums, and `meta`, a JSON text with provenance and cases."""
    meta = {"provenance": source, "cases": cases}
    np.savez_compressed(path, meta=np.array(json.dumps(meta)), datum=datums)


def write_json(path: Path, source: Json, key: str, items: list[Json]) -> None:
    """Write `{"provenance": ..., key: [...]}` with one line per field and per step."""

    def line(value: Any) -> str:
        if isinstance(value, list) and value and isinstance(value[0], dict):
            return "[\n    " + ",\n    ".join(json.dumps(v) for v in value) + "\n   ]"
        return json.dumps(value)

    blocks = [
        "  {\n   " + ",\n   ".join(f"{json.dumps(k)}: {line(v)}" for k, v in item.items()) + "\n  }"
        for item in items
    ]
    path.write_text(
        f'{{\n "provenance": {json.dumps(source, indent=2)},\n "{key}": [\n'
        + ",\n".join(blocks)
        + "\n ]\n}\n",
        encoding="utf-8",
    )


def plain(value: Any) -> Any:
    """The same value in Python's own numbers, so that JSON keeps every bit."""
    return value.item() if isinstance(value, np.generic) else value
