# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A vehicle between its links and the air, without sockets and without a clock.

What the two autopilots have in common; what they do not is in `ardupilot` and `px4`.
"""

from __future__ import annotations

import math
import random
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from functools import partial
from typing import ClassVar

from .channel import Channel, Sender
from .commands import ACCEPTED, DENIED, FAILED, UNSUPPORTED, Command
from .faults import Fault, Schedule
from .local_frame import LocalFrame, Place, Point
from .maneuvers import Fall, Hold, Land, Maneuver, Return, TakeOff
from .mission_items import Item
from .mission_run import Mission, MissionRun
from .mission_service import MissionService
from .parameters import Number, Parameters
from .point_mass import Limits, PointMass
from .settings import Settings
from .telemetry import Builder
from .wire import Codec, Message, mavlink

STEP_S = 0.02
"""Vehicle time of one step of the flight."""

_TICK_STEPS = 5
TICK_S = _TICK_STEPS * STEP_S
"""Vehicle time between two looks at everything that is slower than flying."""

MIN_INTERVAL_S = STEP_S
"""Shortest time between two messages of a kind."""

_MAX_INTERVAL_S = 2000.0
_MAX_SPEED_MPS = 30.0
_MAX_ACCELERATION_MPS2 = 10.0
_TIMESYNC_S = 10.0
_BATTERY_LOW = 0.12
_FORCE = 21196
_FTP_NAK, _FTP_FAILED = 129, 1

Handler = Callable[[Message, Sender], None]
CommandHandler = Callable[[Command], int]


def clamp(value: float, low: float, high: float) -> float:
    """Return the value, or the limit that it is beyond."""
    return min(max(value, low), high)


class Vehicle(ABC):
    """One vehicle.

    Attributes:
        settings: What it was started with.
        time_s: Vehicle time since the start.
        frame: Metres about home.
        craft: What flies.
        maneuver: What it is doing.
        armed: Whether the motors turn.
        landed: Whether it stands on the ground.
        battery: What is left of it, 1 when full.
        failsafes: Names of the active failsafes.
        mission: What is stored.
        parameters: By name.
        limits: What it may do now.
        home: Where its home is from where it stood first, as it or a person has moved it.
        boot_s: Vehicle time at which its autopilot was started.
        uid: Its own id.
    """

    kind: ClassVar[int] = mavlink.MAV_TYPE_QUADROTOR
    autopilot: ClassVar[int]
    version: ClassVar[tuple[int, int, int]]
    capabilities: ClassVar[int]
    builders: ClassVar[Mapping[int, Builder]]
    default_intervals_s: ClassVar[Mapping[int, float]]
    default_parameters: ClassVar[Mapping[str, Number]]
    bytewise_parameters: ClassVar[bool]
    mission_service: ClassVar[type[MissionService]]
    takes_off_by_itself: ClassVar[bool]
    falls: ClassVar[type[Fall]] = Fall

    def __init__(self, settings: Settings) -> None:
        self.settings = settings
        self.random = random.Random(f"{settings.seed} {settings.system}")
        self.time_s = 0.0
        self.frame = LocalFrame(settings.home)
        self.craft = PointMass(settings.wind_mps)
        self.maneuver: Maneuver = Hold()
        self.armed = False
        self.landed = True
        self.battery = 1.0
        self.home = Point(0.0, 0.0, 0.0)
        self.boot_s = 0.0
        self.uid = settings.system
        self.failsafes: set[str] = set()
        self.mission = Mission()
        self._speed_mps: float | None = None
        self.parameters = Parameters(
            {**self.default_parameters, **self._own_parameters()},
            bytewise=self.bytewise_parameters,
            broadcast=self.broadcast,
        )
        for name, value in settings.parameters:
            self.parameters[name] = value
        self.parameters.changed = self._parameter_changed
        self.limits = self._make_limits()
        self.missions = self.mission_service(self)
        self._channels: list[Channel] = []
        self._steps = 0
        self._faults = Schedule(settings.faults)
        self._grounded_s = 0.0
        self._airborne_s: float | None = None
        self._fall: Fall | None = None
        self._loses_requests = settings.requests_lost_s > 0
        self._had_position = False
        self._handlers: dict[str, Handler] = {
            "COMMAND_LONG": self._command,
            "COMMAND_INT": self._command,
            "FILE_TRANSFER_PROTOCOL": self._file_transfer,
            "HEARTBEAT": self.handle_heartbeat,
            "SET_MODE": self._set_mode_message,
            "SET_POSITION_TARGET_GLOBAL_INT": self.set_position_target,
            "SET_POSITION_TARGET_LOCAL_NED": self.set_position_target,
            "TIMESYNC": self._timesync,
            **self.parameters.handlers,
            **self.missions.handlers,
        }
        self._commands: dict[int, CommandHandler] = {
            mavlink.MAV_CMD_COMPONENT_ARM_DISARM: self._arm_disarm,
            mavlink.MAV_CMD_DO_SET_MODE: self._do_set_mode,
            mavlink.MAV_CMD_DO_CHANGE_SPEED: self._do_change_speed,
            mavlink.MAV_CMD_DO_SET_HOME: self._do_set_home,
            mavlink.MAV_CMD_SET_MESSAGE_INTERVAL: self._set_message_interval,
            mavlink.MAV_CMD_GET_MESSAGE_INTERVAL: self._get_message_interval,
            mavlink.MAV_CMD_REQUEST_MESSAGE: self._request_message,
            mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: partial(
                self._request, mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION
            ),
            mavlink.MAV_CMD_GET_HOME_POSITION: partial(
                self._request, mavlink.MAVLINK_MSG_ID_HOME_POSITION
            ),
        }

    # Links

    def connect(self, transmit: Callable[[bytes], None], *, datagram: bool) -> Channel:
        """Return a new link, over which it streams from now on."""
        channel = Channel(
            Codec(self.settings.system, self.settings.key), transmit, datagram=datagram
        )
        channel.stream_only(self.default_intervals_s, self.time_s)
        self._channels.append(channel)
        return channel

    def receive(self, channel: Channel, data: bytes) -> None:
        """Process bytes from a link."""
        for message in channel.messages(data):
            handler = self._handlers.get(message.get_type())
            if handler is not None and self._is_for_us(message):
                sender = Sender(channel, message.get_srcSystem(), message.get_srcComponent())
                handler(message, sender)

    def broadcast(self, message: Message) -> None:
        """Send a message over all links."""
        for channel in self._channels:
            channel.send(message)

    def send_text(self, text: str, severity: int = mavlink.MAV_SEVERITY_INFO) -> None:
        """Send a STATUSTEXT over all links."""
        self.broadcast(mavlink.MAVLink_statustext_message(severity, text.encode()[:50]))

    def _is_for_us(self, message: Message) -> bool:
        # Both autopilots accept messages to system 0.
        system = getattr(message, "target_system", 0)
        component = getattr(message, "target_component", 0)
        return system in (0, self.settings.system) and component in (
            mavlink.MAV_COMP_ID_ALL,
            mavlink.MAV_COMP_ID_AUTOPILOT1,
        )

    # Time

    @property
    def next_s(self) -> float:
        """Vehicle time at which there is something to do again."""
        tick_s = (self._steps // _TICK_STEPS + 1) * TICK_S
        return min(tick_s, *(channel.due_s for channel in self._channels), math.inf)

    def set_speedup(self, speedup: float) -> None:  # noqa: B027
        """Set how much faster than the wall clock vehicle time goes."""

    def advance(self, to_s: float) -> None:
        """Let vehicle time pass."""
        while (self._steps + 1) * STEP_S <= to_s + 1e-9:
            self._steps += 1
            self.time_s = self._steps * STEP_S
            if self.armed or self._fall:
                (self._fall or self.maneuver).step(self, STEP_S)
            if self._steps % _TICK_STEPS == 0:
                self._tick()
            for channel in self._channels:
                if channel.due_s <= self.time_s:
                    self._stream(channel)

    def _stream(self, channel: Channel) -> None:
        for number in channel.take_due(self.time_s):
            message = self.builders[number](self)
            if message is not None:
                channel.send(message)

    def _tick(self) -> None:
        for fault in self._faults.due(self.time_s, self._airborne_s):
            self._start_fault(fault)
        silent = self._faults.lasting("link") is not None
        for channel in self._channels:
            channel.silent = silent
        if self._loses_requests and self.time_s >= self.settings.requests_lost_s:
            self._loses_requests = False
            for channel in self._channels:
                channel.stream_only(self.default_intervals_s, self.time_s)
        if self.has_position and not self._had_position:
            self._had_position = True
            self.broadcast_home()
        if self._steps % round(_TIMESYNC_S / STEP_S) == 0:
            self.broadcast(mavlink.MAVLink_timesync_message(0, int(self.time_s * 1e9)))
        if not self.landed:
            self.battery = max(0.0, self.battery - TICK_S / self.settings.endurance_s)
        idle = self.armed and self.landed and not isinstance(self.maneuver, TakeOff)
        limit_s = self.grounded_limit_s
        if idle and 0.0 < limit_s <= self.time_s - self._grounded_s:
            self.disarm()
        self.parameters.tick()
        self.missions.tick()
        self.tick()

    def tick(self) -> None:  # noqa: B027
        """Do what the autopilot does besides, every `TICK_S`."""

    def broadcast_home(self) -> None:
        """Send the home position over all links."""
        for number in (
            mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN,
            mavlink.MAVLINK_MSG_ID_HOME_POSITION,
        ):
            self.broadcast(self.builders[number](self))

    # State

    @property
    def ready(self) -> bool:
        """Whether it can be armed."""
        return self.uptime_s >= self.settings.ready_s

    @property
    def has_position(self) -> bool:
        """Whether it knows where it is; that comes before it is ready."""
        return self.settings.gps and self.uptime_s >= 0.6 * self.settings.ready_s

    @property
    def seems_to_fly(self) -> bool:
        """Whether it reports to be in the air."""
        return not self.landed

    @property
    def uptime_s(self) -> float:
        """Time since its autopilot was started."""
        return self.time_s - self.boot_s

    @property
    def home_place(self) -> Place:
        """Where its home is."""
        lat_deg, lon_deg = self.frame.geodetic(self.home.north_m, self.home.east_m)
        return Place(lat_deg, lon_deg, self.settings.home.alt_amsl_m + self.home.up_m)

    @property
    @abstractmethod
    def ekf_flags(self) -> int:
        """EKF_STATUS_REPORT.flags, or ESTIMATOR_STATUS.flags."""

    @property
    def system_status(self) -> int:
        """HEARTBEAT.system_status."""
        if self.failsafes:
            return mavlink.MAV_STATE_CRITICAL
        return mavlink.MAV_STATE_STANDBY if self.landed else mavlink.MAV_STATE_ACTIVE

    @property
    def fenced(self) -> bool:
        """Whether SYS_STATUS says that a geofence is enabled."""
        return False

    @property
    def charge_state(self) -> int:
        """BATTERY_STATUS.charge_state."""
        return mavlink.MAV_BATTERY_CHARGE_STATE_OK

    @property
    @abstractmethod
    def base_mode(self) -> int:
        """HEARTBEAT.base_mode, but for the flags that both autopilots have."""

    @property
    @abstractmethod
    def custom_mode(self) -> int:
        """HEARTBEAT.custom_mode."""

    @property
    @abstractmethod
    def mission_total(self) -> int:
        """MISSION_CURRENT.total."""

    @property
    def mission_id(self) -> int:
        """MISSION_CURRENT.mission_id; 0 if it makes none."""
        return 0

    @property
    @abstractmethod
    def grounded_limit_s(self) -> float:
        """Time after which it disarms itself on the ground; 0 or less for never."""

    # What befalls it

    def power_cycle(self) -> None:
        """Be switched off and on, on the ground."""
        self.disarm()
        self.boot_s, self._had_position = self.time_s, False
        self.home = self.craft.point
        for channel in self._channels:
            channel.stream_only(self.default_intervals_s, self.time_s)

    def lose_motors(self) -> None:
        """Fall, and stay armed in the mode that there is, whatever is asked for."""
        self._fall = Fall()

    # What maneuvers call

    def lift_off(self) -> None:
        """Leave the ground."""
        self.landed = False
        if self._airborne_s is None:
            self._airborne_s = self.time_s

    def touch_down(self) -> None:
        """Be on the ground, at the end of a landing."""
        self.landed = True
        self._grounded_s = self.time_s

    def item_begun(self, seq: int, item: Item) -> None:  # noqa: B027
        """Begin an item of the mission."""

    def item_reached(self, seq: int) -> None:
        """Finish an item of the mission."""
        self.mission.reached = seq
        self.broadcast(mavlink.MAVLink_mission_item_reached_message(seq))

    def mission_finished(self) -> None:  # noqa: B027
        """Have no further item."""

    def restart_mission(self) -> None:
        """Leave the item that is being flown and fly the current one."""
        self.maneuver = MissionRun()

    def change_speed(self, speed_mps: float) -> None:
        """Fly at another speed over ground until it is disarmed."""
        if speed_mps > 0:
            self._speed_mps = speed_mps
            self.limits = self._make_limits()

    # What maneuvers are made of

    @abstractmethod
    def take_off(self, up_m: float) -> TakeOff:
        """Return a climb to metres above home."""

    @abstractmethod
    def landing(self) -> Land:
        """Return a landing."""

    @abstractmethod
    def way_home(self) -> Return:
        """Return the way home."""

    @abstractmethod
    def acceptance_radius_m(self, item: Item) -> float:
        """Return how near to an item counts as there."""

    @abstractmethod
    def usual_limits(self) -> Limits:
        """Return the limits that the parameters set."""

    def _make_limits(self) -> Limits:
        limits = self.usual_limits()
        speed_mps = limits.speed_mps if self._speed_mps is None else self._speed_mps
        # Whatever the parameters say, it is a multicopter.
        speeds = (speed_mps, limits.climb_mps, limits.descent_mps)
        speed_mps, climb_mps, descent_mps = (clamp(v, 0.1, _MAX_SPEED_MPS) for v in speeds)
        accelerations = (limits.acceleration_mps2, limits.vertical_mps2)
        horizontal, vertical = (clamp(v, 0.1, _MAX_ACCELERATION_MPS2) for v in accelerations)
        return Limits(speed_mps, horizontal, climb_mps, descent_mps, vertical)

    # Arming

    @abstractmethod
    def arm(self, *, force: bool) -> int:
        """Arm if its checks pass, and return a MAV_RESULT."""

    def start_motors(self) -> None:
        """Be armed."""
        self.armed, self._fall = True, None
        self._grounded_s = self.time_s

    def disarm(self) -> None:
        """Stop the motors; in the air it falls, and reports to be on the ground at once."""
        if not self.armed:
            return
        self.armed = False
        if self.landed:
            self.craft.stop(up_m=0.0)
        elif self._fall is None:
            self._fall = self.falls()
        self.landed = True
        self._speed_mps = None
        self.limits = self._make_limits()

    def _arm_disarm(self, command: Command) -> int:
        force = command.param2 == _FORCE
        if command.param1 == 1:
            return ACCEPTED if self.armed else self.arm(force=force)
        if command.param1 == 0:
            if self.armed and not self.landed and not force:
                return FAILED
            self.disarm()
            return ACCEPTED
        return UNSUPPORTED

    # Commands

    def _command(self, message: Message, sender: Sender) -> None:
        command = Command.received(message, sender)
        handler = self._commands.get(command.number)
        self.acknowledge(command.number, handler(command) if handler else UNSUPPORTED, sender)

    def acknowledge(self, number: int, result: int, sender: Sender) -> None:
        """Send a COMMAND_ACK, if it is not lost."""
        if not self.loses("acks"):
            sender.channel.send(
                mavlink.MAVLink_command_ack_message(
                    number, result, 0, 0, sender.system, sender.component
                )
            )

    def loses(self, kind: str) -> bool:
        """Whether an acknowledgement is lost now."""
        fault = self._faults.lasting(kind)
        return fault is not None and self.random.random() < float(fault.value or 1)

    def add_commands(self, handlers: Mapping[int, CommandHandler]) -> None:
        """Add handlers of commands, by their MAV_CMD."""
        self._commands.update(handlers)

    def add_handlers(self, handlers: Mapping[str, Handler]) -> None:
        """Add handlers of messages, by their name."""
        self._handlers.update(handlers)

    def _set_message_interval(self, command: Command) -> int:
        number, interval_us = command.whole(1), command.param2
        if number not in self.builders or not math.isfinite(interval_us):
            return DENIED
        interval_s: float | None
        if interval_us < 0:
            interval_s = None
        elif interval_us == 0:
            interval_s = self.default_intervals_s.get(number)
        else:
            interval_s = min(max(MIN_INTERVAL_S, interval_us * 1e-6), _MAX_INTERVAL_S)
        if not self._loses_requests:
            command.sender.channel.stream(number, interval_s, self.time_s)
        return ACCEPTED

    def _get_message_interval(self, command: Command) -> int:
        number = command.whole(1)
        if number not in self.builders:
            return FAILED
        interval_s = command.sender.channel.interval_s(number)
        command.sender.channel.send(
            mavlink.MAVLink_message_interval_message(
                number, -1 if interval_s is None else round(interval_s * 1e6)
            )
        )
        return ACCEPTED

    def _request_message(self, command: Command) -> int:
        return self._request(command.whole(1), command)

    def _request(self, number: int, command: Command) -> int:
        builder = self.builders.get(number)
        message = builder(self) if builder else None
        if message is None:
            return FAILED
        command.sender.channel.send(message)
        return ACCEPTED

    def _do_set_home(self, command: Command) -> int:
        if command.whole(1) == 1:
            self.home = self.craft.point
        elif command.on_the_earth:
            up_m = command.z - self.frame.home.alt_amsl_m
            self.home = Point(*self.frame.horizontal(command.lat_deg, command.lon_deg), up_m)
        else:
            return FAILED
        self.broadcast_home()
        return ACCEPTED

    def _do_change_speed(self, command: Command) -> int:
        if not command.param2 > 0:
            return FAILED
        self.change_speed(command.param2)
        return ACCEPTED

    @abstractmethod
    def request_mode(self, main: int, sub: int) -> int:
        """Change the mode if that is possible, and return a MAV_RESULT."""

    def _do_set_mode(self, command: Command) -> int:
        base_mode, main = command.whole(1), command.whole(2)
        sub = int(command.param3) if math.isfinite(command.param3) else 0
        if base_mode < 0 or not base_mode & mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED:
            return DENIED
        return self.request_mode(main, sub)

    def _set_mode_message(self, message: Message, sender: Sender) -> None:
        if message.base_mode & mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED:
            result = self.set_mode_number(message.custom_mode)
            self.acknowledge(mavlink.MAVLINK_MSG_ID_SET_MODE, result, sender)

    @abstractmethod
    def set_mode_number(self, custom_mode: int) -> int:
        """Change to the mode of a HEARTBEAT.custom_mode, and return a MAV_RESULT."""

    # Other messages

    @abstractmethod
    def set_position_target(self, message: Message, sender: Sender) -> None:
        """Process a setpoint."""

    def handle_heartbeat(self, message: Message, sender: Sender) -> None:  # noqa: B027
        """Process another system's heartbeat."""

    def _timesync(self, message: Message, sender: Sender) -> None:
        if message.tc1 == 0:
            now_ns = int(self.time_s * 1e9)
            sender.channel.send(mavlink.MAVLink_timesync_message(now_ns, message.ts1))

    def _file_transfer(self, message: Message, sender: Sender) -> None:
        """Refuse every file, so that no client waits for one."""
        request = bytes(message.payload)
        number = (int.from_bytes(request[:2], "little") + 1) % 65536
        answer = number.to_bytes(2, "little") + bytes(
            [request[2], _FTP_NAK, 1, request[3], 0, 0, 0, 0, 0, 0, _FTP_FAILED]
        )
        sender.channel.send(
            mavlink.MAVLink_file_transfer_protocol_message(
                0, sender.system, sender.component, answer.ljust(251, b"\0")
            )
        )

    def _parameter_changed(self, name: str) -> None:
        self.limits = self._make_limits()

    @abstractmethod
    def _own_parameters(self) -> Mapping[str, Number]:
        """Return the parameters that come from the settings."""

    # Faults

    def _start_fault(self, fault: Fault) -> None:
        if fault.kind == "battery":
            self.battery = min(self.battery, _BATTERY_LOW)
            self.failsafes.add("battery")
            self.battery_failsafe()
        elif fault.kind == "pilot":
            self.pilot_takes_over(fault.value)

    @abstractmethod
    def battery_failsafe(self) -> None:
        """React to a low battery."""

    @abstractmethod
    def pilot_takes_over(self, mode: str) -> None:
        """Have a pilot choose a mode, by its name or by the usual one."""
