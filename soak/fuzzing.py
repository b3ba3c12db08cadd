# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Arbitrary bytes for every parser: coverage-guided in the soak, random in the tests.

`python -m soak.fuzzing NAME SECONDS FOLDER` is coverage-guided and keeps its corpus in the folder.
"""

from __future__ import annotations

import random
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from types import FunctionType, ModuleType

from soak.parsers import PARSERS
from soak.row import Figures, Row, Run, zero

SECONDS = 600
_RUNS = re.compile(r"(?:Done|stat::number_of_executed_units:) (\d+)")
_COVERED = re.compile(r"cov: (\d+)")


def fuzz(name: str, run: Run) -> Figures:
    """Look for bytes that make a parser fail."""
    return at_random(name, 300) if run.quick else guided(name, run.folder, SECONDS)


def at_random(name: str, number: int) -> Figures:
    """Damage readable bytes, again and again.

    Raises:
        Exception: An exception that the parser must not raise.
    """
    take, seeds = PARSERS[name].make()
    draw = random.Random(12)
    for seed in seeds:
        take(seed)
    for _ in range(number):
        take(damaged(draw.choice(seeds), draw))
    return {"inputs": number, "findings": 0}


def damaged(seed: bytes, draw: random.Random) -> bytes:
    """Return the bytes with some of them changed, removed, added or moved."""
    data = bytearray(seed)
    for _ in range(draw.randrange(1, 5)):
        if not data:
            break
        at, to = sorted(draw.randrange(len(data) + 1) for _ in range(2))
        match draw.randrange(6):
            case 0:
                data[min(at, len(data) - 1)] = draw.randrange(256)
            case 1:
                del data[at : min(to, at + 16)]
            case 2:
                data[at:at] = draw.randbytes(draw.randrange(1, 9))
            case 3:
                data[at:at] = data[at : min(to, at + 64)]
            case 4:
                data[min(at, len(data) - 1)] ^= 1 << draw.randrange(8)
            case _:
                data[at : at + 4] = draw.choice((b"\xff" * 4, b"\0" * 4, b"\xff\xff\xff\x7f"))
    return bytes(data)


def guided(name: str, folder: Path, seconds: int) -> Figures:
    """Run atheris in a separate process.

    Raises:
        AssertionError: If it finds a failure; the bytes are in the folder.
    """
    began_s = time.monotonic()
    with (folder / "log").open("w+") as log:
        code = subprocess.call(
            [sys.executable, "-m", "soak.fuzzing", name, str(seconds), str(folder)],
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=subprocess.STDOUT,
        )
        log.seek(0)
        text = log.read()
    assert code == 0, f"{folder}: {text[-3000:]}"
    runs, covered = _RUNS.findall(text), _COVERED.findall(text)
    return {
        "seconds": round(time.monotonic() - began_s),
        "inputs": int(runs[-1]),
        "branches": int(covered[-1]),
        "findings": 0,
    }


def _guide(name: str, seconds: str, folder: str) -> None:
    import atheris

    parser = PARSERS[name]
    take, seeds = parser.make()
    for module in parser.modules:
        for function in functions(sys.modules[module]):
            atheris.instrument_func(function)
    corpus = Path(folder, "corpus")
    corpus.mkdir(parents=True, exist_ok=True)
    for number, seed in enumerate(seeds):
        (corpus / f"seed{number}").write_bytes(seed)
    options = [f"-max_total_time={seconds}", "-timeout=20", "-rss_limit_mb=3000", "-max_len=20000"]
    atheris.Setup(
        [sys.argv[0], *options, f"-artifact_prefix={folder}/", "-print_final_stats=1", str(corpus)],
        take,
    )
    atheris.Fuzz()


def functions(module: ModuleType) -> Iterator[FunctionType]:
    """Yield the functions of a module and the methods of its classes."""
    for value in vars(module).values():
        members = vars(value).values() if isinstance(value, type) else [value]
        for member in members:
            if isinstance(member, property):
                member = member.fget
            function = getattr(member, "__func__", member)
            if isinstance(function, FunctionType) and function.__module__ == module.__name__:
                yield function


def _row(name: str) -> Row:
    return Row(
        f"fuzz_{name}",
        f"10 minutes of coverage-guided fuzzing of {PARSERS[name].reads} without a finding",
        lambda run: fuzz(name, run),
        "{inputs} inputs, {findings} findings",
        zero("findings"),
    )


ROWS = tuple(_row(name) for name in PARSERS)

if __name__ == "__main__":
    _guide(*sys.argv[1:])
