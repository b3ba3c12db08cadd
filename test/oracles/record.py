# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Record golden traces of DSSE 0.1.13 or 1.1.9, in an environment where that package is installed.

Usage: python test/oracles/record.py {0.1.13,1.1.9} WHEEL [DIRECTORY]. See README.md beside it.
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path

import oracle_attributes
import oracle_coverage
import oracle_v1
import oracle_v2
import oracle_wrappers
from oracle_common import WHEELS, provenance, write_drift, write_json, write_maps


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("version", choices=sorted(WHEELS))
    parser.add_argument("wheel", type=Path, help="the wheel that is installed, from PyPI")
    parser.add_argument("directory", type=Path, nargs="?", default=Path(__file__).parent / "data")
    arguments = parser.parse_args()
    os.environ.setdefault("SDL_VIDEODRIVER", "dummy")

    prefix, oracle = {"0.1.13": ("v1", oracle_v1), "1.1.9": ("v2", oracle_v2)}[arguments.version]
    source = {
        what: provenance(arguments.version, arguments.wheel, what)
        for what in ("maps", "episodes", "person", "drift", "wrappers", "coverage", "attributes")
    }
    out = arguments.directory
    out.mkdir(parents=True, exist_ok=True)
    write_maps(out / f"{prefix}_maps.npz", source["maps"], oracle.record_maps())
    write_json(
        out / f"{prefix}_episodes.json",
        source["episodes"],
        "episodes",
        [oracle.play(script) for script in oracle.episodes()],
    )
    write_json(
        out / f"{prefix}_person.json", source["person"], "situations", oracle.record_person()
    )
    if prefix == "v2":
        write_drift(out / "v2_drift.npz", source["drift"], *oracle_v2.record_drift())
        oracle_wrappers.write(out / "v2_wrappers.npz", source["wrappers"])
        oracle_coverage.allow_without_opendrift()
        played = [oracle_coverage.play(script) for script in oracle_coverage.scripts()]
        write_json(out / "v2_coverage.json", source["coverage"], "episodes", played)
        oracle_attributes.write(out / "v2_attributes.json.gz", source["attributes"])


if __name__ == "__main__":
    main()
