"""What is asked of a vehicle while a ground station watches by the broker's link.

The link's rates are the broker's, which turns off what it does not read; a ground station would
look at empty instruments. So while one is there it gets what its instruments show, at rates that
a slow radio can carry, and what it has asked for itself is left alone. When the last one has gone
the vehicle is given its own rates back, and the broker turns off what is too much, as ever.
"""

from collections.abc import Collection
from typing import Final

from mavlink_broker.mavlink.dialect import mavlink

RATES_HZ: Final = {
    mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: 1.0,
    mavlink.MAVLINK_MSG_ID_VFR_HUD: 4.0,
    mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: 5.0,
    mavlink.MAVLINK_MSG_ID_ALTITUDE: 1.0,
    mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: 2.0,
    mavlink.MAVLINK_MSG_ID_RC_CHANNELS: 1.0,
    mavlink.MAVLINK_MSG_ID_NAV_CONTROLLER_OUTPUT: 1.0,
    mavlink.MAVLINK_MSG_ID_GIMBAL_DEVICE_ATTITUDE_STATUS: 2.0,
    mavlink.MAVLINK_MSG_ID_DISTANCE_SENSOR: 1.0,
}
"""By message id, the most missed first: some 800 bytes a second together."""
AS_BEFORE_US: Final = 0.0
"""SET_MESSAGE_INTERVAL's word for the vehicle's own rate."""


class Watched:
    """Whether somebody watches, what he has asked for himself, what is still to be asked for."""

    def __init__(self) -> None:
        self._asked_elsewhere: Collection[int] | None = None
        self._waiting: list[int] = []
        self._shown: set[int] = set()

    @property
    def by_somebody(self) -> bool:
        """Whether a ground station is there."""
        return self._asked_elsewhere is not None

    def update(self, asked_elsewhere: Collection[int] | None) -> bool:
        """Learn what ground stations have asked for, None: nobody is there; true on a change."""
        was_watched = self.by_somebody
        self._asked_elsewhere = asked_elsewhere
        if self.by_somebody and not was_watched:
            self.renew()
        elif was_watched and not self.by_somebody:
            self._waiting = sorted(self._shown)
        return self.by_somebody != was_watched

    def renew(self) -> None:
        """Ask for everything again: the vehicle has been restarted."""
        self._waiting = list(RATES_HZ) if self.by_somebody else []
        self._shown = set()

    def take_next(self) -> tuple[int, float] | None:
        """Give the next message that has to be asked for, and its interval in microseconds."""
        while self._waiting:
            message_id = self._waiting.pop(0)
            if self._asked_elsewhere is None:
                return message_id, AS_BEFORE_US
            if message_id not in self._asked_elsewhere:
                self._shown.add(message_id)
                return message_id, 1e6 / RATES_HZ[message_id]
        return None

    def keeps(self, message_id: int) -> bool:
        """Whether a message is not to be turned off."""
        if self._asked_elsewhere is None:
            return False
        return message_id in RATES_HZ or message_id in self._asked_elsewhere
