"""The same promises over HTTP and over MQTT: one set of tests, a real Mosquitto.

What only MQTT has (reason codes, sessions, presence, sizes) is in `test_mqtt_broker.py`.
"""

import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from edge_server.process.preparation import prepare
from tests.support import fake_cloud
from tests.support.cloud_links import CloudLink, cloud_link
from tests.support.fake_cloud import Fault, Handler, Received
from tests.support.polling import PATIENCE_S, wait_until
from tests.support.station import Station, station_config
from tests.unit.edge_server import documents

POSES = range(12)


@pytest.fixture(params=["http", "mqtt"])
def link(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[CloudLink]:
    """A running cloud and the link to it."""
    with cloud_link(request.param, tmp_path / "broker") as opened:
        yield opened


@pytest.fixture
def station(link: CloudLink, tmp_path: Path) -> Iterator[Station]:
    """A station that has not begun to relay."""
    config = station_config(tmp_path / "state", link.url)
    prepare(config)
    station = Station(config)
    yield station
    station.close()


def effect(link: CloudLink) -> list[int]:
    """Sequence numbers of the poses of vehicle 1, as the cloud holds them."""
    return link.store.stream(1, "pose")


@pytest.mark.first_case
@pytest.mark.promise
def test_every_kind_reaches_the_cloud_and_is_deleted_here(
    link: CloudLink, station: Station
) -> None:
    for kind in documents.TELEMETRY:
        station.ingest(kind, 7)
    station.relay()
    station.wait_empty()
    assert station.rows("telemetry") == 0
    assert station.rows("tombstone") == len(documents.TELEMETRY)
    assert {received.path for received in link.store.kept} == {
        f"/{kind}" for kind in documents.TELEMETRY
    }
    for received in link.store.kept:
        sent = documents.telemetry(received.path.strip("/"), 7)
        assert received.headers["Idempotency-Key"] == received.body["message_id"]
        assert received.headers["Content-Type"] == "application/json"
        assert {name: received.body[name] for name in sent} == sent


def test_nothing_is_lost_and_the_order_holds_over_outages(
    link: CloudLink, station: Station
) -> None:
    station.relay()
    station.ingest("pose", *range(5))
    link.store.wait_for(5, PATIENCE_S)
    for first in (5, 15, 25):
        link.cut()
        station.ingest("pose", *range(first, first + 5))
        link.restore()
        station.ingest("pose", *range(first + 5, first + 10))
        link.store.wait_for(first + 10, PATIENCE_S)
    station.wait_empty()
    assert effect(link) == list(range(35))


def test_a_cloud_that_is_gone_for_long_gets_all_of_it(link: CloudLink, station: Station) -> None:
    link.cut()
    station.relay()
    station.ingest("pose", *POSES)
    wait_until(lambda: station.rows("outbox", "attempts >= 8") > 0)
    link.restore()
    station.wait_empty()
    assert effect(link) == list(POSES)


def test_200_lost(link: CloudLink, station: Station) -> None:
    link.store.faults.extend([fake_cloud.lose_answer, fake_cloud.lose_answer])
    station.ingest("pose", *POSES)
    station.relay()
    station.wait_empty()
    assert effect(link) == list(POSES)
    keys = [received.key for received in link.store.seen]
    assert len(keys) >= len(POSES) + 2
    assert len(set(keys)) == len(POSES)


@pytest.mark.parametrize(
    "fault",
    [
        pytest.param(fake_cloud.status(503, {"Retry-After": "0"}), id="503"),
        pytest.param(fake_cloud.status(202), id="202"),
        pytest.param(fake_cloud.status(401), id="401"),
        pytest.param(fake_cloud.garbage, id="200_with_garbage_body"),
        pytest.param(fake_cloud.lose_record, id="lost_before_store"),
    ],
)
def test_an_unconfirmed_record_is_retried_in_order(
    link: CloudLink, station: Station, fault: Fault
) -> None:
    link.store.faults.extend([fault, fault])
    station.ingest("pose", 0, 1, 2)
    station.ingest("alarm", 0, 1)
    station.relay()
    station.wait_empty()
    assert effect(link) == [0, 1, 2]
    assert link.store.stream(1, "alarm") == [0, 1]
    assert station.rows("tombstone") == 5
    assert len({received.key for received in link.store.seen}) == 5


@pytest.mark.parametrize("status", [409, 413])
def test_a_rejected_record_is_a_dead_letter_and_the_next_one_goes_on(
    link: CloudLink, station: Station, status: int
) -> None:
    link.store.faults.append(fake_cloud.status(status))
    rejected, *_ = station.ingest("pose", 0, 1, 2)
    station.relay()
    wait_until(lambda: station.rows("outbox", "state <> 'dead'") == 0)
    assert effect(link) == [1, 2]
    assert station.rows("outbox", f"record_id = {rejected}") == 1
    assert station.rows("telemetry") == 1


def test_while_our_key_is_refused_nothing_is_dead(link: CloudLink, station: Station) -> None:
    link.store.always = fake_cloud.status(401)
    station.ingest("pose", *POSES)
    station.relay()
    link.store.wait_until(lambda: len(link.store.seen) >= 5, PATIENCE_S)
    assert station.rows("outbox", "state = 'queued'") == len(POSES)
    assert {received.body["sequence_number"] for received in link.store.seen} == {0}
    link.store.always = None
    station.wait_empty()
    assert effect(link) == list(POSES)


def test_a_slow_cloud_gets_each_record_once_in_effect(link: CloudLink, station: Station) -> None:
    def slow(handler: Handler, received: Received) -> None:
        """Answer each record only when it has come a second time: the first answer is late."""
        times = sum(seen.key == received.key for seen in handler.store.seen)
        handler.store.keep(received)
        if times > 1:
            handler.answer(200)
        else:
            handler.reset()

    link.store.always = slow
    station.ingest("pose", 0, 1, 2)
    station.relay()
    station.wait_empty()
    assert effect(link) == [0, 1, 2]
    assert len(link.store.kept) == 3


def test_a_stuck_stream_does_not_hold_up_the_others(link: CloudLink, station: Station) -> None:
    release = threading.Event()
    link.store.faults.append(fake_cloud.hold(release))
    station.relay()
    station.ingest("image", 0)
    link.store.wait_until(lambda: len(link.store.seen) == 1, PATIENCE_S)
    station.ingest("pose", *POSES)
    link.store.wait_for(len(POSES), PATIENCE_S)
    assert effect(link) == list(POSES)
    release.set()
    station.wait_empty()


def test_streams_keep_their_own_order_side_by_side(link: CloudLink, station: Station) -> None:
    vehicles = range(1, 6)
    for number in POSES:
        for vehicle_id in vehicles:
            station.ingest("pose", number, vehicle_id=vehicle_id)
    link.store.faults.extend([fake_cloud.status(503)] * 4)
    station.relay()
    station.wait_empty()
    for vehicle_id in vehicles:
        assert link.store.stream(vehicle_id, "pose") == list(POSES)


def test_a_restarted_relay_goes_on_where_it_was(link: CloudLink, station: Station) -> None:
    station.ingest("pose", *range(30))
    for _ in range(3):
        station.relay()
        link.store.wait_until(lambda: bool(link.store.seen), PATIENCE_S)
        station.stop()
    station.relay()
    station.wait_empty()
    assert effect(link) == list(range(30))
