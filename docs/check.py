# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Runs the commands of README and docs in a scratch clone (`make docs-check`).

Each ```sh block is run by bash, page by page in their order, in the clone of the last commit. A
comment before it, which readers do not see, changes that:

    <!-- docs-check: skip, REASON -->   it cannot be run here
    <!-- docs-check: background -->     it runs beside the blocks after it, up to the first without
                                        this comment
    <!-- docs-check: until TEXT -->     it runs until it or what is beside it has printed this

A program that would run forever is interrupted; one that fails makes the blocks beside it fail.
The first block makes the environment, so it is run whatever pages are chosen. `ros2 run` of this
package works without a full ROS 2. The tests run the blocks of Python
(`test/packaging/test_docs.py`).
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PAGES = ("README.md", "CONTRIBUTING.md", "docs")
TIMEOUT_S = 1800.0
ROS2 = """#!/bin/sh
# `ros2 run dsse_ros PROGRAM`, where there is no other `ros2`.
[ "$1 $2" = "run dsse_ros" ] || { echo "ros2 $*: needs a full ROS 2" >&2; exit 127; }
program=$3; shift 3; exec .venv/bin/"$program" "$@"
"""
_BLOCK = re.compile(
    r"(?:^ *<!-- docs-check: (?P<how>skip|background|until)(?:,? +(?P<text>[^\n]+?))? -->\n)?"
    r"^(?P<indent> *)```sh\n(?P<code>.*?)^(?P=indent)```$",
    re.DOTALL | re.MULTILINE,
)


@dataclass(frozen=True)
class Block:
    """Commands of a page: where they start, and how they are run.

    Attributes:
        page: Path in the repository.
        line: Line of the first command, from 1.
        code: The commands.
        how: `skip`, `background`, `until`, or nothing for one that runs to its end.
        text: The reason to skip it, or what it is run until.
    """

    page: str
    line: int
    code: str
    how: str
    text: str


def blocks(page: str, content: str) -> Iterator[Block]:
    """Return the blocks of commands of a page.

    Raises:
        ValueError: If a comment is none of those above, or has no text where it takes one.
    """
    found = list(_BLOCK.finditer(content))
    if len([one for one in found if one["how"]]) != content.count("<!-- docs-check:"):
        raise ValueError(f"{page}: a comment of docs-check is not followed by a block it knows")
    for one in found:
        how, text = one["how"] or "", one["text"] or ""
        line = content[: one.start("code")].count("\n") + 1
        if (how in ("skip", "until")) != bool(text):
            raise ValueError(f"{page}:{line}: docs-check: {how} {text!r} is not allowed")
        yield Block(page, line, one["code"], how, text)


def all_blocks() -> list[Block]:
    """Return the blocks of all pages."""
    pages = [
        page
        for name in PAGES
        for page in ([ROOT / name] if name.endswith(".md") else sorted((ROOT / name).rglob("*.md")))
    ]
    return [
        block
        for page in pages
        for block in blocks(page.relative_to(ROOT).as_posix(), page.read_text(encoding="utf-8"))
    ]


def chosen_blocks(pages: Sequence[str]) -> list[Block]:
    """Return the first of all blocks, and those of these pages; of all pages without any.

    Raises:
        ValueError: If a page has no blocks, or does not exist.
    """
    first, *others = all_blocks()
    known = {first.page, *(one.page for one in others)}
    unknown = [page for page in pages if page not in known]
    if unknown:
        raise ValueError(f"{unknown[0]}: a page with commands is one of {', '.join(sorted(known))}")
    return [first, *(one for one in others if not pages or one.page in pages)]


class Run:
    """Blocks as processes in a clone, with their output in a folder beside it."""

    def __init__(self, scratch: Path) -> None:
        self.clone, self.logs = scratch / "clone", scratch / "logs"
        self.beside: list[tuple[subprocess.Popen[bytes], Path]] = []
        subprocess.run(["git", "clone", "-q", str(ROOT), str(self.clone)], check=True)
        self.logs.mkdir()
        path = os.environ["PATH"]
        if shutil.which("ros2") is None:
            (scratch / "bin").mkdir()
            (scratch / "bin" / "ros2").write_text(ROS2)
            (scratch / "bin" / "ros2").chmod(0o755)
            path = f"{scratch / 'bin'}:{path}"
        # What `make` sets for its own programs is not there for a reader.
        without = {
            "MAKEFLAGS",
            "MAKELEVEL",
            "MFLAGS",
            "VIRTUAL_ENV",
            "_ROS_WHEELS_BOOTSTRAP_COMPLETE",
        }
        self.environment = {k: v for k, v in os.environ.items() if k not in without} | {
            "PATH": path,
            "AMENT_PREFIX_PATH": str(self.clone / ".venv"),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        }

    def start(self, block: Block) -> tuple[subprocess.Popen[bytes], Path]:
        """Start a block in a process group of its own."""
        log = self.logs / f"{block.page.replace('/', '_')}-{block.line}.log"
        with log.open("wb") as output:
            process = subprocess.Popen(
                ["bash", "-euo", "pipefail", "-c", block.code],
                cwd=self.clone, env=self.environment, stdin=subprocess.DEVNULL, stdout=output,
                stderr=subprocess.STDOUT, start_new_session=True,
            )  # fmt: skip
        return process, log

    def run(self, block: Block) -> str:
        """Run a block; return why it has failed, or nothing."""
        running = self.start(block)
        if block.how == "background":
            self.beside.append(running)
            return ""
        try:
            return wait_for(block, [running, *self.beside])
        finally:
            for process, _ in (running, *self.beside):
                stop(process)
            self.beside.clear()


def wait_for(block: Block, running: Sequence[tuple[subprocess.Popen[bytes], Path]]) -> str:
    """Wait for a block, the first of these processes; return why it has failed, or nothing."""
    log = running[0][1]
    deadline = time.monotonic() + TIMEOUT_S
    while time.monotonic() < deadline:
        codes = [process.poll() for process, _ in running]
        for code, (_, path) in zip(codes, running, strict=True):
            if code:
                return f"exit code {code}, see {path}"
        if block.how == "until":
            if any(block.text in path.read_text(errors="replace") for _, path in running):
                return ""
            if codes[0] is not None:
                return f"ended before it printed {block.text!r}, see {log}"
        elif codes[0] is not None:
            return ""
        time.sleep(0.2)
    return f"not done after {TIMEOUT_S:.0f} s, see {log}"


def stop(process: subprocess.Popen[bytes]) -> None:
    """Interrupt a block and what it has started; kill what does not end of that."""
    for what in (signal.SIGINT, signal.SIGKILL):
        try:
            os.killpg(process.pid, what)
            process.wait(20)
        except (ProcessLookupError, subprocess.TimeoutExpired):
            continue


def main() -> int:
    """Run what is asked for and list what was run and what was not."""
    parser = argparse.ArgumentParser(description="Run the commands of README and docs.")
    parser.add_argument("pages", nargs="*", help="only these pages, such as docs/ros.md")
    parser.add_argument("--list", action="store_true", help="list the commands and run none")
    options = parser.parse_args()
    try:
        chosen = chosen_blocks(options.pages)
    except ValueError as error:
        parser.error(str(error))
    scratch = Path(tempfile.mkdtemp(prefix="docs-check-"))
    run = None if options.list else Run(scratch)
    failures = 0
    for block in chosen:
        began = time.monotonic()
        why = "" if block.how == "skip" or run is None else run.run(block)
        failures += bool(why)
        state = (
            "skipped"
            if block.how == "skip"
            else "to run"
            if run is None
            else "FAILED"
            if why
            else "ran"
        )
        note = why or (block.text if block.how == "skip" else f"{time.monotonic() - began:.0f} s")
        first = block.code.strip().splitlines()[-1]
        print(f"{state:8}{block.page}:{block.line}: {first[:70]} ({note})", flush=True)
    if not failures:
        shutil.rmtree(scratch, ignore_errors=True)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
