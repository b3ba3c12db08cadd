# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Steps per second of one script on DSSE 1.1.9 and, unchanged, on `dsse_ros.compat`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import ExitStack
from pathlib import Path
from statistics import median
from typing import Any

from benchmarks.baselines.published_script import STACKS
from benchmarks.processes import Process


def measure(
    pythons: Mapping[str, Path], *, rounds: int, seconds: float, log: Callable[[str], None]
) -> list[dict[str, Any]]:
    """Return the median rates of each stack of wrappers; both packages run in turn.

    Args:
        pythons: That of DSSE 1.1.9 under `dsse_1_1_9`; without it ours is measured alone.
        rounds: Number of measurements of both.
        seconds: Duration of each measurement.
        log: Prints a line.
    """
    found = []
    with ExitStack() as stack:
        processes = {"ours": stack.enter_context(Process("published_script"))}
        if "dsse_1_1_9" in pythons:
            theirs = Process("published_script", pythons["dsse_1_1_9"])
            processes["dsse_1_1_9"] = stack.enter_context(theirs)
        for name in STACKS:
            for whose, process in processes.items():
                process.set_up({"stack": name, "install_aliases": whose == "ours"})
            rates: dict[str, list[float]] = {whose: [] for whose in processes}
            for _ in range(rounds):
                for whose, process in processes.items():
                    rates[whose].append(process.rate(seconds))
            medians = {whose: median(measured) for whose, measured in rates.items()}
            found.append({"stack": name, "median": medians})
            line = ", ".join(f"{whose} {rate:.0f}/s" for whose, rate in medians.items())
            times = medians["ours"] / medians.get("dsse_1_1_9", medians["ours"])
            log(f"{name}: {line}, {times:.1f} times as fast")
    return found
