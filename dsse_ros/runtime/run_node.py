# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""From the command line to a spinning node and back, with one clear line where it fails."""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import time
import warnings
import weakref
from collections.abc import Callable, Collection, Iterator
from pathlib import Path
from typing import Any

import rclpy
from rclpy.clock import Clock, ClockType
from rclpy.exceptions import (
    InvalidParameterTypeException,
    InvalidParameterValueException,
    NameValidationException,
)
from rclpy.executors import Executor, ExternalShutdownException, SingleThreadedExecutor
from rclpy.logging import LoggingSeverity, get_logger_level, set_logger_level
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import get_rmw_implementation_identifier, remove_ros_args

from dsse_ros.runtime import discovery, security
from dsse_ros.runtime.alarms import Alarms
from dsse_ros.runtime.exit_codes import fail
from dsse_ros.runtime.interrupts import Stop, leave_on_signals, on_signals
from dsse_ros.runtime.parameters import declarable, take_overrides
from dsse_ros.runtime.ros_arguments import UnreadableFileError, parameters_for, split_ros_arguments
from dsse_ros.search import FieldError

MAX_DOMAIN = 232
"""The last domain whose ports there are (DDSI-RTPS 2.3, 9.6.1.1)."""

_LOOK_S = 0.1
"""Wall time between looks at whether a signal has come."""
_WARN_S = 1.0
_ELSEWHERE_S = 0.05
"""Wall time between looks at the alarms in another executor's loop."""

_nodes: weakref.WeakSet[Node] = weakref.WeakSet()
"""All nodes, also those that are still being made."""
_ros_arguments: list[str] = []
"""What followed --ros-args on the command line; rcl keeps it, but does not hand it out."""


def new_executor() -> Executor:
    """Return the executor with the least work per message that this rclpy has."""
    try:
        from rclpy.experimental import EventsExecutor
    except ImportError:
        return SingleThreadedExecutor()
    # In lockstep with 20 drones a step of sim_node takes 4.1 ms of CPU time with it and alarms, 8.6
    # ms with a SingleThreadedExecutor and steady timers, which asks all entities each time: 191 and
    # 91 steps/s, interleaved, where the bare ping-pong did 259 and 168 (rclpy 7.1.6).
    return EventsExecutor()


class AlarmNode(Node):
    """A node with alarms instead of timers.

    The EventsExecutor of rclpy 7.1 to 9.1 calls a timer that is due once more for each reset of any
    other one. `run_node` rings alarms when they are due, any other executor some time later.

    Args:
        name: Name of the node.

    Attributes:
        alarms: In seconds of wall time.
        finished: Whether the node has done what it was started for, and its process ends.
        shared_names: The parameters that only files give to it, and to other nodes as well.
    """

    finished = False

    def __init__(self, name: str) -> None:
        super().__init__(name, automatically_declare_parameters_from_overrides=True)
        _nodes.add(self)
        with _as_field_error():
            given = parameters_for(self.get_fully_qualified_name(), _ros_arguments)
        self.shared_names = frozenset(name for name, one in given.items() if one.shared)
        self.alarms = Alarms(time.monotonic)
        self._warned: dict[str, float] = {}
        self.create_timer(
            _ELSEWHERE_S, self.alarms.ring, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )

    def declare_parameters(
        self, namespace: str, parameters: Any, ignore_override: bool = False
    ) -> list[Any]:
        """Declare parameters, those too whose value has no type: an empty list.

        Raises:
            FieldError: If a value is not allowed.
        """
        declared: list[Any] = [declarable(*parameter) for parameter in parameters]
        return super().declare_parameters(namespace, declared, ignore_override)

    def take_overrides(self, known: Collection[str]) -> tuple[dict[str, Any], dict[str, Any]]:
        """Return the fields and the QoS overrides of these names, see `parameters`.

        Raises:
            FieldError: If a name is not known.
        """
        return take_overrides(self, known, self.shared_names)

    def warn(self, kind: str, text: str) -> None:
        """Log a warning, of each kind one a second at most."""
        now_s = time.monotonic()
        if now_s - self._warned.get(kind, -_WARN_S) >= _WARN_S:
            self._warned[kind] = now_s
            self.get_logger().warning(text)

    def debug(self, text: Callable[[], str]) -> None:
        """Log what is worth making only if somebody wants to read it."""
        if self.get_logger().is_enabled_for(LoggingSeverity.DEBUG):
            self.get_logger().debug(text())


def run_node(name: str, make_node: Callable[[], AlarmNode], argv: list[str] | None) -> int:
    """Make a node, spin it until it has ended, SIGINT or SIGTERM; returns the process's exit code.

    The process is taken to end soon after: from then on it ignores both signals.

    Args:
        name: Opens the line that says what is wrong.
        make_node: Makes the node; may raise FieldError.
        argv: Command line without the program's name, by default the process's own.
    """
    node: AlarmNode | None = None
    stop = Stop()
    try:
        leave_on_signals(_destroy_nodes)
        with _as_field_error():
            _init([name, *(sys.argv[1:] if argv is None else argv)])
            node = make_node()
        executor = new_executor()
        executor.add_node(node)
        # A node is left between two callbacks only, so none of them meets a context that is gone.
        on_signals(stop)
        # EventsExecutor.spin() of rclpy 7.1 burns a whole core once a timer exists.
        while rclpy.ok() and not (stop.wanted or node.finished):
            executor.spin_once(timeout_sec=min(node.alarms.wait_s(), _LOOK_S))
            node.alarms.ring()
    except FieldError as error:
        return fail(name, error)
    except ExternalShutdownException:
        pass
    finally:
        # Not a handler: Python lets a signal kill it in its last moments, unless it is ignored.
        on_signals(signal.SIG_IGN)
        with contextlib.suppress(Exception):
            if node is not None:
                node.destroy_node()
            rclpy.try_shutdown()
    return 0


def _destroy_nodes() -> None:
    """Destroy all nodes: otherwise their files in shared memory would stay."""
    for node in list(_nodes):
        with contextlib.suppress(Exception):
            Node.destroy_node(node)


def init_ros(arguments: list[str]) -> None:
    """Start rclpy with a command line, the program's name first.

    Raises:
        FieldError: If an argument is not allowed.
    """
    with _as_field_error():
        _init(arguments)


def _init(arguments: list[str]) -> None:
    """Start rclpy without its signal handlers, which end the context in the midst of a callback.

    Raises:
        FieldError: If an argument is none of ROS's, there is no such domain, or security is asked
            for in a way that would start the program unprotected.
    """
    with _silent_rcl():
        rest = remove_ros_args(arguments)[1:]
        if rest:
            raise FieldError(
                f"{rest[0]!r} is no argument; parameters are given as --ros-args -p name:=value"
            )
        _ros_arguments[:] = split_ros_arguments(arguments)[1]
        if security.enforce(os.environ):
            # Of a node that is refused; what is wrong is raised.
            warnings.filterwarnings("ignore", "Failed to fini rosout publisher", RuntimeWarning)
        security.check_middleware(os.environ, get_rmw_implementation_identifier())
        discovery.announce_often(os.environ, Path())
        rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
    domain = rclpy.get_default_context().get_domain_id()
    if domain > MAX_DOMAIN:
        raise FieldError(f"ROS_DOMAIN_ID: {domain} is not allowed; 0 to {MAX_DOMAIN}")


@contextlib.contextmanager
def _as_field_error() -> Iterator[None]:
    """Raise what rclpy raises for bad input as FieldError.

    Raises:
        FieldError: If rclpy refuses an argument, a name or a value.
    """
    try:
        yield
    except (
        InvalidParameterTypeException,
        InvalidParameterValueException,
        NameValidationException,
        UnreadableFileError,
    ) as error:
        raise FieldError(str(error)) from None
    except Exception as error:
        # Their classes are not public, and not in the same place in every ROS 2.
        match type(error).__name__:
            case "UnknownROSArgsError":
                raise FieldError(f"unknown ROS arguments: {error}") from None
            case "RCLError" | "RCLInvalidROSArgsError":
                middleware = get_rmw_implementation_identifier()
                raise FieldError(security.explained(str(error), middleware)) from None
        raise


@contextlib.contextmanager
def _silent_rcl() -> Iterator[None]:
    """Keep rcl from logging a line about what it also raises."""
    set_logger_level("rcl", LoggingSeverity.FATAL)
    try:
        yield
    finally:
        # Unless the command line has given it a level.
        if get_logger_level("rcl") == LoggingSeverity.FATAL:
            set_logger_level("rcl", LoggingSeverity.UNSET)
