"""What autopilots keep of a mission item, and what they refuse: PX4's and ArduPilot's storage.

PX4: `mavlink_mission.cpp`, parse and format of an item. ArduPilot: `AP_Mission.cpp`,
`mavlink_int_to_mission_cmd` and back, Copter. Both were read as of 2021 to 2026; a parameter that
comes back changed, cut or as 0 does so there too.
"""

import math
import struct
from collections.abc import Callable, Mapping
from typing import Final, TypeAlias

from tests.support.vehicle_wire import Message, mavlink

Keeping: TypeAlias = Callable[[Message], Message | int]
"""Gives the item as it is given back later, or the MAV_MISSION_RESULT of its refusal."""

_INTEGER_FRAMES: Final = {0: 5, 3: 6, 5: 5, 6: 6}
_PX4_YAW: Final = frozenset({16, 17, 19, 21, 22, 84, 85})
_PX4_PLACES: Final = frozenset({16, 17, 19, 21, 22, 31, 80, 84, 85, 195, 201, 4501})
_PX4_KEPT: Final[Mapping[int, frozenset[int]]] = {
    16: frozenset({1, 2, 4}),
    17: frozenset({3, 4}),
    19: frozenset({1, 2, 3, 4}),
    21: frozenset({2, 4}),
    22: frozenset({4}),
}
_PX4_REST: Final = frozenset(
    {20, 93, 112, 114, 177, 178, 179, 187, 189, 196, 197, 200, 203, 204, 205, 206, 211, 214, 260}
    | {530, 531, 532, 534, 1000, 1001, 2000, 2001, 2003, 2500, 2501, 3000, 42600}
)
_ARDUPILOT_PLACES: Final = frozenset({16, 17, 18, 19, 21, 22, 31, 82, 94, 179, 195, 201})
_ARDUPILOT_REST: Final = frozenset(
    {20, 92, 93, 112, 114, 115, 177, 178, 181, 183, 189, 197, 203, 205, 206, 207, 211, 222}
    | {531, 532, 534, 1000, 2000, 2001, 2500, 2501, 42600}
)
_MAY_HAVE_NAN_YAW: Final = frozenset({16, 21, 22})


def as_px4_keeps(message: Message) -> Message | int:
    """Keep an item as PX4 does: yaw in radians, what it does not use as 0."""
    if message.frame in _INTEGER_FRAMES:
        return _px4_place(message)
    if message.frame != mavlink.MAV_FRAME_MISSION:
        return int(mavlink.MAV_MISSION_UNSUPPORTED_FRAME)
    if message.command not in _PX4_REST:
        return int(mavlink.MAV_MISSION_UNSUPPORTED)
    return message


def _px4_place(message: Message) -> Message | int:
    if message.command not in _PX4_PLACES:
        return int(mavlink.MAV_MISSION_UNSUPPORTED)
    kept = _PX4_KEPT.get(message.command, frozenset())
    for number in range(1, 5):
        name = f"param{number}"
        value = getattr(message, name)
        if number not in kept:
            value = 0.0
        elif number == 4 and message.command in _PX4_YAW:
            value = single(math.degrees(single(math.radians(value) % math.tau)))
        setattr(message, name, value)
    message.frame = _INTEGER_FRAMES[message.frame]
    return message


def as_ardupilot_keeps(message: Message) -> Message | int:
    """Keep an item as ArduCopter does, in 15 bytes: whole numbers, centimetres, no NaN."""
    command = message.command
    values = [message.param1, message.param2, message.param3, message.param4]
    for index, value in enumerate(values):
        is_yaw = index == 3 and command in _MAY_HAVE_NAN_YAW
        if math.isinf(value) or (math.isnan(value) and not is_yaw):
            return int(mavlink.MAV_MISSION_INVALID_PARAM1 + index)
    is_place = command in _ARDUPILOT_PLACES
    if not is_place and command not in _ARDUPILOT_REST:
        return int(mavlink.MAV_MISSION_UNSUPPORTED)
    if is_place and (abs(message.x) > 90 * 10**7 or abs(message.y) > 180 * 10**7):
        return int(mavlink.MAV_MISSION_INVALID_PARAM5_X)
    for index, value in enumerate(_ardupilot_values(command, values)):
        setattr(message, f"param{index + 1}", value)
    if is_place:
        message.z = int(single(message.z * 100.0)) / 100.0
        message.frame = 3 if message.frame in {3, 6} else 0
    else:
        message.frame = 0
        if command != mavlink.MAV_CMD_DO_DIGICAM_CONTROL:
            message.z = 0.0
    return message


def _ardupilot_values(command: int, values: list[float]) -> tuple[float, ...]:
    return _ARDUPILOT_VALUES.get(command, tuple)(values)


def _whole(value: float) -> float:
    """As an unsigned number of 16 bits; what is below 0 comes back from the other end."""
    return float(int(value) % 65536)


def _circle(values: list[float]) -> tuple[float, ...]:
    radius = abs(values[2])
    whole = int(radius) if radius <= 255 else 10 * min(255, int(radius / 10))
    return float(min(255, int(values[0]))), 0.0, math.copysign(whole, values[2]), 0.0


def _landing(values: list[float]) -> tuple[float, ...]:
    return _whole(values[0]), 0.0, 0.0, -1.0 if values[3] < 0 else 1.0


def _first(values: list[float]) -> tuple[float, ...]:
    return _whole(values[0]), 0.0, 0.0, 0.0


def _nothing(_values: list[float]) -> tuple[float, ...]:
    return 0.0, 0.0, 0.0, 0.0


_ARDUPILOT_VALUES: Final[Mapping[int, Callable[[list[float]], tuple[float, ...]]]] = {
    **dict.fromkeys((16, 22, 82, 206, 2500, 2501), _first),
    **dict.fromkeys((20, 195, 197), _nothing),
    17: lambda v: (0.0, 0.0, math.copysign(float(int(abs(v[2]))), v[2]), 0.0),
    18: _circle,
    21: _landing,
    1000: lambda v: tuple(float(int(value)) for value in v),
    2000: lambda v: (_whole(v[0]), v[1], _whole(v[2]), _whole(v[3])),
}


def single(value: float) -> float:
    """Round to single precision, as a float of 32 bits has it."""
    if math.isnan(value):
        return value
    (rounded,) = struct.unpack("<f", struct.pack("<f", value))
    return float(rounded)
