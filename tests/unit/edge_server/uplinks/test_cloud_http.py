"""The cloud over real sockets: what it does becomes an answer or a reason."""

from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

import pytest

from edge_server.config import Config
from edge_server.outbox.answers import Answer, Outcome, Reply, Unreachable, classify
from edge_server.outbox.queue import OutboxRecord, Stream
from edge_server.outbox.uplink import ONE_BY_ONE
from edge_server.uplinks import batches
from edge_server.uplinks.cloud_http import (
    HttpUplink,
    read_accept_batch,
    retry_after_s,
)
from tests.support import fake_cloud
from tests.support.fake_cloud import FakeCloud, Fault, Handler, Received, running_cloud
from tests.support.mock_cloud import running_mock_cloud
from tests.support.system import free_ports

NOW = datetime(2026, 11, 21, 12, 0, 0, tzinfo=UTC)
PAYLOAD = '{"sequence_number":0,"vehicle_id":1,"name":"Äcker"}'
RECORD = OutboxRecord(1, 1, "01K9Z4T1W8F6Q2M3N5P7R9S0VX", Stream(1, "pose"), PAYLOAD, 0)


@pytest.fixture
def cloud() -> Iterator[FakeCloud]:
    """A cloud that runs."""
    with running_cloud() as running:
        yield running


def deliver(url: str, key_file: Path | None = None) -> Reply:
    config = Config(
        cloud_url=url, connect_timeout_s=1.0, read_timeout_s=0.3, cloud_key_file=key_file
    )
    port = HttpUplink(config)
    try:
        return port.send([RECORD])[0]
    finally:
        port.close()


def test_a_record_is_posted_bare_under_its_key(cloud: FakeCloud) -> None:
    answer = deliver(cloud.url)
    assert isinstance(answer, Answer)
    assert (answer.status, answer.content_type) == (200, "application/json")
    (received,) = cloud.store.kept
    assert received.path == "/pose"
    assert received.key == RECORD.message_id
    assert received.body["name"] == "Äcker"
    assert received.headers["Content-Type"] == "application/json"


def too_long(handler: Handler, _: Received) -> None:
    handler.answer(200, b" " * 100_000)


def never(handler: Handler, received: Received) -> None:
    handler.connection.settimeout(2.0)
    assert handler.rfile.read(1) == b""
    handler.close_connection = True
    handler.store.keep(received)


@pytest.mark.parametrize("fault", [fake_cloud.lose_record, fake_cloud.lose_answer, too_long, never])
def test_no_proper_answer_is_a_reason(cloud: FakeCloud, fault: Fault) -> None:
    cloud.store.always = fault
    reply = deliver(cloud.url)
    assert isinstance(reply, Unreachable)
    assert reply.reason


def test_nobody_there_is_a_reason() -> None:
    assert isinstance(deliver(f"http://127.0.0.1:{free_ports(1)[0]}"), Unreachable)


def test_a_redirect_is_an_answer_not_a_way(cloud: FakeCloud) -> None:
    location = {"Location": f"{cloud.url}/elsewhere"}
    cloud.store.faults.append(fake_cloud.status(302, location))
    reply = deliver(cloud.url)
    assert isinstance(reply, Answer)
    assert reply.status == 302
    assert len(cloud.store.seen) == 1


@pytest.mark.parametrize(
    ("header", "seconds"),
    [
        (None, None),
        ("7", 7.0),
        (" 120 ", 120.0),
        ("Sat, 21 Nov 2026 12:00:30 GMT", 30.0),
        ("Sat, 21 Nov 2026 11:00:00 GMT", 0.0),
        ("soon", None),
        ("-5", None),
        ("1.5", None),
        ("²", None),
    ],
)
def test_retry_after_is_read_as_seconds_or_date(header: str | None, seconds: float | None) -> None:
    assert retry_after_s(header, NOW) == seconds


def test_the_clouds_wish_is_in_the_answer(cloud: FakeCloud) -> None:
    cloud.store.always = fake_cloud.status(503, {"Retry-After": "9"})
    reply = deliver(cloud.url)
    assert isinstance(reply, Answer)
    assert (reply.status, reply.retry_after_s) == (503, 9.0)


def records(*kinds: str) -> list[OutboxRecord]:
    """Records of vehicle 1, numbered from 1."""
    found = []
    for number, kind in enumerate(kinds, start=1):
        key = f"{number:026d}"
        payload = f'{{"vehicle_id":1,"sequence_number":{number},"message_id":"{key}"}}'
        found.append(OutboxRecord(number, number, key, Stream(1, kind), payload, 0))
    return found


def test_records_go_together_once_the_cloud_has_offered_it() -> None:
    with running_mock_cloud(batch_records=50) as cloud:
        uplink = HttpUplink(Config(cloud_url=cloud.url))
        assert uplink.batch_limit() == ONE_BY_ONE
        first, *others = records("pose", "pose", "alarm", "gap")
        uplink.send([first])
        assert uplink.batch_limit().records == 50
        replies = uplink.send(others)
        assert [classify(reply).outcome for reply in replies] == [Outcome.CONFIRMED] * 3
        assert cloud.requests == ["/pose", "/batch"]
        kept = cloud.store.records()
        assert [(record.kind, record.body["sequence_number"]) for record in kept] == [
            ("pose", 1),
            ("pose", 2),
            ("alarm", 3),
            ("gap", 4),
        ]
        uplink.close()


def test_a_batch_that_is_refused_goes_one_by_one_and_none_is_tried_for_a_while() -> None:
    now = [0.0]
    with running_mock_cloud(batch_records=2) as cloud:
        uplink = HttpUplink(Config(cloud_url=cloud.url), monotonic=lambda: now[0])
        sent = records("pose", "pose", "alarm")
        replies = uplink.send(sent)
        assert [classify(reply).outcome for reply in replies] == [Outcome.CONFIRMED] * 3
        assert cloud.requests == ["/batch", "/pose", "/pose", "/alarm"]
        assert uplink.batch_limit() == ONE_BY_ONE
        now[0] = batches.NO_BATCHES_S
        assert uplink.batch_limit().records == 2
        uplink.close()


def test_one_by_one_a_stream_waits_behind_its_failure_and_the_others_go_on(
    cloud: FakeCloud,
) -> None:
    cloud.store.faults.extend([fake_cloud.status(404), fake_cloud.status(503)])
    uplink = HttpUplink(Config(cloud_url=cloud.url))
    outcomes = [
        classify(reply).outcome for reply in uplink.send(records("pose", "pose", "alarm", "pose"))
    ]
    held_back = Outcome.HELD_BACK
    assert outcomes == [Outcome.TRY_LATER, held_back, Outcome.CONFIRMED, held_back]
    assert [received.path for received in cloud.store.kept] == ["/alarm"]
    uplink.close()


def test_one_by_one_nobody_is_asked_again_when_nobody_is_there() -> None:
    uplink = HttpUplink(Config(cloud_url=f"http://127.0.0.1:{free_ports(1)[0]}"))
    replies = uplink.send(records("pose", "alarm"))
    assert all(isinstance(reply, Unreachable) for reply in replies)


@pytest.mark.parametrize(
    ("header", "records"),
    [(None, 1), ("", 1), ("0", 1), ("1", 1), ("2", 2), (" 100 ", 100), ("5000", 100)]
    + [(text, 1) for text in ("-5", "1.5", "many", "²", "9" * 30)],
)
def test_an_offer_is_read_and_bounded(header: str | None, records: int) -> None:
    assert read_accept_batch(header).records == records
