# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The measured processes, which wait while another one runs, and the C programs."""

from __future__ import annotations

import json
import os
import re
import select
import subprocess
import sys
import tempfile
from pathlib import Path
from types import TracebackType
from typing import IO, Any, Protocol

from benchmarks import ROOT

TIMEOUT_S = 180.0


class BenchmarkError(Exception):
    """A measured process failed or does not answer; the text is one line."""


class Implementation(Protocol):
    """Makes environment steps on demand."""

    def set_up(self, config: dict[str, Any]) -> None:
        """Get ready for this work."""

    def rate(self, seconds: float) -> float:
        """Work for this long and return environment steps per second."""


class Process:
    """A program of `benchmarks.baselines`.

    Args:
        module: Its name.
        python: Python of its environment, by default this one.
        environment: Variables to add.

    Raises:
        BenchmarkError: From any method, if the program fails.
    """

    def __init__(
        self, module: str, python: Path | None = None, environment: dict[str, str] | None = None
    ) -> None:
        self.module = module
        self._errors = tempfile.TemporaryFile()  # noqa: SIM115
        self._process = subprocess.Popen(
            [str(python or sys.executable), "-m", f"benchmarks.baselines.{module}"],
            cwd=ROOT,
            env={**os.environ, "SDL_VIDEODRIVER": "dummy", **(environment or {})},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._errors,
            bufsize=0,
        )

    def __enter__(self) -> Process:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def set_up(self, config: dict[str, Any]) -> None:
        """Get ready for this work."""
        self.ask("set_up", config)

    def rate(self, seconds: float) -> float:
        """Work for this long and return environment steps per second."""
        answer = self.ask("run", seconds)
        return float(answer["steps"] / answer["seconds"])

    def ask(self, what: str, *arguments: Any) -> dict[str, Any]:
        """Send the program a request and return its answer."""
        assert self._process.stdin is not None and self._process.stdout is not None
        request = json.dumps({"do": what, "with": arguments}) + "\n"
        try:
            self._process.stdin.write(request.encode())
        except BrokenPipeError:
            raise BenchmarkError(self._exit_reason()) from None
        if not select.select([self._process.stdout], [], [], TIMEOUT_S)[0]:
            self._process.kill()
            raise BenchmarkError(f"{self.module}: no answer within {TIMEOUT_S:g} s")
        line = self._process.stdout.readline()
        if not line:
            raise BenchmarkError(self._exit_reason())
        answer: dict[str, Any] = json.loads(line)
        return answer

    def close(self) -> None:
        """End the program."""
        assert self._process.stdin is not None
        self._process.stdin.close()
        try:
            self._process.wait(timeout=5)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def _exit_reason(self) -> str:
        self._process.wait(timeout=10)
        return f"{self.module}: {last_line(self._errors)}"


def last_line(errors: IO[bytes]) -> str:
    """Return the last line of a program's standard error."""
    errors.seek(0)
    lines = errors.read().decode(errors="replace").splitlines()
    return next((line.strip() for line in reversed(lines) if line.strip()), "it ended")


class CBaseline:
    """The C baseline.

    Args:
        program: As `published.build` made it.
        lazy: Whether it keeps only the parameters of the maps.
        worlds: Worlds in a batch, by default those of the set-up.
    """

    def __init__(self, program: Path, *, lazy: bool = False, worlds: int | None = None) -> None:
        self._program = program
        self._lazy = lazy
        self._worlds = worlds
        self._arguments: list[str] = []

    def set_up(self, config: dict[str, Any]) -> None:
        """Get ready for this work."""
        worlds = self._worlds or config["worlds"]["count"]
        fields = config["fields"]
        self._arguments = [str(n) for n in (fields["grid_size"], config["num_drones"], worlds)]

    def rate(self, seconds: float) -> float:
        """Work for this long and return environment steps per second."""
        return _rate(self._program, *self._arguments, f"{seconds:g}", str(int(self._lazy)))


class Limit:
    """memset of as many bytes as the maps of a batch have.

    Args:
        program: As `published.build` made it.
    """

    def __init__(self, program: Path) -> None:
        self._program = program
        self._arguments: list[str] = []
        self._threads = "1"

    def set_up(self, config: dict[str, Any]) -> None:
        """Get ready for the maps of this work."""
        worlds = config["worlds"]
        self._arguments = [str(config["fields"]["grid_size"]), str(worlds["count"])]
        self._threads = str(worlds["threads"])

    def rate(self, seconds: float) -> float:
        """Write for this long and return maps per second."""
        return _rate(self._program, *self._arguments, f"{seconds:g}", self._threads)


def _rate(program: Path, *arguments: str) -> float:
    """Return the rate that a C program prints.

    Raises:
        BenchmarkError: If it prints none.
    """
    done = subprocess.run(
        [str(program), *arguments],
        capture_output=True, text=True, timeout=TIMEOUT_S, stdin=subprocess.DEVNULL,
    )  # fmt: skip
    found = re.search(r"([\d.]+) (?:env steps|maps)/s", done.stdout)
    if done.returncode or found is None:
        raise BenchmarkError(f"the C {program.name}: exit code {done.returncode}")
    return float(found[1])
