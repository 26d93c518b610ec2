"""Recognises a heartbeat that a newer one has overtaken on the network.

UDP may deliver two frames the other way round. A heartbeat has no time of its own, and one that is
late shows a mode that the vehicle has left: it would look as if somebody else had changed it. The
frames of a component are numbered, modulo 256.
"""

import math
from typing import Final

from mavlink_broker.mavlink.dialect import Message

SILENCE_S: Final = 0.5
"""After such a gap the numbers prove nothing: the vehicle may have counted round or restarted."""
_ROUND: Final = 256


class HeartbeatOrder:
    """The order of the frames of one component."""

    def __init__(self) -> None:
        self._number = 0  # Of the newest frame
        self._position = 0  # The same, counted on
        self._heartbeat = 0  # Position of the newest heartbeat
        self._received_at = -math.inf

    def is_overtaken(self, message: Message, now: float) -> bool:
        """Handle a frame; gives whether it is a heartbeat that is older than another one."""
        number, half = message.get_seq(), _ROUND // 2
        step = (number - self._number + half) % _ROUND - half
        if now - self._received_at > SILENCE_S:
            step = 1
        position, self._received_at = self._position + step, now
        if step > 0:
            self._number, self._position = number, position
        if message.get_type() != "HEARTBEAT":
            return False
        if position < self._heartbeat:
            return True
        self._heartbeat = position
        return False
