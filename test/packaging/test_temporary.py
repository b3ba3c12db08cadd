# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""If neither installation nor home can be written, a temporary folder takes their place."""

from __future__ import annotations

import logging
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import dsse_ros
from dsse_ros.base.temporary import temporary_folder, use_without_home

PACKAGE = Path(dsse_ros.__file__).parent
READ_ONLY = "mount --bind {0} {0} && mount -o remount,bind,ro {0} && exec"
PROGRAM = """
import os
from dsse_ros.cli.start import start
from dsse_ros.base.compiled.breadth_first import find_routes
print(os.environ["NUMBA_CACHE_DIR"])
"""


@pytest.fixture(autouse=True)
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    temporary_folder.cache_clear()
    yield tmp_path / f"dsse_ros-{os.getuid()}"
    temporary_folder.cache_clear()


def in_read_only(package: Path, *command: str) -> list[str]:
    """Return a command that finds the package in a read-only mount."""
    script = f'{READ_ONLY.format(package)} "$@"'
    return ["unshare", "--mount", "--map-root-user", "sh", "-c", script, "sh", *command]


def can_mount() -> bool:
    try:
        return not subprocess.run(in_read_only(PACKAGE, "true"), capture_output=True).returncode
    except FileNotFoundError:
        return False


@pytest.mark.slow
@pytest.mark.skipif(not can_mount(), reason="no mount namespaces here")
def test_a_read_only_installation_without_a_home_keeps_compiled_code_in_a_temporary_folder(
    temporary: Path,
) -> None:
    env = os.environ | {"HOME": "/dev/null/home", "TMPDIR": str(temporary.parent)}
    for name in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME"):
        env.pop(name, None)
    command = in_read_only(PACKAGE, sys.executable, "-c", PROGRAM)
    errors = []
    for _ in range(2):
        done = subprocess.run(
            command, env=env, cwd=temporary.parent, capture_output=True, text=True
        )
        assert (done.returncode, done.stdout) == (0, f"{temporary}/numba\n"), done.stderr
        errors.append(done.stderr.splitlines())
    # Once.
    assert [len(lines) for lines in errors] == [1, 0]
    assert str(temporary) in errors[0][0] and "NUMBA_CACHE_DIR" in errors[0][0]
    assert temporary.stat().st_mode & 0o777 == 0o700


def test_a_folder_that_somebody_else_can_write_to_is_not_used(
    temporary: Path, caplog: pytest.LogCaptureFixture
) -> None:
    temporary.mkdir(mode=0o777)
    temporary.chmod(0o777)
    with caplog.at_level(logging.WARNING):
        other = temporary_folder()
    assert other != temporary and other.stat().st_mode & 0o777 == 0o700
    assert str(other) in caplog.text


def test_a_link_is_not_followed(temporary: Path, tmp_path: Path) -> None:
    (tmp_path / "elsewhere").mkdir(mode=0o700)
    temporary.symlink_to(tmp_path / "elsewhere")
    assert temporary_folder().resolve() not in (temporary, tmp_path / "elsewhere")


def test_choices_of_the_user_stay_and_a_home_is_used(temporary: Path, tmp_path: Path) -> None:
    environ = {"HOME": "/dev/null/home", "ROS_LOG_DIR": "/logs"}
    use_without_home(environ)
    assert environ["ROS_LOG_DIR"] == "/logs"
    assert environ["MPLCONFIGDIR"] == f"{temporary}/matplotlib"
    with_home = {"HOME": str(tmp_path)}
    use_without_home(with_home)
    assert with_home == {"HOME": str(tmp_path)}


def test_a_home_that_is_not_stated_is_looked_up_for_ros(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("HOME", raising=False)
    environ = {"ROS_LOG_DIR": "/logs", "MPLCONFIGDIR": "/mpl"}
    use_without_home(environ)
    assert environ["HOME"] == os.path.expanduser("~")
