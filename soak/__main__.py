# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""`make soak`: measures every row of the table of promises, and resumes where it was stopped."""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import shutil
import subprocess
import sys
import time
import traceback
from pathlib import Path
from typing import Any

from benchmarks.bench import machine, own_versions, rounded
from dsse_ros.base.progress_bar import progress, say
from dsse_ros.base.whole_files import write_whole
from soak import ROOT
from soak.rigs import use_defaults_of_dds
from soak.row import Row, Run
from soak.rows import ROWS
from soak.table import RESULTS

BUILD = ROOT / ".venv" / "soak"
CODE = (
    "dsse_ros",
    "msg_adapters",
    "soak",
    "config",
    "test/ros/nodes",
    "test/vehicles/control",
    "benchmarks/ros",
)
"""What a result depends on; a row measured under the same conditions is not measured again."""
SUFFIXES = (".py", ".yaml", ".js", ".css", ".html", ".xml")


def main(arguments: list[str] | None = None) -> int:
    """Measure the missing rows, write them and return the exit code, 1 if a promise is broken."""
    options = _arguments(arguments)
    path: Path = options.out or (BUILD / "soak.json" if options.quick else RESULTS)
    path.parent.mkdir(parents=True, exist_ok=True)
    use_defaults_of_dds()
    code = digest()
    results = _load(path)
    for name in progress(options.only or list(ROWS), "soak"):
        done = results.get(name, {})
        if not options.again and done.get("code") == code and done.get("quick") == options.quick:
            say(f"{name:18} done before: {done['says']}")
            continue
        measured = measure(ROWS[name], options.quick, BUILD / name) | {"code": code}
        # Other processes may measure other rows meanwhile.
        results = _load(path) | {name: measured}
        _save(path, results)
        say(f"{name:18} {results[name]['says']}")
    broken = [name for name in options.only or ROWS if results[name]["missed"]]
    say(f"written to {path}; {len(broken)} broken: {', '.join(broken) or 'none'}")
    return int(bool(broken))


def measure(row: Row, quick: bool, folder: Path) -> dict[str, Any]:
    """Return the result of a row and the conditions under which it was measured."""
    # Keep the inputs that fuzzing has found.
    for path in folder.glob("*"):
        if path.name != "corpus":
            shutil.rmtree(path) if path.is_dir() else path.unlink()
    folder.mkdir(parents=True, exist_ok=True)
    load, began = os.getloadavg()[0], time.time()
    try:
        figures = row.measure(Run(quick=quick, folder=folder))
        missed, says = row.missed(figures), row.says.format(**figures)
    except Exception as error:
        traceback.print_exc()
        figures, missed = {}, [" ".join(f"{type(error).__name__}: {error}".split())[:1000]]
        says = "not measured to its end"
    return {
        "promise": row.promise,
        "says": says + (f"; MISSED: {'; '.join(missed)}" if missed else ""),
        "missed": missed,
        "figures": rounded(figures),
        "quick": quick,
        "date": time.strftime("%Y-%m-%d %H:%M", time.gmtime(began)),
        "seconds": round(time.time() - began),
        "load_before": round(load, 2),
        "load_after": round(os.getloadavg()[0], 2),
        "commit": _commit(),
        "machine": machine(),
        "versions": own_versions(),
    }


def digest() -> str:
    """Return a value that changes with the measured code and the measuring code."""
    found = hashlib.sha256()
    for folder in CODE:
        for path in sorted((ROOT / folder).rglob("*")):
            # Includes the rigs of the tests, but not the tests.
            if path.suffix in SUFFIXES and not path.name.startswith("test_"):
                found.update(f"{path.relative_to(ROOT)}\0".encode() + path.read_bytes() + b"\0")
    return found.hexdigest()[:16]


def _commit() -> str:
    # The results are written there, row by row.
    changes = ["status", "--porcelain", "--untracked-files=no", "--", ".", ":!benchmarks/results"]
    return _git("rev-parse", "--short=12", "HEAD") + ("-dirty" if _git(*changes) else "")


def _git(*arguments: str) -> str:
    done = subprocess.run(["git", *arguments], cwd=ROOT, capture_output=True, text=True)
    return done.stdout.strip()


def _load(path: Path) -> dict[str, dict[str, Any]]:
    try:
        return dict(json.loads(path.read_text(encoding="utf-8")))
    except FileNotFoundError:
        return {}


def _save(path: Path, results: dict[str, dict[str, Any]]) -> None:
    ordered = {name: results[name] for name in ROWS if name in results}
    write_whole(path, (json.dumps(ordered, indent=1) + "\n").encode())


def _arguments(arguments: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="make soak", description=__doc__)
    parser.add_argument("--only", nargs="+", choices=list(ROWS), metavar="ROW", help="these rows")
    parser.add_argument("--quick", action="store_true", help="the short form of each row")
    parser.add_argument("--again", action="store_true", help="rows too that are done")
    parser.add_argument("--out", type=Path, help="JSON of the results")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
