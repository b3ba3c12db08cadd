# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Standard input, output and error of a program, which may be closed, full or abandoned.

A program completes its work whatever happens to its output. A reader that leaves, as `head` does,
is no failure; output that is lost otherwise is one, reported at the end.
"""

from __future__ import annotations

import errno
import io
import os
import sys

_READ, _OUT, _ERROR = 0, 1, 2


class _Stream(io.FileIO):
    """A standard stream whose writes never raise; after the first failure nothing is written.

    Attributes:
        error: The first failure.
    """

    error: OSError | None = None

    def write(self, data: object) -> int:
        content = memoryview(data)  # type: ignore[arg-type]
        try:
            return super().write(content) or 0
        except BlockingIOError:
            raise
        except OSError as error:
            self.error = error
            # Children and libraries that write to it are freed of it too.
            silent = os.open(os.devnull, os.O_WRONLY)
            os.dup2(silent, self.fileno())
            os.close(silent)
            return content.nbytes


_output: _Stream | None = None


def guard() -> None:
    """Have `sys.stdout` and `sys.stderr` never raise, and open what is closed.

    Otherwise the next file that the program opens would take the place of a closed one, and get
    what libraries print.
    """
    global _output
    for number in (_READ, _OUT, _ERROR):
        try:
            os.fstat(number)
        except OSError:
            # It has the lowest free number, which is this one. Output that was closed fails where
            # it is written; standard error was the place to report that.
            mode = os.O_WRONLY if number == _ERROR else os.O_RDONLY
            os.set_inheritable(os.open(os.devnull, mode), True)
    # A test or a notebook has others.
    if sys.stdout is sys.__stdout__:
        _output = _Stream(_OUT, "w", closefd=False)
        sys.stdout = _text(_output, sys.__stdout__)
    if sys.stderr is sys.__stderr__:
        sys.stderr = _text(_Stream(_ERROR, "w", closefd=False), sys.__stderr__)
        sys.stderr.reconfigure(line_buffering=True)


def _text(stream: _Stream, before: object) -> io.TextIOWrapper:
    """Return a text stream like the one before."""
    encoding = before.encoding if isinstance(before, io.TextIOWrapper) else None
    buffered = isinstance(before, io.TextIOWrapper) and before.line_buffering
    # The terminal may lack a letter of a scenario's name.
    return io.TextIOWrapper(io.BufferedWriter(stream), encoding, "replace", line_buffering=buffered)


def left() -> bool:
    """Return whether nobody gets the standard output any more."""
    if _output is None:
        return False
    sys.stdout.flush()
    return _output.error is not None


def lost() -> str:
    """Return why standard output was lost; "" if it was not, or if its reader has left."""
    if not left():
        return ""
    assert _output is not None and _output.error is not None
    match _output.error.errno:
        case errno.EPIPE:
            return ""
        case errno.EBADF:
            return "standard output is closed"
    return f"standard output: {_output.error.strerror}"
