# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Engines that play chunks: processes of this machine, or a Ray cluster.

An engine yields chunks as they finish, in any order. If a worker is killed, another one plays its
chunk again.
"""

from __future__ import annotations

import logging
import os
import signal
import socket
import threading
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from multiprocessing import connection, get_context, parent_process
from multiprocessing.connection import Connection
from types import MappingProxyType
from typing import Any

from dsse_ros.base.fields import FieldError
from dsse_ros.results.campaign.chunks import Columns, Job, play
from dsse_ros.results.campaign.config import CampaignSettings

MAX_DEATHS = 5
"""Number of workers that may die while they play the same chunk."""
WAITING = 2
"""Number of chunks in flight for each CPU of a cluster."""
CONNECT_S = 10.0
"""Time limit of a connection to the cluster."""

Engine = Callable[[Sequence[Job], CampaignSettings], Iterator[tuple[Job, Columns]]]


class WorkerError(RuntimeError):
    """A planner has failed, or a chunk has killed too many workers; the text is one line."""


class _Worker:
    """A process of this machine that plays one chunk after another.

    A killed worker can leave a shared queue locked, or with a partial message. Each worker
    therefore has its own connection, which ends with it.
    """

    def __init__(self) -> None:
        # A forked process would inherit locks that other threads hold.
        context = get_context("spawn")
        self.connection, its_end = context.Pipe()
        self._process = context.Process(target=_serve, args=(its_end,))
        self._process.start()
        its_end.close()

    def end(self) -> None:
        """Kill the process."""
        self._process.kill()
        self._process.join()
        self.connection.close()


def _serve(jobs: Connection[Columns | WorkerError, Job]) -> None:
    """Play jobs, leave Ctrl-C to the campaign, and end with it even if it is killed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = parent_process()
    assert parent is not None

    def follow() -> None:
        connection.wait([parent.sentinel])
        os._exit(1)

    threading.Thread(target=follow, daemon=True).start()
    with suppress(EOFError, OSError):
        while True:
            jobs.send(_answer(jobs.recv()))


def _answer(job: Job) -> Columns | WorkerError:
    try:
        return play(job)
    except Exception as error:  # Third-party planners may raise anything.
        return _failed(job, error)


def local(jobs: Sequence[Job], settings: CampaignSettings) -> Iterator[tuple[Job, Columns]]:
    """Yield chunks played by processes of this machine.

    Raises:
        WorkerError: If a planner fails, or a chunk kills too many workers.
    """
    left = list(reversed(jobs))
    # A container may have fewer cores than the machine.
    count = settings.workers or len(os.sched_getaffinity(0))
    deaths: Counter[int] = Counter()
    idle: list[_Worker] = []
    busy: dict[Any, tuple[_Worker, Job]] = {}
    try:
        while left or busy:
            while left and len(busy) < count:
                worker, job = idle.pop() if idle else _Worker(), left.pop()
                busy[worker.connection] = worker, job
                # A killed worker is noticed when its answer is read.
                with suppress(OSError):
                    worker.connection.send(job)
            for ready in connection.wait(list(busy)):
                worker, job = busy[ready]
                try:
                    answer = worker.connection.recv()
                except (EOFError, OSError):
                    answer = None
                del busy[ready]
                if answer is None:
                    worker.end()
                    left.append(job)
                    deaths[job[0].number] += 1
                    if deaths[job[0].number] >= MAX_DEATHS:
                        raise _failed(job, f"{MAX_DEATHS} workers have died; too little memory?")
                    continue
                idle.append(worker)
                if isinstance(answer, WorkerError):
                    raise answer
                yield job, answer
    finally:
        for worker in (*idle, *(worker for worker, _ in busy.values())):
            worker.end()


def _failed(job: Job, reason: Exception | str) -> WorkerError:
    chunk, entry, case, seed = job
    name = f"{type(reason).__name__}: " if isinstance(reason, Exception) else ""
    return WorkerError(
        f"planner {entry.name!r} has failed in {case.name!r}, missions with seeds "
        f"{seed + chunk.first} to {seed + chunk.first + chunk.count - 1}: "
        + " ".join(f"{name}{reason}".split())
    )


def on_ray(jobs: Sequence[Job], settings: CampaignSettings) -> Iterator[tuple[Job, Columns]]:
    """Yield chunks played by the workers of a Ray cluster, one for each of its CPUs.

    The package must be installed on its machines.

    Raises:
        FieldError: If there is no cluster at the address.
        ImportError: If Ray is not installed.
        WorkerError: If a planner fails, or a chunk kills too many workers.
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
        remote = ray.remote(num_cpus=1, max_retries=MAX_DEATHS)(play)
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
    # Ray itself would retry for minutes.
    try:
        socket.create_connection((host, int(port)), timeout=CONNECT_S).close()
    except (OSError, ValueError, OverflowError) as error:
        raise FieldError(f"address: no Ray cluster at {address!r}: {error}") from None


ENGINES: Mapping[str, Engine] = MappingProxyType({"local": local, "ray": on_ray})
"""Engines by their name in a campaign's file."""
