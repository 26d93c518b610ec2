"""Sets the rates of the messages that the broker requires, and sets them again when they stop.

One SET_MESSAGE_INTERVAL is outstanding at a time, because COMMAND_ACK does not show which of
several it answers. HOME_POSITION is requested until it is received; vehicles send it rarely.
AUTOPILOT_VERSION, which distinguishes kinds of vehicles and each from the others, is requested a
few times at once, then now and then until it is received. Frequent messages that the broker does
not read are disabled: PX4 sends some 400 messages a second on a companion computer's link.

A message that is older than three of its periods is requested again: a vehicle forgets its streams
when it restarts, and a link may lose the request. An old autopilot without SET_MESSAGE_INTERVAL
gets REQUEST_DATA_STREAM(66) for groups of messages.

The rates of the broker's link serve a ground station behind the broker too. While one is connected,
the messages that its instruments show are set to rates that a slow radio can carry, and messages
that it has requested itself are left alone. When the last one has gone, these messages get their
default rates, and the broker disables frequent ones as before.
"""

import math
from collections.abc import Collection
from typing import Final, NamedTuple

from mavlink_broker.mavlink.dialect import Message, Route, mavlink
from mavlink_broker.microservices.command import (
    Accepted,
    CommandLong,
    CommandOutcome,
    CommandTransaction,
    RoundTrip,
    long_command,
)


class Stream(NamedTuple):
    """A message that the broker requires, with its rate."""

    name: str
    message_id: int
    rate_hz: float
    is_periodic: bool = True  # False: optional, or one message is enough

    @property
    def timeout_s(self) -> float:
        """Age at which it is overdue: three periods and a second for the link."""
        return 3.0 / self.rate_hz + 1.0

    @property
    def request(self) -> CommandLong:
        """The command that sets its rate."""
        return set_interval(self.message_id, 1e6 / self.rate_hz)


def set_interval(
    message_id: int, interval_us: float, *, component: int | None = None
) -> CommandLong:
    """SET_MESSAGE_INTERVAL(511), interval in microseconds; -1 disables the message.

    `component` is that of a camera, for example; None: the autopilot.
    """
    command = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
    return long_command(command, message_id, interval_us, component=component)


STREAMS: Final = (
    Stream("MISSION_CURRENT", mavlink.MAVLINK_MSG_ID_MISSION_CURRENT, 2.0),
    Stream("GLOBAL_POSITION_INT", mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, 5.0),
    Stream("EXTENDED_SYS_STATE", mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE, 2.0),
    Stream("ATTITUDE", mavlink.MAVLINK_MSG_ID_ATTITUDE, 5.0),
    Stream("SYS_STATUS", mavlink.MAVLINK_MSG_ID_SYS_STATUS, 1.0),
    Stream("BATTERY_STATUS", mavlink.MAVLINK_MSG_ID_BATTERY_STATUS, 1.0),
    Stream("HOME_POSITION", mavlink.MAVLINK_MSG_ID_HOME_POSITION, 0.5, is_periodic=False),
    Stream("GPS_RAW_INT", mavlink.MAVLINK_MSG_ID_GPS_RAW_INT, 1.0, is_periodic=False),
    Stream("SYSTEM_TIME", mavlink.MAVLINK_MSG_ID_SYSTEM_TIME, 0.5, is_periodic=False),
    Stream("ESTIMATOR_STATUS", mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS, 1.0, is_periodic=False),
    Stream("EKF_STATUS_REPORT", mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT, 1.0, is_periodic=False),
    Stream("FENCE_STATUS", mavlink.MAVLINK_MSG_ID_FENCE_STATUS, 1.0, is_periodic=False),
    Stream("HYGROMETER_SENSOR", mavlink.MAVLINK_MSG_ID_HYGROMETER_SENSOR, 1.0, is_periodic=False),
    Stream("NAMED_VALUE_FLOAT", mavlink.MAVLINK_MSG_ID_NAMED_VALUE_FLOAT, 1.0, is_periodic=False),
    Stream("SCALED_PRESSURE", mavlink.MAVLINK_MSG_ID_SCALED_PRESSURE, 0.5, is_periodic=False),
    Stream("WIND_COV", mavlink.MAVLINK_MSG_ID_WIND_COV, 0.5, is_periodic=False),
    Stream("WIND", mavlink.MAVLINK_MSG_ID_WIND, 0.5, is_periodic=False),
)
"""Required messages, the most urgent first; a slow radio can carry all of them."""

UNREAD: Final = {
    mavlink.mavlink_map[message_id].msgname: message_id
    for message_id in (
        mavlink.MAVLINK_MSG_ID_HIGHRES_IMU,
        mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION,
        mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED,
        mavlink.MAVLINK_MSG_ID_ODOMETRY,
        mavlink.MAVLINK_MSG_ID_RC_CHANNELS,
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
"""Messages that are disabled when they are received, the most frequent first, by name."""
UNREAD_MAX_INTERVAL_S: Final = 0.22
"""Rarer messages are left alone: a ground station on the same radio may have requested them."""
_OFF_US: Final = -1.0
_NEWEST: Final = 0.2  # Weight of the newest interval: two that come together are no stream
MAX_STOPS: Final = 2  # A message that returns more often is requested by another client

_GROUPS: Final = (
    (mavlink.MAV_DATA_STREAM_EXTENDED_STATUS, 2),
    (mavlink.MAV_DATA_STREAM_POSITION, 5),
    (mavlink.MAV_DATA_STREAM_EXTRA1, 5),
    (mavlink.MAV_DATA_STREAM_EXTRA3, 1),
)
"""REQUEST_DATA_STREAM: MISSION_CURRENT and SYS_STATUS; position; attitude; battery; and rates."""

REQUEST_INTERVAL_S: Final = 10.0
LONGEST_PAUSE_S: Final = 60.0
"""Longest pause; the pauses grow for a message that a vehicle does not send."""
CHECK_INTERVAL_S: Final = 0.2
"""How often it is checked which messages are missing; each may be for longer than a second."""
REFUSALS: Final = 2
"""A vehicle that has refused so often, and accepted nothing, lacks the command. PX4 refuses it for
MISSION_CURRENT."""
HOME_INTERVAL_S: Final = 1.0
SINGLE_INTERVAL_S: Final = 1.5
VERSION_INTERVAL_S: Final = 0.5
VERSION_ATTEMPTS: Final = 8
"""Requests for which missions wait; later ones are `VERSION_LATER_S` apart."""
VERSION_LATER_S: Final = 10.0


class StreamRequests:
    """Keeps the required messages of one vehicle coming.

    `observes`: no rate is changed; missing messages are requested one at a time.
    """

    def __init__(self, route: Route, round_trip: RoundTrip, *, observes: bool = False) -> None:
        self._observes = observes
        self.route = route
        self._round_trip = round_trip
        self._received_at: dict[str, float] = {}
        self._interval_s: dict[str, float] = {}
        self._gcs_rates = GroundStationRates()
        self.renew()

    def renew(self) -> None:
        """Set everything again: the vehicle has restarted, or its link was lost for long."""
        self._received_at.clear()
        self._gcs_rates.renew()
        self._requested_at: dict[str, float] = {}
        self._pause_s: dict[str, float] = {}
        self._running: CommandTransaction | None = None
        self._accepted = self._refused = 0
        self._requested = ""
        self._unsupported: set[str] = set()  # Messages that it has refused
        self._stops: dict[str, int] = {}
        self._groups_requested_at = -math.inf
        self._check_at = -math.inf
        self._home_requested_at: float | None = None
        self._version_requests = 0
        self._version_requested_at = -math.inf
        self.is_answered = False
        """Whether the vehicle has acknowledged anything to the broker, and so receives it."""

    def watch(self, requested_by_gcs: Collection[int] | None) -> None:
        """Follow the message ids that ground stations have requested; None without one.

        When the last one has gone the rates are set again, because it may have raised them.
        """
        if self._gcs_rates.update(requested_by_gcs) and not self._gcs_rates.is_present:
            for stream in STREAMS:
                self._requested_at.pop(stream.name, None)

    def ask_version(self) -> None:
        """Request AUTOPILOT_VERSION again: another vehicle may send, which has answered nothing."""
        self.is_answered = False
        self._received_at.pop("AUTOPILOT_VERSION", None)
        self._version_requests = 0
        self._version_requested_at = -math.inf

    @property
    def is_version_settled(self) -> bool:
        """Whether AUTOPILOT_VERSION was received or requested often enough."""
        return self._version_requests > VERSION_ATTEMPTS

    def overdue(self, now: float) -> tuple[str, ...]:
        """Names of the required messages that are overdue."""
        return tuple(
            stream.name
            for stream in STREAMS
            if stream.is_periodic and self._is_overdue(stream, now)
        )

    def receive(self, message: Message, now: float) -> list[Message]:
        """Handle a message of the vehicle."""
        name = message.get_type()
        is_answer = name == "COMMAND_ACK" and self.route.is_for_us(message)
        if is_answer and not self.is_answered:
            self.is_answered = True
            self._version_requests = 0  # Those of before may not have reached it
        if name in _TRACKED:
            mean_s = self._interval_s.get(name, REQUEST_INTERVAL_S)
            newest_s = min(now - self._received_at.get(name, -math.inf), REQUEST_INTERVAL_S)
            self._interval_s[name] = mean_s + _NEWEST * (newest_s - mean_s)
            self._received_at[name] = now
            self._pause_s.pop(name, None)
        if self._running is None:
            return []
        self._running.receive(message, now)
        return self._next(now)

    def tick(self, now: float) -> list[Message]:
        """Request what is missing; to be called only while the vehicle is received."""
        messages = [*self._home(now), *self._version(now)]
        if self._observes:
            return messages + self._single(now)
        messages += self._by_groups(now)
        if self._running is not None:
            messages += self._running.tick(now)
        elif now < self._check_at:
            return messages
        self._check_at = now + CHECK_INTERVAL_S
        return messages + self._next(now)

    def _single(self, now: float) -> list[Message]:
        """Request each missing message once."""
        messages = []
        for stream in STREAMS:
            last = max(
                self._received_at.get(stream.name, -math.inf),
                self._requested_at.get(stream.name, -math.inf),
            )
            if now - last >= SINGLE_INTERVAL_S:
                self._requested_at[stream.name] = now
                messages.append(request_message(self.route, stream.message_id))
        return messages

    def _next(self, now: float) -> list[Message]:
        if self._running is not None:
            if self._running.outcome is None:
                return []
            self._count_outcome(self._running.outcome)
        self._running = None
        for stream in STREAMS:
            if self._is_wanted(stream, now):
                return self._request(stream.name, stream.request, now)
        if not self._accepted:
            return []
        if (request := self._gcs_rates.take_next()) is not None:
            message_id, interval_us = request
            name = mavlink.mavlink_map[message_id].msgname
            return self._request(name, set_interval(message_id, interval_us), now)
        for name, message_id in UNREAD.items():
            if self._is_to_disable(name, now) and not self._gcs_rates.keeps(message_id):
                self._stops[name] = self._stops.get(name, 0) + 1
                return self._request(name, set_interval(message_id, _OFF_US), now)
        return []

    def _count_outcome(self, outcome: CommandOutcome) -> None:
        if isinstance(outcome, Accepted):
            self._accepted += 1
        else:
            self._refused += 1
            self._unsupported |= set() if outcome.result is None else {self._requested}

    @property
    def _lacks_set_message_interval(self) -> bool:
        return self._refused >= REFUSALS and self._accepted == 0

    def _request(self, name: str, request: CommandLong, now: float) -> list[Message]:
        if name in self._requested_at:
            pause_s = self._pause_s.get(name, REQUEST_INTERVAL_S)
            self._pause_s[name] = min(2.0 * pause_s, LONGEST_PAUSE_S)
        self._requested_at[name], self._requested = now, name
        self._running = CommandTransaction(request, self.route, self._round_trip)
        return self._running.start(now)

    def _is_wanted(self, stream: Stream, now: float) -> bool:
        requested_at = self._requested_at.get(stream.name)
        if requested_at is None:
            return not self._lacks_set_message_interval or self._is_overdue(stream, now)
        pause_s = self._pause_s.get(stream.name, REQUEST_INTERVAL_S)
        if stream.name in self._unsupported and not stream.is_periodic:
            return False
        if self._lacks_set_message_interval:
            pause_s = LONGEST_PAUSE_S
        return self._is_overdue(stream, now) and now - requested_at > pause_s

    def _is_overdue(self, stream: Stream, now: float) -> bool:
        last = self._received_at.get(stream.name, self._requested_at.get(stream.name))
        if last is None:
            last = self._groups_requested_at
        return now - last > stream.timeout_s

    def _is_to_disable(self, name: str, now: float) -> bool:
        """Whether an unread message is frequent, and no request to disable it is pending."""
        requested_at = self._requested_at.get(name, -math.inf)
        is_new = (
            self._received_at.get(name, -math.inf) > requested_at
            and now - requested_at > REQUEST_INTERVAL_S
        )
        may_stop = self._stops.get(name, 0) < MAX_STOPS
        return is_new and may_stop and self._interval_s[name] < UNREAD_MAX_INTERVAL_S

    def _by_groups(self, now: float) -> list[Message]:
        """Request groups of an old autopilot while something is missing."""
        if (
            not self._lacks_set_message_interval
            or now - self._groups_requested_at <= REQUEST_INTERVAL_S
        ):
            return []
        if not self.overdue(now):
            return []
        self._groups_requested_at = now
        return [
            mavlink.MAVLink_request_data_stream_message(*self.route.target, group, rate_hz, 1)
            for group, rate_hz in _GROUPS
        ]

    def _home(self, now: float) -> list[Message]:
        if "HOME_POSITION" in self._received_at:
            return []
        if self._home_requested_at is not None and now - self._home_requested_at < HOME_INTERVAL_S:
            return []
        self._home_requested_at = now
        return [request_message(self.route, mavlink.MAVLINK_MSG_ID_HOME_POSITION)]

    def _version(self, now: float) -> list[Message]:
        if "AUTOPILOT_VERSION" in self._received_at:
            self._version_requests = VERSION_ATTEMPTS + 1
            return []
        pause_s = VERSION_LATER_S if self.is_version_settled else VERSION_INTERVAL_S
        if now - self._version_requested_at < pause_s:
            return []
        self._version_requests += 1
        self._version_requested_at = now
        if self._version_requests == VERSION_ATTEMPTS + 1:
            return []
        return [request_message(self.route, mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION)]


_TRACKED: Final = frozenset({*(stream.name for stream in STREAMS), *UNREAD, "AUTOPILOT_VERSION"})
RATE_MESSAGES: Final = _TRACKED | {"COMMAND_ACK"}
"""Messages that `StreamRequests` reads."""


def request_message(
    route: Route, message_id: int, number: int = 0, *, component: int | None = None
) -> Message:
    """REQUEST_MESSAGE(512); the message itself is the answer that counts.

    `number` selects one, of a picture for example; `component` as of `set_interval`.
    """
    command = mavlink.MAV_CMD_REQUEST_MESSAGE
    return long_command(command, message_id, number, component=component).message(route, 0)


GCS_RATES_HZ: Final = {
    mavlink.MAVLINK_MSG_ID_VFR_HUD: 4.0,
    mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: 5.0,
    mavlink.MAVLINK_MSG_ID_ALTITUDE: 1.0,
    mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: 2.0,
    mavlink.MAVLINK_MSG_ID_RC_CHANNELS: 1.0,
    mavlink.MAVLINK_MSG_ID_NAV_CONTROLLER_OUTPUT: 1.0,
    mavlink.MAVLINK_MSG_ID_GIMBAL_DEVICE_ATTITUDE_STATUS: 2.0,
    mavlink.MAVLINK_MSG_ID_DISTANCE_SENSOR: 1.0,
}
"""By message id, the most important first: some 750 bytes a second together."""
DEFAULT_RATE_US: Final = 0.0
"""Interval of SET_MESSAGE_INTERVAL that means the vehicle's default rate."""


class GroundStationRates:
    """Rates for connected ground stations: what they have requested, what is still to be set."""

    def __init__(self) -> None:
        self._requested_by_gcs: Collection[int] | None = None
        self._waiting: list[int] = []
        self._set_for_gcs: set[int] = set()

    @property
    def is_present(self) -> bool:
        """Whether a ground station is connected."""
        return self._requested_by_gcs is not None

    def update(self, requested_by_gcs: Collection[int] | None) -> bool:
        """Follow what ground stations request, None without one; return whether it changed."""
        was_present = self.is_present
        self._requested_by_gcs = requested_by_gcs
        if self.is_present and not was_present:
            self.renew()
        elif was_present and not self.is_present:
            self._waiting = sorted(self._set_for_gcs)
        return self.is_present != was_present

    def renew(self) -> None:
        """Set everything again: the vehicle has restarted."""
        self._waiting = list(GCS_RATES_HZ) if self.is_present else []
        self._set_for_gcs = set()

    def take_next(self) -> tuple[int, float] | None:
        """Return the next message to set and its interval [us]."""
        while self._waiting:
            message_id = self._waiting.pop(0)
            if self._requested_by_gcs is None:
                return message_id, DEFAULT_RATE_US
            if message_id not in self._requested_by_gcs:
                self._set_for_gcs.add(message_id)
                return message_id, 1e6 / GCS_RATES_HZ[message_id]
        return None

    def keeps(self, message_id: int) -> bool:
        """Whether a message must not be disabled."""
        if self._requested_by_gcs is None:
            return False
        return message_id in GCS_RATES_HZ or message_id in self._requested_by_gcs
