# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""`make bench`: everything in one run on one machine, so that its ratios can be trusted."""

from __future__ import annotations

import argparse
import json
import os
import platform
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from benchmarks import (
    ROOT,
    belief_step,
    conversion,
    goals,
    lockstep,
    memory,
    plot,
    recorded,
    sea,
    seeding,
    speed,
    start_up,
)
from benchmarks.processes import BenchmarkError
from benchmarks.published import BASELINE, LIMIT, V1, V2, Unavailable, build, install, versions
from dsse_ros.base.progress_bar import progress, say

RESULTS = Path(__file__).with_name("results")
BUSY = 0.5


class Setup(NamedTuple):
    """What sections measure with.

    Attributes:
        quick: Whether the measurements are short.
        pythons: Pythons of the published packages by name.
        programs: C programs by name.
    """

    quick: bool
    pythons: Mapping[str, Path]
    programs: Mapping[str, Path]

    def rounds(self, quick: int, full: int) -> int:
        """Return the number of rounds."""
        return quick if self.quick else full

    @property
    def seconds(self) -> float:
        """Seconds of a round over ROS."""
        return 1.0 if self.quick else 2.5


SECTIONS: Mapping[str, Callable[[Setup], Any]] = {
    "speed": lambda setup: speed.measure(
        setup.pythons,
        setup.programs,
        cells=speed.QUICK_CELLS if setup.quick else speed.CELLS,
        rounds=setup.rounds(3, 6),
        seconds=0.1 if setup.quick else 0.15,
        log=_print,
    ),
    "seeding": lambda setup: seeding.measure(setup.rounds(3, 10)),
    "start_up": lambda setup: start_up.measure(setup.rounds(1, 2)),
    "memory": lambda setup: memory.measure(10**5 if setup.quick else 10**6),
    "conversion": lambda setup: conversion.measure(setup.rounds(30, 300)),
    "lockstep": lambda setup: lockstep.measure(
        rounds=setup.rounds(2, 5), seconds=setup.seconds, log=_print
    ),
    "belief_over_ros": lambda setup: lockstep.measure_belief(
        rounds=setup.rounds(2, 6), seconds=setup.seconds, log=_print
    ),
    "belief_step": lambda setup: belief_step.measure(rounds=setup.rounds(1, 3), log=_print),
    "sea": lambda setup: sea.measure(rounds=setup.rounds(2, 6), log=_print),
    "recorded": lambda setup: recorded.measure(
        rounds=setup.rounds(2, 6), seconds=setup.seconds, log=_print
    ),
}


def main(arguments: list[str] | None = None) -> int:
    """Measure, print, write the results and return the exit code; a missed goal is no failure."""
    options = _arguments(arguments)
    quick = options.quick
    options.build.mkdir(parents=True, exist_ok=True)
    out = options.out or (options.build if quick else RESULTS)
    out.mkdir(parents=True, exist_ok=True)
    pythons, programs = _baselines(options.build)
    setup = Setup(quick, pythons, programs)

    began = time.time()
    load = os.getloadavg()[0]
    if load > BUSY:
        _print(f"The machine is busy (load {load:.1f}): figures and ratios will be worse")
    figures: dict[str, Any] = {"speed": []}
    for name in progress(options.only or SECTIONS, "bench"):
        _print(f"\n{name.replace('_', '-')}")
        if name == "speed":
            _print(speed.heading())
        try:
            figures[name] = SECTIONS[name](setup)
        except (BenchmarkError, OSError) as error:
            _print(f"{name}: {error}")
    _print_others(figures)

    judged = goals.judge(figures)
    _print(f"\n{goals.table(judged)}")
    result = {
        "machine": machine(),
        "load_before": load,
        "load_after": os.getloadavg()[0],
        "versions": {
            "ours": own_versions(),
            **{name: versions(python) for name, python in pythons.items()},
        },
        "date": time.strftime("%Y-%m-%d", time.gmtime(began)),
        "seconds": round(time.time() - began),
        "quick": quick,
        "goals": judged,
        **figures,
    }
    path = out / "bench.json"
    path.write_text(json.dumps(rounded(result), indent=1) + "\n", encoding="utf-8")
    if figures["speed"]:
        plot.save(figures["speed"], out / "bench.png")
    _print(f"\n{result['seconds']} s; written to {path}")
    return 0


def machine() -> dict[str, Any]:
    """Return the conditions of the measurement."""
    return {
        "cpu": _cpu(),
        "cores": os.cpu_count(),
        "memory_gib": round(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30),
        "system": f"{platform.system()} {platform.release()} {platform.machine()}",
    }


def own_versions() -> dict[str, str]:
    """Return the versions in this environment."""
    from importlib.metadata import PackageNotFoundError, version

    found = {"python": platform.python_version()}
    for name in ("dsse_ros", "numpy", "numba", "gymnasium", "pettingzoo", "rclpy"):
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found


def rounded(value: Any) -> Any:
    """Return the value with floats rounded to five significant digits: timings have no more."""
    if isinstance(value, float):
        return float(f"{value:.5g}")
    if isinstance(value, dict):
        return {key: rounded(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [rounded(part) for part in value]
    return value


def _arguments(arguments: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="make bench", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="about 2 minutes instead of 10")
    parser.add_argument("--only", nargs="+", choices=SECTIONS, help="measure only these")
    parser.add_argument(
        "--build", type=Path, default=ROOT / ".venv" / "bench", help="for what is installed"
    )
    parser.add_argument("--out", type=Path, help="for results; a quick run's go to --build")
    return parser.parse_args(arguments)


def _baselines(folder: Path) -> tuple[dict[str, Path], dict[str, Path]]:
    """Return the available Pythons of the published packages, and the available C programs."""
    pythons: dict[str, Path] = {}
    programs: dict[str, Path] = {}
    for name, package in (("dsse_0_1_13", V1), ("dsse_1_1_9", V2)):
        try:
            pythons[name] = install(package, folder)
        except Unavailable as error:
            _print(str(error))
    for source in (BASELINE, LIMIT):
        try:
            programs[source.stem] = build(source, folder)
        except Unavailable as error:
            _print(str(error))
    return pythons, programs


def _print(line: str) -> None:
    say(line)


def _print_others(figures: dict[str, Any]) -> None:
    if "start_up" in figures:
        best = {kind: min(found) for kind, found in figures["start_up"].items()}
        _print(
            f"\nfirst step after {best['warm_s']:.2f} s with the compiler's cache, "
            f"{best['cold_s']:.1f} s without"
        )
    for name, found in figures.get("memory", {}).items():
        _print(f"memory {name:12} grows {found['growth_bytes_per_step']:.3f} bytes per step")
    for name, found in figures.get("conversion", {}).items():
        _print(
            f"OccupancyGrid 1000 x 1000, {name}: {1e3 * found['message_s']:.2f} ms; copying the "
            f"bytes {1e3 * found['copy_s']:.2f} ms"
        )


def _cpu() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    named = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return named[0] if named else platform.processor()


if __name__ == "__main__":
    sys.exit(main())
