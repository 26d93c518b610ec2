"""Metrics."""

import fcntl
import os
import time
from dataclasses import replace
from threading import Event

import pytest
from prometheus_client.parser import text_string_to_metric_families

from edge_server.outbox.answers import Answer, Unreachable, classify
from edge_server.outbox.counts import RelayCounts, UplinkState
from edge_server.outbox.queue import OutboxRecord, Stream
from edge_server.process import relay
from edge_server.process.relay import LockedError, StateFolderLock, take_lock
from edge_server.services.errors import FullError
from edge_server.store.files.tally import Tally
from tests.support.system import wait_for
from tests.unit.edge_server.conftest import Edge
from tests.unit.edge_server.documents import TELEMETRY, telemetry

Page = dict[tuple[str, frozenset[tuple[str, str]]], float]
NAMES = {
    "fm_outbox_depth",
    "fm_outbox_oldest_seconds",
    "fm_delivered",
    "fm_retries",
    "fm_dead_letters",
    "fm_uplink_state",
    "fm_dropped",
    "fm_delivery_seconds",
    "fm_db_bytes",
    "fm_disk_free_bytes",
    "fm_ingest_rejected",
}


def read_page(edge: Edge) -> Page:
    answer = edge.ask("GET", "/metrics", "operator")
    assert answer.status_code == 200
    assert answer.content_type.startswith("text/plain")
    return {
        (sample.name, frozenset(sample.labels.items())): sample.value
        for family in text_string_to_metric_families(answer.text)
        for sample in family.samples
    }


def value(page: Page, name: str, **labels: str) -> float | None:
    return page.get((name, frozenset(labels.items())))


def counts_of(edge: Edge) -> RelayCounts:
    """Count as the relay does."""
    return RelayCounts(Tally(edge.config.relay_tally_path))


def record(edge: Edge, kind: str) -> OutboxRecord:
    made = edge.report(kind, telemetry(kind)).json
    assert made is not None
    return OutboxRecord(1, made["id"], made["message_id"], Stream(1, kind), "{}", 0)


def test_all_documented_metrics_are_present(edge: Edge) -> None:
    text = edge.ask("GET", "/metrics", "admin").text
    assert {family.name for family in text_string_to_metric_families(text)} >= NAMES


def test_the_depth_follows_what_waits(edge: Edge) -> None:
    for number, kind in enumerate(TELEMETRY, start=1):
        for sequence_number in range(number):
            edge.report(kind, telemetry(kind, sequence_number))
    edge.clock.pass_s(90.0)
    page = read_page(edge)
    for number, kind in enumerate(TELEMETRY, start=1):
        assert value(page, "fm_outbox_depth", kind=kind) == number
    assert value(page, "fm_outbox_oldest_seconds") == 90.0


def test_an_empty_outbox_has_no_age(edge: Edge) -> None:
    page = read_page(edge)
    assert value(page, "fm_outbox_oldest_seconds") == 0.0
    assert value(page, "fm_outbox_depth", kind="alarm") == 0.0


def test_what_the_relay_has_counted_is_on_the_page(edge: Edge) -> None:
    counts = counts_of(edge)
    received_at = edge.clock.now
    for _ in range(3):
        sent = record(edge, "pose")
        counts.count(sent, classify(Answer(200)), received_at)
    counts.count(sent, classify(Answer(503)), received_at)
    counts.count(sent, classify(Unreachable("refused")), received_at)
    counts.count(record(edge, "alarm"), classify(Answer(422)), received_at)
    page = read_page(edge)
    assert value(page, "fm_delivered_total", kind="pose") == 3.0
    assert value(page, "fm_retries_total", reason="try_later_503") == 1.0
    assert value(page, "fm_retries_total", reason="no_cloud") == 1.0
    assert value(page, "fm_rejected_total", kind="alarm", status="422") == 1.0
    assert value(page, "fm_delivery_seconds_count") == 3.0
    assert value(page, "fm_delivery_seconds_bucket", le="+Inf") == 3.0


def test_the_state_of_the_uplink_is_the_relays_while_there_is_one(edge: Edge) -> None:
    counts_of(edge).set_uplink(UplinkState.BLOCKED)
    assert value(read_page(edge), "fm_uplink_state") == UplinkState.STOPPED
    lock = take_lock(edge.config.relay_lock_path, 0.0)
    assert value(read_page(edge), "fm_uplink_state") == UplinkState.BLOCKED
    counts_of(edge).set_uplink(UplinkState.OPEN)
    assert value(read_page(edge), "fm_uplink_state") == UplinkState.OPEN
    os.close(lock)
    assert value(read_page(edge), "fm_uplink_state") == UplinkState.STOPPED


def test_reading_the_lock_does_not_block_a_relay(
    edge: Edge, monkeypatch: pytest.MonkeyPatch
) -> None:
    counts_of(edge).set_uplink(UplinkState.OPEN)
    edge.config.relay_lock_path.touch()
    look = edge.config.relay_lock_path.open("rb")
    fcntl.flock(look, fcntl.LOCK_SH)
    monkeypatch.setattr(time, "sleep", lambda _: look.close())  # It ends while the relay waits
    shared = replace(edge.config, database_url="postgresql+psycopg://somewhere/edge")
    lock = StateFolderLock(shared)
    monkeypatch.undo()
    assert lock.is_held
    assert value(read_page(edge), "fm_uplink_state") == UplinkState.OPEN
    lock.close()


def test_of_two_relays_on_a_shared_database_the_survivor_is_seen(
    edge: Edge, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(relay, "SHARED_PATIENCE_S", 0.0)
    monkeypatch.setattr(relay, "RETAKE_S", 0.01)
    counts_of(edge).set_uplink(UplinkState.OPEN)
    shared = replace(edge.config, database_url="postgresql+psycopg://somewhere/edge")
    first, second = StateFolderLock(shared), StateFolderLock(shared)
    assert (first.is_held, second.is_held, second.try_again()) == (True, False, False)
    stopping = Event()
    second.keep_trying(stopping)
    first.close()
    wait_for(lambda: second.is_held, "the survivor's lock")
    assert value(read_page(edge), "fm_uplink_state") == UplinkState.OPEN
    second.close()
    assert not second.try_again()  # What has ended takes nothing any more
    assert value(read_page(edge), "fm_uplink_state") == UplinkState.STOPPED


def test_two_relays_on_a_file_are_one_too_many(edge: Edge, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(relay, "LOCK_PATIENCE_S", 0.0)
    lock = StateFolderLock(edge.config)
    with pytest.raises(LockedError, match="another relay runs on this state folder"):
        StateFolderLock(edge.config)
    lock.close()


def test_requests_are_counted_by_route_and_status(edge: Edge) -> None:
    for _ in range(2):
        edge.report("pose", telemetry("pose"))
    edge.report("pose", {"sequence_number": -1})
    edge.ask("GET", "/poses/12345", "operator")
    edge.ask("GET", "/nothing", "operator")
    page = read_page(edge)
    requests = "fm_http_requests_total"
    assert value(page, requests, method="POST", route="/pose/", status="201") == 2.0
    assert value(page, requests, method="POST", route="/pose/", status="422") == 1.0
    one = "/pose/<int64:record_id>/"
    assert value(page, requests, method="GET", route=one, status="404") == 1.0
    assert value(page, requests, method="GET", route="(none)", status="404") == 1.0
    seconds = "fm_http_request_seconds_count"
    assert value(page, seconds, method="POST", route="/pose/") == 3.0


@pytest.mark.thorough
def test_reports_that_are_not_taken_are_counted(edge: Edge) -> None:
    edge.report("pose", {"sequence_number": -1})
    edge.ask("POST", "/pose/", None, json=telemetry("pose"))
    bulk = {"records": [{"pose": {}}, {"pose": telemetry("pose")}, {"alarm": {}}]}
    edge.post("/telemetry/", bulk, "broker")
    edge.post("/plans/", {}, "operator")
    page = read_page(edge)
    assert value(page, "fm_ingest_rejected_total", code="422") == 3.0
    assert value(page, "fm_ingest_rejected_total", code="401") == 1.0


def test_what_a_bulk_refuses_is_counted_by_its_own_status(
    edge: Edge, monkeypatch: pytest.MonkeyPatch
) -> None:
    def admit(kind: str, _picture_bytes: int = 0) -> None:
        if kind == "pose":
            raise FullError("the disk budget is used up")

    monkeypatch.setattr(edge.context.space, "admit", admit)
    records = [{"pose": telemetry("pose")}, {"pose": telemetry("pose", 1)}, {"alarm": {}}]
    edge.post("/telemetry/", {"records": [*records, {"alarm": telemetry("alarm")}]}, "broker")
    page = read_page(edge)
    assert value(page, "fm_ingest_rejected_total", code="507") == 2.0
    assert value(page, "fm_ingest_rejected_total", code="422") == 1.0
