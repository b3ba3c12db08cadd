# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Nodes forked from a server that has imported them: a start costs a fifth of the CPU time.

That the executables themselves start is tested in test/cli.
"""

from __future__ import annotations

import importlib
import multiprocessing
import os
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from functools import cache
from multiprocessing import forkserver
from pathlib import Path

import pytest

_context = multiprocessing.get_context("forkserver")
_context.set_forkserver_preload(["warm"])

_OF_IMPORTS = ("NUMBA_CACHE_DIR", "PYTHONPATH")
"""Variables that decide what is imported or loaded."""
_environment = {name: os.environ.get(name) for name in _OF_IMPORTS}


def forkable(environment: Mapping[str, str]) -> bool:
    """Return whether a node of this environment imports what the server has imported."""
    return all(environment.get(name) == value for name, value in _environment.items())


@cache
def _serve() -> None:
    """Start the server, once."""
    with pytest.MonkeyPatch.context() as patch:
        # The server does not take over `sys.path` (CPython 117378).
        patch.setenv("PYTHONPATH", str(Path(__file__).parent), prepend=os.pathsep)
        forkserver.ensure_running()


class ForkedNode:
    """A node as a process, with the interface of `subprocess.Popen` that the tests use."""

    def __init__(
        self, module: str, arguments: Sequence[str], log: Path, environment: Mapping[str, str]
    ) -> None:
        _serve()
        # A node that a failed test leaves behind ends with the tests.
        self._process = _context.Process(
            target=_run, args=(module, [*arguments], str(log), {**environment}), daemon=True
        )
        self._process.start()

    @property
    def pid(self) -> int:
        """Process id."""
        assert self._process.pid is not None
        return self._process.pid

    @property
    def returncode(self) -> int | None:
        """Exit code, negative after a signal; None while it runs."""
        return self._process.exitcode

    def poll(self) -> int | None:
        """Return the exit code; None while it runs."""
        return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        """Return the exit code when it has ended.

        Raises:
            subprocess.TimeoutExpired: If it runs on.
        """
        self._process.join(timeout)
        if self.returncode is None:
            raise subprocess.TimeoutExpired(self._process.name, timeout or 0.0)
        return self.returncode

    def send_signal(self, number: signal.Signals) -> None:
        """Send a signal, if it runs."""
        if self.returncode is None:
            os.kill(self.pid, number)

    def kill(self) -> None:
        """End it without asking."""
        self.send_signal(signal.SIGKILL)


def _run(module: str, arguments: list[str], log: str, environment: dict[str, str]) -> None:
    os.environ.clear()
    os.environ.update(environment)
    output = os.open(log, os.O_WRONLY | os.O_APPEND)
    os.dup2(output, 1)
    os.dup2(output, 2)
    os.chdir(Path(log).parent)
    sys.argv = [module, *arguments]
    sys.exit(importlib.import_module(module).main())
