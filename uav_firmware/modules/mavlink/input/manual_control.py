"""MANUAL_CONTROL: sticks as they come in. Pure but for the memory of who holds them.

PX4's convention, which QGroundControl and MAVSDK follow: x forward, y right and r clockwise are
-1000..1000; z is 0 (down) to 1000 (up) with 500 in the centre. The specification lets z begin
at -1000; a negative z counts as down, since a throttle that is too low is the safe error.
"""

from typing import Final

from uav_firmware.bus import Topic
from uav_firmware.modules.mavlink.wire.addressing import Outgoing, Sender
from uav_firmware.modules.mavlink.wire.dialect import Message
from uav_firmware.msg.control_mode import ManualControlSetpoint

INVALID_AXIS: Final = 0x7FFF
"""A value that says that there is no such stick."""
KEPT_US: Final = 1_000_000
"""Silence of the holder of the sticks after which somebody else may take them."""


def sticks_of(message: Message, now_us: int) -> ManualControlSetpoint | None:
    """Sticks of a MANUAL_CONTROL; None unless all four axes are there, as on PX4."""
    axes = (message.x, message.y, message.z, message.r)
    if INVALID_AXIS in axes:
        return None
    forward, right, up, yaw = (min(max(axis / 1000.0, -1.0), 1.0) for axis in axes)
    return ManualControlSetpoint(now_us, forward, right, 2.0 * max(up, 0.0) - 1.0, yaw)


class ManualInput:
    """Takes MANUAL_CONTROL from one sender at a time; the first one keeps the sticks."""

    def __init__(self, system_id: int, topic: Topic[ManualControlSetpoint]) -> None:
        self._system_id = system_id
        self._topic = topic
        self._holder: tuple[int, int] | None = None
        self._heard_us = 0

    def handle(self, message: Message, sender: Sender, now_us: int) -> list[Outgoing]:
        """Publish the sticks if they are for this vehicle; there is never an answer."""
        if message.target != self._system_id:
            return []
        if self._holder not in {None, sender.identity} and now_us - self._heard_us <= KEPT_US:
            return []
        sticks = sticks_of(message, now_us)
        if sticks is not None:
            self._holder, self._heard_us = sender.identity, now_us
            self._topic.publish(sticks)
        return []
