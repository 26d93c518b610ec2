"""Streams: whole frames are found in any bytes; a full radio is written to more slowly."""

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from mavlink_broker.links.link import FRAME_TIMEOUT_S, MIN_FACTOR, FrameScanner, RateLimiter
from mavlink_broker.mavlink.codec import SIGNATURE_LENGTH, Encoder, signed
from mavlink_broker.mavlink.dialect import mavlink

HEARTBEAT = mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3)
PRIVATE_MESSAGE = 55_555
LARGEST_FRAME = 12 + 255 + SIGNATURE_LENGTH
NOISE = st.binary(max_size=60)
HEADS = st.sampled_from(
    [b"\xfd", b"\xfe", b"\xfd\x09\x00", b"\xfd\x09\xff", b"\xfd\x00\x01", b"\xfe\x09"]
)
UNKNOWN = st.builds(
    lambda payload: (
        bytes((0xFD, len(payload), 0, 0, 0, 1, 1))
        + PRIVATE_MESSAGE.to_bytes(3, "little")
        + payload
        + b"\x12\x34"
    ),
    st.lists(HEADS | st.binary(max_size=9), max_size=20).map(b"".join),
)
"""Frames of a private dialect, whose payload may look like the beginning of a frame."""


def frames(count: int) -> list[bytes]:
    encoder = Encoder(1, 1)
    plain = [encoder.encode(HEARTBEAT) for _ in range(count)]
    return [f if n % 3 else signed(f, bytes(32), 0, n) for n, f in enumerate(plain)]


@given(st.lists(st.integers(1, 50), min_size=1, max_size=40))
def test_reads_may_break_frames_anywhere(sizes: list[int]) -> None:
    sent = frames(5)
    stream, scanner, received = b"".join(sent), FrameScanner(), []
    for size in sizes:
        received += scanner.feed(stream[:size], 0.0)
        stream = stream[size:]
    received += scanner.feed(stream, 0.0)
    assert received == sent
    assert scanner.skipped == 0


@given(st.lists(NOISE, min_size=4, max_size=4))
@example([b"", b"", b"\xfe\x11\x00\x00", b""])  # The head of a frame as long as what follows
def test_no_noise_costs_a_frame(noises: list[bytes]) -> None:
    sent = frames(3)
    stream = b"".join(n + f for n, f in zip(noises, sent, strict=False)) + noises[-1]
    scanner = FrameScanner()
    received = scanner.feed(stream, 0.0)
    received += scanner.feed(b"", 2 * FRAME_TIMEOUT_S)
    assert [frame for frame in received if frame in sent] == sent
    assert sum(map(len, received)) + scanner.skipped == len(stream)


@given(st.lists(UNKNOWN | HEADS | NOISE, max_size=12), st.lists(st.integers(1, 80), max_size=30))
def test_no_bytes_stop_a_stream(pieces: list[bytes], reads: list[int]) -> None:
    stream, scanner, received = b"".join(pieces), FrameScanner(), []
    for size in (*reads, len(stream)):
        received += scanner.feed(stream[:size], 0.0)
        stream = stream[size:]
    received += scanner.feed(b"", 2 * FRAME_TIMEOUT_S)
    assert sum(map(len, received)) + scanner.skipped == len(b"".join(pieces))


@given(UNKNOWN)
def test_a_frame_of_a_private_dialect_is_returned_whatever_its_payload_looks_like(
    frame: bytes,
) -> None:
    """Unless it contains a frame whose checksum holds."""
    scanner = FrameScanner()
    assert scanner.feed(frame, 0.0) == [frame]


def test_a_first_byte_out_of_nothing_does_not_swallow_a_quiet_line() -> None:
    scanner = FrameScanner()
    (frame,) = frames(1)
    assert scanner.feed(b"\xfd\xff\x00" + frame, 0.0) == []
    assert scanner.feed(b"", FRAME_TIMEOUT_S / 2) == []
    assert scanner.feed(b"", FRAME_TIMEOUT_S * 1.01) == [frame]


def test_a_frame_may_take_its_time_on_a_slow_line() -> None:
    scanner = FrameScanner()
    frame = b"".join(frames(1))
    for number, byte in enumerate(frame[:-1]):
        assert scanner.feed(bytes((byte,)), number * 0.9 / len(frame)) == []
    assert scanner.feed(frame[-1:], 0.9) == [frame]


def test_a_megabyte_without_a_first_byte_is_skipped_and_nothing_of_it_kept() -> None:
    scanner = FrameScanner()
    assert scanner.feed(b"\x55" * 1_000_000, 0.0) == []
    assert scanner.skipped == 1_000_000
    assert not scanner.is_waiting
    sent = frames(1)
    assert scanner.feed(sent[0], 0.0) == sent


@given(st.sampled_from([b"\xfd", b"\xfe", b"\xfd\x00\x00", b"\xfe\xff"]), st.integers(1, 9000))
def test_first_bytes_alone_are_never_more_than_one_frame_long(pattern: bytes, count: int) -> None:
    scanner = FrameScanner()
    received = scanner.feed(pattern * count, 0.0)
    assert sum(map(len, received)) + scanner.skipped >= len(pattern) * count - LARGEST_FRAME


def test_a_damaged_frame_costs_itself_only() -> None:
    first, second, third = frames(3)
    damaged = second[:12] + bytes((second[12] ^ 1,)) + second[13:]
    scanner = FrameScanner()
    received = scanner.feed(first + damaged + third, 0.0) + scanner.feed(b"", 5.0)
    assert received == [first, third]


BAUD = 57_600
FRAME_BYTES = 50


def written_in(rate_limiter: RateLimiter, seconds: float) -> int:
    """Bytes that get through when there is always something to write."""
    written, step_s = 0, 0.02
    for n in range(round(seconds / step_s)):
        while written < seconds * BAUD and rate_limiter.allows(n * step_s):
            rate_limiter.written(FRAME_BYTES)
            written += FRAME_BYTES
            if rate_limiter.factor >= 1.0:
                break
    return written


def test_without_a_report_nothing_is_held_back() -> None:
    rate_limiter = RateLimiter(BAUD)
    assert all(rate_limiter.allows(0.0) for _ in range(1000))


def test_the_rate_of_a_full_radio_decreases_to_a_tenth() -> None:
    rate_limiter = RateLimiter(BAUD)
    rates = []
    for _ in range(20):
        rate_limiter.report(5)
        rates.append(rate_limiter.factor)
    assert rates == sorted(rates, reverse=True)
    assert rates[-1] == MIN_FACTOR


def test_an_empty_one_gets_more_again_up_to_the_line() -> None:
    rate_limiter = RateLimiter(BAUD)
    for _ in range(20):
        rate_limiter.report(5)
    for _ in range(100):
        rate_limiter.report(100)
    assert rate_limiter.factor == 1.0


def test_in_between_the_rate_stays() -> None:
    rate_limiter = RateLimiter(BAUD)
    rate_limiter.report(0)
    before = rate_limiter.factor
    rate_limiter.report(50)
    assert rate_limiter.factor == before


@given(reports=st.integers(1, 30))
def test_what_is_written_keeps_the_rate(reports: int) -> None:
    rate_limiter = RateLimiter(BAUD)
    for _ in range(reports):
        rate_limiter.report(0)
    assert written_in(rate_limiter, 10.0) == pytest.approx(10.0 * rate_limiter.bytes_s, rel=0.05)


@given(st.lists(st.integers(0, 255)))
def test_any_reports_leave_a_sensible_rate(reports: list[int]) -> None:
    rate_limiter = RateLimiter(BAUD)
    for report in reports:
        rate_limiter.report(report)
    assert MIN_FACTOR <= rate_limiter.factor <= 1.0
