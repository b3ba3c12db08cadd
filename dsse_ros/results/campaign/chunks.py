# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Plays chunks of missions, and stores them so that they survive kills.

A chunk is written under another name, synced to the disk and renamed, so that its file is complete
or absent. So each mission is in the results exactly once, whenever a campaign is killed.
"""

from __future__ import annotations

import fcntl
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import IO, Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray
from pyarrow import csv

from dsse_ros.base.fields import FieldError
from dsse_ros.base.json_reader import read_json
from dsse_ros.base.whole_files import PART, write_whole
from dsse_ros.planners.batch import play_missions
from dsse_ros.results.campaign.config import Campaign, Case, Chunk, PlannerEntry
from dsse_ros.results.campaign.provenance import difference

COLUMNS = pa.schema(
    [
        ("planner", pa.string()),
        ("scenario", pa.string()),
        ("seed", pa.int64()),
        ("planner_seed", pa.int64()),
        ("found", pa.bool_()),
        ("steps", pa.int64()),
        ("time_s", pa.float64()),
        ("path_length_m", pa.float64()),
        ("collisions", pa.int64()),
        ("drones_lost", pa.int64()),
    ]
)
"""Columns of the results, one row for each mission; `planner_seed` is null if the planner drew
nothing."""
MANIFEST, CHUNKS, LOCK = "campaign.json", "chunks", "campaign.lock"

Columns = dict[str, NDArray[Any]]
"""Results of the missions of a chunk: `found` bool, `steps`, `lost`, `collisions`,
`planner_seeds` int64 and `path_length_m` float64, (M,) each."""
Job = tuple[Chunk, PlannerEntry, Case, int]
"""A chunk, with its planner, its scenario and the seed of the campaign."""


def job(campaign: Campaign, chunk: Chunk) -> Job:
    """Return all that is needed to play a chunk anywhere."""
    return (
        chunk, campaign.planners[chunk.planner], campaign.cases[chunk.case], campaign.settings.seed
    )  # fmt: skip


def play(played_job: Job) -> Columns:
    """Play the missions of a chunk; the result is the same each time, on any machine."""
    chunk, entry, case, seed = played_job
    dealt = None
    if (seeds := entry.planner_seeds) is not None:
        dealt = [n % seeds for n in range(chunk.first, chunk.first + min(chunk.count, seeds))]
    missions = play_missions(
        chunk.count, entry.planner, case.scenario, rules=case.rules, seed=seed + chunk.first,
        planner_seeds=dealt, options=entry.options,
    )  # fmt: skip
    return dict(vars(missions))


class Results:
    """The folder of a campaign.

    Only one process may use a folder at a time. The context manager releases it.

    Args:
        folder: An existing folder.

    Raises:
        FieldError: If the folder belongs to another campaign, or is in use.
    """

    def __init__(self, folder: Path, campaign: Campaign) -> None:
        self._folder, self._campaign = folder, campaign
        self._lock: IO[str] = (folder / LOCK).open("w")
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            self._lock.close()
            raise FieldError(f"out: {str(folder)!r} is in use by another campaign") from None
        try:
            self._open()
        except BaseException:
            self._lock.close()
            raise

    def __enter__(self) -> Results:
        return self

    def __exit__(self, *args: object) -> None:
        self._lock.close()

    def _open(self) -> None:
        manifest = self._folder / MANIFEST
        (self._folder / CHUNKS).mkdir(exist_ok=True)
        for left in (*self._folder.glob(f"*{PART}*"), *self._path(0).parent.glob(f"*{PART}*")):
            left.unlink()
        if manifest.exists():
            self._check(manifest)
            return
        if any(self._path(0).parent.iterdir()):
            raise FieldError(f"out: {str(self._folder)!r} has chunks, but no {MANIFEST}")
        digest, definition = self._campaign.digest, self._campaign.definition
        text = json.dumps({"digest": digest, **definition}, indent=1) + "\n"
        write_whole(manifest, text.encode())

    def _check(self, manifest: Path) -> None:
        where = f"out: {str(self._folder)!r}"
        try:
            there = read_json(manifest.read_bytes(), MANIFEST)
            same = there["digest"] == self._campaign.digest
        except (OSError, ValueError, KeyError, TypeError):
            raise FieldError(f"{where}: {MANIFEST} is not a campaign's") from None
        if not same:
            differing = [
                difference(name, there.get(name), value)
                for name, value in self._campaign.definition.items()
                if there.get(name) != value
            ]
            raise FieldError(
                f"{where} belongs to a campaign with different {', '.join(differing)}; "
                "use a new folder"
            )

    def _path(self, number: int) -> Path:
        return self._folder / CHUNKS / f"{number:07}.parquet"

    def missing(self, chunks: Sequence[Chunk]) -> list[Chunk]:
        """Return the chunks that are not stored yet."""
        return [chunk for chunk in chunks if not self._path(chunk.number).exists()]

    def keep(self, chunk: Chunk, played: Columns) -> None:
        """Write a chunk.

        Raises:
            OSError: If it cannot be written.
        """
        planner, case = self._campaign.planners[chunk.planner], self._campaign.cases[chunk.case]
        first = self._campaign.settings.seed + chunk.first
        table = pa.table(
            {
                "planner": [planner.name] * chunk.count,
                "scenario": [case.name] * chunk.count,
                "seed": np.arange(first, first + chunk.count),
                "planner_seed": pa.array(played["planner_seeds"], mask=played["planner_seeds"] < 0),
                "found": played["found"],
                "steps": played["steps"],
                "time_s": played["steps"] * case.scenario.step_duration_s,
                "path_length_m": played["path_length_m"],
                "collisions": played["collisions"],
                "drones_lost": played["lost"],
            },
            schema=COLUMNS,
        )
        write_whole(self._path(chunk.number), lambda file: pq.write_table(table, file))

    def collect(self) -> pa.Table:
        """Write `missions.parquet` and `missions.csv` of all chunks; return the missions.

        Raises:
            FieldError: If a chunk is damaged.
            OSError: If a file cannot be read or written.
        """
        table = pa.concat_tables(self._read()).combine_chunks()
        for name, write in (("parquet", pq.write_table), ("csv", csv.write_csv)):
            write_whole(
                self._folder / f"missions.{name}",
                lambda file, write=write: write(table, file),  # type: ignore[misc]
            )
        return table

    def _read(self) -> Iterator[pa.Table]:
        for chunk in self._campaign.chunks():
            path = self._path(chunk.number)
            try:
                table = pq.read_table(path)
            except pa.ArrowInvalid:
                table = None
            if table is None or table.schema != COLUMNS or len(table) != chunk.count:
                raise FieldError(f"out: {str(path)!r} is damaged; delete it to play it again")
            yield table
