"""MANUAL_CONTROL, FOLLOW_TARGET and GIMBAL_MANAGER_SET_*: streamed messages to topics.

MANUAL_CONTROL has PX4's convention, which QGroundControl and MAVSDK use: x forward, y right and r
clockwise are -1000..1000; z is 0 (down) to 1000 (up) with 500 in the centre. The specification
allows z from -1000; a negative z counts as down, which is the safe direction.

FOLLOW_TARGET has no target system, so it is accepted from every sender; the navigator uses it in
follow mode only, and from one system. None of these messages has an answer.
"""

import math
from collections.abc import Callable, Mapping
from typing import Final, NamedTuple

from uav_firmware.bus import Queue, Topic
from uav_firmware.lib.rotation import normalise, to_euler
from uav_firmware.modules.mavlink.wire.addressing import (
    STREAM_TIMEOUT_US,
    Outgoing,
    Sender,
    StreamSender,
    is_for_us,
)
from uav_firmware.modules.mavlink.wire.dialect import Message
from uav_firmware.msg.control_mode import ManualControlSetpoint
from uav_firmware.msg.guidance import FollowTarget
from uav_firmware.msg.payload import Controller, GimbalFlags, GimbalOrder, PayloadOrder
from uav_firmware.msg.status import Severity, StatusText
from uav_firmware.msg.vectors import Vector3
from uav_firmware.topics import Topics

INVALID_AXIS: Final = 0x7FFF
"""Value of an axis that does not exist."""
_CENTRED: Final = 0.1  # [-] Sticks do not rest exactly in their centre; MPC_HOLD_DZ by default
_HAS_POSITION: Final = 1
_HAS_VELOCITY: Final = 2
_FASTEST_M_S: Final = 100.0
_UNSET: Final[Vector3] = (math.nan, math.nan, math.nan)
_DEVICES: Final = frozenset({0, 1})
_TWO_FRAMES: Final = GimbalFlags.YAW_IN_VEHICLE_FRAME | GimbalFlags.YAW_IN_EARTH_FRAME


def sticks_of(message: Message, now_us: int) -> ManualControlSetpoint | None:
    """Sticks of a MANUAL_CONTROL; None unless it has all four axes, as in PX4."""
    axes = (message.x, message.y, message.z, message.r)
    if INVALID_AXIS in axes:
        return None
    forward, right, up, yaw = (min(max(axis / 1000.0, -1.0), 1.0) for axis in axes)
    return ManualControlSetpoint(now_us, forward, right, 2.0 * max(up, 0.0) - 1.0, yaw)


def are_centred(sticks: ManualControlSetpoint) -> bool:
    """Whether all four sticks are in their centre, within a dead zone."""
    axes = (sticks.forward, sticks.right, sticks.up, sticks.yaw)
    return max(map(abs, axes)) <= _CENTRED


class ManualInput:
    """Accepts MANUAL_CONTROL from one sender at a time.

    In the air another sender than so far is accepted with centred sticks, or when it has ordered a
    mode: its pilot may not know that he begins to steer. Each change of sender is reported.
    """

    def __init__(self, system_id: int, topics: Topics) -> None:
        self._system_id = system_id
        self._topics = topics
        self._stream = StreamSender()
        self._waiting: tuple[Sender, ManualControlSetpoint] | None = None  # Not centred

    def handle(self, message: Message, sender: Sender, now_us: int) -> list[Outgoing]:
        """Publish the sticks if they are for this vehicle."""
        if message.target != self._system_id or not self._stream.admits(sender, now_us):
            return []
        sticks = sticks_of(message, now_us)
        if sticks is None:
            return []
        if self._stream.is_other(sender) and self._in_the_air and not are_centred(sticks):
            if self._waiting is None or self._waiting[0] != sender:
                self._report(now_us, f"Sticks of system {sender.system} not used: centre them")
            self._waiting = (sender, sticks)
        else:
            self._accept(sender, sticks, now_us)
        return []

    def order_mode(self, sender: Sender, now_us: int) -> None:
        """Accept sticks that are not centred: their pilot has ordered a mode."""
        if self._waiting is None or self._waiting[0] != sender:
            return
        sticks = self._waiting[1]
        streams = now_us - sticks.time_us <= STREAM_TIMEOUT_US
        if streams and self._stream.admits(sender, now_us):
            self._accept(sender, sticks, now_us)

    @property
    def _in_the_air(self) -> bool:
        land = self._topics.land_detected.value
        return land is not None and not land.landed

    def _accept(self, sender: Sender, sticks: ManualControlSetpoint, now_us: int) -> None:
        if self._stream.is_other(sender):
            self._report(now_us, f"Manual control by system {sender.system} from now on")
        self._waiting = None
        self._stream.accept(sender, now_us)
        self._topics.manual_control_setpoint.publish(sticks)

    def _report(self, now_us: int, text: str) -> None:
        self._topics.status_text.publish(StatusText(now_us, Severity.WARNING, text))


def target_of(message: Message, system_id: int, now_us: int) -> FollowTarget | None:
    """Target of a FOLLOW_TARGET; None when its values are impossible."""
    position, velocity = _position(message), _velocity(message)
    if position is None or velocity is None:
        return None
    accuracy = message.position_cov[0]
    return FollowTarget(
        now_us,
        system_id,
        *position,
        velocity_ned=velocity,
        accuracy_m=accuracy if math.isfinite(accuracy) and accuracy > 0.0 else math.nan,
    )


def _position(message: Message) -> Vector3 | None:
    if not message.est_capabilities & _HAS_POSITION:
        return _UNSET
    latitude, longitude = message.lat / 1e7, message.lon / 1e7
    if abs(latitude) > 90.0 or abs(longitude) > 180.0 or not math.isfinite(message.alt):
        return None
    return (latitude, longitude, message.alt)


def _velocity(message: Message) -> Vector3 | None:
    if not message.est_capabilities & _HAS_VELOCITY:
        return _UNSET
    north, east, down = message.vel
    if not all(abs(part) <= _FASTEST_M_S for part in (north, east, down)):
        return None
    return (north, east, down)


class FollowInput:
    """Publishes targets."""

    def __init__(self, topic: Topic[FollowTarget]) -> None:
        self._topic = topic

    def handle(self, message: Message, sender: Sender, now_us: int) -> list[Outgoing]:
        """Handle FOLLOW_TARGET."""
        target = target_of(message, sender.system, now_us)
        if target is not None:
            self._topic.publish(target)
        return []


class _Aim(NamedTuple):
    """Angles [rad] and rates [rad/s], or fractions of their range; NaN is unset."""

    pitch: float
    yaw: float
    pitch_rate: float
    yaw_rate: float


def _pitch_yaw(message: Message) -> _Aim:
    return _Aim(message.pitch, message.yaw, message.pitch_rate, message.yaw_rate)


def _attitude(message: Message) -> _Aim | None:
    """Pitch and yaw of a quaternion; NaN without one. Roll is ignored."""
    rates = (message.angular_velocity_y, message.angular_velocity_z)
    if any(math.isnan(part) for part in message.q):
        return _Aim(math.nan, math.nan, *rates)
    w, x, y, z = message.q
    try:
        _, pitch, yaw = to_euler(normalise((w, x, y, z)))
    except ValueError:
        return None
    return _Aim(pitch, yaw, *rates)


_READERS: Final[Mapping[str, Callable[[Message], _Aim | None]]] = {
    "GIMBAL_MANAGER_SET_PITCHYAW": _pitch_yaw,
    "GIMBAL_MANAGER_SET_MANUAL_CONTROL": _pitch_yaw,
    "GIMBAL_MANAGER_SET_ATTITUDE": _attitude,
}


class GimbalInput:
    """Publishes valid messages as orders to payload; drops others."""

    message_types: Final = frozenset(_READERS)

    def __init__(self, system_id: int, orders: Queue[PayloadOrder]) -> None:
        self._system_id = system_id
        self._orders = orders

    def handle(self, message: Message, sender: Sender, now_us: int) -> list[Outgoing]:
        """Handle one of the three messages."""
        if not is_for_us(message, self._system_id) or message.gimbal_device_id not in _DEVICES:
            return []
        flags: int = message.flags
        if flags & GimbalFlags.RETRACT or flags & _TWO_FRAMES == _TWO_FRAMES:
            return []
        aim = _READERS[message.get_type()](message)
        normalised = message.get_type() == "GIMBAL_MANAGER_SET_MANUAL_CONTROL"
        if aim is None or not _is_valid(aim, normalised=normalised):
            return []
        source = Controller(sender.system, sender.component)
        self._orders.publish(GimbalOrder(now_us, source, flags, *aim, normalised))
        return []


def _is_valid(aim: _Aim, *, normalised: bool) -> bool:
    """Whether every value is unset or within limits."""
    most = 1.0 if normalised else 2.0 * math.tau
    return all(math.isnan(part) or abs(part) <= most for part in aim)
