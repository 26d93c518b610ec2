"""A ground station finds instruments that move, and leaves the broker's streams as they were."""

from collections.abc import Collection

from mavlink_broker.mavlink.addressing import Route
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.microservices.message_rates import STREAMS, UNREAD, StreamRequests
from mavlink_broker.microservices.round_trip import RoundTrip
from mavlink_broker.microservices.watched_rates import RATES_HZ

VFR_HUD = mavlink.MAVLINK_MSG_ID_VFR_HUD
IMU = mavlink.MAVLINK_MSG_ID_HIGHRES_IMU
OWN_US = 1e5
"""How often this vehicle sends what nobody has asked for."""
NAMES = {number: name for name, number in UNREAD.items()}


class Vehicle:
    """Grants every interval, and sends what it has granted, and what nobody has turned off."""

    def __init__(self) -> None:
        self.requests = StreamRequests(Route(254, 191, 1, 1), RoundTrip())
        self.intervals_us: dict[int, float] = dict.fromkeys(UNREAD.values(), OWN_US)
        self.now = 0.0

    def run(self, seconds: float, asked_elsewhere: Collection[int] | None) -> None:
        end = self.now + seconds
        while self.now < end:
            self.now += 0.1
            self.requests.watch(asked_elsewhere)
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


def test_while_nobody_watches_what_nobody_reads_is_turned_off() -> None:
    vehicle = Vehicle()
    vehicle.run(30.0, None)
    assert {vehicle.intervals_us[number] for number in UNREAD.values()} == {-1.0}


def test_who_watches_gets_what_instruments_show_and_no_more() -> None:
    vehicle = Vehicle()
    vehicle.run(30.0, None)
    vehicle.run(30.0, ())
    shown = {n: 1e6 / us for n, us in vehicle.intervals_us.items() if us > 0 and n in NAMES}
    assert shown == RATES_HZ


def test_what_a_ground_station_asked_for_itself_is_left_alone() -> None:
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


def test_a_restarted_vehicle_is_asked_again() -> None:
    vehicle = Vehicle()
    vehicle.run(10.0, ())
    vehicle.intervals_us = {}
    vehicle.requests.renew()
    vehicle.run(10.0, ())
    assert vehicle.intervals_us.keys() >= RATES_HZ.keys()
