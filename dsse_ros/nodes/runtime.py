# SPDX-License-Identifier: Apache-2.0
"""From the command line to a spinning node and back, with one clear line where it fails."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable

import rclpy
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.executors import Executor, ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node

from dsse_ros.search import FieldError

BAD_INPUT = 2
"""Exit code after an input that is not allowed."""


def new_executor() -> Executor:
    """Return the executor with the least work per message that this rclpy has."""
    try:
        from rclpy.experimental import EventsExecutor
    except ImportError:
        return SingleThreadedExecutor()
    return EventsExecutor()


def run_node(name: str, make_node: Callable[[], Node], argv: list[str] | None) -> int:
    """Make a node, spin it until it is interrupted, and return the process's exit code.

    Args:
        name: Opens the line that says what is wrong.
        make_node: Makes the node; may raise FieldError.
        argv: Command line without the program's name, by default the process's own.
    """
    node: Node | None = None
    try:
        rclpy.init(args=None if argv is None else [name, *argv])
        node = make_node()
        executor = new_executor()
        executor.add_node(node)
        # EventsExecutor.spin() of rclpy 7.1 burns a whole core once a timer exists.
        while rclpy.ok():
            executor.spin_once(timeout_sec=1.0)
    except (FieldError, InvalidParameterTypeException, InvalidParameterValueException) as error:
        return fail(name, error)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except rclpy.exceptions.ROSInterruptException:
        pass
    except Exception as error:
        if type(error).__name__ in ("RCLInvalidROSArgsError", "UnknownROSArgsError", "RCLError"):
            return fail(name, error)
        raise
    finally:
        # A second interrupt or a context that is gone already must not hide the exit code.
        with contextlib.suppress(KeyboardInterrupt, Exception):
            if node is not None:
                node.destroy_node()
            rclpy.try_shutdown()
    return 0


def fail(name: str, error: object) -> int:
    """Print what is wrong on one line and return the exit code for it."""
    print(f"{name}: {' '.join(str(error).split())}", file=sys.stderr)
    return BAD_INPUT
