"""Which vehicles the broker listens to, in whose name, and how it signs what it says."""

from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest

from mavlink_broker.mavlink.codec import Decoder, Encoder
from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.mavlink.key_ring import KeyRing
from mavlink_broker.mavlink.signature_check import TELL_EVERY_S, Guard, Refusal, VehicleSigning

KEY, WRONG_KEY = bytes(range(32)), bytes(range(1, 33))
NOW = datetime(2026, 9, 1, tzinfo=UTC)
HEARTBEAT = mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3)
RADIO = mavlink.MAVLink_radio_status_message(1, 1, 1, 1, 1, 1, 1)
SIGNED, OPEN, KEYLESS = 1, 2, 3
"""Systems: with a key; named as unable to sign; neither."""


@pytest.fixture
def guard(tmp_path: Path) -> Guard:
    path = tmp_path / f"signing-{SIGNED}.key"
    path.write_bytes(KEY)
    path.chmod(0o600)
    return Guard(KeyRing(tmp_path), {OPEN}, lambda: NOW)


def heard(
    message: Any,
    *,
    system: int = SIGNED,
    key: bytes | None = None,
    ahead: timedelta = timedelta(),
    version_1: bool = False,
) -> Message:
    """A message as it arrives from a vehicle whose clock is so far ahead of the broker's."""
    if version_1:
        frame = message.pack(mavlink.MAVLink(None, system, 1), force_mavlink1=True)
    else:
        signing = None if key is None else VehicleSigning(key, lambda: NOW + ahead).for_sending()
        frame = Encoder(system, 1).encode(message, signing)
    (decoded,) = Decoder().decode(frame)
    return decoded


@pytest.mark.parametrize(
    ("message", "refusal"),
    [
        (heard(HEARTBEAT, key=KEY), None),
        (heard(HEARTBEAT), Refusal.UNSIGNED),
        (heard(HEARTBEAT, key=WRONG_KEY), Refusal.BAD_SIGNATURE),
        (heard(HEARTBEAT, key=KEY, ahead=timedelta(seconds=-61)), Refusal.REPLAYED),
        (heard(HEARTBEAT, key=KEY, ahead=timedelta(seconds=-59)), None),
        (heard(HEARTBEAT, key=KEY, ahead=timedelta(hours=1)), None),
        (heard(HEARTBEAT, version_1=True), Refusal.VERSION_1),
        (heard(HEARTBEAT, system=OPEN), None),
        (heard(HEARTBEAT, system=OPEN, version_1=True), None),
        (heard(HEARTBEAT, system=KEYLESS), Refusal.UNSIGNED),
        (heard(HEARTBEAT, system=KEYLESS, key=KEY), Refusal.NO_KEY),
        (heard(RADIO), None),
        (heard(RADIO, key=WRONG_KEY), Refusal.BAD_SIGNATURE),
    ],
)
def test_who_is_listened_to(guard: Guard, message: Message, refusal: Refusal | None) -> None:
    assert guard.admits(message, 0.0) is (refusal is None)
    assert list(guard.refused) == ([] if refusal is None else [refusal])


def test_a_frame_is_heard_once(guard: Guard) -> None:
    message = heard(HEARTBEAT, key=KEY)
    assert guard.admits(message, 0.0)
    assert not guard.admits(message, 0.0)


def test_a_forged_frame_from_the_future_does_not_lock_the_vehicle_out(guard: Guard) -> None:
    forged = heard(HEARTBEAT, key=WRONG_KEY, ahead=timedelta(days=365 * 50))
    assert not guard.admits(forged, 0.0)
    assert guard.admits(heard(HEARTBEAT, key=KEY), 0.0)


def test_without_keys_everybody_is_listened_to_and_nothing_is_signed() -> None:
    guard = Guard(None, (), lambda: NOW)
    assert guard.admits(heard(HEARTBEAT), 0.0)
    assert guard.admits(heard(HEARTBEAT, key=WRONG_KEY), 0.0)
    assert guard.signing_for(SIGNED, 0.0) is None


def test_only_who_has_a_key_is_spoken_to_in_signatures(guard: Guard) -> None:
    assert guard.signing_for(SIGNED, 0.0) is not None
    assert guard.signing_for(OPEN, 0.0) is None
    assert guard.signing_for(KEYLESS, 0.0) is None


def time_of(frame: bytes) -> int:
    return int.from_bytes(frame[-12:-6], "little")


def test_times_rise_from_frame_to_frame_and_above_all_that_the_vehicle_has_used(
    guard: Guard,
) -> None:
    encoder = Encoder(254, 191)
    signing = guard.signing_for(SIGNED, 0.0)
    assert signing is not None
    sent = [time_of(encoder.encode(HEARTBEAT, signing.for_sending())) for _ in range(3)]
    vehicle = heard(HEARTBEAT, key=KEY, ahead=timedelta(hours=1))
    assert guard.admits(vehicle, 0.0)
    sent.append(time_of(encoder.encode(HEARTBEAT, signing.for_sending())))
    assert sent == sorted(set(sent))
    assert sent[-1] >= time_of(bytes(vehicle.get_msgbuf()))


def test_one_counter_of_sequences_whether_signed_or_not(guard: Guard) -> None:
    encoder = Encoder(254, 191)
    signing = guard.signing_for(SIGNED, 0.0)
    assert signing is not None
    frames = [
        encoder.encode(HEARTBEAT, signing.for_sending()),
        encoder.encode(HEARTBEAT),
        encoder.encode(HEARTBEAT, signing.for_sending()),
    ]
    assert [frame[4] for frame in frames] == [0, 1, 2]
    assert [frame[2] for frame in frames] == [1, 0, 1]


def test_what_is_refused_is_told_seldom(guard: Guard, caplog: pytest.LogCaptureFixture) -> None:
    for second in range(100):
        guard.admits(heard(HEARTBEAT), float(second))
    assert guard.refused[Refusal.UNSIGNED] == 100
    assert len(caplog.records) == 100 // TELL_EVERY_S + 1
    assert "1 unsigned; the last from system 1" in caplog.messages[0]
    assert "30 unsigned" in caplog.messages[1]
