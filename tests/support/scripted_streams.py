"""Which of a scripted vehicle's messages are due: at its own rates, or only what was asked for."""

import math
from typing import Final

from tests.support.vehicle_wire import Message, mavlink

TELEMETRY_S: Final = 0.2
_UNASKED_S: Final = {
    "position": TELEMETRY_S,
    "attitude": 1.0,
    "landed": 0.4,
    "health": 0.4,
    "battery": 1.0,
    "estimate": 1.0,
}
"""Periods [s] of a vehicle that streams without being asked: PX4's on a radio link, about."""
IDS: Final = {
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: "position",
    mavlink.MAVLINK_MSG_ID_ATTITUDE: "attitude",
    mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: "landed",
    mavlink.MAVLINK_MSG_ID_SYS_STATUS: "health",
    mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: "battery",
    mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: "mission",
    mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT: "estimate",
}
_GROUPS: Final = {
    mavlink.MAV_DATA_STREAM_EXTENDED_STATUS: ("health", "mission", "landed"),
    mavlink.MAV_DATA_STREAM_POSITION: ("position",),
    mavlink.MAV_DATA_STREAM_EXTRA1: ("attitude",),
    mavlink.MAV_DATA_STREAM_EXTRA3: ("battery", "estimate"),
}


class ScriptedStreams:
    """The streams of one vehicle."""

    def __init__(self, *, unasked: bool, mission_every_s: float, now: float) -> None:
        self._unasked = unasked
        self._mission_every_s = mission_every_s
        self.restart(now)

    def restart(self, now: float) -> None:
        """Forget what was asked for."""
        periods = dict.fromkeys(IDS.values(), math.inf)
        if self._unasked:
            periods |= _UNASKED_S | {"mission": self._mission_every_s}
        self._periods = periods
        self._due_at = dict.fromkeys(periods, now)

    def ask(self, message_id: int, interval_us: float, now: float) -> None:
        """Take SET_MESSAGE_INTERVAL; one that streams unasked streams on as it does."""
        name = IDS.get(message_id)
        if name is not None and not self._unasked:
            self._set(name, math.inf if interval_us < 0 else interval_us / 1e6, now)

    def ask_group(self, message: Message, now: float) -> None:
        """Take REQUEST_DATA_STREAM."""
        for name in _GROUPS.get(message.req_stream_id, ()):
            self._set(name, 1.0 / message.req_message_rate, now)

    def stop(self, name: str) -> None:
        """Send one no more."""
        self._periods[name] = math.inf

    def due(self, now: float) -> list[str]:
        """Names of what is to be sent now."""
        names = [name for name, at in self._due_at.items() if now >= at]
        for name in names:
            self._due_at[name] = now + self._periods[name]
        return [name for name in names if math.isfinite(self._periods[name])]

    def _set(self, name: str, period_s: float, now: float) -> None:
        self._periods[name], self._due_at[name] = period_s, now
