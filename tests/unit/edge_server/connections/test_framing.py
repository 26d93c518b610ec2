"""Requests are split from a stream of bytes, however the bytes arrive."""

import itertools
import re
from collections.abc import Iterable

import pytest
from gunicorn.config import Config  # type: ignore[import-untyped]  # it has no types
from gunicorn.http import get_parser  # type: ignore[import-untyped]  # as above
from hypothesis import given
from hypothesis import strategies as st

from edge_server.connections import framing as framing_module
from edge_server.connections.framing import (
    CHUNKS_ALLOWED,
    LEAST_CHUNK_BYTES,
    MAXIMUM_BODY_BYTES,
    MAXIMUM_HEAD_BYTES,
    FramedRequest,
    Lane,
    RequestFraming,
    Stage,
    lane_of,
)
from tests.support.cases import failures

GET = b"GET /plans/ HTTP/1.1\r\nHost: edge\r\n\r\n"
NOT_A_LENGTH = "the header field Content-Length must be the number of bytes of the body"
SIZED = b"POST /pose/ HTTP/1.1\r\nHost: a\r\nContent-Length: 12\r\n\r\nhello\r\n\r\nyou"
CHUNKED = (
    b"POST /pose/ HTTP/1.1\r\nHost: a\r\nTransfer-Encoding: Chunked\r\n\r\n"
    b"5;name=value\r\nhello\r\n1f\r\n" + b"x" * 31 + b"\r\n0\r\nChecksum: yes\r\n\r\n"
)
EMPTY = b"POST /x HTTP/1.1\r\nHost: a\r\ncontent-length: 0\r\n\r\n"


def cut(stream: bytes, places: Iterable[int]) -> list[bytes]:
    bounds = [0, *sorted(place % (len(stream) + 1) for place in places), len(stream)]
    return [stream[a:b] for a, b in itertools.pairwise(bounds)]


def requests_in(parts: Iterable[bytes]) -> tuple[list[FramedRequest], RequestFraming]:
    framing, found = RequestFraming(), []
    for part in parts:
        framing.feed(part)
        while framing.stage is Stage.READY:
            found.append(framing.take())
    return found, framing


@given(
    st.lists(st.sampled_from([GET, SIZED, CHUNKED, EMPTY]), min_size=1, max_size=5),
    st.lists(st.integers(min_value=0, max_value=10_000), max_size=20),
)
def test_requests_are_framed_as_they_were_sent(requests: list[bytes], places: list[int]) -> None:
    found, framing = requests_in(cut(b"".join(requests), places))
    assert found == [FramedRequest(raw, is_whole=True) for raw in requests]
    assert framing.kept_bytes == 0
    assert framing.stage is Stage.HEAD


@pytest.mark.parametrize("request_", [SIZED, CHUNKED])
def test_a_request_is_ready_at_its_last_byte_and_not_before(request_: bytes) -> None:
    framing = RequestFraming()
    for place in range(len(request_) - 1):
        framing.feed(request_[place : place + 1])
        assert framing.stage is not Stage.READY
    framing.feed(request_[-1:])
    assert framing.stage is Stage.READY


@pytest.mark.parametrize(
    "raw",
    [
        b"POST / HTTP/1.1\r\nHost: a\r\nContent-Length: 1" + b"0" * 30 + b"\r\n\r\n",
        b"POST / HTTP/1.1\r\nHost: a\r\nContent-Length: %d\r\n\r\n" % (MAXIMUM_BODY_BYTES + 1),
    ],
)
def test_a_head_that_cannot_be_framed_goes_to_the_parser_and_is_the_last(raw: bytes) -> None:
    found, framing = requests_in([raw])
    assert found == [FramedRequest(raw, is_whole=False)]
    assert framing.kept_bytes == 0


@pytest.mark.parametrize(
    ("raw", "status", "reason"),
    [
        (b"x" * (MAXIMUM_HEAD_BYTES + 1), 414, None),
        (b"GET / HTTP/1.1\r\nHost: a\r\nA: " + b"x" * MAXIMUM_HEAD_BYTES, 431, None),
        (b"GET / HTTP/1.1\r\nHost: a\r\nA: " + b"x" * MAXIMUM_HEAD_BYTES + b"\r\n\r\n", 431, None),
        (b"GET / HTTP/1.2\r\n\r\n", 505, None),
        (b"PRI * HTTP/2.0\r\n\r\n", 505, None),
        (b"GET / HTTP/1.1\r\n\r\n", 400, "the header field Host is missing"),
        (
            b"POST / HTTP/1.1\r\nHost: a\r\nIdempotency-Key: a\r\nIDEMPOTENCY-KEY: a\r\n\r\n",
            400,
            "the header field Idempotency-Key is present twice",
        ),
        (
            b"GET / HTTP/1.1\r\nAuthorization: Bearer a\r\nauthorization: Bearer b\r\n\r\n",
            400,
            "the header field Authorization is present twice",
        ),
        (
            b"POST / HTTP/1.1\r\nHost: a\r\nContent-Length: -1\r\n\r\n",
            400,
            f'{NOT_A_LENGTH}, not "-1"',
        ),
        (
            b"POST / HTTP/1.1\r\nHost: a\r\nContent-Length: \xb2\r\n\r\n",
            400,
            f'{NOT_A_LENGTH}, not "\\xb2"',
        ),
        (
            b"POST / HTTP/1.1\r\nHost: a\r\nContent-Length: 5\r\nContent-Length: 5\r\n\r\n",
            400,
            "the header field Content-Length is present twice",
        ),
        (
            b"POST / HTTP/1.1\r\nHost:\r\nContent-Length: 5\r\nTransfer-Encoding: chunked\r\n\r\n",
            400,
            "the header fields Content-Length and Transfer-Encoding exclude each other",
        ),
    ],
)
def test_an_invalid_head_is_refused_and_is_the_last(
    raw: bytes, status: int, reason: str | None
) -> None:
    for parts in ([GET + raw], cut(GET + raw, range(0, len(raw), 5000))):
        found, framing = requests_in(parts)
        assert found == [
            FramedRequest(GET, is_whole=True),
            FramedRequest(raw, False, status, reason),
        ]
        assert framing.kept_bytes == 0


def test_a_list_field_may_be_present_twice() -> None:
    raw = b"GET / HTTP/1.0\r\nAccept: a/b\r\nAccept: c/d\r\nIf-Match: x\r\nIf-Match: y\r\n\r\n"
    assert requests_in([raw])[0] == [FramedRequest(raw, is_whole=True)]


IN_CHUNKS = b"POST / HTTP/1.1\r\nHost: a\r\nTransfer-Encoding: chunked\r\n\r\n"


BROKEN_BODIES: list[tuple[bytes, int]] = [
    (b"POST / HTTP/1.1\r\nHost: a\r\nTransfer-Encoding: gzip, chunked\r\n\r\n", 501),
    (
        b"PUT / HTTP/1.1\r\nHost:\r\nTransfer-Encoding: gzip\r\nTransfer-Encoding: chunked\r\n\r\n",
        501,
    ),
    (b"POST / HTTP/1.1\r\nHost: a\r\nTransfer-Encoding: chunked, chunked\r\n\r\n", 400),
    (IN_CHUNKS + b"zz\r\n", 400),
    (IN_CHUNKS + b"-5\r\n", 400),
    (IN_CHUNKS + b"+5\r\n", 400),
    (IN_CHUNKS + b"0x5\r\n", 400),
    (IN_CHUNKS + b"5_0\r\n", 400),
    (IN_CHUNKS + b"5 \r\n", 400),
    (IN_CHUNKS + b"\r\n", 400),
    (IN_CHUNKS + b"5;a\nb\r\n", 400),
    (IN_CHUNKS + b'5;a="b\r\n', 400),
    (IN_CHUNKS + b"5\r\nhello!!", 400),
    (IN_CHUNKS + b"ffffffff\r\n", 413),
    (IN_CHUNKS + b"1" * 9000, 400),
    (IN_CHUNKS + b"5;" + b"a" * 200_000, 400),
    (IN_CHUNKS + b"0\r\nContent-Length: 4\r\n\r\n", 400),
    (IN_CHUNKS + b"0\r\nno trailer\r\n\r\n", 400),
    (IN_CHUNKS + b"0\r\n" + b"a: b\r\n" * 20_000 + b"\r\n", 400),
    (IN_CHUNKS + b"1\r\n \r\n" * 2000, 413),
]


def check_broken_body(raw: bytes, status: int) -> None:
    found, framing = requests_in([GET + raw])
    assert found == [
        FramedRequest(GET, is_whole=True),
        FramedRequest(raw, is_whole=False, refusal=status),
    ]
    assert framing.kept_bytes == 0


def test_a_broken_body_is_refused_and_is_the_last() -> None:
    assert failures(check_broken_body, BROKEN_BODIES) == []


@pytest.mark.thorough
@given(st.integers(1, 200), st.integers(1, 3000), st.lists(st.integers(0, 400_000), max_size=5))
def test_the_number_of_chunks_is_bounded_by_their_payload(
    size: int, number: int, places: list[int]
) -> None:
    chunks = (b"%x\r\n" % size + b" " * size + b"\r\n") * number
    found, _ = requests_in(cut(IN_CHUNKS + chunks + b"0\r\n\r\n", places))
    accepted = all(
        some <= CHUNKS_ALLOWED + some * size // LEAST_CHUNK_BYTES for some in range(1, number + 1)
    )
    assert found[0].refusal == (None if accepted else 413)


class CountingPattern:
    """A pattern that counts how often it is used."""

    def __init__(self, pattern: re.Pattern[bytes]) -> None:
        self._pattern = pattern
        self.used = 0

    def fullmatch(self, line: bytes) -> re.Match[bytes] | None:
        self.used += 1
        return self._pattern.fullmatch(line)


def test_a_body_of_tiny_chunks_costs_a_bounded_number_of_steps(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    pattern = CountingPattern(framing_module._CHUNK_SIZE)
    monkeypatch.setattr(framing_module, "_CHUNK_SIZE", pattern)
    requests_in([IN_CHUNKS, *[b"1\r\n \r\n" * 100] * 1000])
    assert pattern.used < 1100


@given(
    st.lists(
        st.one_of(
            st.sampled_from(
                [b"5\r\nhello\r\n", b"0005;a=b\r\nhello\r\n", b'5 ; a="\\b"\r\nhello\r\n']
            ),
            st.sampled_from([b"0\r\n", b"a: b\r\n", b"Host: a\r\n", b"a_b: c\r\n", b"\r\n", b"\n"]),
            st.binary(max_size=8),
        ),
        max_size=8,
    )
)
def test_the_parser_reads_every_body_that_is_not_refused(parts: list[bytes]) -> None:
    found, _ = requests_in(
        [b"POST / HTTP/1.1\r\nHost: a\r\nTransfer-Encoding: chunked\r\n\r\n" + b"".join(parts)]
    )
    for request in found[:1]:
        if request.refusal is None:
            parsed = next(get_parser(Config(), [request.raw], ("127.0.0.1", 1)))
            assert set(parsed.body.read()) <= set(b"".join(parts))


@given(st.binary(max_size=400), st.lists(st.integers(0, 400), max_size=5))
def test_any_bytes_are_framed_and_none_are_lost(tail: bytes, places: list[int]) -> None:
    stream = CHUNKED[:70] + tail
    found, framing = requests_in(cut(stream, places))
    assert sum(len(request.raw) for request in found) + framing.kept_bytes == len(stream)


def test_a_body_without_end_is_not_kept() -> None:
    framing = RequestFraming()
    framing.feed(b"POST / HTTP/1.1\r\nHost: a\r\nTransfer-Encoding: chunked\r\n\r\n")
    fed = 0
    while framing.stage is not Stage.READY:
        framing.feed(b"10000\r\n" + b"x" * 0x10000 + b"\r\n")
        fed += 0x10000
        assert fed < 2 * MAXIMUM_BODY_BYTES
    assert not framing.take().is_whole


@pytest.mark.parametrize(("version", "wants"), [(b"HTTP/1.1", True), (b"HTTP/1.0", False)])
def test_expect_100_continue_is_recognized(version: bytes, *, wants: bool) -> None:
    framing = RequestFraming()
    framing.feed(
        b"POST / %b\r\nHost: a\r\nContent-Length: 5\r\nExpect: 100-Continue\r\n\r\n" % version
    )
    assert framing.wants_continue == wants


@pytest.mark.parametrize(
    ("raw", "lane"),
    [
        (b"POST /events/ HTTP/1.1\r\n", Lane.URGENT),
        (b"POST /event HTTP/1.1\r\n", Lane.URGENT),
        (b"DELETE /events/7 HTTP/1.1\r\n", Lane.URGENT),
        (b"GET /events/ HTTP/1.1\r\n", Lane.GENERAL),
        (b"POST /eventful HTTP/1.1\r\n", Lane.GENERAL),
        (b"GET /broker/commands?after=0&wait=25 HTTP/1.1\r\n", Lane.BROKER),
        (b"POST /plans/ HTTP/1.1\r\n", Lane.GENERAL),
        (b"\xff\xfe", Lane.GENERAL),
    ],
)
def test_events_and_the_broker_have_threads_of_their_own(raw: bytes, lane: Lane) -> None:
    assert lane_of(raw, lambda _key: True) is lane


SESSION = b"fs_01234567_" + b"a" * 64


@pytest.mark.parametrize(
    "field",
    [
        b"Cookie: session=" + SESSION,
        b"cookie:session=" + SESSION,
        b"Cookie: theme=dark; session=" + SESSION + b"; language=es",
    ],
)
def test_an_abort_of_a_person_who_is_signed_in_is_urgent(field: bytes) -> None:
    raw = b"POST /events/ HTTP/1.1\r\n" + field + b"\r\n\r\n"
    assert lane_of(raw, lambda secret: secret == SESSION.decode()) is Lane.URGENT
    assert lane_of(raw, lambda _secret: False) is Lane.GENERAL
    other = raw.replace(b"session=", b"another_session=")
    assert lane_of(other, bool) is Lane.GENERAL


@pytest.mark.parametrize(
    ("field", "lane"),
    [
        (b"Authorization: Bearer ours", Lane.URGENT),
        (b"AUTHORIZATION:bearer  ours ", Lane.URGENT),
        (b"X-API-Key: ours", Lane.URGENT),
        (b"X-API-Key: ours\r\nAuthorization: Bearer theirs", Lane.GENERAL),
        (b"Authorization: Basic b3Vycw==", Lane.GENERAL),
        (b"X-Api-Key: theirs", Lane.GENERAL),
        (b"Host: edge\r\n\r\nX-API-Key: ours", Lane.GENERAL),
        (b"Host: edge", Lane.GENERAL),
    ],
)
def test_a_request_without_a_known_key_uses_the_general_threads(field: bytes, lane: Lane) -> None:
    raw = b"POST /events/ HTTP/1.1\r\nContent-Length: 40\r\n" + field + b"\r\n\r\n{}"
    assert lane_of(raw, lambda key: key == "ours") is lane
