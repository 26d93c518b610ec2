"""Asks the vehicle for the messages that the broker lives on, and asks again when they stop.

One SET_MESSAGE_INTERVAL is outstanding at a time, because COMMAND_ACK does not say which of
several it answers. HOME_POSITION is asked for until it is there; vehicles send it rarely.
AUTOPILOT_VERSION is asked for a few times, since it tells kinds of vehicles apart. What
a vehicle sends often and nobody here reads is turned off: PX4 pours some 400 messages a second
on a companion computer's link, and a fleet's broker would read them all for nothing.

Every message has an age, and is asked for again when it is older than three of its periods: a
vehicle forgets its streams when it restarts, and a link may lose the request. An old autopilot
that knows no SET_MESSAGE_INTERVAL is asked by REQUEST_DATA_STREAM(66), by groups.
"""

import math
from collections.abc import Collection
from typing import Final, NamedTuple

from mavlink_broker.mavlink.addressing import Route
from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.microservices.command import (
    Accepted,
    CommandLong,
    CommandOutcome,
    CommandTransaction,
)
from mavlink_broker.microservices.round_trip import RoundTrip
from mavlink_broker.microservices.watched_rates import Watched


class Stream(NamedTuple):
    """A message that is wanted regularly."""

    name: str
    message_id: int
    rate_hz: float
    flows: bool = True  # Else a vehicle may do without, or need not tell it twice

    @property
    def patience_s(self) -> float:
        """Age from which on it is overdue: three lost ones, and a second for the link."""
        return 3.0 / self.rate_hz + 1.0

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
    Stream("HOME_POSITION", mavlink.MAVLINK_MSG_ID_HOME_POSITION, 0.5, flows=False),
    Stream("SYSTEM_TIME", mavlink.MAVLINK_MSG_ID_SYSTEM_TIME, 0.5, flows=False),
    Stream("ESTIMATOR_STATUS", mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS, 1.0, flows=False),
    Stream("EKF_STATUS_REPORT", mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT, 1.0, flows=False),
    Stream("FENCE_STATUS", mavlink.MAVLINK_MSG_ID_FENCE_STATUS, 1.0, flows=False),
    Stream("HYGROMETER_SENSOR", mavlink.MAVLINK_MSG_ID_HYGROMETER_SENSOR, 1.0, flows=False),
    Stream("NAMED_VALUE_FLOAT", mavlink.MAVLINK_MSG_ID_NAMED_VALUE_FLOAT, 1.0, flows=False),
    Stream("SCALED_PRESSURE", mavlink.MAVLINK_MSG_ID_SCALED_PRESSURE, 0.5, flows=False),
    Stream("WIND_COV", mavlink.MAVLINK_MSG_ID_WIND_COV, 0.5, flows=False),
    Stream("WIND", mavlink.MAVLINK_MSG_ID_WIND, 0.5, flows=False),
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
        mavlink.MAVLINK_MSG_ID_DISTANCE_SENSOR,
        mavlink.MAVLINK_MSG_ID_GIMBAL_DEVICE_ATTITUDE_STATUS,
        mavlink.MAVLINK_MSG_ID_ALTITUDE,
        mavlink.MAVLINK_MSG_ID_VFR_HUD,
        mavlink.MAVLINK_MSG_ID_TIMESYNC,
        mavlink.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW,
        mavlink.MAVLINK_MSG_ID_NAV_CONTROLLER_OUTPUT,
        mavlink.MAVLINK_MSG_ID_ATTITUDE_TARGET,
        mavlink.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED,
        mavlink.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT,
    )
}
"""What is turned off when it is heard, the most frequent first, by name."""
OFTEN_S: Final = 0.22
"""What comes more rarely is let be: a ground station on the same radio may have asked for it."""
_OFF_US: Final = -1.0
_NEWEST: Final = 0.2  # Weight of the newest interval: two that come together are no stream
STOPS: Final = 2  # What comes back behind as many is asked for by somebody else on this link

_GROUPS: Final = (
    (mavlink.MAV_DATA_STREAM_EXTENDED_STATUS, 2),
    (mavlink.MAV_DATA_STREAM_POSITION, 5),
    (mavlink.MAV_DATA_STREAM_EXTRA1, 5),
    (mavlink.MAV_DATA_STREAM_EXTRA3, 1),
)
"""REQUEST_DATA_STREAM: MISSION_CURRENT and SYS_STATUS; position; attitude; battery; and rates."""

ASK_AGAIN_S: Final = 10.0
LONGEST_PAUSE_S: Final = 60.0
"""What a vehicle does not have is asked for ever more rarely."""
REFUSALS: Final = 2
"""That many and nothing accepted: it does not know the command. PX4 refuses MISSION_CURRENT."""
HOME_EVERY_S: Final = 1.0
SINGLE_EVERY_S: Final = 1.5
VERSION_EVERY_S: Final = 0.5
VERSION_ATTEMPTS: Final = 8


class StreamRequests:
    """Keeps the wanted messages of one vehicle coming.

    `turns_off`: what nobody here reads is turned off; not where others listen to the same link.
    `observes`: no rate is changed at all; what does not come is asked for once at a time.
    """

    def __init__(
        self,
        route: Route,
        round_trip: RoundTrip,
        *,
        turns_off: bool = True,
        observes: bool = False,
    ) -> None:
        self._observes = observes
        self.route = route
        self._round_trip = round_trip
        self._turns_off = turns_off
        self._heard_at: dict[str, float] = {}
        self._interval_s: dict[str, float] = {}
        self._watched = Watched()
        self.renew()

    def renew(self) -> None:
        """Ask for everything again: the vehicle has been restarted, or was long out of reach."""
        self._heard_at.clear()
        self._watched.renew()
        self._asked_at: dict[str, float] = {}
        self._pause_s: dict[str, float] = {}
        self._running: CommandTransaction | None = None
        self._accepted = self._refused = 0
        self._asked_for = ""
        self._lacks: set[str] = set()  # What it has said that it does not have
        self._stops: dict[str, int] = {}
        self._groups_at = -math.inf
        self._home_asked_at: float | None = None
        self._version_asked = 0
        self._version_asked_at = -math.inf

    def watch(self, asked_elsewhere: Collection[int] | None) -> None:
        """Learn that ground stations watch, and what they have asked for; None: nobody does.

        When the last one has gone the rates are set back: he may have had them faster.
        """
        if self._watched.update(asked_elsewhere) and not self._watched.by_somebody:
            for stream in STREAMS:
                self._asked_at.pop(stream.name, None)

    @property
    def is_version_settled(self) -> bool:
        """Whether AUTOPILOT_VERSION has come, or has been asked for often enough."""
        return self._version_asked > VERSION_ATTEMPTS

    def overdue(self, now: float) -> tuple[str, ...]:
        """Names of the messages that were asked for and have not come in time."""
        return tuple(
            stream.name for stream in STREAMS if stream.flows and self._is_overdue(stream, now)
        )

    def receive(self, message: Message, now: float) -> list[Message]:
        """Take a message or an answer."""
        name = message.get_type()
        if name in _FOLLOWED:
            mean_s = self._interval_s.get(name, ASK_AGAIN_S)
            newest_s = min(now - self._heard_at.get(name, -math.inf), ASK_AGAIN_S)
            self._interval_s[name] = mean_s + _NEWEST * (newest_s - mean_s)
            self._heard_at[name] = now
            self._pause_s.pop(name, None)
        if self._running is None:
            return []
        self._running.receive(message, now)
        return self._next(now)

    def tick(self, now: float) -> list[Message]:
        """Ask for what is missing; to be called only while the vehicle is heard."""
        messages = [*self._home(now), *self._version(now)]
        if self._observes:
            return messages + self._single(now)
        messages += self._by_groups(now)
        if self._running is not None:
            messages += self._running.tick(now)
        return messages + self._next(now)

    def _single(self, now: float) -> list[Message]:
        """Ask once for each message that does not come by itself."""
        messages = []
        for stream in STREAMS:
            last = max(
                self._heard_at.get(stream.name, -math.inf),
                self._asked_at.get(stream.name, -math.inf),
            )
            if now - last >= SINGLE_EVERY_S:
                self._asked_at[stream.name] = now
                number = getattr(mavlink, f"MAVLINK_MSG_ID_{stream.name}")
                messages.append(request_message(self.route, number))
        return messages

    def _next(self, now: float) -> list[Message]:
        if self._running is not None:
            if self._running.outcome is None:
                return []
            self._note(self._running.outcome)
        self._running = None
        for stream in STREAMS:
            if self._is_wanted(stream, now):
                return self._ask(stream.name, stream.request, now)
        if not self._accepted:
            return []
        if (shown := self._watched.take_next()) is not None:
            message_id, interval_us = shown
            name = mavlink.mavlink_map[message_id].msgname
            return self._ask(name, set_interval(message_id, interval_us), now)
        for name, message_id in UNREAD.items() if self._turns_off else ():
            if self._is_to_stop(name, now) and not self._watched.keeps(message_id):
                self._stops[name] = self._stops.get(name, 0) + 1
                return self._ask(name, set_interval(message_id, _OFF_US), now)
        return []

    def _note(self, outcome: CommandOutcome) -> None:
        if isinstance(outcome, Accepted):
            self._accepted += 1
        else:
            self._refused += 1
            self._lacks |= set() if outcome.result is None else {self._asked_for}

    @property
    def _knows_no_intervals(self) -> bool:
        return self._refused >= REFUSALS and self._accepted == 0

    def _ask(self, name: str, request: CommandLong, now: float) -> list[Message]:
        if name in self._asked_at:
            pause_s = self._pause_s.get(name, ASK_AGAIN_S)
            self._pause_s[name] = min(2.0 * pause_s, LONGEST_PAUSE_S)
        self._asked_at[name], self._asked_for = now, name
        self._running = CommandTransaction(request, self.route, self._round_trip)
        return self._running.start(now)

    def _is_wanted(self, stream: Stream, now: float) -> bool:
        asked_at = self._asked_at.get(stream.name)
        if asked_at is None:
            return not self._knows_no_intervals or self._is_overdue(stream, now)
        pause_s = self._pause_s.get(stream.name, ASK_AGAIN_S)
        if stream.name in self._lacks and not stream.flows:
            return False
        if self._knows_no_intervals:
            pause_s = LONGEST_PAUSE_S
        return self._is_overdue(stream, now) and now - asked_at > pause_s

    def _is_overdue(self, stream: Stream, now: float) -> bool:
        last = self._heard_at.get(stream.name, self._asked_at.get(stream.name))
        if last is None:
            last = self._groups_at
        return now - last > stream.patience_s

    def _is_to_stop(self, name: str, now: float) -> bool:
        """Whether an unread message comes often, and no request to stop it is under way."""
        asked_at = self._asked_at.get(name, -math.inf)
        is_news = self._heard_at.get(name, -math.inf) > asked_at and now - asked_at > ASK_AGAIN_S
        is_ours = self._stops.get(name, 0) < STOPS
        return is_news and is_ours and self._interval_s[name] < OFTEN_S

    def _by_groups(self, now: float) -> list[Message]:
        """Ask an autopilot of the older kind, as long as something is missing."""
        if not self._knows_no_intervals or now - self._groups_at <= ASK_AGAIN_S:
            return []
        if not self.overdue(now):
            return []
        self._groups_at = now
        target = self.route.target_system, self.route.target_component
        return [
            mavlink.MAVLink_request_data_stream_message(*target, group, rate_hz, 1)
            for group, rate_hz in _GROUPS
        ]

    def _home(self, now: float) -> list[Message]:
        if "HOME_POSITION" in self._heard_at:
            return []
        if self._home_asked_at is not None and now - self._home_asked_at < HOME_EVERY_S:
            return []
        self._home_asked_at = now
        return [request_message(self.route, mavlink.MAVLINK_MSG_ID_HOME_POSITION)]

    def _version(self, now: float) -> list[Message]:
        if "AUTOPILOT_VERSION" in self._heard_at:
            self._version_asked = VERSION_ATTEMPTS + 1
        if self.is_version_settled or now - self._version_asked_at < VERSION_EVERY_S:
            return []
        self._version_asked += 1
        self._version_asked_at = now
        if self._version_asked > VERSION_ATTEMPTS:
            return []
        return [request_message(self.route, mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION)]


_FOLLOWED: Final = frozenset({*(stream.name for stream in STREAMS), *UNREAD, "AUTOPILOT_VERSION"})


def request_message(route: Route, message_id: int) -> Message:
    """REQUEST_MESSAGE(512); the message itself is the answer that counts."""
    return CommandLong(
        command=mavlink.MAV_CMD_REQUEST_MESSAGE,
        parameters=(float(message_id), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    ).message(route, 0)
