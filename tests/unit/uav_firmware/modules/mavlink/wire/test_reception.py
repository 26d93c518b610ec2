"""Admission by signature, refused frames, and keys set over a link."""

import errno
from typing import Any

import pytest

from tests.support.memory_storage import MemoryStorage
from tests.unit.uav_firmware.modules.mavlink.harness import (
    SYSTEM,
    MavlinkHarness,
    command_long,
    status,
)
from uav_firmware.cal.link import Address
from uav_firmware.cal.storage import Write
from uav_firmware.modules.mavlink.wire.dialect import is_signed, mavlink
from uav_firmware.modules.mavlink.wire.link_security import SigningParams
from uav_firmware.modules.mavlink.wire.peers import Peer, Profile
from uav_firmware.modules.mavlink.wire.reception import REPORT_INTERVAL_US, SigningOptions
from uav_firmware.modules.mavlink.wire.signature import EPOCH_US, Signer, SigningClock
from uav_firmware.modules.mavlink.wire.signing_setup import SetupTrust
from uav_firmware.modules.mavlink.wire.signing_store import FILE_NAME, SigningStoreError
from uav_firmware.msg.link import RefusedFrames
from uav_firmware.parameters import Registry

KEY, GROUND_KEY, WRONG_KEY = bytes(range(32)), bytes(range(1, 33)), bytes(range(2, 34))
WORLD_US = 1_790_000_000_000_000
BROKER: Address = ("127.0.0.1", 14540)
GROUND: Address = ("127.0.0.1", 14550)
PROGRAM: Address = ("127.0.0.1", 50_000)
REMOTE: Address = ("192.0.2.9", 50_000)
ARM = command_long(400, 1.0)
HEARTBEAT = mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3)
SECOND_US = 1_000_000
NEVER, BEYOND_LOOPBACK, ALWAYS = 0, 1, 2


class CountingStorage(MemoryStorage):
    """Storage that counts writes."""

    def __init__(self) -> None:
        super().__init__()
        self.saves = 0

    def save(self, name: str, contents: bytes) -> Write:
        self.saves += 1
        return super().save(name, contents)


def signer(key: bytes = KEY, *, behind_us: int = 0) -> Signer:
    """Another system with a key."""
    return Signer(key, SigningClock(lambda: WORLD_US - behind_us))


def secured(
    mode: int = BEYOND_LOOPBACK,
    *,
    broker: bytes | None = KEY,
    ground: bytes | None = None,
    storage: MemoryStorage | None = None,
    setup: SetupTrust = SetupTrust.NEVER,
    world_us: int = WORLD_US,
) -> MavlinkHarness:
    """A vehicle with a signed link to the broker."""
    registry = Registry()
    registry.add(SigningParams)
    registry.set("MAV_SIGN_CFG", mode)
    return MavlinkHarness(
        registry=registry,
        peers=(
            Peer(address=BROKER, profile=Profile.ONBOARD, signing_key=broker),
            Peer(address=GROUND, profile=Profile.GROUND_STATION, signing_key=ground),
        ),
        signing=SigningOptions(world_us=lambda: world_us, storage=storage, setup=setup),
    )


def is_heard(harness: MavlinkHarness, **sender: Any) -> bool:
    """Whether the vehicle admits a sender after its HEARTBEAT."""
    heartbeats = harness.topics.ground_station_heartbeat.count
    harness.send(HEARTBEAT, **sender)
    harness.run()
    return harness.topics.ground_station_heartbeat.count > heartbeats


def refused(harness: MavlinkHarness) -> RefusedFrames:
    """The published counts."""
    harness.run(SECOND_US)
    counts = harness.topics.refused_frames.value
    assert counts is not None
    return counts


def is_sent_signed(harness: MavlinkHarness, to: Address) -> bool:
    """Whether all frames to a peer are signed, or none."""
    harness.received(at=to)
    harness.run(SECOND_US)
    received = {is_signed(message) for message in harness.received(at=to)}
    assert len(received) == 1
    return received.pop()


# Rows of the table in docs/reference/mavlink-links.md: sender, key, in modes 0, 1 and 2
@pytest.mark.parametrize(
    ("source", "key", "expected"),
    [
        (BROKER, None, (True, False, False)),
        (BROKER, KEY, (True, True, True)),
        (BROKER, WRONG_KEY, (True, False, False)),
        (GROUND, None, (True, True, False)),
        (GROUND, KEY, (True, True, True)),
        (GROUND, WRONG_KEY, (True, False, False)),
        (PROGRAM, None, (True, True, False)),
        (PROGRAM, KEY, (True, True, True)),
        (REMOTE, None, (True, False, False)),
        (REMOTE, KEY, (True, True, True)),
        (REMOTE, WRONG_KEY, (True, False, False)),
    ],
)
def test_admission_by_link_and_key(
    source: Address, key: bytes | None, expected: tuple[bool, bool, bool]
) -> None:
    for mode in (NEVER, BEYOND_LOOPBACK, ALWAYS):
        sender = None if key is None else signer(key)
        assert is_heard(secured(mode), source=source, signer=sender) is expected[mode], mode


@pytest.mark.parametrize("source", [BROKER, GROUND, PROGRAM, REMOTE])
def test_with_a_key_for_each_link_unsigned_frames_are_refused(source: Address) -> None:
    """By default a program of the same machine is an unknown sender too."""
    harness = secured(ground=GROUND_KEY)
    assert not is_heard(harness, source=source)
    harness.send(ARM, source=source)
    harness.run()
    assert harness.commands() == []
    assert harness.received(at=PROGRAM) == []
    key = GROUND_KEY if source == GROUND else KEY
    assert is_heard(harness, source=source, signer=signer(key))


@pytest.mark.parametrize("source", [BROKER, GROUND, PROGRAM, REMOTE])
@pytest.mark.parametrize("mode", [NEVER, BEYOND_LOOPBACK, ALWAYS])
def test_without_a_key_all_senders_are_admitted(source: Address, mode: int) -> None:
    assert is_heard(secured(mode, broker=None), source=source)
    assert is_heard(secured(mode, broker=None), source=source, signer=signer(WRONG_KEY))


def test_refused_senders_command_nothing() -> None:
    harness = secured()
    harness.send(ARM, source=BROKER)
    harness.send(ARM, source=BROKER, signer=signer(WRONG_KEY))
    harness.run()
    assert harness.commands() == []
    harness.send(ARM, source=BROKER, signer=signer())
    harness.run()
    assert len(harness.commands()) == 1


def test_a_link_with_its_own_key_accepts_no_other() -> None:
    harness = secured(ground=GROUND_KEY)
    assert not is_heard(harness, source=GROUND, signer=signer(KEY))
    assert not is_heard(harness, source=BROKER, signer=signer(GROUND_KEY))
    assert is_heard(harness, source=GROUND, signer=signer(GROUND_KEY))


def test_a_frame_of_one_link_is_a_replay_on_another() -> None:
    harness = secured()
    sender = signer()
    harness.send(HEARTBEAT, source=REMOTE, signer=sender)
    harness.send(ARM, source=BROKER, signer=sender)
    (recorded, _) = harness.memory.incoming[-1]
    harness.run()
    assert len(harness.commands()) == 1
    harness.memory.incoming += [(recorded, BROKER), (recorded, REMOTE), (recorded, GROUND)]
    harness.run()
    assert harness.commands() == []
    assert refused(harness).replayed == 3


def test_reasons_are_counted_separately() -> None:
    harness = secured()
    old = mavlink.MAVLink(None, 255, 190)
    harness.send(ARM, source=BROKER)
    harness.send(ARM, source=BROKER, signer=signer(WRONG_KEY))
    harness.send(ARM, source=BROKER, signer=signer(behind_us=61 * SECOND_US))
    harness.send(ARM, source=BROKER, signer=signer(behind_us=-25 * 3600 * SECOND_US))
    harness.memory.incoming.append((ARM.pack(old, force_mavlink1=True), BROKER))
    harness.memory.incoming.append((b"\xfd" + bytes(30), BROKER))
    counts = refused(harness)
    assert counts[1:] == RefusedFrames(0, 1, 1, 1, 1, 1, 1)[1:]
    assert harness.commands() == []


def test_counts_are_published_on_change_only() -> None:
    harness = secured()
    harness.send(ARM, source=BROKER)
    refused(harness)
    published = harness.topics.refused_frames.count
    harness.run(5 * SECOND_US)
    assert harness.topics.refused_frames.count == published == 1


@pytest.mark.thorough
def test_refused_frames_are_reported_at_most_every_30_seconds() -> None:
    harness = secured()
    reported = []
    for _ in range(70):
        harness.send(ARM, source=BROKER)
        harness.run(SECOND_US)
        reported += [m.text for m in harness.received("STATUSTEXT", at=GROUND)]
    assert reported[0] == "MAVLink frames refused: 1 unsigned"
    assert len(reported) == 70 * SECOND_US // REPORT_INTERVAL_US + 1


def test_a_station_whose_clock_is_ahead_shuts_out_others_and_the_text_names_the_clock() -> None:
    harness = secured()
    hour_us = 3600 * SECOND_US
    harness.send(ARM, source=BROKER, signer=signer(behind_us=-hour_us), system=211)
    harness.send(ARM, source=BROKER, signer=signer(), system=212)
    assert texts(harness) == ""
    harness.run(2 * SECOND_US)
    assert refused(harness).replayed == 1
    text = "".join(m.text for m in harness.received("STATUSTEXT", at=GROUND))
    assert text == (
        "MAVLink frames refused: 1 replayed "
        "(signed with an older time than was accepted last: perhaps a clock is wrong)"
    )


def test_a_station_with_a_wrong_year_is_refused_and_the_text_names_its_date() -> None:
    storage = MemoryStorage()
    harness = secured(storage=storage)
    ten_years_us = 3650 * 24 * 3600 * SECOND_US
    harness.send(ARM, source=BROKER, signer=signer(behind_us=-ten_years_us), system=211)
    harness.run(2 * SECOND_US)
    assert refused(harness).ahead == 1
    text = "".join(m.text for m in harness.received("STATUSTEXT", at=GROUND))
    assert text == (
        "MAVLink frames refused: 1 ahead of the vehicle's clock "
        "(check the date of the station, else the vehicle's)"
    )
    assert is_heard(harness, source=BROKER, signer=signer(), system=212)
    assert is_heard(secured(storage=storage), source=BROKER, signer=signer(), system=213)


def test_malformed_bytes_are_counted_and_not_reported() -> None:
    harness = secured()
    harness.memory.incoming += [(b"\xfd" + bytes(30), BROKER)] * 20
    assert refused(harness).malformed == 20
    assert harness.received("STATUSTEXT", at=GROUND) == []


def test_an_unsigned_remote_heartbeat_opens_no_channel() -> None:
    harness = secured()
    harness.send(HEARTBEAT, source=REMOTE)
    harness.run(SECOND_US)
    assert harness.received(at=REMOTE) == []
    assert harness.topics.ground_station_heartbeat.count == 0
    harness.send(HEARTBEAT, source=REMOTE, signer=signer())
    assert is_sent_signed(harness, REMOTE)


def test_radio_status_is_admitted_unsigned_but_not_with_a_bad_signature() -> None:
    harness = secured()
    radio = mavlink.MAVLink_radio_status_message(1, 1, 1, 1, 1, 1, 1)
    harness.send(radio, source=BROKER, system=51, component=68)
    harness.run(SECOND_US)
    assert harness.topics.refused_frames.count == 0
    assert is_sent_signed(harness, BROKER)
    harness.send(radio, source=BROKER, system=51, component=68, signer=signer(WRONG_KEY))
    assert refused(harness).bad_signature == 1


def test_a_link_with_a_key_gets_signed_frames_from_the_start() -> None:
    harness = secured()
    assert is_sent_signed(harness, BROKER)
    assert not is_sent_signed(harness, GROUND)


def test_the_stated_client_behaviour_is_answered() -> None:
    harness = secured()
    harness.send(HEARTBEAT, source=PROGRAM)
    assert not is_sent_signed(harness, PROGRAM)
    harness.send(HEARTBEAT, source=PROGRAM, signer=signer())
    assert is_sent_signed(harness, PROGRAM)
    harness.send(HEARTBEAT, source=PROGRAM)
    assert not is_sent_signed(harness, PROGRAM)


def test_parameter_changes_apply_in_flight() -> None:
    harness = secured(NEVER)
    assert not is_sent_signed(harness, BROKER)
    harness.registry.set("MAV_SIGN_CFG", ALWAYS)
    harness.run()
    assert is_sent_signed(harness, BROKER)
    assert is_sent_signed(harness, GROUND)
    assert not is_heard(harness, source=GROUND)
    harness.registry.set("MAV_SIGN_CFG", NEVER)
    harness.run()
    assert not is_sent_signed(harness, GROUND)
    assert is_heard(harness, source=GROUND)


def times_sent(harness: MavlinkHarness) -> list[int]:
    """Times of the signatures of all frames to the broker [10 us since 2015]."""
    harness.run(SECOND_US)
    return [int.from_bytes(m.get_msgbuf()[-12:-6], "little") for m in harness.received(at=BROKER)]


def test_sent_times_increase_across_a_restart() -> None:
    storage = MemoryStorage()
    first = times_sent(secured(storage=storage))
    assert first == sorted(set(first))
    assert first[0] == (WORLD_US - EPOCH_US) // 10
    second = times_sent(secured(storage=storage, world_us=WORLD_US - 3600 * SECOND_US))
    assert second[0] > first[-1]


def test_after_a_restart_a_sender_with_a_correct_clock_is_accepted() -> None:
    storage = MemoryStorage()
    secured(storage=storage).run(SECOND_US)
    harness = secured(storage=storage)
    assert is_heard(harness, source=BROKER, signer=signer())


def test_after_a_restart_without_a_clock_replays_are_refused() -> None:
    storage = MemoryStorage()
    secured(storage=storage).run(SECOND_US)
    harness = secured(storage=storage, world_us=EPOCH_US)
    assert not is_heard(harness, source=BROKER, signer=signer(behind_us=3600 * SECOND_US))
    assert is_heard(harness, source=BROKER, signer=signer())


@pytest.mark.thorough
def test_the_time_is_stored_once_a_minute_and_not_without_a_key() -> None:
    storage = CountingStorage()
    now = [WORLD_US]
    harness = MavlinkHarness(
        peers=(Peer(address=BROKER, profile=Profile.ONBOARD, signing_key=KEY),),
        signing=SigningOptions(world_us=lambda: now[0], storage=storage),
    )
    for _ in range(600):
        now[0] += SECOND_US
        harness.run(SECOND_US)
        harness.received(at=BROKER)
    assert storage.saves == pytest.approx(10, abs=1)
    without = CountingStorage()
    secured(broker=None, storage=without).run(SECOND_US)
    assert without.saves == 0


def test_full_storage_is_reported_once_and_does_not_stop_the_vehicle() -> None:
    storage = MemoryStorage()
    storage.refusal = errno.ENOSPC
    harness = secured(storage=storage)
    harness.run(10 * SECOND_US)
    texts = [m.text for m in harness.received("STATUSTEXT", at=GROUND)]
    assert "".join(texts) == "Signing time not stored: No space left on device"


@pytest.mark.parametrize(
    "contents",
    [
        b"",
        b"[]",
        b"{}",
        b'{"sent_before": -1, "key": null}',
        b'{"sent_before": 1e3, "key": null}',
        b'{"sent_before": 999999999999999999, "key": null}',
        b'{"sent_before": 1, "key": "00"}',
        b'{"sent_before": 1, "key": 5}',
        b'{"sent_before": 1, "key": "' + b"0" * 64 + b'"}',
        b"\xff",
    ],
)
def test_an_invalid_stored_state_prevents_the_start(
    contents: bytes,
) -> None:
    storage = MemoryStorage()
    storage.files[FILE_NAME] = contents
    with pytest.raises(SigningStoreError, match=FILE_NAME):
        secured(storage=storage)


def setup_message(key: bytes = GROUND_KEY, *, time: int = 0, target: int = SYSTEM) -> Any:
    return mavlink.MAVLink_setup_signing_message(target, 1, list(key), time)


def texts(harness: MavlinkHarness) -> str:
    harness.run()
    return "".join(m.text for m in harness.received("STATUSTEXT", at=GROUND))


class TestSetupSigning:
    def disarmed(self, trust: SetupTrust, storage: MemoryStorage | None = None) -> MavlinkHarness:
        harness = secured(setup=trust, storage=storage)
        harness.topics.vehicle_status.publish(status(armed=False))
        return harness

    @pytest.mark.parametrize(
        ("trust", "source", "key", "expected"),
        [
            (SetupTrust.NEVER, GROUND, None, False),
            (SetupTrust.NEVER, BROKER, KEY, False),
            (SetupTrust.SIGNED, GROUND, None, False),
            (SetupTrust.SIGNED, GROUND, KEY, True),
            (SetupTrust.SIGNED, BROKER, KEY, True),
            (SetupTrust.LOOPBACK, GROUND, None, True),
            (SetupTrust.LOOPBACK, BROKER, KEY, True),
        ],
    )
    def test_only_a_trusted_link_may_set_the_key(
        self, trust: SetupTrust, source: Address, key: bytes | None, expected: bool
    ) -> None:
        harness = self.disarmed(trust)
        harness.send(setup_message(), source=source, signer=None if key is None else signer(key))
        assert ("Signing key set" in texts(harness)) is expected
        assert is_heard(harness, source=REMOTE, signer=signer(GROUND_KEY)) is expected

    def test_setup_signing_is_not_forwarded(self) -> None:
        harness = self.disarmed(SetupTrust.LOOPBACK)
        harness.send(setup_message(), source=GROUND)
        harness.run(SECOND_US)
        for peer in (GROUND, BROKER):
            assert harness.received("SETUP_SIGNING", at=peer) == []

    def test_setup_while_armed_is_refused(self) -> None:
        harness = self.disarmed(SetupTrust.LOOPBACK)
        harness.topics.vehicle_status.publish(status(armed=True))
        harness.send(setup_message(), source=GROUND)
        assert "the vehicle is armed" in texts(harness)
        assert not is_heard(harness, source=REMOTE, signer=signer(GROUND_KEY))

    def test_setup_for_another_vehicle_is_ignored(self) -> None:
        harness = self.disarmed(SetupTrust.LOOPBACK)
        harness.send(setup_message(target=SYSTEM + 1), source=GROUND)
        assert texts(harness) == ""
        assert not is_heard(harness, source=REMOTE, signer=signer(GROUND_KEY))

    def test_setup_with_a_far_future_time_is_refused(self) -> None:
        harness = self.disarmed(SetupTrust.LOOPBACK)
        harness.send(setup_message(time=(1 << 64) - 1), source=GROUND)
        assert "its time is ahead of the vehicle's clock" in texts(harness)

    def test_a_key_that_cannot_be_stored_is_refused(self) -> None:
        storage = MemoryStorage()
        harness = self.disarmed(SetupTrust.LOOPBACK, storage)
        storage.refusal = errno.ENOSPC
        harness.send(setup_message(), source=GROUND)
        assert "cannot be stored" in texts(harness)
        assert not is_heard(harness, source=REMOTE, signer=signer(GROUND_KEY))

    def test_a_set_key_survives_a_restart_and_configured_keys_stay(self) -> None:
        storage = MemoryStorage()
        harness = self.disarmed(SetupTrust.LOOPBACK, storage)
        harness.send(setup_message(), source=GROUND)
        harness.run()
        again = secured(storage=storage)
        assert is_heard(again, source=REMOTE, signer=signer(GROUND_KEY))
        assert not is_heard(again, source=BROKER, signer=signer(GROUND_KEY))
        assert is_heard(again, source=BROKER, signer=signer())

    def test_a_key_of_zeros_removes_the_key(self) -> None:
        storage = MemoryStorage()
        harness = self.disarmed(SetupTrust.LOOPBACK, storage)
        harness.send(setup_message(), source=GROUND)
        harness.send(setup_message(bytes(32)), source=GROUND)
        assert "Signing key removed" in texts(harness)
        assert not is_heard(harness, source=REMOTE, signer=signer(GROUND_KEY))
        assert not is_heard(secured(storage=storage), source=REMOTE, signer=signer(GROUND_KEY))

    def test_the_first_key_requires_signatures(self) -> None:
        harness = secured(ALWAYS, broker=None, setup=SetupTrust.LOOPBACK)
        harness.topics.vehicle_status.publish(status(armed=False))
        assert is_heard(harness, source=REMOTE)
        harness.send(setup_message(), source=GROUND)
        harness.run()
        assert not is_heard(harness, source=REMOTE)
        assert is_heard(harness, source=REMOTE, signer=signer(GROUND_KEY))
