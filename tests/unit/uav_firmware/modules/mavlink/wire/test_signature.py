"""Signatures: genuine frames are accepted once, others never change the state."""

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import common

from uav_firmware.modules.mavlink.wire.signature import (
    CLOCK_SET,
    EPOCH_US,
    LATEST,
    LEAD,
    LEAD_WITHOUT_CLOCK,
    MAX_STREAMS,
    NEW_STREAM_WINDOW,
    Refusal,
    Signer,
    SigningClock,
)

KEY = bytes(range(32))
OTHER_KEY = bytes(range(1, 33))
MINUTE = NEW_STREAM_WINDOW
TODAY = CLOCK_SET + 600 * LEAD
WORLD = 3_000_000_000_000  # [10 us since 2015]
BODY = bytes.fromhex("fd0901000a0101000000") + bytes(9) + b"\x12\x34"


class World:
    """A clock that a test sets [10 us since 2015]."""

    def __init__(self, time: int = WORLD) -> None:
        self.time = time

    def __call__(self) -> int:
        return EPOCH_US + self.time * 10


def signer(key: bytes = KEY, *, time: int = WORLD, world: World | None = None) -> Signer:
    return Signer(key, SigningClock(world or World(time)))


def signed(time: int, *, key: bytes = KEY, link: int = 0, body: bytes = BODY) -> bytes:
    """A frame as another system signs it."""
    return signer(key, time=time).sign(body, link)


def test_signatures_of_stock_pymavlink_are_genuine() -> None:
    codec = common.MAVLink(None, srcSystem=7, srcComponent=1)
    codec.signing.secret_key = KEY
    codec.signing.timestamp = WORLD
    codec.signing.link_id = 3
    codec.signing.sign_outgoing = True
    frame = common.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3).pack(codec)
    assert signer().verify(bytes(frame), 7, 1) is None
    assert signer(OTHER_KEY).verify(bytes(frame), 7, 1) is Refusal.BAD_SIGNATURE


def test_stock_pymavlink_accepts_our_signatures() -> None:
    heartbeat = common.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)
    plain = bytearray(heartbeat.pack(common.MAVLink(None, 7, 1)))
    plain[2] = 1  # Signed flag
    crc = common.x25crc(bytes(plain[1:-2]) + bytes([heartbeat.crc_extra])).crc
    frame = signer().sign(bytes(plain[:-2]) + crc.to_bytes(2, "little"), 3)
    reader = common.MAVLink(None)
    reader.signing.secret_key = KEY
    message: Any = reader.decode(bytearray(frame))
    assert message.get_signed()
    assert message.get_link_id() == 3


@given(st.integers(0, len(BODY) + 12), st.integers(0, 7))
def test_any_flipped_bit_invalidates_a_signature(position: int, bit: int) -> None:
    frame = bytearray(signed(WORLD))
    frame[position] ^= 1 << bit
    assert signer().verify(bytes(frame), 1, 1) is Refusal.BAD_SIGNATURE


def test_a_frame_is_accepted_once() -> None:
    ours, frame = signer(), signed(WORLD)
    assert ours.verify(frame, 1, 1) is None
    assert ours.verify(frame, 1, 1) is Refusal.REPLAYED


def test_any_older_frame_of_a_stream_is_refused() -> None:
    ours = signer()
    assert ours.verify(signed(WORLD), 1, 1) is None
    assert ours.verify(signed(WORLD - 1), 1, 1) is Refusal.REPLAYED
    assert ours.verify(signed(WORLD + 1), 1, 1) is None


@pytest.mark.parametrize(
    ("link", "system", "component"), [(1, 1, 1), (0, 2, 1), (0, 1, 2)], ids=str
)
def test_streams_are_distinguished(link: int, system: int, component: int) -> None:
    ours = signer()
    assert ours.verify(signed(WORLD), 1, 1) is None
    assert ours.verify(signed(WORLD, link=link), system, component) is None


def test_a_new_stream_may_be_a_minute_behind_and_no_more() -> None:
    assert signer().verify(signed(WORLD - MINUTE), 1, 1) is None
    assert signer().verify(signed(WORLD - MINUTE - 1), 1, 1) is Refusal.REPLAYED


def test_a_known_stream_may_lag_if_its_times_increase() -> None:
    world = World()
    ours = signer(world=world)
    assert ours.verify(signed(WORLD), 1, 1) is None
    world.time += 100 * MINUTE
    assert ours.verify(signed(WORLD + 1), 1, 1) is None


@given(st.binary(min_size=6, max_size=6), st.integers(0, (1 << 48) - 1))
def test_a_forged_frame_from_the_future_does_not_lock_the_genuine_sender_out(
    mark: bytes, time: int
) -> None:
    ours = signer()
    forged = BODY + b"\0" + time.to_bytes(6, "little") + mark
    assert ours.verify(forged, 1, 1) is Refusal.BAD_SIGNATURE
    assert ours.verify(signed(WORLD), 1, 1) is None


def test_a_genuine_time_beyond_the_limit_does_not_stop_the_clock() -> None:
    ours = signer()
    assert ours.verify(signed(LATEST + 1), 1, 1) is Refusal.AHEAD
    assert ours.verify(signed(LATEST), 1, 1) is None
    assert len({ours.sign(BODY, 0) for _ in range(100)}) == 100


@pytest.mark.parametrize(
    ("world", "observed", "latest"),
    [
        (TODAY, 0, TODAY + LEAD),  # The first run
        (TODAY, TODAY + LEAD, TODAY + LEAD),  # No accepted frame lets a later one be accepted
        (TODAY, TODAY + 2 * LEAD, TODAY + 2 * LEAD + LEAD_WITHOUT_CLOCK),  # World clock set back
        (-1, TODAY, TODAY + LEAD_WITHOUT_CLOCK),  # The world clock is of 1970 or 2014
        (-1, 0, LATEST),  # Nothing is known
        (-1, MINUTE, LATEST),  # The stored time is of a run that knew nothing
        (LATEST, 0, LATEST),
    ],
)
def test_a_genuine_frame_may_be_ahead_of_what_the_clock_can_know(
    world: int, observed: int, latest: int
) -> None:
    ours = Signer(KEY, SigningClock(World(world), observed=observed))
    assert ours.verify(signed(latest + 1), 1, 1) is Refusal.AHEAD
    assert ours.verify(signed(latest), 1, 1) is None


def test_a_station_with_a_wrong_year_does_not_shut_the_others_out() -> None:
    clock = SigningClock(World(TODAY))
    ours = Signer(KEY, clock)
    assert ours.verify(signed(TODAY), 1, 1) is None
    assert ours.verify(signed(TODAY + 10 * LEAD_WITHOUT_CLOCK), 1, 1) is Refusal.AHEAD
    assert ours.verify(signed(TODAY + 1), 1, 1) is None
    assert ours.verify(signed(TODAY), 2, 1) is None
    assert clock.now() == TODAY + 1


def test_a_frame_from_ahead_that_was_accepted_cannot_be_repeated_after_a_restart() -> None:
    clock = SigningClock(World(TODAY))
    frame = signed(TODAY + LEAD)
    assert Signer(KEY, clock).verify(frame, 1, 1) is None
    restarted = Signer(KEY, SigningClock(World(TODAY + MINUTE + 1), observed=clock.now()))
    assert restarted.verify(signed(TODAY + LEAD + MINUTE + 1), 1, 1) is None
    assert restarted.verify(frame, 1, 1) is Refusal.REPLAYED
    assert restarted.verify(frame, 2, 1) is Refusal.REPLAYED


def test_sent_times_increase_when_the_world_clock_stops_or_steps_back() -> None:
    world = World()
    clock = SigningClock(world)
    first = clock.next()
    world.time -= MINUTE
    assert first < clock.next() < clock.next()


def test_the_clock_follows_the_newest_genuine_frame_and_no_forged_one() -> None:
    world = World()
    clock = SigningClock(world)
    ours = Signer(KEY, clock)
    ours.verify(signed(WORLD + 10 * MINUTE, key=OTHER_KEY), 1, 1)
    assert clock.now() == WORLD
    ours.verify(signed(WORLD + 10 * MINUTE), 1, 1)
    assert clock.next() >= WORLD + 10 * MINUTE


def test_a_run_starts_above_the_times_of_the_previous_one() -> None:
    clock = SigningClock(World(0), used=WORLD, observed=WORLD - MINUTE)
    assert clock.next() == WORLD + 1
    assert clock.now() == WORLD - MINUTE


def test_the_number_of_streams_is_bounded_and_old_ones_are_replaced() -> None:
    world = World()
    ours = signer(world=world)
    for system in range(MAX_STREAMS):
        assert ours.verify(signed(WORLD), system, 1) is None
    assert ours.verify(signed(WORLD), 1, 2) is Refusal.REPLAYED
    assert ours.verify(signed(WORLD + 1), 1, 1) is None
    world.time += 2 * MINUTE
    assert ours.verify(signed(WORLD + 2 * MINUTE), 1, 2) is None
    assert ours.verify(signed(WORLD), 5, 1) is Refusal.REPLAYED


@pytest.mark.parametrize("key", [b"", bytes(32), bytes(31), b"x" * 33])
def test_invalid_keys_are_refused(key: bytes) -> None:
    with pytest.raises(ValueError, match="signing key"):
        signer(key)
