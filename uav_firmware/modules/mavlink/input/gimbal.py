"""Streamed wishes for the gimbal: GIMBAL_MANAGER_SET_ATTITUDE, _PITCHYAW, _MANUAL_CONTROL.

None has an answer; who is in control, and what the gimbal can do, is payload's to judge.
"""

import math
from collections.abc import Callable, Mapping
from typing import Final, NamedTuple

from uav_firmware.bus import Queue
from uav_firmware.lib.rotation import normalise, to_euler
from uav_firmware.modules.mavlink.wire.addressing import Outgoing, Sender, is_for_us
from uav_firmware.modules.mavlink.wire.dialect import Message
from uav_firmware.msg.payload import Controller, GimbalFlags, GimbalOrder, PayloadOrder

_DEVICES: Final = frozenset({0, 1})
_TWO_FRAMES: Final = GimbalFlags.YAW_IN_VEHICLE_FRAME | GimbalFlags.YAW_IN_EARTH_FRAME


class _Wish(NamedTuple):
    """Angles [rad] and rates [rad/s], or shares of them; NaN leaves a part as it is."""

    pitch: float
    yaw: float
    pitch_rate: float
    yaw_rate: float


def _pitch_yaw(message: Message) -> _Wish:
    return _Wish(message.pitch, message.yaw, message.pitch_rate, message.yaw_rate)


def _attitude(message: Message) -> _Wish | None:
    """Pitch and yaw of a quaternion, whose roll has no meaning here; NaN for none."""
    rates = (message.angular_velocity_y, message.angular_velocity_z)
    if any(math.isnan(part) for part in message.q):
        return _Wish(math.nan, math.nan, *rates)
    w, x, y, z = message.q
    try:
        _, pitch, yaw = to_euler(normalise((w, x, y, z)))
    except ValueError:
        return None
    return _Wish(pitch, yaw, *rates)


_READERS: Final[Mapping[str, Callable[[Message], _Wish | None]]] = {
    "GIMBAL_MANAGER_SET_PITCHYAW": _pitch_yaw,
    "GIMBAL_MANAGER_SET_MANUAL_CONTROL": _pitch_yaw,
    "GIMBAL_MANAGER_SET_ATTITUDE": _attitude,
}


class GimbalInput:
    """Hands good messages on and drops the others."""

    message_types: Final = frozenset(_READERS)

    def __init__(self, system_id: int, orders: Queue[PayloadOrder]) -> None:
        self._system_id = system_id
        self._orders = orders

    def handle(self, message: Message, sender: Sender, now_us: int) -> list[Outgoing]:
        """Take one of the three messages."""
        if not is_for_us(message, self._system_id) or message.gimbal_device_id not in _DEVICES:
            return []
        flags: int = message.flags
        if flags & GimbalFlags.RETRACT or flags & _TWO_FRAMES == _TWO_FRAMES:
            return []
        wish = _READERS[message.get_type()](message)
        normalised = message.get_type() == "GIMBAL_MANAGER_SET_MANUAL_CONTROL"
        if wish is None or not _is_sane(wish, normalised=normalised):
            return []
        source = Controller(sender.system, sender.component)
        self._orders.publish(GimbalOrder(now_us, source, flags, *wish, normalised))
        return []


def _is_sane(wish: _Wish, *, normalised: bool) -> bool:
    """Whether every part is unset or of a size that can be meant."""
    most = 1.0 if normalised else 2.0 * math.tau
    return all(math.isnan(part) or abs(part) <= most for part in wish)
