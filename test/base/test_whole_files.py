# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A file that is replaced has its old or its new content, whenever its writer ends."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import dsse_ros
from dsse_ros.base.whole_files import PART, whole_file, write_whole

WRITER = """\
import sys
from pathlib import Path
from dsse_ros.base.whole_files import write_whole
path, number = Path(sys.argv[1]), 0
while True:
    number += 1
    text = b"%d" % number
    write_whole(path, lambda file: [file.write(text + b"\\n") for _ in range(20_000)])
    print(number, flush=True)
"""


@pytest.mark.slow
def test_a_writer_that_is_killed_leaves_a_whole_file(tmp_path: Path) -> None:
    path = tmp_path / "file"
    for after_s in (0.0, 0.003, 0.01, 0.02, 0.05):
        process = subprocess.Popen(
            [sys.executable, "-c", WRITER, str(path)], stdout=subprocess.PIPE, text=True
        )
        assert process.stdout is not None
        process.stdout.readline()
        # Anywhere within the next ones.
        time.sleep(after_s)
        process.kill()
        assert process.wait() == -signal.SIGKILL
        process.stdout.close()
        lines = path.read_text().splitlines()
        assert len(lines) == 20_000 and len(set(lines)) == 1


def test_a_writer_that_fails_leaves_the_file_and_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "file"
    write_whole(path, b"old")

    def fail(file: object) -> None:
        raise OSError("no space")

    with pytest.raises(OSError, match="no space"):
        write_whole(path, fail)
    assert path.read_bytes() == b"old"
    assert os.listdir(tmp_path) == ["file"] and PART not in str(path)


def test_a_file_keeps_its_mode_and_a_new_one_has_that_of_the_umask(tmp_path: Path) -> None:
    path, plain = tmp_path / "file", tmp_path / "plain"
    write_whole(path, b"old")
    plain.write_bytes(b"")
    assert path.stat().st_mode == plain.stat().st_mode
    path.chmod(0o600)
    write_whole(path, b"new")
    assert path.stat().st_mode & 0o777 == 0o600 and path.read_bytes() == b"new"


def test_a_file_that_is_cut_off_is_not_there_under_its_name(tmp_path: Path) -> None:
    path = tmp_path / "missions" / "drone0.plan"
    path.parent.mkdir()
    with pytest.raises(KeyboardInterrupt), whole_file(path) as part:
        assert part.suffix == ".plan"
        part.write_text("half of it")
        raise KeyboardInterrupt
    assert os.listdir(path.parent) == []
    with whole_file(path) as part:
        part.write_text("all")
    assert path.read_text() == "all" and os.listdir(path.parent) == ["drone0.plan"]
    with pytest.raises(FileNotFoundError) as error, whole_file(tmp_path / "no" / "x.csv"):
        pass
    assert error.value.filename == str(tmp_path / "no" / "x.csv")


def test_what_is_no_regular_file_is_written_itself_and_a_link_is_followed(tmp_path: Path) -> None:
    with whole_file(Path(os.devnull)) as part:
        part.write_text("x")
    assert not Path(os.devnull).is_file()
    (tmp_path / "real").write_text("old")
    (tmp_path / "link").symlink_to(tmp_path / "real")
    write_whole(tmp_path / "link", b"new")
    assert (tmp_path / "link").is_symlink() and (tmp_path / "real").read_text() == "new"


def test_no_program_writes_a_result_under_its_final_name() -> None:
    package = Path(dsse_ros.__file__).parent
    writes = re.compile(r"\.write_(text|bytes)\(|savefig\(path|np\.savetxt\(\n? *arguments")
    found = [
        str(path.relative_to(package))
        for path in package.rglob("*.py")
        if writes.search(path.read_text(encoding="utf-8"))
    ]
    assert found == []
