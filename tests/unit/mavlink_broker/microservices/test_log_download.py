"""The client of the log protocol against vehicles that state and send anything."""

from collections.abc import Iterator
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.microservices.command import RoundTrip
from mavlink_broker.microservices.log_download import (
    ATTEMPTS,
    LARGEST_WINDOW,
    LIST_ATTEMPTS,
    LIST_WITHIN_S,
    NO_DATA,
    PACKET_BYTES,
    PART_BYTES,
    LogDownload,
    LogEntry,
    LogList,
)
from tests.support.log_air import ROUTE

UINT16, UINT32 = st.integers(0, 2**16 - 1), st.integers(0, 2**32 - 1)
ENTRIES = st.builds(
    mavlink.MAVLink_log_entry_message,
    st.one_of(st.integers(0, 5), UINT16),
    st.one_of(st.integers(0, 5), UINT16),
    st.one_of(st.integers(0, 5), UINT16),
    UINT32,
    UINT32,
)
PAUSES_S = st.sampled_from([0.0, 0.001, 0.3, 2.0])


def data_message(log: int, offset: int, data: bytes, count: int | None = None) -> Message:
    padded = list(data.ljust(PACKET_BYTES, b"\0")[:PACKET_BYTES])
    return mavlink.MAVLink_log_data_message(
        log, offset, len(data) if count is None else count, padded
    )


def answer(request: Message, contents: bytes, log: int = 3) -> Iterator[Message]:
    """What an honest vehicle answers."""
    end = min(request.ofs + request.count, len(contents))
    for offset in range(request.ofs, end, PACKET_BYTES):
        yield data_message(log, offset, contents[offset : min(offset + PACKET_BYTES, end)])
    if request.ofs >= len(contents):
        yield data_message(log, request.ofs, b"")


def entry(number: int, count: int, last: int, size: int = 10) -> Message:
    return mavlink.MAVLink_log_entry_message(number, count, last, 1_772_355_600 + number, size)


@given(messages=st.lists(st.tuples(ENTRIES, PAUSES_S), max_size=30))
def test_a_list_ends_whatever_a_vehicle_states(messages: list[tuple[Message, float]]) -> None:
    logs, now = LogList(ROUTE, RoundTrip()), 0.0
    requests = len(logs.start(now))
    for message, pause_s in messages:
        now += pause_s
        logs.receive(message, now)
        requests += len(logs.tick(now))
    while logs.entries is None:
        assert now <= LIST_WITHIN_S + 10.0
        now += 0.5
        requests += len(logs.tick(now))
    assert requests <= LIST_WITHIN_S + LIST_ATTEMPTS
    numbers = [one.number for one in logs.entries]
    assert numbers == sorted(set(numbers))


def test_entries_outside_of_the_stated_numbers_are_ignored() -> None:
    logs = LogList(ROUTE, RoundTrip())
    logs.start(0.0)
    for number in (7, 1, 2):
        logs.receive(entry(number, 2, 2), 0.1)
    assert [one.number for one in logs.entries or ()] == [1, 2]


def test_a_list_that_is_numbered_again_midway_begins_again() -> None:
    logs = LogList(ROUTE, RoundTrip())
    logs.start(0.0)
    logs.receive(entry(0, 3, 2, size=5), 0.1)
    for number in range(2):
        logs.receive(entry(number, 2, 1, size=7), 0.2)
    assert [one.size for one in logs.entries or ()] == [7, 7]


def test_a_vehicle_that_states_65535_logs_costs_little() -> None:
    logs = LogList(ROUTE, RoundTrip())
    logs.start(0.0)
    for number in range(2000):
        logs.receive(entry(number, 65_535, 65_535), 0.1)
    (request,) = logs.tick(5.0)
    assert (request.start, request.end) == (0, 0xFFFF)
    logs.tick(LIST_WITHIN_S)
    assert len(logs.entries or ()) == 2000


@given(
    size=st.one_of(st.integers(1, 500), st.just(2**32 - 1)),
    messages=st.lists(
        st.tuples(
            st.builds(
                data_message,
                st.sampled_from([3, 3, 3, 4]),
                st.one_of(st.integers(0, 600), UINT32),
                st.binary(max_size=PACKET_BYTES),
                st.one_of(st.none(), st.integers(0, 255)),
            ),
            PAUSES_S,
        ),
        max_size=40,
    ),
)
def test_a_download_ends_whatever_a_vehicle_sends(
    size: int, messages: list[tuple[Message, float]]
) -> None:
    download, now = LogDownload(LogEntry(3, 0, size), ROUTE), 0.0
    sent: dict[int, set[int]] = {}
    requests = download.tick(now)
    for message, pause_s in messages:
        now += pause_s
        if message.id == 3:
            for at, byte in enumerate(message.data[: min(message.count, PACKET_BYTES)]):
                sent.setdefault(message.ofs + at, set()).add(byte)
        requests += download.receive(message, now)
        requests += download.tick(now)
    for _ in range(10_000):
        if download.failure is not None or download.part is not None:
            break
        now += 0.25
        requests += download.tick(now)
    assert all(one.count <= LARGEST_WINDOW and one.ofs + one.count <= size for one in requests)
    if (part := download.part) is not None:
        assert part.offset == 0
        assert len(part.data) <= min(size, PART_BYTES)
        assert all(byte in sent.get(at, ()) for at, byte in enumerate(part.data))
    else:
        assert download.failure is not None
        assert now < 300.0


@given(
    contents=st.binary(min_size=1, max_size=2000),
    offset=st.integers(0, 2000),
    chaos=st.randoms(use_true_random=False),
    loss=st.floats(0.0, 0.4),
)
def test_what_arrives_in_any_order_and_number_is_the_log(
    contents: bytes, offset: int, chaos: Any, loss: float
) -> None:
    download, now = LogDownload(LogEntry(3, 0, len(contents)), ROUTE, offset=offset), 0.0
    requests = download.tick(now)
    late: list[Message] = []
    while download.part is None:
        assert download.failure is None
        assert now < 3000.0
        arriving = late + [one for request in requests for one in answer(request, contents)]
        chaos.shuffle(arriving)
        requests, late = [], []
        for message in arriving:
            fate = chaos.random()
            if fate < loss:
                continue
            if fate > 0.9:
                late.append(message)
            if fate < 0.95:
                requests += download.receive(message, now)
        now += chaos.choice([0.01, 0.4, 1.2])
        requests += download.tick(now)
    part = download.part
    assert (part.offset, part.is_last) == (min(offset, len(contents)), True)
    assert part.data == contents[offset:]


def test_a_silent_vehicle_is_asked_a_bounded_number_of_times() -> None:
    download, now = LogDownload(LogEntry(3, 0, 1000), ROUTE), 0.0
    requests = download.tick(now)
    while download.failure is None:
        now += 0.05
        requests += download.tick(now)
    assert len(requests) == ATTEMPTS
    assert 30.0 < now < 120.0
    assert download.failure == NO_DATA


def test_a_vehicle_that_repeats_the_same_bytes_is_left() -> None:
    download, now = LogDownload(LogEntry(3, 0, 1000), ROUTE), 0.0
    requests = download.tick(now)
    while download.failure is None:
        now += 0.05
        requests += download.receive(data_message(3, 0, b"x" * 90), now)
        requests += download.tick(now)
    assert download.failure == NO_DATA
    assert len(requests) <= ATTEMPTS + 2


@pytest.mark.parametrize("size", [90, 180])
def test_one_empty_packet_ends_no_log(size: int) -> None:
    """The log has 90 bytes, whatever is stated, and the first packet is empty."""
    contents = bytes(range(90))
    download, now = LogDownload(LogEntry(3, 0, size), ROUTE), 0.0
    (request,) = download.tick(now)
    download.receive(data_message(3, 0, b""), now)
    while (part := download.part) is None:
        assert now < 60.0
        now += 0.1
        for message in answer(request, contents):
            for again in download.receive(message, now):
                request = again
        for again in download.tick(now):
            request = again
    assert (part.data, part.is_last) == (contents, True)
