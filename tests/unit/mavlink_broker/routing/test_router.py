"""Frames between links, vehicles and ground stations: accepted, counted once, signed, answered."""

from collections.abc import Mapping
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest

from mavlink_broker.config import Config, LinkSettings
from mavlink_broker.links.url import Address, LinkUrl
from mavlink_broker.mavlink.codec import Decoder, Encoder, is_signed
from mavlink_broker.mavlink.dialect import Message, mavlink, source_of
from mavlink_broker.mavlink.signing import LinkSigning
from mavlink_broker.routing.policy import BrokerControl
from mavlink_broker.routing.router import Router

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
    """Links whose other ends are the test; implements `mavlink_broker.routing.router.Link`."""

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

    def radio_status(self, address: Address, free_percent: int) -> None:
        assert address == RADIO
        self.free_percent = free_percent

    def contact_addresses(self) -> list[Address]:
        return self.waiting


class RouterWorld:
    """Traffic over wifi, a radio and a ground station's port, in simulated time."""

    def __init__(
        self,
        keys: Path | None = None,
        *,
        links: str = "udpin://:14540 serial:///dev/ttyUSB0",
        forward: str = "udpin://127.0.0.1:14551",
        controls: Mapping[int, BrokerControl] | None = None,
    ) -> None:
        parse = LinkUrl.parse
        settings = LinkSettings(
            links=tuple(map(parse, links.split())), forward=tuple(map(parse, forward.split()))
        )
        self.now = 100.0
        self.air = Air()
        self._controls = controls or {}
        config = Config(signing_keys=keys, traffic=settings)
        self.router = Router(config, self.air, self, self.control_of)
        self._encoders: dict[tuple[int, int], Encoder] = {}
        self._signings = {n: LinkSigning(key, self.utc) for n, key in KEYS.items()}

    def monotonic(self) -> float:
        return self.now

    def utc(self) -> datetime:
        return EPOCH + timedelta(seconds=self.now)

    def control_of(self, system: int) -> BrokerControl:
        return self._controls.get(system, BrokerControl.FREE)

    def frame(
        self, message: Any, system: int = 1, component: int = 1, key: int | None = None
    ) -> Any:
        encoder = self._encoders.setdefault((system, component), Encoder(system, component))
        return encoder.encode(
            message, None if key is None else self._signings[key].next_signature()
        )

    def receive(self, *arrivals: tuple[Address, bytes], after_s: float = 0.1) -> list[Message]:
        self.now += after_s
        self.air.arriving += arrivals
        return self.router.receive(0.0)

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
    def test_a_message_on_two_links_is_received_once(self) -> None:
        world = RouterWorld()
        frame = world.frame(HEARTBEAT)
        assert len(world.receive((WIFI, frame), (RADIO, frame))) == 1
        for _ in range(20):
            frame = world.frame(ATTITUDE)
            assert len(world.receive((RADIO, frame), (WIFI, frame))) == 1

    def test_the_answer_is_sent_on_the_active_link(self) -> None:
        world = RouterWorld()
        world.receive((WIFI, world.frame(HEARTBEAT)), (RADIO, world.frame(HEARTBEAT)))
        world.router.send(1, [LAND])
        assert len(world.sent_to(WIFI)) == 1
        world.receive((RADIO, world.frame(HEARTBEAT)), after_s=2.0)
        world.router.send(1, [LAND])
        assert len(world.sent_to(RADIO)) == 1
        assert world.sent_to(WIFI) == []

    def test_a_camera_with_a_link_of_its_own_is_answered_there(self) -> None:
        world = RouterWorld()
        world.receive((WIFI, world.frame(HEARTBEAT)))
        world.receive((RADIO, world.frame(HEARTBEAT, component=100)))
        capture = mavlink.MAVLink_command_long_message(1, 100, 2000, 0, *[0.0] * 7)
        world.router.send(1, [capture, LAND])
        assert [m.command for m, _ in world.sent_to(RADIO)] == [2000]
        assert [m.command for m, _ in world.sent_to(WIFI)] == [mavlink.MAV_CMD_NAV_LAND]
        world.receive((WIFI, world.frame(HEARTBEAT)), after_s=6.0)  # And the camera is silent
        world.router.send(1, [capture])
        assert [m.command for m, _ in world.sent_to(WIFI)] == [2000]

    @pytest.mark.parametrize("control", [BrokerControl.FREE, BrokerControl.MISSION])
    @pytest.mark.parametrize("camera_s", [300.0, 1000.0, 1.0])
    def test_the_clock_of_a_camera_is_not_that_of_another_vehicle(
        self, control: BrokerControl, camera_s: float
    ) -> None:
        """It may have been switched on, or have restarted, at any time."""
        world = RouterWorld(controls={1: control})
        begin = world.now

        def arrive(address: Address, *kinds: str) -> list[str]:
            passed_ms = round(1e3 * (world.now + 0.1 - begin))
            attitude = mavlink.MAVLink_attitude_message(1_000_000 + passed_ms, *[0] * 6)
            capture = mavlink.MAVLink_camera_capture_status_message(
                round(camera_s * 1e3) + passed_ms, 0, 0, 0, 0, 0
            )
            frames = {
                "HEARTBEAT": world.frame(HEARTBEAT),
                "ATTITUDE": world.frame(attitude),
                "CAMERA_CAPTURE_STATUS": world.frame(capture, component=100),
            }
            messages = world.receive(*((address, frames[kind]) for kind in kinds))
            return [message.get_type() for message in messages]

        everything = "HEARTBEAT", "ATTITUDE", "CAMERA_CAPTURE_STATUS"
        for _ in range(10):
            arrive(WIFI, *everything)
        world.now += 2.0
        arrive(RADIO, "CAMERA_CAPTURE_STATUS")
        assert world.router.take_replaced() == set()
        for _ in range(10):
            arrive(RADIO, "ATTITUDE", "HEARTBEAT", "CAMERA_CAPTURE_STATUS")
        assert world.router.take_replaced() == set()
        assert sorted(arrive(RADIO, *everything)) == sorted(everything)

    def test_two_vehicles_on_one_radio_share_one_series_of_sequence_numbers(self) -> None:
        world = RouterWorld()
        world.receive((RADIO, world.frame(HEARTBEAT, 1)), (RADIO, world.frame(HEARTBEAT, 2)))
        for _ in range(3):
            world.router.send(1, [LAND])
            world.router.send(2, [LAND])
        assert [m.get_seq() for m, _ in world.sent_to(RADIO)] == list(range(6))

    def test_nothing_is_sent_to_an_unknown_vehicle(self) -> None:
        world = RouterWorld()
        world.router.send(7, [LAND])
        assert world.air.sent == []

    def test_a_radio_status_is_passed_to_its_link(self) -> None:
        world = RouterWorld()
        status = mavlink.MAVLink_radio_status_message(1, 1, 17, 1, 1, 1, 1)
        assert world.receive((RADIO, world.frame(status, 51, 68))) == []
        assert world.air.free_percent == 17


class TestFirstHeartbeats:
    def test_a_silent_contact_gets_a_heartbeat_every_second_until_it_sends(self) -> None:
        world = RouterWorld()
        world.air.waiting = [RADIO]
        for _ in range(30):
            world.receive()
        signings_for_contact = world.sent_to(RADIO)
        assert 3 <= len(signings_for_contact) <= 4
        assert {m.get_type() for m, _ in signings_for_contact} == {"HEARTBEAT"}
        assert {m.type for m, _ in signings_for_contact} == {mavlink.MAV_TYPE_ONBOARD_CONTROLLER}
        for _ in range(30):
            world.receive((RADIO, world.frame(HEARTBEAT)))
        assert world.sent_to(RADIO) == []

    def test_first_heartbeats_are_signed_with_each_vehicles_key(self, keys: Path) -> None:
        world = RouterWorld(keys)
        world.air.waiting = [RADIO]
        world.receive((WIFI, world.frame(HEARTBEAT, 2, key=2)))
        accepted = [
            number
            for message, frame in world.sent_to(RADIO)
            for number, key in KEYS.items()
            if is_signed(frame)
            and LinkSigning(key, world.utc).check(bytearray(frame), source_of(message)) is None
        ]
        assert 1 in accepted
        assert 2 not in accepted


class TestSignatures:
    def test_an_unsigned_vehicle_is_accepted_on_a_trusted_line_only(self, keys: Path) -> None:
        world = RouterWorld(keys, links="udpin://:14540 serial:///dev/ttyUSB0?trusted")
        assert world.receive((WIFI, world.frame(HEARTBEAT))) == []
        assert len(world.receive((RADIO, world.frame(HEARTBEAT)))) == 1

    def test_a_wrong_signature_is_never_accepted(self, keys: Path) -> None:
        world = RouterWorld(keys, links="udpin://:14540 serial:///dev/ttyUSB0?trusted")
        assert world.receive((RADIO, world.frame(HEARTBEAT, key=2))) == []

    def test_a_second_vehicle_with_the_same_key_is_named_and_takes_no_place(
        self, keys: Path
    ) -> None:
        """It signs two minutes ahead, as one that was restarted."""
        world = RouterWorld(keys)
        other = LinkSigning(KEYS[1], lambda: world.utc() + timedelta(minutes=2))
        twin = Encoder(1, 1)
        for second in range(12):
            boot_ms = 1000 * second
            one = mavlink.MAVLink_attitude_message(600_000 + boot_ms, 0, 0, 0, 0, 0, 0)
            two = mavlink.MAVLink_attitude_message(boot_ms, 0, 0, 0, 0, 0, 0)
            seen = world.receive(
                (WIFI, world.frame(HEARTBEAT, key=1)),
                (WIFI, world.frame(one, key=1)),
                (RADIO, twin.encode(HEARTBEAT, other.next_signature())),
                (RADIO, twin.encode(two, other.next_signature())),
                after_s=1.0,
            )
            assert [m.time_boot_ms for m in seen if m.get_type() == "ATTITUDE"] == [
                one.time_boot_ms
            ]
        world.router.send(1, [LAND])
        assert world.sent_to(RADIO) == []
        assert "has the same system id, 1" in (world.router.warning_of(1, world.now) or "")

    def test_a_refused_frame_is_not_forwarded_and_gives_no_address(self, keys: Path) -> None:
        world = RouterWorld(keys)
        world.receive((STATION, world.frame(GROUND_HEARTBEAT, 255, 190)))
        world.receive((WIFI, world.frame(HEARTBEAT)), (WIFI, world.frame(HEARTBEAT, key=2)))
        world.router.send(1, [LAND])
        assert world.air.sent == []


class TestGroundStations:
    def test_see_every_vehicle_without_signatures_on_the_loopback(self, keys: Path) -> None:
        world = RouterWorld(keys)
        world.receive((STATION, world.frame(GROUND_HEARTBEAT, 255, 190)))
        for system in (1, 2):
            world.receive((WIFI, world.frame(HEARTBEAT, system, key=system)))
        seen = world.sent_to(STATION)
        assert [m.get_srcSystem() for m, _ in seen] == [1, 2]
        assert not any(is_signed(frame) for _, frame in seen)

    def test_frames_to_a_vehicle_are_signed_with_its_key(self, keys: Path) -> None:
        world = RouterWorld(keys)
        world.receive((WIFI, world.frame(HEARTBEAT, key=1)))
        world.receive((STATION, world.frame(LAND, 255, 190)))
        ((message, frame),) = world.sent_to(WIFI)
        assert source_of(message) == (255, 190)
        check = LinkSigning(KEYS[1], world.utc)
        assert check.check(bytearray(frame), source_of(message)) is None

    def test_are_refused_while_a_mission_runs(self) -> None:
        world = RouterWorld(controls={1: BrokerControl.MISSION})
        world.receive((WIFI, world.frame(HEARTBEAT)))
        world.receive((STATION, world.frame(LAND, 255, 190)))
        assert world.sent_to(WIFI) == []
        answer, _ = world.sent_to(STATION)[0]
        assert (answer.get_type(), answer.get_srcSystem()) == ("COMMAND_ACK", 1)

    def test_see_messages_that_the_broker_does_not_know(self) -> None:
        world = RouterWorld()
        world.receive((STATION, world.frame(GROUND_HEARTBEAT, 255, 190)))
        world.receive((WIFI, world.frame(HEARTBEAT)))
        world.sent_to(STATION)
        body = bytes((1, 0, 0, 1, 1, 1)) + (70_000).to_bytes(3, "little") + b"x"
        unknown = b"\xfd" + body + mavlink.x25crc(body + b"\x07").crc.to_bytes(2, "little")
        assert world.receive((WIFI, unknown)) == []
        assert [frame for _, frame in world.sent_to(STATION)] == [unknown]

    def test_that_have_timed_out_get_nothing(self) -> None:
        world = RouterWorld()
        world.receive((STATION, world.frame(GROUND_HEARTBEAT, 255, 190)))
        assert world.router.requested_messages(1, world.now) is not None
        world.receive((WIFI, world.frame(HEARTBEAT)), after_s=11.0)
        assert world.sent_to(STATION) == []
        assert world.router.requested_messages(1, world.now) is None

    def test_that_are_contacted_first_get_frames_at_once(self) -> None:
        world = RouterWorld(forward="udpout://127.0.0.1:50000")
        world.air.waiting = [STATION]
        world.receive((WIFI, world.frame(HEARTBEAT)))
        assert len(world.sent_to(STATION)) == 1
        world.receive((STATION, world.frame(LAND, 255, 190)))
        assert len(world.sent_to(WIFI)) == 1


class TestGroundStationsElsewhere:
    FORWARD = "udpin://0.0.0.0:14551"

    def test_must_sign_with_the_ground_stations_key(self, keys: Path) -> None:
        world = RouterWorld(keys, forward=self.FORWARD)
        world.receive((WIFI, world.frame(HEARTBEAT, key=1)))
        world.receive((STATION, world.frame(LAND, 255, 190)))
        world.receive((STATION, world.frame(LAND, 255, 190, key=1)))
        assert world.sent_to(WIFI) == []
        world.receive((STATION, world.frame(LAND, 250, 190, key=255)))
        assert len(world.sent_to(WIFI)) == 1

    def test_get_what_is_signed_with_that_key(self, keys: Path) -> None:
        world = RouterWorld(keys, forward=self.FORWARD)
        world.receive((STATION, world.frame(GROUND_HEARTBEAT, 255, 190, key=255)))
        world.receive((WIFI, world.frame(HEARTBEAT, key=1)))
        ((message, frame),) = world.sent_to(STATION)
        check = LinkSigning(KEYS[255], world.utc)
        assert check.check(bytearray(frame), source_of(message)) is None

    def test_get_nothing_where_there_is_no_such_key(
        self, keys: Path, caplog: pytest.LogCaptureFixture
    ) -> None:
        (keys / "signing-255.key").unlink()
        world = RouterWorld(keys, forward="udpout://192.0.2.9:14550")
        world.air.waiting = [STATION]
        world.receive((STATION, world.frame(GROUND_HEARTBEAT, 255, 190)))
        world.receive((WIFI, world.frame(HEARTBEAT, key=1)))
        assert world.sent_to(STATION) == []
        assert caplog.text.count("signing-255.key") == 1

    def test_need_no_key_on_a_trusted_line(self, keys: Path) -> None:
        world = RouterWorld(keys, forward="serial:///dev/ttyGROUND?trusted")
        world.air.waiting = [STATION]
        world.receive((WIFI, world.frame(HEARTBEAT, key=1)))
        assert [is_signed(frame) for _, frame in world.sent_to(STATION)] == [False]
        world.receive((STATION, world.frame(LAND, 255, 190)))
        assert len(world.sent_to(WIFI)) == 1

    def test_need_no_key_without_signing(self) -> None:
        world = RouterWorld(forward=self.FORWARD)
        world.receive((STATION, world.frame(GROUND_HEARTBEAT, 255, 190)))
        world.receive((WIFI, world.frame(HEARTBEAT)))
        assert len(world.sent_to(STATION)) == 1


def test_hostile_bytes_from_a_ground_station_lead_to_nothing() -> None:
    world = RouterWorld()
    world.receive((WIFI, world.frame(HEARTBEAT)))
    whole = world.frame(LAND, 255, 190)
    for cut in range(1, len(whole)):
        world.receive((STATION, whole[:cut]), (STATION, whole[cut:]), (STATION, b"\xfd" * 500))
    assert world.air.sent == []


def test_the_frame_log_contains_accepted_and_sent_frames(keys: Path, tmp_path: Path) -> None:
    traffic = LinkSettings(links=(LinkUrl.parse("udpin://:14540"),), tlog_dir=tmp_path / "tlog")
    world = RouterWorld(keys)
    config = Config(signing_keys=keys, traffic=traffic)
    world.router = Router(config, world.air, world, world.control_of)
    accepted, refused = world.frame(HEARTBEAT, key=1), world.frame(ATTITUDE)
    world.receive((WIFI, accepted), (WIFI, refused))
    world.router.send(1, [LAND])
    world.router.close()
    ((_, sent),) = world.sent_to(WIFI)
    (path,) = (tmp_path / "tlog").iterdir()
    stamp = path.read_bytes()[:8]
    assert path.read_bytes() == stamp + accepted + stamp + sent
    assert KEYS[1] not in path.read_bytes()


@pytest.mark.parametrize("name", ["empty", "missing"])
def test_a_folder_without_keys_is_named_at_the_start(
    name: str, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "empty").mkdir()
    RouterWorld(tmp_path / name)
    assert f"{tmp_path / name} has no signing-<system id>.key" in caplog.text


def test_a_folder_with_keys_is_not_warned_of(keys: Path, caplog: pytest.LogCaptureFixture) -> None:
    RouterWorld(keys)
    assert caplog.text == ""
