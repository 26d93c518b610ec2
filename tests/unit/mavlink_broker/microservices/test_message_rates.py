"""The messages that the broker requires keep coming."""

from collections.abc import Collection
from itertools import cycle, pairwise

from mavlink_broker.autopilots.status_texts import StatusTexts
from mavlink_broker.mavlink.dialect import Message, MissionCurrent, Route, mavlink
from mavlink_broker.microservices.command import RoundTrip
from mavlink_broker.microservices.message_rates import (
    GCS_RATES_HZ,
    MAX_STOPS,
    REQUEST_INTERVAL_S,
    STREAMS,
    UNREAD,
    StreamRequests,
)
from mavlink_broker.microservices.parameter import READ_ATTEMPTS, ParameterRead
from tests.unit.mavlink_broker.microservices.harness import (
    ROUTE,
    acknowledgement,
    received,
    tick_until,
)

SET = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL


def intervals(messages: list[Message]) -> list[int]:
    return [int(m.param1) for m in messages if getattr(m, "command", None) == SET]


def asked_for_all(requests: StreamRequests) -> list[int]:
    """Acknowledge every request; gives the message ids in the order asked."""
    asked = intervals(requests.tick(0.0))
    for _ in STREAMS:
        asked += intervals(requests.receive(acknowledgement(SET, 0), 0.01))
    return asked


def test_each_message_is_requested_once_one_at_a_time() -> None:
    asked = asked_for_all(StreamRequests(ROUTE, RoundTrip()))
    assert asked == [stream.message_id for stream in STREAMS]


def test_a_refusal_does_not_hold_up_the_others() -> None:
    requests = StreamRequests(ROUTE, RoundTrip())
    requests.tick(0.0)
    after = requests.receive(acknowledgement(SET, mavlink.MAV_RESULT_UNSUPPORTED), 0.1)
    assert intervals(after) == [STREAMS[1].message_id]


def test_an_overdue_message_is_requested_again() -> None:
    requests = StreamRequests(ROUTE, RoundTrip())
    asked_for_all(requests)
    asked: list[int] = []
    for tenth in range(1, 300):
        now = tenth / 10
        requests.receive(received(MissionCurrent(0)), now)
        asked += intervals(requests.tick(now))
        asked += intervals(requests.receive(acknowledgement(SET, 0), now))
    assert mavlink.MAVLINK_MSG_ID_ATTITUDE in asked
    assert mavlink.MAVLINK_MSG_ID_MISSION_CURRENT not in asked


def test_each_is_overdue_when_three_of_its_periods_are_over() -> None:
    requests = StreamRequests(ROUTE, RoundTrip())
    asked_for_all(requests)
    position = mavlink.MAVLink_global_position_int_message(1, 2, 3, 4, 5, 6, 7, 8, 9)
    requests.receive(received(MissionCurrent(0)), 1.0)
    requests.receive(received(position), 1.0)
    assert requests.overdue(1.1) == ()
    assert "GLOBAL_POSITION_INT" not in requests.overdue(2.5)
    assert "MISSION_CURRENT" not in requests.overdue(3.4)
    assert {"GLOBAL_POSITION_INT", "MISSION_CURRENT"} <= set(requests.overdue(3.6))


def test_an_unsupported_message_is_requested_with_growing_pauses() -> None:
    requests = StreamRequests(ROUTE, RoundTrip())
    asked_for_all(requests)
    battery = mavlink.MAVLINK_MSG_ID_BATTERY_STATUS
    requested_at: list[float] = []
    for tenth in range(3000):
        now = tenth / 10
        sent = requests.tick(now) + requests.receive(acknowledgement(SET, 0), now)
        requested_at += [now] * intervals(sent).count(battery)
    pauses = [round(later - before) for before, later in pairwise(requested_at)]
    assert pauses == sorted(pauses)
    assert pauses[-1] == 60


def groups(messages: list[Message]) -> list[int]:
    return [m.req_stream_id for m in messages if m.get_type() == "REQUEST_DATA_STREAM"]


def refuse_all(requests: StreamRequests, result: int, seconds: int = 30) -> list[Message]:
    """Answer every request alike for some time; gives what was sent."""
    sent: list[Message] = []
    for tenth in range(seconds * 10):
        sent += requests.tick(tenth / 10)
        sent += requests.receive(acknowledgement(SET, result), tenth / 10)
    return sent


def test_an_autopilot_without_intervals_gets_group_requests() -> None:
    sent = refuse_all(StreamRequests(ROUTE, RoundTrip()), mavlink.MAV_RESULT_UNSUPPORTED)
    assert set(groups(sent)) == {2, 6, 10, 12}
    assert len(groups(sent)) == 3 * 4, "every ten seconds, as long as nothing comes"
    assert len(intervals(sent)) <= len(STREAMS)


def test_an_autopilot_that_does_not_answer_gets_group_requests() -> None:
    assert groups(tick_until(StreamRequests(ROUTE, RoundTrip()), 0.0, 30.0))


def test_one_refusal_causes_no_group_requests() -> None:
    """PX4 sends MISSION_CURRENT by itself, and refuses to send it more often."""
    requests = StreamRequests(ROUTE, RoundTrip())
    requests.tick(0.0)
    requests.receive(acknowledgement(SET, mavlink.MAV_RESULT_DENIED), 0.1)
    assert groups(refuse_all(requests, mavlink.MAV_RESULT_ACCEPTED)) == []


def test_a_restart_of_the_vehicle_renews_everything() -> None:
    requests = StreamRequests(ROUTE, RoundTrip())
    asked_for_all(requests)
    requests.renew()
    assert asked_for_all(requests) == [stream.message_id for stream in STREAMS]


def receive_often(requests: StreamRequests, now: float, *apart_s: float) -> None:
    """A vehicle's inertial data, which the broker does not read; at such intervals, repeatedly."""
    imu = received(mavlink.MAVLink_highres_imu_message(1, *[0.0] * 13, 0))
    heard_at = now
    times = [now]
    for _, pause_s in zip(range(80), cycle(apart_s), strict=False):
        heard_at -= pause_s
        times.append(heard_at)
    for time in reversed(times):
        requests.receive(imu, time)


def test_an_unread_message_is_disabled_when_it_is_received() -> None:
    requests = StreamRequests(ROUTE, RoundTrip())
    asked_for_all(requests)
    receive_often(requests, 1.0, 0.02)
    stop = [m for m in requests.tick(1.0) if m.command == SET]
    assert [(m.param1, m.param2) for m in stop] == [(105, -1)]
    requests.receive(acknowledgement(SET, 0), 1.1)
    receive_often(requests, 1.2, 0.02)
    assert intervals(requests.tick(1.2)) == [], "one more may have been in transit"
    later_s = 1.0 + REQUEST_INTERVAL_S + 0.1
    receive_often(requests, later_s, 0.02)
    assert mavlink.MAVLINK_MSG_ID_HIGHRES_IMU in tick_until_all(requests, later_s)


def test_a_rare_unread_message_is_left_alone() -> None:
    """MAVProxy asks for everything four times a second, and would ask again."""
    requests = StreamRequests(ROUTE, RoundTrip())
    asked_for_all(requests)
    receive_often(requests, 1.0, 0.15, 0.35)
    assert mavlink.MAVLINK_MSG_ID_HIGHRES_IMU not in tick_until_all(requests, 1.0)


def test_a_message_that_always_returns_is_left_alone() -> None:
    """MAVProxy with a stream rate of ten has its instruments, and no gap in them every 15 s."""
    requests = StreamRequests(ROUTE, RoundTrip())
    asked_for_all(requests)
    stopped = []
    for minute in range(1, 6):
        receive_often(requests, 60.0 * minute, 0.1)
        stopped += tick_until_all(requests, 60.0 * minute)
    assert stopped.count(mavlink.MAVLINK_MSG_ID_HIGHRES_IMU) == MAX_STOPS


def test_a_refused_optional_message_is_not_requested_again() -> None:
    """ArduPilot sends a STATUSTEXT for every message that it does not know."""
    requests = StreamRequests(ROUTE, RoundTrip())
    asked = intervals(requests.tick(0.0))
    refused = {mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS, mavlink.MAVLINK_MSG_ID_WIND_COV}
    for second in range(2000):
        result = mavlink.MAV_RESULT_FAILED if asked[-1] in refused else 0
        asked += intervals(requests.receive(acknowledgement(SET, result), second))
        asked += intervals(requests.tick(second))
    assert {number: asked.count(number) for number in refused} == dict.fromkeys(refused, 1)
    assert asked.count(mavlink.MAVLINK_MSG_ID_SYSTEM_TIME) > 1


def tick_until_all(requests: StreamRequests, now: float) -> list[int]:
    """Acknowledge whatever is asked; gives the message ids asked for."""
    asked = intervals(requests.tick(now))
    for _ in range(len(STREAMS) + len(UNREAD)):
        asked += intervals(requests.receive(acknowledgement(SET, 0), now))
    return asked


def test_what_is_read_is_never_turned_off() -> None:
    assert not {stream.name for stream in STREAMS} & set(UNREAD)


def test_home_is_requested_until_it_is_received() -> None:
    def wishes(messages: list[Message]) -> int:
        return sum(
            m.command == mavlink.MAV_CMD_REQUEST_MESSAGE
            and m.param1 == mavlink.MAVLINK_MSG_ID_HOME_POSITION
            for m in messages
        )

    requests = StreamRequests(ROUTE, RoundTrip())
    assert wishes(tick_until(requests, 0.0, 3.0)) == 3
    home = mavlink.MAVLink_home_position_message(1, 2, 3, 0, 0, 0, [1, 0, 0, 0], 0, 0, 0)
    requests.receive(received(home), 3.0)
    assert wishes(tick_until(requests, 3.0, 9.0)) == 0


def test_the_version_is_requested_a_few_times_then_rarely_until_it_is_received() -> None:
    def wishes(messages: list[Message]) -> int:
        version = mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION
        return sum(getattr(m, "param1", None) == version for m in messages)

    requests = StreamRequests(ROUTE, RoundTrip())
    assert wishes(tick_until(requests, 0.0, 3.0)) == 6
    assert not requests.is_version_settled
    assert wishes(tick_until(requests, 3.0, 12.0)) == 2
    assert wishes(tick_until(requests, 12.0, 60.0)) == 5
    version = mavlink.MAVLink_autopilot_version_message(0, 0, 0, 0, 0, *[[0] * 8] * 3, 0, 0, 7)
    requests.receive(received(version), 60.0)
    assert wishes(tick_until(requests, 60.0, 90.0)) == 0
    assert requests.is_version_settled


def value(name: bytes, kind: int, number: float) -> Message:
    return received(mavlink.MAVLink_param_value_message(name, number, kind, 1, 0))


def test_a_parameter_is_requested_until_it_is_received() -> None:
    read = ParameterRead("BAT1_CAPACITY", ROUTE, RoundTrip())
    assert len(tick_until(read, 0.0, 2.5)) == 3
    read.receive(value(b"OTHER", 9, 1.0))
    read.receive(value(b"BAT1_CAPACITY", 6, 1.0))
    assert read.outcome is None
    read.receive(value(b"BAT1_CAPACITY", 9, 5000.0))
    assert read.value == 5000.0
    assert tick_until(read, 2.5, 9.0) == []


def test_requests_of_a_missing_parameter_end() -> None:
    read = ParameterRead("BAT1_CAPACITY", ROUTE, RoundTrip())
    assert len(tick_until(read, 0.0, 60.0)) == READ_ATTEMPTS
    assert read.outcome is not None


def text(content: bytes, identifier: int = 0, chunk: int = 0, severity: int = 2) -> Message:
    return received(mavlink.MAVLink_statustext_message(severity, content, identifier, chunk))


def test_complaints_count_and_chatter_does_not() -> None:
    texts = StatusTexts()
    texts.receive(text(b"first"), 1.0)
    texts.receive(text(b"second"), 2.0)
    texts.receive(text(b"all is well", severity=6), 3.0)
    assert texts.since(0.0) == ["first", "second"]
    assert texts.since(2.5) == []


def test_a_long_complaint_is_put_together_whatever_the_order() -> None:
    texts = StatusTexts()
    texts.receive(text(b"not arrive", 7, 1), 1.0)
    texts.receive(text(b"x" * 50, 7, 0), 1.1)
    assert texts.since(0.0) == ["x" * 50 + "not arrive"]


def test_a_lost_part_of_a_complaint_shows_as_a_gap() -> None:
    texts = StatusTexts()
    texts.receive(text(b"PreArm: compass", 7, 0), 1.0)
    texts.receive(text(b" degrees off", 7, 2), 1.1)
    assert texts.since(0.0) == ["PreArm: compass... degrees off"]


def test_repeated_texts_count_once_and_only_the_last_three_are_reported() -> None:
    texts = StatusTexts()
    for second, content in enumerate((b"a", b"b\t", b"b", b"c", b"d", b"d")):
        texts.receive(text(content), float(second))
    assert texts.since(0.0) == ["b", "c", "d"]


def test_an_id_that_is_used_again_later_means_another_complaint() -> None:
    texts = StatusTexts()
    texts.receive(text(b"first", 7), 1.0)
    texts.receive(text(b"second", 7), 60.0)
    assert texts.since(0.0) == ["first", "second"]


VFR_HUD = mavlink.MAVLINK_MSG_ID_VFR_HUD
IMU = mavlink.MAVLINK_MSG_ID_HIGHRES_IMU
OWN_US = 1e5
"""Interval at which this vehicle sends what was not requested."""
NAMES = {number: name for name, number in UNREAD.items()}


class Vehicle:
    """Grants every interval, and sends what it has granted, and what was not turned off."""

    def __init__(self) -> None:
        self.requests = StreamRequests(Route(254, 191, 1, 1), RoundTrip())
        self.intervals_us: dict[int, float] = dict.fromkeys(UNREAD.values(), OWN_US)
        self.now = 0.0

    def run(self, seconds: float, requested_by_gcs: Collection[int] | None) -> None:
        end = self.now + seconds
        while self.now < end:
            self.now += 0.1
            self.requests.watch(requested_by_gcs)
            self._obey(self.requests.tick(self.now))
            for number, interval_us in list(self.intervals_us.items()):
                if interval_us > 0 and number in NAMES | {s.message_id: s.name for s in STREAMS}:
                    message = mavlink.mavlink_map[number]
                    self._obey(self.requests.receive(_empty(message), self.now))

    def _obey(self, messages: list) -> None:  # type: ignore[type-arg]  # of pymavlink's classes
        for message in messages:
            if getattr(message, "command", 0) == mavlink.MAV_CMD_SET_MESSAGE_INTERVAL:
                self.intervals_us[int(message.param1)] = message.param2 or OWN_US
                accepted = mavlink.MAVLink_command_ack_message(message.command, 0, 0, 0, 254, 191)
                self._obey(self.requests.receive(accepted, self.now))


def _empty(message_class: type) -> object:
    class Empty:
        """A message of which only the type matters."""

        def get_type(self) -> str:
            return str(message_class.msgname)  # type: ignore[attr-defined]  # pymavlink's

    return Empty()


def test_without_a_ground_station_unread_messages_are_disabled() -> None:
    vehicle = Vehicle()
    vehicle.run(30.0, None)
    assert {vehicle.intervals_us[number] for number in UNREAD.values()} == {-1.0}


def test_a_ground_station_gets_the_messages_of_its_instruments() -> None:
    vehicle = Vehicle()
    vehicle.run(30.0, None)
    vehicle.run(30.0, ())
    request = {n: 1e6 / us for n, us in vehicle.intervals_us.items() if us > 0 and n in NAMES}
    assert request == GCS_RATES_HZ


def test_messages_that_a_ground_station_requested_are_left_alone() -> None:
    vehicle = Vehicle()
    vehicle.run(10.0, None)
    vehicle.intervals_us |= {VFR_HUD: 5e4, IMU: 2e4}
    vehicle.run(60.0, {VFR_HUD, IMU})
    assert vehicle.intervals_us[VFR_HUD] == 5e4
    assert vehicle.intervals_us[IMU] == 2e4


def test_when_it_has_gone_everything_is_as_before() -> None:
    vehicle = Vehicle()
    vehicle.run(30.0, None)
    before = dict(vehicle.intervals_us)
    vehicle.intervals_us[STREAMS[1].message_id] = 2e4
    vehicle.run(30.0, {IMU})
    vehicle.run(60.0, None)
    assert vehicle.intervals_us == before


def test_rates_are_set_again_after_a_restart() -> None:
    vehicle = Vehicle()
    vehicle.run(10.0, ())
    vehicle.intervals_us = {}
    vehicle.requests.renew()
    vehicle.run(10.0, ())
    assert vehicle.intervals_us.keys() >= GCS_RATES_HZ.keys()
