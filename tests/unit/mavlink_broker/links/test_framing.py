"""Whole frames are found in any stream, whatever surrounds and splits them."""

from hypothesis import given
from hypothesis import strategies as st

from mavlink_broker.links.stream import FRAME_TIMEOUT_S, FrameScanner
from mavlink_broker.mavlink.codec import SIGNATURE_LENGTH, Encoder, signed
from mavlink_broker.mavlink.dialect import mavlink

HEARTBEAT = mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3)
LARGEST_FRAME = 12 + 255 + SIGNATURE_LENGTH
NOISE = st.binary(max_size=60)


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
def test_no_noise_costs_a_frame(noises: list[bytes]) -> None:
    sent = frames(3)
    stream = b"".join(n + f for n, f in zip(noises, sent, strict=False)) + noises[-1]
    scanner = FrameScanner()
    received = scanner.feed(stream, 0.0)
    received += scanner.feed(b"", 2 * FRAME_TIMEOUT_S)
    assert [frame for frame in received if frame in sent] == sent
    assert sum(map(len, received)) + scanner.skipped == len(stream)


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
