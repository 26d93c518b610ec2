"""Asks the vehicle for the messages that the broker lives on, and asks again when they stop.

One SET_MESSAGE_INTERVAL is outstanding at a time, because COMMAND_ACK does not say which of
several it answers. HOME_POSITION is asked for until it is there; vehicles send it rarely.
AUTOPILOT_VERSION is asked for a few times, since it tells kinds of vehicles apart. What
a vehicle sends often and nobody here reads is turned off: PX4 pours some 400 messages a second
on a companion computer's link, and a fleet's broker would read them all for nothing.
"""

import math
from typing import Final, NamedTuple

from mavlink_broker.dialect import Message, mavlink
from mavlink_broker.protocol.command import CommandLong, CommandTransaction
from mavlink_broker.protocol.round_trip import RoundTrip
from mavlink_broker.protocol.route import Route


class Stream(NamedTuple):
    """A message that is wanted regularly."""

    name: str
    message_id: int
    rate_hz: float

    @property
    def request(self) -> CommandLong:
        """The command that asks for it."""
        return set_interval(self.message_id, 1e6 / self.rate_hz)


def set_interval(message_id: int, interval_us: float) -> CommandLong:
    """SET_MESSAGE_INTERVAL(511), interval in microseconds; -1 turns the message off."""
    return CommandLong(
        command=mavlink.MAV_CMD_SET_MESSAGE_INTERVAL,
        parameters=(float(message_id), interval_us, 0.0, 0.0, 0.0, 0.0, 0.0),
    )


STREAMS: Final = (
    Stream("MISSION_CURRENT", mavlink.MAVLINK_MSG_ID_MISSION_CURRENT, 2.0),
    Stream("GLOBAL_POSITION_INT", mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, 5.0),
    Stream("EXTENDED_SYS_STATE", mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE, 2.0),
    Stream("ATTITUDE", mavlink.MAVLINK_MSG_ID_ATTITUDE, 5.0),
    Stream("SYS_STATUS", mavlink.MAVLINK_MSG_ID_SYS_STATUS, 1.0),
    Stream("BATTERY_STATUS", mavlink.MAVLINK_MSG_ID_BATTERY_STATUS, 1.0),
    Stream("HOME_POSITION", mavlink.MAVLINK_MSG_ID_HOME_POSITION, 0.5),
)
"""What is wanted, the most urgent first; nothing that a slow radio could not carry."""

UNREAD: Final = {
    mavlink.mavlink_map[message_id].msgname: message_id
    for message_id in (
        mavlink.MAVLINK_MSG_ID_HIGHRES_IMU,
        mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION,
        mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED,
        mavlink.MAVLINK_MSG_ID_ODOMETRY,
        mavlink.MAVLINK_MSG_ID_RC_CHANNELS,
        mavlink.MAVLINK_MSG_ID_GPS_RAW_INT,
        mavlink.MAVLINK_MSG_ID_ALTITUDE,
        mavlink.MAVLINK_MSG_ID_VFR_HUD,
        mavlink.MAVLINK_MSG_ID_WIND_COV,
        mavlink.MAVLINK_MSG_ID_TIMESYNC,
        mavlink.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW,
        mavlink.MAVLINK_MSG_ID_NAV_CONTROLLER_OUTPUT,
        mavlink.MAVLINK_MSG_ID_ATTITUDE_TARGET,
        mavlink.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED,
        mavlink.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT,
    )
}
"""What is turned off when it is heard, the most frequent first, by name."""
_OFF_US: Final = -1.0

SILENT_AFTER_S: Final = 6.0
ASK_AGAIN_S: Final = 10.0
HOME_EVERY_S: Final = 1.0
VERSION_EVERY_S: Final = 0.5
VERSION_ATTEMPTS: Final = 8


class StreamRequests:
    """Keeps the wanted messages of one vehicle coming."""

    def __init__(self, route: Route, round_trip: RoundTrip) -> None:
        self._route = route
        self._round_trip = round_trip
        self._heard_at: dict[str, float] = {}
        self._asked_at: dict[str, float] = {}
        self._running: CommandTransaction | None = None
        self._home_asked_at: float | None = None
        self._version_asked = 0
        self._version_asked_at = -math.inf

    @property
    def is_version_settled(self) -> bool:
        """Whether AUTOPILOT_VERSION has come, or has been asked for often enough."""
        return self._version_asked > VERSION_ATTEMPTS

    def renew(self) -> None:
        """Ask for everything again: the vehicle has been restarted."""
        self._heard_at.clear()
        self._asked_at.clear()
        self._running = None
        self._home_asked_at = None
        self._version_asked = 0

    def receive(self, message: Message, now: float) -> list[Message]:
        """Take a message or an answer."""
        self._heard_at[message.get_type()] = now
        if self._running is None:
            return []
        self._running.receive(message, now)
        return self._next(now)

    def tick(self, now: float) -> list[Message]:
        """Ask for what is missing; to be called only while the vehicle is heard."""
        messages = [*self._home(now), *self._version(now)]
        if self._running is not None:
            messages += self._running.tick(now)
        return messages + self._next(now)

    def _next(self, now: float) -> list[Message]:
        if self._running is not None and self._running.outcome is None:
            return []
        self._running = None
        for stream in STREAMS:
            if self._is_wanted(stream, now):
                return self._ask(stream.name, stream.request, now)
        for name, message_id in UNREAD.items():
            if self._is_to_stop(name, now):
                return self._ask(name, set_interval(message_id, _OFF_US), now)
        return []

    def _ask(self, name: str, request: CommandLong, now: float) -> list[Message]:
        self._asked_at[name] = now
        self._running = CommandTransaction(request, self._route, self._round_trip)
        return self._running.start(now)

    def _is_wanted(self, stream: Stream, now: float) -> bool:
        asked_at = self._asked_at.get(stream.name)
        if asked_at is None:
            return True
        heard_at = self._heard_at.get(stream.name, asked_at)
        return now - heard_at > SILENT_AFTER_S and now - asked_at > ASK_AGAIN_S

    def _is_to_stop(self, name: str, now: float) -> bool:
        """Whether an unread message has come, and no request to stop it is under way."""
        asked_at = self._asked_at.get(name, -math.inf)
        return self._heard_at.get(name, -math.inf) > asked_at and now - asked_at > ASK_AGAIN_S

    def _home(self, now: float) -> list[Message]:
        if "HOME_POSITION" in self._heard_at:
            return []
        if self._home_asked_at is not None and now - self._home_asked_at < HOME_EVERY_S:
            return []
        self._home_asked_at = now
        return [request_message(self._route, mavlink.MAVLINK_MSG_ID_HOME_POSITION)]

    def _version(self, now: float) -> list[Message]:
        if "AUTOPILOT_VERSION" in self._heard_at:
            self._version_asked = VERSION_ATTEMPTS + 1
        if self.is_version_settled or now - self._version_asked_at < VERSION_EVERY_S:
            return []
        self._version_asked += 1
        self._version_asked_at = now
        if self._version_asked > VERSION_ATTEMPTS:
            return []
        return [request_message(self._route, mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION)]


def request_message(route: Route, message_id: int) -> Message:
    """REQUEST_MESSAGE(512); the message itself is the answer that counts."""
    return CommandLong(
        command=mavlink.MAV_CMD_REQUEST_MESSAGE,
        parameters=(float(message_id), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    ).message(route, 0)
