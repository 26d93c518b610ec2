"""FOLLOW_TARGET: where somebody says that a target is. Pure but for the topic.

The message has no addressee, so it counts for every vehicle that hears it; the navigator takes
it only in follow mode and from one system.
"""

import math
from typing import Final

from uav_firmware.bus import Topic
from uav_firmware.modules.mavlink.wire.addressing import Outgoing, Sender
from uav_firmware.modules.mavlink.wire.dialect import Message
from uav_firmware.msg.guidance import FollowTarget
from uav_firmware.msg.vectors import Vector3

_HAS_POSITION: Final = 1
_HAS_VELOCITY: Final = 2
_FASTEST_M_S: Final = 100.0
_UNSET: Final[Vector3] = (math.nan, math.nan, math.nan)


def target_of(message: Message, system_id: int, now_us: int) -> FollowTarget | None:
    """What a FOLLOW_TARGET tells; None when it tells nothing that can be true."""
    place, velocity = _place(message), _velocity(message)
    if place is None or velocity is None:
        return None
    accuracy = message.position_cov[0]
    return FollowTarget(
        now_us,
        system_id,
        *place,
        velocity_ned=velocity,
        accuracy_m=accuracy if math.isfinite(accuracy) and accuracy > 0.0 else math.nan,
    )


def _place(message: Message) -> Vector3 | None:
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
    """Publishes what is reported."""

    def __init__(self, topic: Topic[FollowTarget]) -> None:
        self._topic = topic

    def handle(self, message: Message, sender: Sender, now_us: int) -> list[Outgoing]:
        """Take FOLLOW_TARGET; there is never an answer."""
        target = target_of(message, sender.system, now_us)
        if target is not None:
            self._topic.publish(target)
        return []
