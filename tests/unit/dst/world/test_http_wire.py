"""The simulated socket under the real clients, and what they make of an answer cut at any byte."""

from pathlib import Path

import pytest
from requests import RequestException

from dst.world import http_wire
from edge_server.config import Config
from edge_server.outbox.answers import Outcome, Unreachable, classify
from edge_server.outbox.queue import OutboxRecord, Stream
from edge_server.uplinks.cloud_http import HttpUplink
from mavlink_broker.edge.bounded_http import Answer, BoundedHttp

BODY = b'{"id": 7, "state": "queued"}'
WHOLE = http_wire.answer_bytes(201, BODY)
RECORD = OutboxRecord(
    outbox_id=1, record_id=1, stream=Stream(1, "pose"), message_id="01K9", payload="{}", attempts=0
)


def read(data: bytes, *, is_reset: bool = False) -> Answer:
    with http_wire.serving(lambda _request: (data, is_reset)), BoundedHttp() as http:
        return http.exchange(
            "GET", "http://edge/", within_s=60.0, timeouts_s=(1.0, 1.0), max_bytes=1000
        )


def test_a_whole_answer_arrives() -> None:
    assert read(WHOLE) == Answer(201, BODY)


@pytest.mark.parametrize("is_reset", [False, True])
def test_the_broker_takes_no_answer_that_is_cut_off_for_one_of_the_edge_server(
    is_reset: bool,
) -> None:
    for length in range(len(WHOLE)):
        with pytest.raises(RequestException):
            read(WHOLE[:length], is_reset=is_reset).json()


@pytest.mark.parametrize("is_reset", [False, True])
def test_the_relay_takes_no_answer_that_is_cut_off_for_a_confirmation(
    is_reset: bool, tmp_path: Path
) -> None:
    uplink = HttpUplink(Config(state_dir=tmp_path))
    whole = http_wire.answer_bytes(200, b"{}")
    for length in range(len(whole)):
        cut = whole[:length]
        with http_wire.serving(lambda _request, cut=cut: (cut, is_reset)):  # type: ignore[misc]
            [reply] = uplink.send([RECORD])
        assert isinstance(reply, Unreachable), cut
    with http_wire.serving(lambda _request: (whole, False)):
        [reply] = uplink.send([RECORD])
    assert classify(reply).outcome is Outcome.CONFIRMED
    uplink.close()
