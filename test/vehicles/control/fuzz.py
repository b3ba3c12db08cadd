# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Any message of ArduPilot's message set with any fields, through codec and vehicle controller.

`python test/vehicles/control/fuzz.py 1000000` does it by hand; a seed may follow.
"""

from __future__ import annotations

import random
import struct
import sys
from collections import Counter
from pathlib import Path
from typing import Any

if not __package__ and __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parent))

from autopilot.wire import Codec as VehicleCodec
from autopilot.wire import mavlink

from dsse_ros.vehicles.control.commands import ControllerSettings
from dsse_ros.vehicles.control.orders import (
    FlyMission,
    GoTo,
    Hold,
    Land,
    Order,
    Return,
    SearchPlace,
    TakeOff,
)
from dsse_ros.vehicles.control.vehicle_controller import VehicleController
from dsse_ros.vehicles.mavlink.codec import Codec
from dsse_ros.vehicles.mavlink.messages import INCOMING, Address
from dsse_ros.vehicles.mission_items.items import MissionItem

VEHICLE, OURSELVES = Address(7, 1), Address(245, 191)
AUTOPILOTS = (mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, mavlink.MAV_AUTOPILOT_PX4)
_ALL = list(mavlink.mavlink_map.values())
_INCOMING = [kind for kind in _ALL if kind in INCOMING]
_ITEMS = tuple(
    MissionItem(command, lat_deg=-24.0 + 1e-5 * seq, lon_deg=-46.3, alt_m=20.0)
    for seq, command in enumerate((16, 22, 16, 20))
)
_ORDERS: tuple[Order, ...] = (
    TakeOff(20.0),
    GoTo(-24.001, -46.3, 20.0, 3.0),
    SearchPlace(-24.001, -46.3, 20.0, 10.0, 3.0, 3.0),
    Hold(),
    Return(),
    Land(),
    FlyMission(_ITEMS),
)
_LIMITS = {
    "int8_t": (-(2**7), 2**7 - 1),
    "uint8_t": (0, 2**8 - 1),
    "uint8_t_mavlink_version": (0, 2**8 - 1),
    "int16_t": (-(2**15), 2**15 - 1),
    "uint16_t": (0, 2**16 - 1),
    "int32_t": (-(2**31), 2**31 - 1),
    "uint32_t": (0, 2**32 - 1),
    "int64_t": (-(2**63), 2**63 - 1),
    "uint64_t": (0, 2**64 - 1),
}
_FLOATS = (0.0, -0.0, 1.0, 1e-45, 3.4e38, -3.4e38, float("inf"), float("-inf"), float("nan"))


def fuzz(number: int, seed: int, autopilot: Any) -> tuple[Counter[str], Counter[str]]:
    """Send messages to a controller that gets orders, and return what codec and controller count.

    Raises:
        AssertionError: If it would send what cannot be sent, be due at once again, or accept
            an invalid position.
    """
    draw = random.Random(seed)
    sender = VehicleCodec(VEHICLE.system)
    codec = Codec(OURSELVES, VEHICLE)
    settings = ControllerSettings(autopilot=autopilot, speed_mps=5.0)
    controller = VehicleController(VEHICLE, OURSELVES, settings)
    counts: Counter[str] = Counter()
    now = 0.0
    for _ in range(number):
        now += draw.choice((0.0, 0.01, 0.1))
        outgoing = []
        kind = draw.choice(_INCOMING if draw.random() < 0.8 else _ALL)
        data = bytes(sender.encode(any_message(kind, draw)))
        for message in codec.decode(data, now, datagram=True):
            outgoing += controller.receive(message, now)
        if now >= controller.deadline:
            outgoing += controller.tick(now)
            assert controller.deadline > now
        if draw.random() < 0.01:
            outgoing += controller.give(draw.choice(_ORDERS), now)
        if draw.random() < 0.001:
            outgoing += controller.hand_over(Hold(), now)
            # As when the program is started again.
            counts += controller.counts
            controller = VehicleController(VEHICLE, OURSELVES, settings)
        for one in outgoing:
            assert codec.encode(one)
        state = controller.state
        assert not abs(state.lat_deg) > 90 and not abs(state.lon_deg) > 180
        assert not abs(state.alt_m) > 1e5 and not abs(state.alt_amsl_m) > 1e5
        assert not controller.counts["errors"], controller.outcome
    return codec.counts, counts + controller.counts


def any_message(kind: Any, draw: random.Random) -> Any:
    """Return a message of a kind, with any fields; now and then one that is for us."""
    values: dict[str, Any] = {}
    lengths = dict(zip(kind.ordered_fieldnames, kind.array_lengths, strict=True))
    for name, wire_type in zip(kind.fieldnames, kind.fieldtypes, strict=True):
        length = lengths[name]
        if wire_type == "char":
            values[name] = draw.randbytes(length or 1)
        elif length:
            values[name] = [_any_number(wire_type, draw) for _ in range(length)]
        else:
            values[name] = _any_number(wire_type, draw)
    if "target_system" in values and draw.random() < 0.9:
        values["target_system"] = draw.choice((0, OURSELVES.system))
        if "target_component" in values:
            values["target_component"] = draw.choice((0, OURSELVES.component))
    if kind.msgname == "HEARTBEAT" and draw.random() < 0.8:
        # As from a vehicle that can be led.
        modes = (4, 3, 6, 9, 6 << 16, 4 << 16 | 3 << 24, 4 << 16 | 4 << 24, 4 << 16 | 5 << 24)
        values |= {"custom_mode": draw.choice(modes), "base_mode": draw.choice((1, 129, 209))}
        values |= {"system_status": draw.choice((3, 4, 5)), "type": mavlink.MAV_TYPE_QUADROTOR}
        values["autopilot"] = draw.choice(AUTOPILOTS)
    if kind.msgname == "GLOBAL_POSITION_INT" and draw.random() < 0.8:
        values |= {"lat": -240000000 + draw.randrange(20000), "lon": -463000000}
        values |= {"alt": 20000, "relative_alt": draw.choice((0, 20000))}
    if kind.msgname == "EXTENDED_SYS_STATE" and draw.random() < 0.8:
        values["landed_state"] = draw.choice((1, 2))
    if kind.msgname.startswith("MISSION") and draw.random() < 0.8:
        values |= {name: draw.randrange(5) for name in ("seq", "count") if name in values}
        values |= {name: 0 for name in ("mission_type", "type") if name in values}
    return kind(**values)


def _any_number(wire_type: str, draw: random.Random) -> float:
    if wire_type in ("float", "double"):
        if draw.random() < 0.5:
            return draw.choice(_FLOATS)
        (value,) = struct.unpack("<f", draw.randbytes(4))
        return float(value)
    least, most = _LIMITS[wire_type]
    return draw.choice((least, most, 0, 1, draw.randint(least, most)))


if __name__ == "__main__":
    for one in ("ardupilot", "px4"):
        print(one, *map(dict, fuzz(int(sys.argv[1]) // 2, int((sys.argv[2:] or [0])[0]), one)))
