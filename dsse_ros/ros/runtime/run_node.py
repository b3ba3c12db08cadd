# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Runs a node from its command line to its exit code; failures print one clear line."""

from __future__ import annotations

import contextlib
import faulthandler
import os
import re
import signal
import sys
import time
import traceback
import warnings
import weakref
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import rclpy
from rclpy.clock import Clock, ClockType
from rclpy.context import Context
from rclpy.exceptions import (
    InvalidParameterTypeException,
    InvalidParameterValueException,
    NameValidationException,
)
from rclpy.executors import Executor, ExternalShutdownException, SingleThreadedExecutor
from rclpy.logging import LoggingSeverity, get_logger_level, set_logger_level
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import get_rmw_implementation_identifier

from dsse_ros.base.defects import Defects, describe
from dsse_ros.base.fields import FieldError
from dsse_ros.ros.runtime import fast_dds, security
from dsse_ros.ros.runtime.alarms import Alarms
from dsse_ros.ros.runtime.exit_codes import FAILED, fail
from dsse_ros.ros.runtime.interrupts import WatchedStop, leave_on_signals, on_signals
from dsse_ros.ros.runtime.parameters import QOS_PREFIX, declarable, overrides
from dsse_ros.ros.runtime.ros_arguments import (
    NO_NAMES,
    check_reached,
    full_name,
    known_parameters,
    split_ros_arguments,
    typed_names,
)

T = TypeVar("T")

MAX_DOMAIN = 232
"""The highest domain id with valid ports (DDSI-RTPS 2.3, 9.6.1.1)."""

_LOOK_S = 0.1
"""Wall time between looks at whether a signal has come."""
_WARN_S = 1.0
_ELSEWHERE_S = 0.05
"""Wall time between looks at the alarms in another executor's loop."""
LEAVING_S = 60.0
"""Wall time in which a node closes its files and leaves ROS, else its process ends."""

_nodes: weakref.WeakSet[Node] = weakref.WeakSet()
"""All nodes, including those that are still being made."""
_ros_arguments: list[str] = []
"""The arguments after --ros-args; rcl keeps them, but does not return them."""


def new_executor() -> Executor:
    """Return the executor of this rclpy with the least work per message."""
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

    The EventsExecutor of rclpy 7.1 to 9.1 calls a due timer again for each reset of any other
    timer. `run_node` rings alarms when they are due, other executors some time later.

    Args:
        name: Name of the node.
        options: Further arguments of `Node`.

    Attributes:
        program: Name of the node if it is not remapped.
        alarms: Alarms, in seconds of wall time.
        finished: Whether the node has done its work, so that its process ends.
        failed: Whether the node could not do its work to the end.
        typed_names: Parameters given with -p, not in a file that other nodes may read too.
    """

    finished = False
    failed = False

    def __init__(self, name: str, **options: Any) -> None:
        super().__init__(name, automatically_declare_parameters_from_overrides=True, **options)
        _nodes.add(self)
        self.program = name
        self.typed_names = typed_names(_ros_arguments)
        self.alarms = Alarms(time.monotonic)
        self._warned: dict[str, float] = {}
        self._defects = Defects()
        self._endings = contextlib.ExitStack()
        self.create_timer(
            _ELSEWHERE_S, self.alarms.ring, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )

    def at_end(self, callback: Callable[[], object]) -> None:
        """Have the node call this when it ends, before the functions of earlier calls.

        rclpy may also destroy a node whose constructor has failed.
        """
        self._endings.callback(callback)

    def destroy_node(self) -> None:
        """Do what is left to do at the end, and close the node."""
        try:
            self._endings.close()
        finally:
            super().destroy_node()

    def declare_parameters(
        self, namespace: str, parameters: Any, ignore_override: bool = False
    ) -> list[Any]:
        """Declare parameters, including those whose value has no type: an empty list.

        Raises:
            FieldError: If a value is not allowed.
        """
        declared: list[Any] = [declarable(*parameter) for parameter in parameters]
        return super().declare_parameters(namespace, declared, ignore_override)

    def take_overrides(
        self, known: Collection[str], full_names: Mapping[str, str] = NO_NAMES
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Return the parameters and the QoS overrides that the node was started with.

        See `ros_arguments.known_parameters` for the names.

        Raises:
            FieldError: If a name is not allowed.
        """
        values = overrides(self)
        qos = {name: values.pop(name) for name in list(values) if name.startswith(QOS_PREFIX)}
        check_reached([self.get_fully_qualified_name()], _ros_arguments)
        what = f"the parameters of {self.get_name()}"
        kept = known_parameters(what, values, known, self.typed_names, full_names)
        if others := values.keys() - kept.keys():
            self.get_logger().info(
                f"no parameters of {self.get_name()}, left to other nodes: "
                + ", ".join(sorted(others))
            )
        return kept, qos

    def warn(self, kind: str, text: str) -> None:
        """Log a warning, at most one a second of each kind."""
        now_s = time.monotonic()
        if now_s - self._warned.get(kind, -_WARN_S) >= _WARN_S:
            self._warned[kind] = now_s
            self.get_logger().warning(text)

    def isolated(
        self, what: str, callback: Callable[..., T], otherwise: Any = None
    ) -> Callable[..., T | Any]:
        """Return a callback whose exceptions are logged, because one that escapes ends the node.

        A ValueError is bad input: a warning, at most one a second. Any other exception is a defect:
        an error, once for each kind.

        Args:
            what: The start of the log line, such as the topic.
            callback: The callback.
            otherwise: What is returned after an exception.
        """

        def call(*arguments: Any) -> T | Any:
            try:
                return callback(*arguments)
            except ValueError as error:
                self.warn(what, f"{what}: {error}")
            except Exception as error:
                # While ROS is left, nothing can be published.
                if self.context.ok() and self._defects.is_new(error):
                    text = "".join(traceback.format_exception(error))
                    self.get_logger().error(f"{what}: defect: {describe(error)}\n{text}")
            return otherwise

        return call

    def hand_over(self) -> None:  # noqa: B027
        """Leave what the node controls in a safe state; called from any thread before it ends."""

    def debug(self, text: Callable[[], str]) -> None:
        """Log at debug level; make the text only if that level is logged."""
        if self.get_logger().is_enabled_for(LoggingSeverity.DEBUG):
            self.get_logger().debug(text())


def run_node(name: str, make_node: Callable[[], AlarmNode], argv: list[str] | None) -> int:
    """Make a node, spin it until it has ended, SIGINT or SIGTERM; return the process's exit code.

    It is 2 for bad input and 3 if the node has failed.

    The process should exit soon after the return: from then on it ignores both signals. If leaving
    ROS takes longer than `LEAVING_S`, the process ends. If a callback keeps the loop from ending,
    another signal, or `interrupts.STUCK_S` after the first one, ends the process once the node has
    handed over.

    Args:
        name: Start of the error line.
        make_node: Makes the node; may raise FieldError.
        argv: Command line without the program's name, by default the process's own.
    """
    node: AlarmNode | None = None
    executor: Executor | None = None
    stop = WatchedStop(lambda: node.hand_over() if node is not None else None)
    try:
        leave_on_signals(_destroy_nodes, code=0)
        with _as_field_error():
            _init([name, *(sys.argv[1:] if argv is None else argv)])
            node = make_node()
        executor = new_executor()
        executor.add_node(node)
        # Stop between two callbacks only, so that no callback runs without a context.
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
        # Ignore signals instead of handling them: a signal can kill Python while it exits.
        on_signals(signal.SIG_IGN)
        stop.loop_ended.set()
        leave_ros(executor, node)
    return FAILED if node is not None and node.failed else 0


@contextlib.contextmanager
def spinning(node: Node) -> Iterator[Executor]:
    """Yield an executor with this node, and leave ROS at the end."""
    executor = new_executor()
    executor.add_node(node)
    try:
        yield executor
    finally:
        leave_ros(executor, node)


def leave_ros(executor: Executor | None = None, node: Node | None = None) -> None:
    """End an executor, its node and rclpy; if it takes longer than `LEAVING_S`, end the process."""
    with contextlib.suppress(Exception), _in_time():
        # The executor holds the participant, which would be destroyed after the time limit.
        if executor is not None:
            executor.shutdown()
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()


def _destroy_nodes() -> None:
    """Destroy all nodes, because otherwise their files in shared memory would stay."""
    with _in_time():
        for node in list(_nodes):
            with contextlib.suppress(Exception):
                Node.destroy_node(node)


@contextlib.contextmanager
def _in_time() -> Iterator[None]:
    """End the process with code 1 and a traceback if this takes longer than `LEAVING_S`.

    Fast DDS can deadlock as a node removes an endpoint while another node leaves (its issue #6502).
    rclpy then holds Python's lock, so no thread of Python could end the process.
    """
    # A program may have replaced `sys.stderr` with an object that is not a file.
    if sys.__stderr__ is not None and not sys.__stderr__.closed:
        faulthandler.dump_traceback_later(LEAVING_S, exit=True, file=sys.__stderr__)
    try:
        yield
    finally:
        faulthandler.cancel_dump_traceback_later()


def init_ros(arguments: list[str]) -> None:
    """Start rclpy with a command line, the program's name first.

    Raises:
        FieldError: If an argument is not allowed.
    """
    with _as_field_error():
        _init(arguments)


def overrides_of(
    names: Iterable[str], ros: Sequence[str], others: Iterable[str] = ()
) -> dict[str, Any]:
    """Return the parameters that ROS arguments give to nodes of these names, the last one's first.

    Args:
        names: Names of nodes; they exist during the call.
        ros: The arguments after --ros-args.
        others: Names of other nodes that they may be for.

    Raises:
        FieldError: If an argument is not allowed.
    """
    check_reached([full_name(name, ros) for name in (*names, *others)], ros)
    found: dict[str, Any] = {}
    context = Context()
    try:
        with _as_field_error():
            _init(["", "--ros-args", *ros], context)
            for name in names:
                node = AlarmNode(name, context=context, enable_rosout=False)
                found |= overrides(node)
                with _in_time():
                    node.destroy_node()
    finally:
        context.try_shutdown()
    return found


def _init(arguments: list[str], context: Context | None = None) -> None:
    """Start rclpy without its signal handlers, which end the context during a callback.

    Raises:
        FieldError: If an argument is not a ROS argument, the domain is not allowed, or security is
            requested in a way that would start the program unprotected.
    """
    with _silent_rcl():
        # rcl would take name:=value among the program's own arguments for a remapping.
        own, _ros_arguments[:] = split_ros_arguments(arguments)
        if len(own) > 1:
            raise FieldError(
                f"{own[1]!r} is not an argument; give parameters as --ros-args -p name:=value"
            )
        if security.enforce(os.environ):
            # A refused node emits this warning, and its error is raised anyway.
            warnings.filterwarnings("ignore", "Failed to fini rosout publisher", RuntimeWarning)
        security.check_middleware(os.environ, get_rmw_implementation_identifier())
        fast_dds.configure(os.environ, Path())
        context = context or rclpy.get_default_context()
        rclpy.init(args=arguments, context=context, signal_handler_options=SignalHandlerOptions.NO)
    domain = context.get_domain_id()
    if domain > MAX_DOMAIN:
        raise FieldError(f"ROS_DOMAIN_ID must be from 0 to {MAX_DOMAIN}, got {domain}")


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
    ) as error:
        raise FieldError(str(error)) from None
    except Exception as error:
        # The error classes are not public, and their module depends on the ROS 2 version.
        match type(error).__name__:
            case "UnknownROSArgsError":
                raise FieldError(f"unknown ROS arguments: {error}") from None
            case "RCLError" | "RCLInvalidROSArgsError":
                middleware = get_rmw_implementation_identifier()
                text = _plain(security.explained(str(error), middleware))
                raise FieldError(text) from None
        raise


_RULES = {
    "remap rule": "a remapping from:=to: names have letters, digits and underscores, do not begin "
    "with a digit, and a namespace begins with /",
    "parameter override rule": "a parameter name:=value with a value in YAML, or node:name:=value "
    "with the name of a node without its namespace",
}
"""What an argument after --ros-args must be, by the name that rcl has for it."""


def _plain(error: str) -> str:
    """Return an error of rcl about an argument without the parser's states."""
    for rule, wanted in _RULES.items():
        if refused := re.search(rf"Couldn't parse {rule}: '(?:-\w|--\w+) (.*?)'\. ", error):
            return f"{refused[1]!r} must be {wanted}"
    return error


@contextlib.contextmanager
def _silent_rcl() -> Iterator[None]:
    """Keep rcl from logging a line about what it also raises."""
    set_logger_level("rcl", LoggingSeverity.FATAL)
    try:
        yield
    finally:
        # Keep a level that the command line has set.
        if get_logger_level("rcl") == LoggingSeverity.FATAL:
            set_logger_level("rcl", LoggingSeverity.UNSET)
