# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Files that become unwritable during a mission."""

from __future__ import annotations

import resource
import shutil
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from dsse_ros.search.environments.snapshot import Snapshot
from soak.rigs import Sim, domain
from soak.row import Figures, Row, Run, zero
from soak.traffic import SEARCHED

STEPS = 5


@dataclass(frozen=True)
class Case:
    """A failure of the files of a mission.

    Attributes:
        happens: Causes it, given the simulation and the folder of its files.
        says: What the log contains once for each file.
        mended: Whether a later snapshot can be written again.
    """

    happens: Callable[[Sim, Path], None]
    says: dict[str, str]
    mended: bool = False


def limit_files(sim: Sim, folder: Path) -> None:
    """Prevent all files of the node from growing."""
    largest = max(path.stat().st_size for path in folder.iterdir())
    size = min(largest, (folder / "mission.csv").stat().st_size)
    resource.prlimit(sim.process.child.pid, resource.RLIMIT_FSIZE, (size, resource.RLIM_INFINITY))


def limit_for_a_while(sim: Sim, folder: Path) -> None:
    """Prevent files from growing for some steps, and then allow it again."""
    limit_files(sim, folder)
    fly(sim, STEPS)
    resource.prlimit(sim.process.child.pid, resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY,) * 2)


def remove_folder(sim: Sim, folder: Path) -> None:
    """Remove the folder with all its files."""
    while folder.exists():
        # The node may write a file into it meanwhile.
        with suppress(OSError):
            shutil.rmtree(folder)


def replace_by_file(sim: Sim, folder: Path) -> None:
    """Replace the folder with a file."""
    remove_folder(sim, folder)
    folder.write_text("")


def occupy_name(sim: Sim, folder: Path) -> None:
    """Put a folder in the path of the snapshot."""
    snapshot = folder / "mission.snapshot"
    while not snapshot.is_dir():
        # The node may write a new one between the two calls.
        snapshot.unlink(missing_ok=True)
        with suppress(FileExistsError):
            snapshot.mkdir()


def leave(sim: Sim, folder: Path) -> None:
    """Do nothing: the failure exists from the start."""


CASES = {
    "disk full": Case(
        limit_files, {"record_file": "File too large", "snapshot_file": "File too large"}
    ),
    "disk full for a while": Case(
        limit_for_a_while,
        {"record_file": "File too large", "snapshot_file": "File too large"},
        mended=True,
    ),
    "folder gone": Case(remove_folder, {"snapshot_file": "No such file or directory"}),
    "folder replaced": Case(replace_by_file, {"snapshot_file": "Not a directory"}),
    "name taken": Case(occupy_name, {"snapshot_file": "Is a directory"}),
    "device full": Case(leave, {"record_file": "No space left on device"}),
}
OF_START = {
    "record_file:=/sys/mission.csv": "record_file",
    "snapshot_file:=/sys/mission.snapshot": "snapshot_file",
    "record_file:=/proc/mission.csv": "record_file",
    "snapshot_file:=/proc/self/fd/mission": "snapshot_file",
}
"""Not even root can write there: the node refuses it at the start."""


def files_lost(run: Run) -> Figures:
    """Let missions write a log and snapshots, and then make that fail."""
    wrong: list[str] = []
    with domain(run.folder) as rig:
        cases, of_start = list(CASES)[:: run.size(1, 2)], list(OF_START)[:: run.size(1, 4)]
        for name in run.each(cases, "cases"):
            case = CASES[name]
            folder = run.folder / name.replace(" ", "_")
            folder.mkdir(parents=True)
            if name == "device full":
                (folder / "mission.csv").symlink_to("/dev/full")
            sim = rig.sim(
                SEARCHED
                | {
                    "grid_size": 12,
                    "num_drones": 3,
                    "record_file": str(folder / "mission.csv"),
                    "snapshot_file": str(folder / "mission.snapshot"),
                    "snapshot_every": 1,
                },
                namespace=f"/{folder.name}",
            )
            fly(sim, STEPS)
            case.happens(sim, folder)
            fly(sim, STEPS)
            wrong += [f"{name}: {what}" for what in faults(sim, case, folder)]
        for argument in of_start:
            field = OF_START[argument]
            process = rig.start("sim_node", {}, "-p", argument)
            if process.wait() != 2 or field not in process.output.splitlines()[-1]:
                wrong.append(f"{argument}: {process.output}")
    return {
        "cases": len(cases) + len(of_start),
        "wrong": len(wrong),
        "failures": wrong,
    }


def fly(sim: Sim, steps: int) -> None:
    """Make some steps."""
    for _ in range(steps):
        sim.fly(1, 2, 3)


def faults(sim: Sim, case: Case, folder: Path) -> list[str]:
    """Stop a node and return its faults."""
    found = []
    for field, reason in case.says.items():
        lines = [line for line in sim.process.output.splitlines() if f"{field}: " in line]
        if not lines or any(reason not in line for line in lines):
            found.append(f"{field} says {lines}, not {reason}")
        if field == "record_file" and len(lines) != 1:
            found.append(f"{len(lines)} lines of {field}")
    if case.mended and Snapshot.load(folder / "mission.snapshot").extra["number"] != 1:
        found.append("no snapshot again")
    sim.process.stop()
    return found + [
        f"{word} in the log"
        for word in ("Exception ignored", "Traceback")
        if word in sim.process.output
    ]


ROWS = (
    Row(
        "files_lost",
        "Disk full, folder read-only, taken away or without permission: a clear error, and the "
        "mission goes on",
        files_lost,
        "{cases} cases, {wrong} wrong",
        zero("wrong"),
    ),
)
