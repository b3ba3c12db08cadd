# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A node as a process: its start, its end, and what its log says."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
from collections.abc import Collection, Iterator, Sequence
from pathlib import Path
from typing import Any

from dsse_ros.base.private_files import open_private
from dsse_ros.ros.runtime.exit_codes import BAD_INPUT
from dsse_ros.ros.runtime.ros_arguments import full_name, pairs, reaching
from dsse_ros.search.environments.compiler import progress

STOP_S = 10.0
"""Wall time a process has to end after it was interrupted."""
_TAIL_BYTES = 4096


class MissionFailed(Exception):
    """The mission did not reach its end."""


@contextlib.contextmanager
def process(
    module: str, parameters: dict[str, Any], log: Path, ros: Sequence[str] = ()
) -> Iterator[subprocess.Popen[bytes]]:
    """Run a node with these parameters as a process during the block.

    Further ROS arguments come before the parameters.
    """
    # A source tree in the working directory would come before the installation.
    program = "import sys; sys.path[:] = filter(None, sys.path); "
    program += f"from dsse_ros.cli.start import {module}; "
    program += f"from dsse_ros.ros.runtime.interrupts import end_with; end_with({os.getpid()}); "
    command = [sys.executable, "-c", program + f"sys.exit({module}())", "--ros-args", *ros]
    for name, value in parameters.items():
        # ROS parses the value as YAML, so texts need quotes.
        text = json.dumps(value, ensure_ascii=False) if isinstance(value, str) else value
        command += ["-p", f"{name}:={text}"]
    # The log of the page has its token.
    with open_private(log) as output:
        child = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=output, stderr=subprocess.STDOUT
        )
        try:
            yield child
        finally:
            if child.poll() is None:
                child.send_signal(signal.SIGINT)
            try:
                child.wait(STOP_S)
            except subprocess.TimeoutExpired:
                child.kill()
                child.wait()


def check_running(child: subprocess.Popen[bytes], name: str, log: Path) -> None:
    """Raise if a process has ended, with the reason that it printed.

    Raises:
        MissionFailed: If it has ended.
    """
    code = child.poll()
    if code is None:
        return
    lines = log.read_text(errors="replace").strip().splitlines()
    if lines and (code == BAD_INPUT or lines[-1].startswith(f"{name}: ")):
        raise MissionFailed(lines[-1])
    raise MissionFailed(f"{name} ended with code {code}; see {log}")


def ros_for(node: str, parameters: Collection[str], ros: Sequence[str]) -> list[str]:
    """Return ROS arguments without parameters for other nodes."""
    kept: list[str] = []
    for flag, value in pairs(reaching([full_name(node, ros)], ros)):
        name = value.partition(":=")[0]
        if flag != "--param" or ":" in name or name in parameters:
            kept += [flag, value] if value else [flag]
    return kept


def working(log: Path) -> str:
    """Return what a node computes or compiles, from the end of its log; empty for nothing."""
    with log.open("rb") as file:
        file.seek(max(0, log.stat().st_size - _TAIL_BYTES))
        return progress(file.read().decode(errors="replace"))
