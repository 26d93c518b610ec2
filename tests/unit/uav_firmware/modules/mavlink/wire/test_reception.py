"""Which link must be signed, what becomes of the rest, and keys that come over a link."""

import errno
from typing import Any

import pytest

from tests.support.memory_storage import MemoryStorage
from tests.unit.uav_firmware.modules.mavlink.harness import SYSTEM, Bench, command_long, status
from uav_firmware.cal.link import Address
from uav_firmware.cal.storage import Write
from uav_firmware.modules.mavlink.signing.signature import EPOCH_US, Signer, SigningClock
from uav_firmware.modules.mavlink.signing.signing_params import SigningParams
from uav_firmware.modules.mavlink.signing.signing_setup import SetupTrust
from uav_firmware.modules.mavlink.signing.signing_store import FILE_NAME, SigningStoreError
from uav_firmware.modules.mavlink.wire.dialect import is_signed, mavlink
from uav_firmware.modules.mavlink.wire.peers import Peer, Profile
from uav_firmware.modules.mavlink.wire.reception import SigningOptions
from uav_firmware.modules.mavlink.wire.refused_frames import TELL_EVERY_US
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
    """Storage that knows how often it was written."""

    def __init__(self) -> None:
        super().__init__()
        self.saves = 0

    def save(self, name: str, contents: bytes) -> Write:
        self.saves += 1
        return super().save(name, contents)


def signer(key: bytes = KEY, *, behind_us: int = 0) -> Signer:
    """Another system that holds a key."""
    return Signer(key, SigningClock(lambda: WORLD_US - behind_us))


def secured(
    mode: int = BEYOND_LOOPBACK,
    *,
    broker: bytes | None = KEY,
    ground: bytes | None = None,
    storage: MemoryStorage | None = None,
    setup: SetupTrust = SetupTrust.NEVER,
    world_us: int = WORLD_US,
) -> Bench:
    """A vehicle on the bench whose broker's link is signed."""
    registry = Registry()
    registry.add(SigningParams)
    registry.set("MAV_SIGN_CFG", mode)
    return Bench(
        registry=registry,
        peers=(
            Peer(address=BROKER, profile=Profile.ONBOARD, signing_key=broker),
            Peer(address=GROUND, profile=Profile.GROUND_STATION, signing_key=ground),
        ),
        signing=SigningOptions(world_us=lambda: world_us, storage=storage, setup=setup),
    )


def is_heard(bench: Bench, **sender: Any) -> bool:
    """Whether the vehicle listens to a sender, who introduces itself and says who it is."""
    heartbeats = bench.topics.ground_station_heartbeat.count
    bench.say(HEARTBEAT, **sender)
    bench.run()
    return bench.topics.ground_station_heartbeat.count > heartbeats


def refused(bench: Bench) -> RefusedFrames:
    """The counts that are published."""
    bench.run(SECOND_US)
    counts = bench.topics.refused_frames.value
    assert counts is not None
    return counts


def is_sent_signed(bench: Bench, to: Address) -> bool:
    """Whether what goes to a peer is signed, all of it or nothing."""
    bench.hear(at=to)
    bench.run(SECOND_US)
    heard = {is_signed(message) for message in bench.hear(at=to)}
    assert len(heard) == 1
    return heard.pop()


# Rows of the README's table: who, with which key, in modes 0, 1 and 2
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
def test_who_is_heard(
    source: Address, key: bytes | None, expected: tuple[bool, bool, bool]
) -> None:
    for mode in (NEVER, BEYOND_LOOPBACK, ALWAYS):
        sender = None if key is None else signer(key)
        assert is_heard(secured(mode), source=source, signer=sender) is expected[mode], mode


@pytest.mark.parametrize("source", [BROKER, GROUND, PROGRAM, REMOTE])
def test_a_vehicle_with_a_key_for_each_link_listens_to_nobody_without_one(source: Address) -> None:
    """By default: a program of the same machine is a stranger like any other."""
    bench = secured(ground=GROUND_KEY)
    assert not is_heard(bench, source=source)
    bench.say(ARM, source=source)
    bench.run()
    assert bench.commands() == []
    assert bench.hear(at=PROGRAM) == []
    key = GROUND_KEY if source == GROUND else KEY
    assert is_heard(bench, source=source, signer=signer(key))


@pytest.mark.parametrize("source", [BROKER, GROUND, PROGRAM, REMOTE])
@pytest.mark.parametrize("mode", [NEVER, BEYOND_LOOPBACK, ALWAYS])
def test_without_a_key_everybody_is(source: Address, mode: int) -> None:
    assert is_heard(secured(mode, broker=None), source=source)
    assert is_heard(secured(mode, broker=None), source=source, signer=signer(WRONG_KEY))


def test_who_is_not_heard_does_not_command() -> None:
    bench = secured()
    bench.say(ARM, source=BROKER)
    bench.say(ARM, source=BROKER, signer=signer(WRONG_KEY))
    bench.run()
    assert bench.commands() == []
    bench.say(ARM, source=BROKER, signer=signer())
    bench.run()
    assert len(bench.commands()) == 1


def test_a_link_with_its_own_key_takes_no_other() -> None:
    bench = secured(ground=GROUND_KEY)
    assert not is_heard(bench, source=GROUND, signer=signer(KEY))
    assert not is_heard(bench, source=BROKER, signer=signer(GROUND_KEY))
    assert is_heard(bench, source=GROUND, signer=signer(GROUND_KEY))


def test_a_frame_heard_on_one_link_is_a_replay_on_another() -> None:
    bench = secured()
    sender = signer()
    bench.say(HEARTBEAT, source=REMOTE, signer=sender)
    bench.say(ARM, source=BROKER, signer=sender)
    (recorded, _) = bench.memory.incoming[-1]
    bench.run()
    assert len(bench.commands()) == 1
    bench.memory.incoming += [(recorded, BROKER), (recorded, REMOTE), (recorded, GROUND)]
    bench.run()
    assert bench.commands() == []
    assert refused(bench).replayed == 3


def test_each_reason_is_counted_by_itself() -> None:
    bench = secured()
    old = mavlink.MAVLink(None, 255, 190)
    bench.say(ARM, source=BROKER)
    bench.say(ARM, source=BROKER, signer=signer(WRONG_KEY))
    bench.say(ARM, source=BROKER, signer=signer(behind_us=61 * SECOND_US))
    bench.memory.incoming.append((ARM.pack(old, force_mavlink1=True), BROKER))
    bench.memory.incoming.append((b"\xfd" + bytes(30), BROKER))
    counts = refused(bench)
    assert counts[1:] == RefusedFrames(0, 1, 1, 1, 1, 1)[1:]
    assert bench.commands() == []


def test_counts_are_published_on_change_only() -> None:
    bench = secured()
    bench.say(ARM, source=BROKER)
    refused(bench)
    published = bench.topics.refused_frames.count
    bench.run(5 * SECOND_US)
    assert bench.topics.refused_frames.count == published == 1


def test_the_user_is_told_at_once_and_then_seldom() -> None:
    bench = secured()
    told = []
    for _ in range(70):
        bench.say(ARM, source=BROKER)
        bench.run(SECOND_US)
        told += [m.text for m in bench.hear("STATUSTEXT", at=GROUND)]
    assert told[0] == "MAVLink frames refused: 1 unsigned"
    assert len(told) == 70 * SECOND_US // TELL_EVERY_US + 1


def test_noise_on_the_line_is_no_event() -> None:
    bench = secured()
    bench.memory.incoming += [(b"\xfd" + bytes(30), BROKER)] * 20
    assert refused(bench).malformed == 20
    assert bench.hear("STATUSTEXT", at=GROUND) == []


def test_an_unsigned_heartbeat_from_afar_makes_nobody_known() -> None:
    bench = secured()
    bench.say(HEARTBEAT, source=REMOTE)
    bench.run(SECOND_US)
    assert bench.hear(at=REMOTE) == []
    assert bench.topics.ground_station_heartbeat.count == 0
    bench.say(HEARTBEAT, source=REMOTE, signer=signer())
    assert is_sent_signed(bench, REMOTE)


def test_radio_status_is_heard_unsigned_but_not_badly_signed() -> None:
    bench = secured()
    radio = mavlink.MAVLink_radio_status_message(1, 1, 1, 1, 1, 1, 1)
    bench.say(radio, source=BROKER, system=51, component=68)
    bench.run(SECOND_US)
    assert bench.topics.refused_frames.count == 0
    assert is_sent_signed(bench, BROKER)
    bench.say(radio, source=BROKER, system=51, component=68, signer=signer(WRONG_KEY))
    assert refused(bench).bad_signature == 1


def test_the_link_with_a_key_is_sent_signatures_from_the_first_frame() -> None:
    bench = secured()
    assert is_sent_signed(bench, BROKER)
    assert not is_sent_signed(bench, GROUND)


def test_a_client_is_answered_as_it_speaks() -> None:
    bench = secured()
    bench.say(HEARTBEAT, source=PROGRAM)
    assert not is_sent_signed(bench, PROGRAM)
    bench.say(HEARTBEAT, source=PROGRAM, signer=signer())
    assert is_sent_signed(bench, PROGRAM)
    bench.say(HEARTBEAT, source=PROGRAM)
    assert not is_sent_signed(bench, PROGRAM)


def test_the_parameter_is_followed_in_flight() -> None:
    bench = secured(NEVER)
    assert not is_sent_signed(bench, BROKER)
    bench.registry.set("MAV_SIGN_CFG", ALWAYS)
    bench.run()
    assert is_sent_signed(bench, BROKER)
    assert is_sent_signed(bench, GROUND)
    assert not is_heard(bench, source=GROUND)
    bench.registry.set("MAV_SIGN_CFG", NEVER)
    bench.run()
    assert not is_sent_signed(bench, GROUND)
    assert is_heard(bench, source=GROUND)


def times_sent(bench: Bench) -> list[int]:
    """Times of the signatures of all frames to the broker [10 us since 2015]."""
    bench.run(SECOND_US)
    return [int.from_bytes(m.get_msgbuf()[-12:-6], "little") for m in bench.hear(at=BROKER)]


def test_times_rise_from_frame_to_frame_and_over_a_restart() -> None:
    storage = MemoryStorage()
    first = times_sent(secured(storage=storage))
    assert first == sorted(set(first))
    assert first[0] == (WORLD_US - EPOCH_US) // 10
    second = times_sent(secured(storage=storage, world_us=WORLD_US - 3600 * SECOND_US))
    assert second[0] > first[-1]


def test_after_a_restart_a_ground_station_with_a_right_clock_is_heard() -> None:
    storage = MemoryStorage()
    secured(storage=storage).run(SECOND_US)
    bench = secured(storage=storage)
    assert is_heard(bench, source=BROKER, signer=signer())


def test_after_a_restart_with_a_lost_clock_old_recordings_are_still_refused() -> None:
    storage = MemoryStorage()
    secured(storage=storage).run(SECOND_US)
    bench = secured(storage=storage, world_us=EPOCH_US)
    assert not is_heard(bench, source=BROKER, signer=signer(behind_us=3600 * SECOND_US))
    assert is_heard(bench, source=BROKER, signer=signer())


def test_the_time_is_stored_once_a_minute_and_not_without_a_key() -> None:
    storage = CountingStorage()
    now = [WORLD_US]
    bench = Bench(
        peers=(Peer(address=BROKER, profile=Profile.ONBOARD, signing_key=KEY),),
        signing=SigningOptions(world_us=lambda: now[0], storage=storage),
    )
    for _ in range(600):
        now[0] += SECOND_US
        bench.run(SECOND_US)
        bench.hear(at=BROKER)
    assert storage.saves == pytest.approx(10, abs=1)
    without = CountingStorage()
    secured(broker=None, storage=without).run(SECOND_US)
    assert without.saves == 0


def test_a_full_medium_is_told_once_and_does_not_stop_the_vehicle() -> None:
    storage = MemoryStorage()
    storage.refusal = errno.ENOSPC
    bench = secured(storage=storage)
    bench.run(10 * SECOND_US)
    texts = [m.text for m in bench.hear("STATUSTEXT", at=GROUND)]
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
def test_what_is_stored_and_cannot_be_understood_keeps_the_vehicle_from_starting(
    contents: bytes,
) -> None:
    storage = MemoryStorage()
    storage.files[FILE_NAME] = contents
    with pytest.raises(SigningStoreError, match=FILE_NAME):
        secured(storage=storage)


def setup_message(key: bytes = GROUND_KEY, *, time: int = 0, target: int = SYSTEM) -> Any:
    return mavlink.MAVLink_setup_signing_message(target, 1, list(key), time)


def texts(bench: Bench) -> str:
    bench.run()
    return "".join(m.text for m in bench.hear("STATUSTEXT", at=GROUND))


class TestSetupSigning:
    def disarmed(self, trust: SetupTrust, storage: MemoryStorage | None = None) -> Bench:
        bench = secured(setup=trust, storage=storage)
        bench.topics.vehicle_status.publish(status(armed=False))
        return bench

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
    def test_only_a_trusted_link_sets_the_key(
        self, trust: SetupTrust, source: Address, key: bytes | None, expected: bool
    ) -> None:
        bench = self.disarmed(trust)
        bench.say(setup_message(), source=source, signer=None if key is None else signer(key))
        assert ("Signing key set" in texts(bench)) is expected
        assert is_heard(bench, source=REMOTE, signer=signer(GROUND_KEY)) is expected

    def test_the_message_goes_to_nobody(self) -> None:
        bench = self.disarmed(SetupTrust.LOOPBACK)
        bench.say(setup_message(), source=GROUND)
        bench.run(SECOND_US)
        for peer in (GROUND, BROKER):
            assert bench.hear("SETUP_SIGNING", at=peer) == []

    def test_not_while_armed(self) -> None:
        bench = self.disarmed(SetupTrust.LOOPBACK)
        bench.topics.vehicle_status.publish(status(armed=True))
        bench.say(setup_message(), source=GROUND)
        assert "the vehicle is armed" in texts(bench)
        assert not is_heard(bench, source=REMOTE, signer=signer(GROUND_KEY))

    def test_not_for_another_vehicle(self) -> None:
        bench = self.disarmed(SetupTrust.LOOPBACK)
        bench.say(setup_message(target=SYSTEM + 1), source=GROUND)
        assert texts(bench) == ""
        assert not is_heard(bench, source=REMOTE, signer=signer(GROUND_KEY))

    def test_not_with_a_time_that_would_push_the_clock_to_its_end(self) -> None:
        bench = self.disarmed(SetupTrust.LOOPBACK)
        bench.say(setup_message(time=(1 << 64) - 1), source=GROUND)
        assert "over a year ahead" in texts(bench)

    def test_a_key_that_cannot_be_stored_is_not_taken(self) -> None:
        storage = MemoryStorage()
        bench = self.disarmed(SetupTrust.LOOPBACK, storage)
        storage.refusal = errno.ENOSPC
        bench.say(setup_message(), source=GROUND)
        assert "cannot be stored" in texts(bench)
        assert not is_heard(bench, source=REMOTE, signer=signer(GROUND_KEY))

    def test_the_key_survives_a_restart_and_the_key_by_file_stays_what_it_is(self) -> None:
        storage = MemoryStorage()
        bench = self.disarmed(SetupTrust.LOOPBACK, storage)
        bench.say(setup_message(), source=GROUND)
        bench.run()
        again = secured(storage=storage)
        assert is_heard(again, source=REMOTE, signer=signer(GROUND_KEY))
        assert not is_heard(again, source=BROKER, signer=signer(GROUND_KEY))
        assert is_heard(again, source=BROKER, signer=signer())

    def test_zeros_take_the_key_away(self) -> None:
        storage = MemoryStorage()
        bench = self.disarmed(SetupTrust.LOOPBACK, storage)
        bench.say(setup_message(), source=GROUND)
        bench.say(setup_message(bytes(32)), source=GROUND)
        assert "Signing key removed" in texts(bench)
        assert not is_heard(bench, source=REMOTE, signer=signer(GROUND_KEY))
        assert not is_heard(secured(storage=storage), source=REMOTE, signer=signer(GROUND_KEY))

    def test_the_first_key_of_a_vehicle_without_any_closes_its_links(self) -> None:
        bench = secured(ALWAYS, broker=None, setup=SetupTrust.LOOPBACK)
        bench.topics.vehicle_status.publish(status(armed=False))
        assert is_heard(bench, source=REMOTE)
        bench.say(setup_message(), source=GROUND)
        bench.run()
        assert not is_heard(bench, source=REMOTE)
        assert is_heard(bench, source=REMOTE, signer=signer(GROUND_KEY))
