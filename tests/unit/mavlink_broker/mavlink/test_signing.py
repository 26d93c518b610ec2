"""Keys of systems; frames that are refused, and why."""

from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavlink_broker.mavlink.codec import Decoder, Encoder
from mavlink_broker.mavlink.dialect import Message, mavlink, source_of
from mavlink_broker.mavlink.signing import (
    CLOCK_ADVICE,
    DATE_ADVICE,
    LOG_INTERVAL_S,
    MAX_LEAD,
    RETRY_INTERVAL_S,
    KeyRing,
    LinkSigning,
    Refusal,
    SignatureCheck,
)

KEY, WRONG_KEY = bytes(range(32)), bytes(range(1, 33))
NOW = datetime(2026, 9, 1, tzinfo=UTC)
HEARTBEAT = mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3)
RADIO = mavlink.MAVLink_radio_status_message(1, 1, 1, 1, 1, 1, 1)
SIGNED, OPEN, KEYLESS = 1, 2, 3
"""Systems: with a key; named as unable to sign; neither."""


@pytest.fixture
def signature_check(tmp_path: Path) -> SignatureCheck:
    path = tmp_path / f"signing-{SIGNED}.key"
    path.write_bytes(KEY)
    path.chmod(0o600)
    return SignatureCheck(KeyRing(tmp_path), {OPEN}, lambda: NOW)


def received(
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
        signing = None if key is None else LinkSigning(key, lambda: NOW + ahead).next_signature()
        frame = Encoder(system, 1).encode(message, signing)
    (decoded,) = Decoder().decode(frame)
    return decoded


@pytest.mark.parametrize(
    ("message", "refusal"),
    [
        (received(HEARTBEAT, key=KEY), None),
        (received(HEARTBEAT), Refusal.UNSIGNED),
        (received(HEARTBEAT, key=WRONG_KEY), Refusal.BAD_SIGNATURE),
        (received(HEARTBEAT, key=KEY, ahead=timedelta(seconds=-61)), Refusal.REPLAYED),
        (received(HEARTBEAT, key=KEY, ahead=timedelta(seconds=-59)), None),
        (received(HEARTBEAT, key=KEY, ahead=timedelta(hours=1)), None),
        (received(HEARTBEAT, version_1=True), Refusal.VERSION_1),
        (received(HEARTBEAT, system=OPEN), None),
        (received(HEARTBEAT, system=OPEN, version_1=True), None),
        (received(HEARTBEAT, system=KEYLESS), Refusal.UNSIGNED),
        (received(HEARTBEAT, system=KEYLESS, key=KEY), Refusal.NO_KEY),
        (received(RADIO), None),
        (received(RADIO, key=WRONG_KEY), Refusal.BAD_SIGNATURE),
    ],
)
def test_which_messages_are_accepted(
    signature_check: SignatureCheck, message: Message, refusal: Refusal | None
) -> None:
    assert signature_check.accepts(message, 0.0) is (refusal is None)
    assert list(signature_check.refused) == ([] if refusal is None else [refusal])


def test_a_frame_is_accepted_once(signature_check: SignatureCheck) -> None:
    message = received(HEARTBEAT, key=KEY)
    assert signature_check.accepts(message, 0.0)
    assert not signature_check.accepts(message, 0.0)


@pytest.mark.parametrize("ahead_s", [0.001, 5.0, 120.0, 3600.0])
def test_a_second_vehicle_that_signs_ahead_does_not_silence_the_first(
    signature_check: SignatureCheck, ahead_s: float
) -> None:
    """A vehicle that was restarted signs up to two minutes ahead."""
    for second in range(5):
        here, ahead = timedelta(seconds=second), timedelta(seconds=second + ahead_s)
        one, other = (
            received(HEARTBEAT, key=KEY, ahead=here),
            received(HEARTBEAT, key=KEY, ahead=ahead),
        )
        assert signature_check.accepts(one, 0.0, address="first")
        assert signature_check.accepts(other, 0.0, address="second")


@given(st.lists(st.tuples(st.integers(0, 9), st.sampled_from("ABC")), max_size=30))
def test_no_address_is_accepted_twice_with_a_frame_or_an_older_one(
    arrivals: list[tuple[int, str]],
) -> None:
    """Whoever repeats frames from the same or another address is refused."""
    signing, all_newest = LinkSigning(KEY, lambda: NOW), -1
    newest: dict[str, int] = {}
    frames = [received(HEARTBEAT, key=KEY, ahead=timedelta(seconds=n)) for n in range(10)]
    for number, address in arrivals:
        message = frames[number]
        refusal = signing.check(message.get_msgbuf(), source_of(message), address)
        known = newest.get(address)
        is_new = number > all_newest or (known is not None and number > known)
        assert (refusal is None) is is_new
        if is_new:
            newest[address], all_newest = number, max(all_newest, number)


def test_a_forged_frame_from_the_future_does_not_lock_the_vehicle_out(
    signature_check: SignatureCheck,
) -> None:
    forged = received(HEARTBEAT, key=WRONG_KEY, ahead=timedelta(days=365 * 50))
    assert not signature_check.accepts(forged, 0.0)
    assert signature_check.accepts(received(HEARTBEAT, key=KEY), 0.0)


def test_a_sender_with_a_wrong_year_shuts_no_later_stream_out(
    signature_check: SignatureCheck, caplog: pytest.LogCaptureFixture
) -> None:
    wrong = received(HEARTBEAT, key=KEY, ahead=timedelta(days=3650))
    assert not signature_check.accepts(wrong, 0.0, address="station with a wrong year")
    assert signature_check.refused == {Refusal.AHEAD: 1}
    assert "1 over a year ahead; the last from system 1" + DATE_ADVICE in caplog.text
    assert signature_check.accepts(received(HEARTBEAT, key=KEY), 0.0, address="station")


@pytest.mark.parametrize(
    ("utc", "ahead", "refusal"),
    [
        (NOW, MAX_LEAD, None),
        (NOW, MAX_LEAD + timedelta(seconds=1), Refusal.AHEAD),
        (datetime(1970, 1, 1, tzinfo=UTC), timedelta(days=3650), None),  # Not set: knows nothing
    ],
)
def test_how_far_a_sender_may_be_ahead(
    utc: datetime, ahead: timedelta, refusal: Refusal | None
) -> None:
    message = received(HEARTBEAT, key=KEY, ahead=ahead)
    assert LinkSigning(KEY, lambda: utc).check(message.get_msgbuf(), source_of(message)) is refusal


def test_without_keys_every_message_is_accepted_and_nothing_signed() -> None:
    signature_check = SignatureCheck(None, (), lambda: NOW)
    assert signature_check.accepts(received(HEARTBEAT), 0.0)
    assert signature_check.accepts(received(HEARTBEAT, key=WRONG_KEY), 0.0)
    assert signature_check.signing_for(SIGNED, 0.0) is None


def test_only_frames_to_systems_with_a_key_are_signed(signature_check: SignatureCheck) -> None:
    assert signature_check.signing_for(SIGNED, 0.0) is not None
    assert signature_check.signing_for(OPEN, 0.0) is None
    assert signature_check.signing_for(KEYLESS, 0.0) is None


def time_of(frame: bytes) -> int:
    return int.from_bytes(frame[-12:-6], "little")


def test_times_rise_from_frame_to_frame_and_above_all_that_the_vehicle_has_used(
    signature_check: SignatureCheck,
) -> None:
    encoder = Encoder(254, 191)
    signing = signature_check.signing_for(SIGNED, 0.0)
    assert signing is not None
    sent = [time_of(encoder.encode(HEARTBEAT, signing.next_signature())) for _ in range(3)]
    vehicle = received(HEARTBEAT, key=KEY, ahead=timedelta(hours=1))
    assert signature_check.accepts(vehicle, 0.0)
    sent.append(time_of(encoder.encode(HEARTBEAT, signing.next_signature())))
    assert sent == sorted(set(sent))
    assert sent[-1] >= time_of(bytes(vehicle.get_msgbuf()))


def test_one_counter_of_sequences_whether_signed_or_not(signature_check: SignatureCheck) -> None:
    encoder = Encoder(254, 191)
    signing = signature_check.signing_for(SIGNED, 0.0)
    assert signing is not None
    frames = [
        encoder.encode(HEARTBEAT, signing.next_signature()),
        encoder.encode(HEARTBEAT),
        encoder.encode(HEARTBEAT, signing.next_signature()),
    ]
    assert [frame[4] for frame in frames] == [0, 1, 2]
    assert [frame[2] for frame in frames] == [1, 0, 1]


def test_refusals_are_logged_at_intervals(
    signature_check: SignatureCheck, caplog: pytest.LogCaptureFixture
) -> None:
    for second in range(100):
        signature_check.accepts(received(HEARTBEAT), float(second))
    assert signature_check.refused[Refusal.UNSIGNED] == 100
    assert len(caplog.records) == 100 // LOG_INTERVAL_S + 1
    assert "1 unsigned; the last from system 1" in caplog.messages[0]
    assert "30 unsigned" in caplog.messages[1]
    assert CLOCK_ADVICE not in caplog.text


def test_the_log_says_what_refuses_a_vehicle_whose_clock_is_behind(
    signature_check: SignatureCheck, caplog: pytest.LogCaptureFixture
) -> None:
    signature_check.accepts(received(HEARTBEAT, key=KEY, ahead=timedelta(seconds=-70)), 0.0)
    assert CLOCK_ADVICE in caplog.text


KEY = bytes(range(32))


def put(folder: Path, system: int, contents: bytes, mode: int = 0o600) -> None:
    path = folder / f"signing-{system}.key"
    path.write_bytes(contents)
    path.chmod(mode)


@pytest.mark.parametrize("contents", [KEY, KEY.hex().encode() + b"\n"], ids=["raw", "hex"])
def test_a_key_is_read_raw_or_as_digits(tmp_path: Path, contents: bytes) -> None:
    put(tmp_path, 7, contents)
    ring = KeyRing(tmp_path)
    assert ring.key_of(7, 0.0) == KEY
    assert ring.key_of(8, 0.0) is None


def test_a_key_that_appears_later_is_read(tmp_path: Path) -> None:
    ring = KeyRing(tmp_path)
    assert ring.key_of(7, 0.0) is None
    put(tmp_path, 7, KEY)
    assert ring.key_of(7, RETRY_INTERVAL_S / 2) is None
    assert ring.key_of(7, RETRY_INTERVAL_S) == KEY


@pytest.mark.parametrize(
    ("contents", "mode"),
    [(KEY, 0o640), (KEY[:-1], 0o600), (bytes(32), 0o600), (b"\xff" * 64, 0o600), (b"", 0o600)],
)
def test_an_invalid_key_is_logged_and_not_used(
    tmp_path: Path, contents: bytes, mode: int, caplog: pytest.LogCaptureFixture
) -> None:
    put(tmp_path, 7, contents, mode)
    assert KeyRing(tmp_path).key_of(7, 0.0) is None
    assert "signing-7.key" in caplog.text
