"""Frames between links, vehicles and ground stations: believed, counted once, signed, answered."""

from collections.abc import Mapping
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest

from mavlink_broker.config import Config
from mavlink_broker.forwarding.verdict import Tenure
from mavlink_broker.link_settings import TrafficSettings
from mavlink_broker.links.url import Address, LinkUrl
from mavlink_broker.mavlink.codec import Decoder, Encoder
from mavlink_broker.mavlink.dialect import Message, mavlink, source_of
from mavlink_broker.mavlink.frames import is_signed
from mavlink_broker.mavlink.signature_check import VehicleSigning
from mavlink_broker.routing.routing import Traffic

EPOCH = datetime(2026, 11, 21, 8, 0, tzinfo=UTC)
KEYS = {1: bytes(range(32)), 2: bytes(range(32, 64)), 255: bytes(range(64, 96))}
HEARTBEAT = mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3)
GROUND_HEARTBEAT = mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)
ATTITUDE = mavlink.MAVLink_attitude_message(1, 0, 0, 0, 0, 0, 0)
LAND = mavlink.MAVLink_command_long_message(1, 1, mavlink.MAV_CMD_NAV_LAND, 0, *[0.0] * 7)
WIFI = Address("192.0.2.1", 14581, 0)
RADIO = Address("/dev/ttyUSB0", 57600, 1)
STATION = Address("127.0.0.1", 50_000, 2)


class Air:
    """Links whose other ends are the test; implements `mavlink_broker.routing.routing.Link`."""

    def __init__(self) -> None:
        self.arriving: list[tuple[Address, bytes]] = []
        self.sent: list[tuple[Address, bytes]] = []
        self.waiting: list[Address] = []
        self.free_percent: int | None = None

    def receive(self, timeout_s: float) -> list[tuple[Address, bytes]]:
        del timeout_s
        arrivals, self.arriving = self.arriving, []
        return arrivals

    def send(self, address: Address, frame: bytes) -> None:
        self.sent.append((address, frame))

    def radio(self, address: Address, free_percent: int) -> None:
        assert address == RADIO
        self.free_percent = free_percent

    def greeted(self) -> list[Address]:
        return self.waiting


class Crossroads:
    """Traffic over wifi, a radio and a ground station's port, in simulated time."""

    def __init__(
        self,
        keys: Path | None = None,
        *,
        links: str = "udpin://:14540 serial:///dev/ttyUSB0",
        forward: str = "udpin://127.0.0.1:14551",
        tenures: Mapping[int, Tenure] | None = None,
    ) -> None:
        parse = LinkUrl.parse
        settings = TrafficSettings(
            links=tuple(map(parse, links.split())), forward=tuple(map(parse, forward.split()))
        )
        self.now = 100.0
        self.air = Air()
        self._tenures = tenures or {}
        config = Config(signing_keys=keys, traffic=settings)
        self.traffic = Traffic(config, self.air, self, self._tenure)
        self._encoders: dict[tuple[int, int], Encoder] = {}
        self._signings = {n: VehicleSigning(key, self.utc) for n, key in KEYS.items()}

    def monotonic(self) -> float:
        return self.now

    def utc(self) -> datetime:
        return EPOCH + timedelta(seconds=self.now)

    def _tenure(self, system: int) -> Tenure:
        return self._tenures.get(system, Tenure.FREE)

    def frame(
        self, message: Any, system: int = 1, component: int = 1, key: int | None = None
    ) -> Any:
        encoder = self._encoders.setdefault((system, component), Encoder(system, component))
        return encoder.encode(message, None if key is None else self._signings[key].for_sending())

    def hear(self, *arrivals: tuple[Address, bytes], after_s: float = 0.1) -> list[Message]:
        self.now += after_s
        self.air.arriving += arrivals
        return self.traffic.receive(0.0)

    def sent_to(self, address: Address) -> list[tuple[Message, bytes]]:
        """Take what was sent to an address."""
        frames = [frame for to, frame in self.air.sent if to == address]
        self.air.sent = [(to, frame) for to, frame in self.air.sent if to != address]
        return [(Decoder(keeps_unknown=True).decode(frame)[0], frame) for frame in frames]


@pytest.fixture
def keys(tmp_path: Path) -> Path:
    for number, key in KEYS.items():
        path = tmp_path / f"signing-{number}.key"
        path.write_bytes(key)
        path.chmod(0o600)
    return tmp_path


class TestSeveralLinks:
    def test_a_message_that_comes_by_two_links_is_heard_once(self) -> None:
        roads = Crossroads()
        frame = roads.frame(HEARTBEAT)
        assert len(roads.hear((WIFI, frame), (RADIO, frame))) == 1
        for _ in range(20):
            frame = roads.frame(ATTITUDE)
            assert len(roads.hear((RADIO, frame), (WIFI, frame))) == 1

    def test_the_answer_goes_where_the_vehicle_was_last_heard(self) -> None:
        roads = Crossroads()
        roads.hear((WIFI, roads.frame(HEARTBEAT)), (RADIO, roads.frame(HEARTBEAT)))
        roads.traffic.send(1, [LAND])
        assert len(roads.sent_to(WIFI)) == 1
        roads.hear((RADIO, roads.frame(HEARTBEAT)), after_s=2.0)
        roads.traffic.send(1, [LAND])
        assert len(roads.sent_to(RADIO)) == 1
        assert roads.sent_to(WIFI) == []

    def test_a_camera_with_a_link_of_its_own_is_answered_there(self) -> None:
        roads = Crossroads()
        roads.hear((WIFI, roads.frame(HEARTBEAT)))
        roads.hear((RADIO, roads.frame(HEARTBEAT, component=100)))
        capture = mavlink.MAVLink_command_long_message(1, 100, 2000, 0, *[0.0] * 7)
        roads.traffic.send(1, [capture, LAND])
        assert [m.command for m, _ in roads.sent_to(RADIO)] == [2000]
        assert [m.command for m, _ in roads.sent_to(WIFI)] == [mavlink.MAV_CMD_NAV_LAND]
        roads.hear((WIFI, roads.frame(HEARTBEAT)), after_s=6.0)  # And the camera is silent
        roads.traffic.send(1, [capture])
        assert [m.command for m, _ in roads.sent_to(WIFI)] == [2000]

    def test_two_vehicles_on_one_radio_hear_one_series_of_numbers(self) -> None:
        roads = Crossroads()
        roads.hear((RADIO, roads.frame(HEARTBEAT, 1)), (RADIO, roads.frame(HEARTBEAT, 2)))
        for _ in range(3):
            roads.traffic.send(1, [LAND])
            roads.traffic.send(2, [LAND])
        assert [m.get_seq() for m, _ in roads.sent_to(RADIO)] == list(range(6))

    def test_nothing_is_sent_to_whom_nobody_has_heard(self) -> None:
        roads = Crossroads()
        roads.traffic.send(7, [LAND])
        assert roads.air.sent == []

    def test_a_radios_word_about_itself_reaches_its_link(self) -> None:
        roads = Crossroads()
        status = mavlink.MAVLink_radio_status_message(1, 1, 17, 1, 1, 1, 1)
        assert roads.hear((RADIO, roads.frame(status, 51, 68))) == []
        assert roads.air.free_percent == 17


class TestSpeakingFirst:
    def test_who_waits_hears_a_heartbeat_every_second_until_he_speaks(self) -> None:
        roads = Crossroads()
        roads.air.waiting = [RADIO]
        for _ in range(30):
            roads.hear()
        greetings = roads.sent_to(RADIO)
        assert 3 <= len(greetings) <= 4
        assert {m.get_type() for m, _ in greetings} == {"HEARTBEAT"}
        assert {m.type for m, _ in greetings} == {mavlink.MAV_TYPE_ONBOARD_CONTROLLER}
        for _ in range(30):
            roads.hear((RADIO, roads.frame(HEARTBEAT)))
        assert roads.sent_to(RADIO) == []

    def test_vehicles_that_must_sign_are_greeted_each_by_its_key(self, keys: Path) -> None:
        roads = Crossroads(keys)
        roads.air.waiting = [RADIO]
        roads.hear((WIFI, roads.frame(HEARTBEAT, 2, key=2)))
        believed = [
            number
            for message, frame in roads.sent_to(RADIO)
            for number, key in KEYS.items()
            if is_signed(frame)
            and VehicleSigning(key, roads.utc).judge(bytearray(frame), source_of(message)) is None
        ]
        assert 1 in believed
        assert 2 not in believed


class TestSignatures:
    def test_an_unsigned_vehicle_is_believed_on_a_trusted_cable_only(self, keys: Path) -> None:
        roads = Crossroads(keys, links="udpin://:14540 serial:///dev/ttyUSB0?trusted")
        assert roads.hear((WIFI, roads.frame(HEARTBEAT))) == []
        assert len(roads.hear((RADIO, roads.frame(HEARTBEAT)))) == 1

    def test_a_wrong_signature_is_believed_nowhere(self, keys: Path) -> None:
        roads = Crossroads(keys, links="udpin://:14540 serial:///dev/ttyUSB0?trusted")
        assert roads.hear((RADIO, roads.frame(HEARTBEAT, key=2))) == []

    def test_what_is_not_believed_is_not_shown_and_not_a_way(self, keys: Path) -> None:
        roads = Crossroads(keys)
        roads.hear((STATION, roads.frame(GROUND_HEARTBEAT, 255, 190)))
        roads.hear((WIFI, roads.frame(HEARTBEAT)), (WIFI, roads.frame(HEARTBEAT, key=2)))
        roads.traffic.send(1, [LAND])
        assert roads.air.sent == []


class TestGroundStations:
    def test_see_every_vehicle_without_signatures_on_the_loopback(self, keys: Path) -> None:
        roads = Crossroads(keys)
        roads.hear((STATION, roads.frame(GROUND_HEARTBEAT, 255, 190)))
        for system in (1, 2):
            roads.hear((WIFI, roads.frame(HEARTBEAT, system, key=system)))
        seen = roads.sent_to(STATION)
        assert [m.get_srcSystem() for m, _ in seen] == [1, 2]
        assert not any(is_signed(frame) for _, frame in seen)

    def test_speak_to_a_vehicle_with_its_key(self, keys: Path) -> None:
        roads = Crossroads(keys)
        roads.hear((WIFI, roads.frame(HEARTBEAT, key=1)))
        roads.hear((STATION, roads.frame(LAND, 255, 190)))
        ((message, frame),) = roads.sent_to(WIFI)
        assert source_of(message) == (255, 190)
        judge = VehicleSigning(KEYS[1], roads.utc)
        assert judge.judge(bytearray(frame), source_of(message)) is None

    def test_are_refused_while_a_mission_runs(self) -> None:
        roads = Crossroads(tenures={1: Tenure.MISSION})
        roads.hear((WIFI, roads.frame(HEARTBEAT)))
        roads.hear((STATION, roads.frame(LAND, 255, 190)))
        assert roads.sent_to(WIFI) == []
        answer, _ = roads.sent_to(STATION)[0]
        assert (answer.get_type(), answer.get_srcSystem()) == ("COMMAND_ACK", 1)

    def test_see_messages_that_the_broker_does_not_know(self) -> None:
        roads = Crossroads()
        roads.hear((STATION, roads.frame(GROUND_HEARTBEAT, 255, 190)))
        roads.hear((WIFI, roads.frame(HEARTBEAT)))
        roads.sent_to(STATION)
        body = bytes((1, 0, 0, 1, 1, 1)) + (70_000).to_bytes(3, "little") + b"x"
        unknown = b"\xfd" + body + mavlink.x25crc(body + b"\x07").crc.to_bytes(2, "little")
        assert roads.hear((WIFI, unknown)) == []
        assert [frame for _, frame in roads.sent_to(STATION)] == [unknown]

    def test_that_have_gone_are_sent_no_more(self) -> None:
        roads = Crossroads()
        roads.hear((STATION, roads.frame(GROUND_HEARTBEAT, 255, 190)))
        assert roads.traffic.asked_of(1, roads.now) is not None
        roads.hear((WIFI, roads.frame(HEARTBEAT)), after_s=11.0)
        assert roads.sent_to(STATION) == []
        assert roads.traffic.asked_of(1, roads.now) is None

    def test_that_listen_are_sent_to_unasked(self) -> None:
        roads = Crossroads(forward="udpout://127.0.0.1:50000")
        roads.air.waiting = [STATION]
        roads.hear((WIFI, roads.frame(HEARTBEAT)))
        assert len(roads.sent_to(STATION)) == 1
        roads.hear((STATION, roads.frame(LAND, 255, 190)))
        assert len(roads.sent_to(WIFI)) == 1


class TestGroundStationsElsewhere:
    FORWARD = "udpin://0.0.0.0:14551"

    def test_must_sign_with_the_ground_stations_key(self, keys: Path) -> None:
        roads = Crossroads(keys, forward=self.FORWARD)
        roads.hear((WIFI, roads.frame(HEARTBEAT, key=1)))
        roads.hear((STATION, roads.frame(LAND, 255, 190)))
        roads.hear((STATION, roads.frame(LAND, 255, 190, key=1)))
        assert roads.sent_to(WIFI) == []
        roads.hear((STATION, roads.frame(LAND, 250, 190, key=255)))
        assert len(roads.sent_to(WIFI)) == 1

    def test_get_what_is_signed_with_that_key(self, keys: Path) -> None:
        roads = Crossroads(keys, forward=self.FORWARD)
        roads.hear((STATION, roads.frame(GROUND_HEARTBEAT, 255, 190, key=255)))
        roads.hear((WIFI, roads.frame(HEARTBEAT, key=1)))
        ((message, frame),) = roads.sent_to(STATION)
        judge = VehicleSigning(KEYS[255], roads.utc)
        assert judge.judge(bytearray(frame), source_of(message)) is None

    def test_get_nothing_where_there_is_no_such_key(
        self, keys: Path, caplog: pytest.LogCaptureFixture
    ) -> None:
        (keys / "signing-255.key").unlink()
        roads = Crossroads(keys, forward="udpout://192.0.2.9:14550")
        roads.air.waiting = [STATION]
        roads.hear((STATION, roads.frame(GROUND_HEARTBEAT, 255, 190)))
        roads.hear((WIFI, roads.frame(HEARTBEAT, key=1)))
        assert roads.sent_to(STATION) == []
        assert caplog.text.count("signing-255.key") == 1

    def test_need_no_key_on_a_trusted_cable(self, keys: Path) -> None:
        roads = Crossroads(keys, forward="serial:///dev/ttyGROUND?trusted")
        roads.air.waiting = [STATION]
        roads.hear((WIFI, roads.frame(HEARTBEAT, key=1)))
        assert [is_signed(frame) for _, frame in roads.sent_to(STATION)] == [False]
        roads.hear((STATION, roads.frame(LAND, 255, 190)))
        assert len(roads.sent_to(WIFI)) == 1

    def test_need_no_key_where_nobody_has_one(self) -> None:
        roads = Crossroads(forward=self.FORWARD)
        roads.hear((STATION, roads.frame(GROUND_HEARTBEAT, 255, 190)))
        roads.hear((WIFI, roads.frame(HEARTBEAT)))
        assert len(roads.sent_to(STATION)) == 1


def test_hostile_bytes_from_a_ground_station_lead_to_nothing() -> None:
    roads = Crossroads()
    roads.hear((WIFI, roads.frame(HEARTBEAT)))
    whole = roads.frame(LAND, 255, 190)
    for cut in range(1, len(whole)):
        roads.hear((STATION, whole[:cut]), (STATION, whole[cut:]), (STATION, b"\xfd" * 500))
    assert roads.air.sent == []


def test_the_frame_log_holds_what_was_believed_and_what_was_sent(
    keys: Path, tmp_path: Path
) -> None:
    traffic = TrafficSettings(links=(LinkUrl.parse("udpin://:14540"),), tlog_dir=tmp_path / "tlog")
    roads = Crossroads(keys)
    config = Config(signing_keys=keys, traffic=traffic)
    roads.traffic = Traffic(config, roads.air, roads, roads._tenure)
    believed, refused = roads.frame(HEARTBEAT, key=1), roads.frame(ATTITUDE)
    roads.hear((WIFI, believed), (WIFI, refused))
    roads.traffic.send(1, [LAND])
    roads.traffic.close()
    ((_, sent),) = roads.sent_to(WIFI)
    (path,) = (tmp_path / "tlog").iterdir()
    stamp = path.read_bytes()[:8]
    assert path.read_bytes() == stamp + believed + stamp + sent
    assert KEYS[1] not in path.read_bytes()
