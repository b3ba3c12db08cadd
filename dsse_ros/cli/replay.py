# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""`ros2 run dsse_ros replay`: check whether the missions of a bag repeat.

The journal of a live search is computed again.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from dsse_ros.base.fields import FieldError
from dsse_ros.cli.command_line import Parser
from dsse_ros.mission.files.journal_repair import repair
from dsse_ros.mission.files.mission_journal import replayed as replayed_journal
from dsse_ros.mission.live.journal import is_journal
from dsse_ros.mission.recording.bag import read_bag
from dsse_ros.mission.recording.bag_replay import Replay, ReplayedMission
from dsse_ros.mission.run.status import counted
from dsse_ros.ros.runtime.exit_codes import FAILED, fail
from dsse_ros.world.scenario.limits import LARGEST_GRID_CELLS


def line(mission: ReplayedMission) -> str:
    """Return how the replay of a mission has gone, on one line."""
    where = "" if mission.namespace == "/" else f" in {mission.namespace.rstrip('/')}"
    head = f"mission {mission.number} of run {mission.run_id}{where}"
    if mission.seed is not None:
        head += f", seed {mission.seed}"
    steps = counted(mission.steps, "step")
    if mission.difference:
        return f"{head}: DIFFERS: {mission.difference}"
    parts = []
    if mission.compared:
        fewer = mission.fewer
        shown = [
            f"{name} ({fewer[name][0]} of {counted(fewer[name][1], 'message')})"
            if name in fewer else name
            for name in sorted(mission.compared)
        ]  # fmt: skip
        parts.append(f"{steps} repeat byte for byte in {', '.join(shown)}")
    if mission.incomplete:
        parts.append(f"not replayed {'any further' if mission.steps else ''}".rstrip())
        parts[-1] += f": {mission.incomplete}"
    elif not mission.ended:
        parts.append("the bag does not have its end")
    if mission.lost:
        parts.append(f"lost: {', '.join(mission.lost)}")
    return f"{head}: {'; '.join(parts)}"


def line_of_rest(not_compared: Mapping[str, tuple[int, int]]) -> str:
    """Return what was not compared, on one line; "" if everything was."""
    shown = [
        topic if left == total else f"{topic} ({left} of {counted(total, 'message')})"
        for topic, (left, total) in not_compared.items()
    ]
    return f"not compared: {', '.join(shown)}" if shown else ""


def _replay_journal(path: Path) -> int:
    """Print what the last mission of a journal comes to; return the exit code."""
    try:
        mission = replayed_journal(path, print)
    except FieldError as error:
        return fail("replay", error)
    if mission is None:
        return fail("replay", "no mission in the journal")
    inputs = ", ".join(counted(number, kind) for kind, number in sorted(mission.inputs.items()))
    print(
        f"mission {mission.number}: {counted(mission.steps, 'step')}, {inputs or 'no inputs'}: "
        f"POS {mission.pos:.4f}, belief sha256 {mission.sha256}"
    )
    return 0


def _repair_journal(path: Path, new: Path) -> int:
    """Write a copy of a damaged journal, and print what it lacks; return the exit code."""
    try:
        kept, lost = repair(path, new)
    except FieldError as error:
        return fail("replay", error)
    for missing in lost:
        print(missing)
    print(f"{counted(kept, 'record')} in {new}")
    return 0


def main(argv: Sequence[str] | None = None) -> int:
    """Run the program; returns its exit code.

    It is 0 if all missions repeat as far as they are recorded, 2 for bad input, 3 if one differs.
    """
    parser = Parser(prog="replay", description=__doc__.partition(": ")[2])
    parser.add_argument(
        "bag", type=Path, help="MCAP file, rosbag2 folder with MCAP files, or journal"
    )
    parser.add(
        "--max-cells",
        type=int,
        default=LARGEST_GRID_CELLS,
        help="number of cells of the largest grid to replay",
    )
    parser.add_argument(
        "--repaired",
        type=Path,
        metavar="NEW",
        help="write a copy of a damaged journal, without what is damaged, to this new file",
    )
    arguments = parser.parse_args(argv)
    if arguments.repaired:
        return _repair_journal(arguments.bag, arguments.repaired)
    if is_journal(arguments.bag):
        return _replay_journal(arguments.bag)
    replayed = different = 0
    notes: list[str] = []
    try:
        bag = Replay(read_bag(arguments.bag, notes.append), arguments.max_cells)
        for mission in bag.missions():
            print(line(mission), flush=True)
            replayed += bool(mission.compared)
            different += bool(mission.difference)
    except FieldError as error:
        return fail("replay", error)
    for note in filter(None, [line_of_rest(bag.not_compared), *notes]):
        print(note)
    if different:
        return FAILED
    if not replayed:
        return fail("replay", "no mission in the bag can be replayed")
    return 0


if __name__ == "__main__":
    sys.exit(main())
