"""Downloads from servers with unusual or wrong behaviour."""

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavlink_broker.mavlink.codec import Decoder, Encoder
from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.microservices.ftp_download import FileDownload
from mavlink_broker.microservices.ftp_requests import (
    Fetched,
    FetchOutcome,
    MissingRanges,
    NotFetched,
)
from tests.support.file_server import (
    BURST,
    CHECKSUM,
    OPEN,
    READ,
    RESET,
    TERMINATE,
    ScriptedFiles,
)
from tests.unit.mavlink_broker.microservices.harness import ROUTE, received

PATH = "/image/1.jpg"
CONTENTS = random.Random(7).randbytes(20_001)
FILES = {PATH: CONTENTS}


def fetch(
    server: ScriptedFiles, *, restart_after: int | None = None, limit_bytes: int = 10**6
) -> FetchOutcome:
    """Fetch in simulated time; the server is restarted after so many requests."""
    download = FileDownload(PATH, ROUTE, limit_bytes=limit_bytes)
    now, waiting = 0.0, download.start(0.0)
    while download.outcome is None:
        assert now < 600.0
        now += 0.02
        asked, waiting = waiting, []
        for message in asked:
            if restart_after is not None and len(server.asked) >= restart_after:
                restart_after = None
                server.restart()
            for answer in server.answers(on_the_wire(message)):
                waiting += download.receive(received(answer), now)
        waiting += download.tick(now)
    assert waiting == []
    return download.outcome


def on_the_wire(message: Message) -> Message:
    (decoded,) = Decoder().decode(Encoder(254, 191).encode(message))
    return decoded


def test_bursts_are_preferred_and_the_session_is_closed() -> None:
    server = ScriptedFiles(FILES)
    assert fetch(server) == Fetched(CONTENTS)
    assert READ not in server.asked
    assert server.asked[0] == OPEN
    assert server.asked[-2:] == [CHECKSUM, TERMINATE]


@pytest.mark.parametrize(
    "server",
    [
        ScriptedFiles(FILES, unknown=frozenset({BURST})),
        ScriptedFiles(FILES, silent=frozenset({BURST})),
        ScriptedFiles(FILES, unknown=frozenset({CHECKSUM})),
        ScriptedFiles(FILES, silent=frozenset({CHECKSUM})),
        ScriptedFiles(FILES, silent=frozenset({TERMINATE})),
        ScriptedFiles(FILES, piece=80, burst_packets=7),
        ScriptedFiles(FILES, busy_for=3),
        ScriptedFiles(FILES, busy_for=30),
        ScriptedFiles(FILES, wrong_checksums=2),
    ],
    ids=lambda server: f"{sorted(server.unknown | server.silent)} {server.piece} {server.busy_for}",
)
def test_every_kind_of_server_gives_its_file(server: ScriptedFiles) -> None:
    assert fetch(server) == Fetched(CONTENTS)


def test_other_sessions_are_closed_only_when_waiting_has_not_helped() -> None:
    patient, stuck = ScriptedFiles(FILES, busy_for=5), ScriptedFiles(FILES, busy_for=30)
    fetch(patient)
    fetch(stuck)
    assert RESET not in patient.asked
    assert stuck.asked.count(RESET) == 1


@given(st.integers(min_value=1, max_value=12))
def test_a_restart_at_any_request_loses_nothing(after: int) -> None:
    assert fetch(ScriptedFiles(FILES, burst_packets=9), restart_after=after) == Fetched(CONTENTS)


def test_what_never_agrees_with_its_checksum_is_not_taken() -> None:
    outcome = fetch(ScriptedFiles(FILES, wrong_checksums=99))
    assert outcome == NotFetched("the checksum of the received file is wrong")


def test_a_silent_server_is_given_up() -> None:
    server = ScriptedFiles(FILES, silent=frozenset({OPEN}))
    assert fetch(server) == NotFetched("the vehicle does not answer")


@pytest.mark.parametrize(
    ("server", "reason"),
    [
        (ScriptedFiles({}), "the vehicle answers: file not found"),
        (ScriptedFiles({PATH: b""}), "it is empty"),
        (ScriptedFiles(FILES, sends_nothing=True), "the vehicle sends no data of it"),
        (ScriptedFiles(FILES, unknown=frozenset({OPEN})), "the vehicle answers: unknown command"),
    ],
)
def test_a_failed_download_has_its_reason(server: ScriptedFiles, reason: str) -> None:
    assert fetch(server) == NotFetched(reason)


def test_a_session_that_was_not_opened_is_not_closed() -> None:
    server = ScriptedFiles({})
    fetch(server)
    assert server.asked == [OPEN]


def test_a_file_that_is_still_being_written_is_opened_again() -> None:
    class Growing(ScriptedFiles):
        def _checksum(self, contents: bytes) -> int:
            self.files = FILES
            return super()._checksum(contents)

    server = Growing({PATH: CONTENTS[:9_000]}, wrong_checksums=1)
    assert isinstance(fetch(server), Fetched)


def test_nothing_is_requested_while_paused() -> None:
    download = FileDownload(PATH, ROUTE, limit_bytes=10**6)
    server = ScriptedFiles(FILES)
    download.is_paused = True
    (opening,) = download.start(0.0)
    (opened,) = server.answers(on_the_wire(opening))
    assert download.receive(received(opened), 0.1) == []
    assert download.tick(100.0) == []
    download.is_paused = False
    assert len(download.tick(100.1)) == 1


@given(st.binary(min_size=251, max_size=251))
def test_hostile_answers_are_survived(payload: bytes) -> None:
    download = FileDownload(PATH, ROUTE, limit_bytes=10**6)
    (opening,) = download.start(0.0)
    (opened,) = ScriptedFiles(FILES).answers(on_the_wire(opening))
    download.receive(received(opened), 0.1)
    for number in range(4):
        hostile = bytes([number, 0, 3, 128 + number % 2]) + payload[4:]
        message = mavlink.MAVLink_file_transfer_protocol_message(0, 254, 191, hostile)
        download.receive(received(message), 0.2)
        download.tick(0.3)


@pytest.mark.thorough
@given(st.lists(st.tuples(st.integers(0, 60), st.integers(0, 20))))
def test_ranges_know_what_is_missing(arrivals: list[tuple[int, int]]) -> None:
    ranges, missing = MissingRanges(50), set(range(50))
    for begin, size in arrivals:
        news = missing & set(range(begin, begin + size))
        assert ranges.remove(begin, begin + size) is bool(news)
        missing -= news
        expected = {
            at for offset, count in ranges.pieces(7) for at in range(offset, offset + count)
        }
        assert expected == missing
        assert ranges.count == len(missing)
