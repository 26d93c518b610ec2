"""An answer that is cut off, stalled, endless or malformed at any byte leads to a retry."""

import json
import queue
import random
import threading
from collections.abc import Callable, Iterator, Sequence

import pytest

from edge_server.config import Config
from edge_server.outbox.answers import Outcome, Reply, classify
from edge_server.outbox.queue import OutboxRecord, Stream
from edge_server.uplinks.bounded_http import MAXIMUM_RAW_BYTES
from edge_server.uplinks.cloud_http import HttpUplink
from tests.support import scripted_answers
from tests.support.scripted_answers import ScriptedAnswers, WriteAnswer

READ_TIMEOUT_S = 0.1
RECORDS = [
    OutboxRecord(number, number, f"{number:026d}", Stream(number, "pose"), "{}", 0)
    for number in (1, 2)
]
RESULTS = json.dumps(
    {"results": [{"message_id": one.message_id, "status": 200} for one in RECORDS]}
).encode()
HEAD = b"HTTP/1.1 200 OK\r\nServer: cloud\r\nContent-Type: application/json\r\n"


def sized(body: bytes) -> bytes:
    return HEAD + b"Content-Length: %d\r\n\r\n%b" % (len(body), body)


def chunked(body: bytes) -> bytes:
    half = len(body) // 2
    parts = [body[:half], body[half:]]
    chunks = b"".join(b"%x\r\n%b\r\n" % (len(part), part) for part in parts if part)
    return HEAD + b"Transfer-Encoding: chunked\r\n\r\n" + chunks + b"0\r\n\r\n"


def until_the_end(body: bytes) -> bytes:
    return HEAD + b"\r\n" + body


ONE = b'{"stored": true}'
ANSWERS = {
    "a length": (sized(ONE), RECORDS[:1]),
    "chunks": (chunked(ONE), RECORDS[:1]),
    "no length": (until_the_end(ONE), RECORDS[:1]),
    "a batch in chunks": (chunked(RESULTS), RECORDS),
}


@pytest.fixture(scope="module")
def server() -> Iterator[ScriptedAnswers]:
    """A server for all tests of this file."""
    with scripted_answers.scripted_answers() as running:
        yield running


@pytest.fixture(scope="module")
def uplink(server: ScriptedAnswers) -> Iterator[HttpUplink]:
    """One client for all of them: what one answer did to it, the next one shows."""
    made = HttpUplink(
        Config(cloud_url=server.url, connect_timeout_s=5.0, read_timeout_s=READ_TIMEOUT_S)
    )
    yield made
    made.close()


def outcomes(
    server: ScriptedAnswers, uplink: HttpUplink, speak: WriteAnswer, records: Sequence[OutboxRecord]
) -> list[Outcome]:
    server.write_answer = speak
    replies: list[Reply] = uplink.send(records)
    assert len(replies) == len(records)
    return [classify(reply).outcome for reply in replies]


@pytest.mark.first_case
@pytest.mark.parametrize("end", [scripted_answers.cut, scripted_answers.reset])
@pytest.mark.parametrize("name", ANSWERS)
def test_an_answer_cut_at_any_byte_is_retried(
    server: ScriptedAnswers,
    uplink: HttpUplink,
    name: str,
    end: Callable[[bytes], WriteAnswer],
) -> None:
    answer, records = ANSWERS[name]
    needed = len(answer) - (2 if name.endswith("chunks") else 0)
    for length in range(len(answer)):
        found = outcomes(server, uplink, end(answer[:length]), records)
        if length < needed:
            assert set(found) == {Outcome.NO_CLOUD}, answer[:length]
        else:  # Only the line break behind the last chunk is missing
            assert set(found) <= {Outcome.NO_CLOUD, Outcome.CONFIRMED}, answer[:length]
    whole = outcomes(server, uplink, scripted_answers.cut(answer), records)
    assert set(whole) == {Outcome.CONFIRMED}


@pytest.mark.first_case
@pytest.mark.parametrize("name", ANSWERS)
def test_an_answer_that_stalls_at_any_byte_is_retried(
    server: ScriptedAnswers, uplink: HttpUplink, name: str
) -> None:
    answer, records = ANSWERS[name]
    draw = random.Random(name)
    for length in (0, 9, *draw.sample(range(len(answer) - 5), 4)):
        gone: queue.SimpleQueue[bool] = queue.SimpleQueue()
        found = outcomes(server, uplink, scripted_answers.stall(answer[:length], gone.put), records)
        assert set(found) == {Outcome.NO_CLOUD}, answer[:length]
        assert gone.get(timeout=60.0), answer[:length]


CHUNKED = HEAD + b"Transfer-Encoding: chunked\r\n\r\n"


@pytest.mark.parametrize(
    "answer",
    [
        CHUNKED + b"zz\r\n{}\r\n0\r\n\r\n",
        CHUNKED + b"-2\r\n{}\r\n0\r\n\r\n",
        CHUNKED + b"\r\n{}\r\n0\r\n\r\n",
        CHUNKED + b"1" * 100 + b"\r\n{}\r\n0\r\n\r\n",
        CHUNKED + b"2\r\n{}0\r\n\r\n",
        HEAD + b"Content-Length: 3\r\nContent-Length: 2\r\n\r\n{}",
        HEAD + b"Content-Length: 1000000000000\r\n\r\n{}",
        HEAD + b"Content-Length: -5\r\n\r\n{}",
        HEAD + b"Content-Length: abc\r\n\r\n{}",
        HEAD + b"Content-Length: \r\n\r\n{}",
        HEAD + b'Content-Length: 1_0\r\n\r\n{"a":1234}',
        HEAD + b"this is no header\r\nContent-Length: 2\r\n\r\n{}",
        HEAD + b"X-Cut\r\n\r\n{}",
        HEAD + b"X-Id: a\0b\r\nContent-Length: 2\r\n\r\n{}",
        HEAD + b"X\0Id: a\r\nContent-Length: 2\r\n\r\n{}",
        HEAD + b"Content-Encoding: gzip\r\nContent-Length: 2\r\n\r\n{}",
        HEAD + b"Content-Length: 3\r\n\r\nNaN",
        HEAD + b"Content-Encoding: gzip\r\nContent-Length: 2\r\n\r\n\x1f\x8b",
        HEAD + b"\xff\xfe: \x00\r\n" * 200 + b"\r\n",
        b"HTTP/1.1 200 OK\r\n" + b"X: y\r\n" * 300 + b"\r\n",
        b"HTTP/1.1 99999 OK\r\n\r\n",
        b"HTTP/1.1 abc\r\n\r\n",
        b"SSH-2.0-OpenSSH_9.2\r\n",
        b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03",
        sized(b'{"results": 1}') + b"and more that belongs to nothing",
    ],
)
def test_a_malformed_answer_is_retried(
    server: ScriptedAnswers, uplink: HttpUplink, answer: bytes
) -> None:
    found = outcomes(server, uplink, scripted_answers.cut(answer), RECORDS[:1])
    assert found in ([Outcome.NO_CLOUD], [Outcome.CONFIRMED])
    assert (found == [Outcome.CONFIRMED]) == answer.startswith(sized(b'{"results": 1}'))
    whole = outcomes(server, uplink, scripted_answers.cut(sized(ONE)), RECORDS[:1])
    assert whole == [Outcome.CONFIRMED]


def test_random_bytes_are_retried(server: ScriptedAnswers, uplink: HttpUplink) -> None:
    draw = random.Random(12)
    for _ in range(200):
        answer = bytearray(draw.choice([sized(ONE), chunked(ONE), until_the_end(ONE)]))
        for _ in range(draw.randrange(1, 6)):
            answer[draw.randrange(len(answer))] = draw.randrange(256)
        found = outcomes(server, uplink, scripted_answers.cut(bytes(answer)), RECORDS[:1])
        assert found[0] in set(Outcome)


@pytest.mark.parametrize(
    ("answer", "forever"),
    [
        (b"", b"HTTP/1.1 100 Continue\r\n\r\n"),
        (b"HTTP/1.1 200 OK\r\n", b"X"),
        (HEAD + b"\r\n", b" "),
        (HEAD + b"Content-Length: 60000\r\n\r\n", b" "),
        (CHUNKED, b"1\r\n \r\n"),
        (CHUNKED + b"1;", b"x"),
    ],
)
def test_an_endless_answer_times_out(
    server: ScriptedAnswers, uplink: HttpUplink, answer: bytes, forever: bytes
) -> None:
    enough = threading.Event()
    threading.Timer(20.0, enough.set).start()
    server_had = server.requests
    found = outcomes(server, uplink, scripted_answers.drip(answer, forever, enough), RECORDS[:1])
    assert found == [Outcome.NO_CLOUD]
    assert not enough.is_set()
    assert server.requests == server_had + 1


@pytest.mark.parametrize("start", [CHUNKED + b"1;", CHUNKED + b"2\r\n{}\r\n0\r\n", HEAD + b"\r\n"])
def test_a_large_answer_is_not_stored(
    server: ScriptedAnswers, uplink: HttpUplink, start: bytes
) -> None:
    flood = start + b"x" * (4 * MAXIMUM_RAW_BYTES)
    assert outcomes(server, uplink, scripted_answers.cut(flood), RECORDS[:1]) == [Outcome.NO_CLOUD]


@pytest.mark.thorough
def test_a_large_record_has_its_timeout_for_each_piece(server: ScriptedAnswers) -> None:
    """A picture over a slow link takes longer than any timeout of ours, and arrives."""
    frame = "A" * 10_000_000  # More than the kernel's buffers take at once
    picture = OutboxRecord(3, 3, f"{3:026d}", Stream(1, "image"), f'{{"frame":"{frame}"}}', 0)
    uplink = HttpUplink(Config(cloud_url=server.url, connect_timeout_s=0.3, read_timeout_s=5.0))
    server.read_pause_s = 0.01
    found = outcomes(server, uplink, scripted_answers.cut(sized(ONE)), [picture])
    server.read_pause_s = 0.0
    uplink.close()
    assert found == [Outcome.CONFIRMED]
