# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What plays chunks: processes of this machine, or a Ray cluster.

An engine yields chunks as they are done, in any order. A worker that was killed costs what it had
under way, which another one plays again.
"""

from __future__ import annotations

import logging
import os
import signal
import socket
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import connection, get_context, parent_process
from types import MappingProxyType
from typing import Any

from dsse_ros.campaign.chunks import Columns, Job, play
from dsse_ros.campaign.config import CampaignSettings
from dsse_ros.search import FieldError

MAX_KILLS = 5
"""Times in a row that workers may die with no chunk done."""
WAITING = 2
"""Chunks for each worker that are handed out at once."""
CONNECT_S = 10.0
"""For a connection to the cluster."""

Engine = Callable[[Sequence[Job], CampaignSettings], Iterator[tuple[Job, Columns]]]


class WorkerError(RuntimeError):
    """A planner has failed, or workers die again and again; its text is one line."""


def _cores() -> int:
    # A container may have fewer than the machine.
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _start_worker() -> None:
    """Leave Ctrl-C to the campaign, and end with it even if it was killed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = parent_process()
    assert parent is not None

    def follow() -> None:
        connection.wait([parent.sentinel])
        os._exit(1)

    threading.Thread(target=follow, daemon=True).start()


def local(jobs: Sequence[Job], settings: CampaignSettings) -> Iterator[tuple[Job, Columns]]:
    """Yield chunks that processes of this machine have played.

    Raises:
        WorkerError: If a planner fails, or workers die again and again.
    """
    workers = min(settings.workers or _cores(), len(jobs))
    left = list(reversed(jobs))
    kills = 0
    while left:
        # Forked, workers would share locks that threads hold.
        pool = ProcessPoolExecutor(workers, get_context("spawn"), _start_worker)
        under_way: dict[Future[Columns], Job] = {}
        try:
            while left or under_way:
                while left and len(under_way) < WAITING * workers:
                    under_way[pool.submit(play, left[-1])] = left[-1]
                    left.pop()
                for future in wait(under_way, return_when=FIRST_COMPLETED).done:
                    played = _result(future, under_way[future])
                    job = under_way.pop(future)
                    kills = 0
                    yield job, played
        except BrokenProcessPool:
            left += reversed(under_way.values())
            kills += 1
            if kills >= MAX_KILLS:
                raise WorkerError(
                    f"workers have died {kills} times with no chunk done; too little memory?"
                ) from None
        finally:
            pool.shutdown(wait=False, cancel_futures=True)


def _result(future: Future[Columns], job: Job) -> Columns:
    try:
        return future.result()
    except BrokenProcessPool:
        raise
    except Exception as error:  # Planners of others may raise anything.
        raise _failed(job, error) from error


def _failed(job: Job, error: Exception) -> WorkerError:
    chunk, entry, case, seed = job
    reason = " ".join(f"{type(error).__name__}: {error}".split())
    return WorkerError(
        f"planner {entry.name!r} has failed in {case.name!r}, missions with seeds "
        f"{seed + chunk.first} to {seed + chunk.first + chunk.count - 1}: {reason}"
    )


def on_ray(jobs: Sequence[Job], settings: CampaignSettings) -> Iterator[tuple[Job, Columns]]:
    """Yield chunks that the workers of a Ray cluster have played, one for each of its CPUs.

    The package must be installed on its machines.

    Raises:
        FieldError: If there is no cluster at the address.
        ImportError: If Ray is not installed.
        WorkerError: If a planner fails, or workers die again and again.
    """
    import ray

    host, _, port = settings.address.rpartition(":")
    if host:
        _check_listening(settings.address, host, port)
    here: dict[str, Any] = {"_node_ip_address": host} if host.startswith("127.") else {}
    try:
        ray.init(settings.address, logging_level=logging.ERROR, log_to_driver=False, **here)
    except (ConnectionError, ValueError, RuntimeError) as error:
        raise FieldError(f"address: no Ray cluster at {settings.address!r}: {error}") from None
    try:
        remote = ray.remote(num_cpus=1, max_retries=MAX_KILLS)(play)
        workers = max(1, int(ray.cluster_resources().get("CPU", 1)))
        left = list(reversed(jobs))
        under_way: dict[Any, Job] = {}
        while left or under_way:
            while left and len(under_way) < WAITING * workers:
                job = left.pop()
                under_way[remote.remote(job)] = job
            for reference in ray.wait(list(under_way))[0]:
                job = under_way.pop(reference)
                try:
                    played = ray.get(reference)
                except ray.exceptions.RayTaskError as error:
                    raise _failed(job, error.cause) from error
                except ray.exceptions.RayError as error:
                    raise _failed(job, error) from error
                yield job, played
    finally:
        ray.shutdown()


def _check_listening(address: str, host: str, port: str) -> None:
    # Ray itself would try for minutes.
    try:
        socket.create_connection((host, int(port)), timeout=CONNECT_S).close()
    except (OSError, ValueError, OverflowError) as error:
        raise FieldError(f"address: no Ray cluster at {address!r}: {error}") from None


ENGINES: Mapping[str, Engine] = MappingProxyType({"local": local, "ray": on_ray})
"""By the name in a campaign's file."""
