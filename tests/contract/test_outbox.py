"""Store and forward, against a cloud that misbehaves over real sockets.

What is promised: every acknowledged record reaches the cloud, once in effect, in the order of its
stream, and is kept here until the cloud has confirmed it.
"""

import threading
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from afarcloud.state import Report
from afarcloud.wire import Kind, read
from edge_server.config import Config
from edge_server.process.preparation import prepare
from edge_server.services.reports import telemetry
from tests.support import fake_cloud
from tests.support.fake_cloud import FakeCloud, Fault, Handler, Received, running_cloud
from tests.support.polling import wait_until
from tests.support.station import Station
from tests.unit.edge_server import documents


class CloudStation(Station):
    """A station with the cloud at which its uplink points."""

    def __init__(self, config: Config, cloud: FakeCloud) -> None:
        super().__init__(config)
        self.cloud = cloud


@pytest.fixture
def config(tmp_path: Path, engine_name: str, database_url: str) -> Config:
    """A state folder with an empty database, and a relay that is quick to try again."""
    made = Config(
        state_dir=tmp_path,
        database_url=None if engine_name == "sqlite" else database_url,
        backoff_base_s=0.02,
        backoff_cap_s=0.1,
        probe_interval_s=0.05,
        read_timeout_s=5.0,
    )
    prepare(made)
    return made


@pytest.fixture
def station(config: Config) -> Iterator[CloudStation]:
    """A station whose cloud runs and whose relay does not yet."""
    with running_cloud() as cloud:
        station = CloudStation(_with_cloud(config, cloud.url), cloud)
        yield station
        station.close()


def _with_cloud(config: Config, url: str) -> Config:
    settings = {
        name: getattr(config, name)
        for name in (
            "state_dir",
            "database_url",
            "backoff_base_s",
            "backoff_cap_s",
            "probe_interval_s",
        )
    }
    return Config(**settings, read_timeout_s=config.read_timeout_s, cloud_url=url)


@pytest.mark.first_case
def test_every_kind_reaches_the_cloud_and_is_deleted_here(station: CloudStation) -> None:
    for kind in documents.TELEMETRY:
        station.ingest(kind, 7)
    station.relay()
    station.cloud.store.wait_for(len(documents.TELEMETRY))
    station.wait_empty()
    assert station.rows("telemetry") == 0
    assert station.rows("tombstone") == len(documents.TELEMETRY)
    for received in station.cloud.store.kept:
        sent = documents.telemetry(received.path.strip("/"), 7)
        assert received.headers["Idempotency-Key"] == received.body["message_id"]
        assert {name: received.body[name] for name in sent} == sent


@pytest.mark.first_case
def test_a_record_goes_out_at_once(station: CloudStation) -> None:
    station.relay()
    for number in range(20):
        station.ingest("state_vector", number)
        station.cloud.store.wait_for(number + 1)
    assert station.cloud.store.stream(1, "state_vector") == list(range(20))


@pytest.mark.first_case
def test_tb2157_first_seconds_of_outage(station: CloudStation) -> None:
    station.relay()
    station.ingest("pose", *range(5))
    station.cloud.store.wait_for(5)
    station.cloud.stop()
    station.ingest("pose", *range(5, 30))
    station.cloud.start()
    station.cloud.store.wait_for(30)
    assert station.cloud.store.stream(1, "pose") == list(range(30))


@pytest.mark.first_case
@pytest.mark.parametrize(
    "fault",
    [
        pytest.param(fake_cloud.status(500), id="500"),
        pytest.param(fake_cloud.status(503, {"Retry-After": "0"}), id="503"),
        pytest.param(fake_cloud.status(408), id="408"),
        pytest.param(fake_cloud.status(425), id="425"),
        pytest.param(fake_cloud.status(429), id="429"),
        pytest.param(fake_cloud.status(401), id="401"),
        pytest.param(fake_cloud.status(403), id="403"),
        pytest.param(fake_cloud.status(202), id="202"),
        pytest.param(fake_cloud.status(301, {"Location": "/elsewhere"}), id="301"),
        pytest.param(fake_cloud.status(307, {"Location": "/elsewhere"}), id="307"),
        pytest.param(fake_cloud.html, id="200_from_captive_portal"),
        pytest.param(fake_cloud.garbage, id="200_with_garbage_body"),
        pytest.param(fake_cloud.lose_record, id="reset_before_store"),
        pytest.param(fake_cloud.lose_answer, id="200_lost"),
    ],
)
def test_an_unconfirmed_record_is_retried_in_order(station: CloudStation, fault: Fault) -> None:
    station.cloud.store.faults.extend([fault, fault, fault])
    station.ingest("pose", 0, 1, 2)
    station.ingest("alarm", 0, 1)
    station.relay()
    station.wait_empty()
    store = station.cloud.store
    assert store.stream(1, "pose") == [0, 1, 2]
    assert store.stream(1, "alarm") == [0, 1]
    assert len(store.seen) == 5 + 3
    assert len({received.key for received in store.seen}) == 5
    assert {received.path for received in store.seen} == {"/pose", "/alarm"}


@pytest.mark.first_case
def test_an_empty_200_confirms(station: CloudStation) -> None:
    station.cloud.store.always = fake_cloud.empty
    station.ingest("pose", 0)
    station.relay()
    station.wait_empty()
    assert len(station.cloud.store.seen) == 1


@pytest.mark.first_case
@pytest.mark.parametrize("status", [400, 405, 409, 413, 415, 422])
def test_a_rejected_record_is_a_dead_letter_and_the_next_one_goes_on(
    station: CloudStation, status: int
) -> None:
    station.cloud.store.faults.append(fake_cloud.status(status))
    rejected, _ = station.ingest("pose", 0, 1)
    station.relay()
    station.cloud.store.wait_for(1)
    wait_until(lambda: station.rows("outbox") == 1)
    assert station.cloud.store.stream(1, "pose") == [1]
    assert station.rows("outbox", f"state = 'dead' AND record_id = {rejected}") == 1
    assert station.rows("telemetry", f"id = {rejected}") == 1
    station.ingest("pose", 2)
    station.cloud.store.wait_for(2)
    assert len(station.cloud.store.seen) == 3


@pytest.mark.first_case
def test_301_not_followed_to_other_host(station: CloudStation) -> None:
    with running_cloud() as stranger:
        fault = fake_cloud.status(307, {"Location": f"{stranger.url}/pose"})
        station.cloud.store.faults.append(fault)
        station.ingest("pose", 0)
        station.relay()
        station.wait_empty()
        assert stranger.store.seen == []


@pytest.mark.first_case
def test_while_our_key_is_refused_there_is_one_probe_at_a_time(station: CloudStation) -> None:
    station.cloud.store.always = fake_cloud.status(401)
    for vehicle_id in range(1, 9):
        station.ingest("pose", 0, vehicle_id=vehicle_id)
    station.relay()
    station.cloud.store.wait_until(lambda: len(station.cloud.store.seen) >= 6)
    first_burst = [r.at for r in station.cloud.store.seen]
    # The records in flight when the first 401 came may have been answered too.
    probes = first_burst[station.context.config.relay_workers :]
    gaps = [later - earlier for earlier, later in pairwise(probes)]
    assert all(gap >= 0.04 for gap in gaps)
    assert station.rows("outbox", "state = 'queued'") == 8
    station.cloud.store.always = None
    station.wait_empty()


@pytest.mark.first_case
def test_a_stuck_stream_does_not_hold_up_the_others(station: CloudStation) -> None:
    release = threading.Event()
    station.cloud.store.faults.append(fake_cloud.hold(release))
    station.ingest("image", 0)
    station.relay()
    station.cloud.store.wait_until(lambda: len(station.cloud.store.seen) == 1)
    station.ingest("pose", *range(10))
    station.cloud.store.wait_for(10)
    assert station.cloud.store.stream(1, "image") == []
    release.set()
    station.wait_empty()


@pytest.mark.first_case
def test_a_slow_cloud_still_has_a_hand_free_for_an_alarm(station: CloudStation) -> None:
    release = threading.Event()
    busy = station.context.config.relay_workers - 1
    station.cloud.store.faults.extend([fake_cloud.hold(release)] * busy)
    for vehicle_id in range(1, 9):
        station.ingest("pose", 0, vehicle_id=vehicle_id)
    station.relay()
    station.cloud.store.wait_until(lambda: len(station.cloud.store.seen) == busy)
    station.ingest("alarm", 0)
    station.cloud.store.wait_for(1)
    assert station.cloud.store.kept[0].path == "/alarm"
    release.set()
    station.wait_empty()


@pytest.mark.first_case
def test_alarms_and_reports_overtake_a_backlog(station: CloudStation) -> None:
    def poses_wait_for_them(handler: Handler, received: Received) -> None:
        if received.path == "/pose":
            handler.store.wait_until(lambda: urgent <= {r.path for r in handler.store.kept})
        handler.store.keep(received)
        handler.answer(200)

    urgent = {"/alarm", "/mission_report"}
    station.cloud.store.always = poses_wait_for_them
    for vehicle_id in (1, 2, 3):
        station.ingest("pose", *range(30), vehicle_id=vehicle_id)
    station.ingest("mission_report", 0)
    station.ingest("alarm", 0)
    station.relay()
    station.wait_empty()
    assert {received.path for received in station.cloud.store.kept[:2]} == urgent
    for vehicle_id in (1, 2, 3):
        assert station.cloud.store.stream(vehicle_id, "pose") == list(range(30))


@pytest.mark.first_case
def test_what_is_corrected_or_deleted_while_it_waits_is_sent_so(station: CloudStation) -> None:
    station.cloud.stop()
    station.relay()
    corrected, deleted, _ = station.ingest("pose", 0, 1, 2)
    wait_until(lambda: station.rows("outbox", "attempts > 0") > 0)
    report = read(Kind.POSE, documents.telemetry("pose", 100))
    assert isinstance(report, Report)
    telemetry.replace(station.context, Kind.POSE, corrected, report)
    telemetry.remove(station.context, Kind.POSE, deleted)
    station.cloud.start()
    station.wait_empty()
    station.cloud.store.wait_for(2)
    arrived = station.cloud.store.stream(1, "pose")
    # Corrected in the middle of an attempt that reaches the cloud after all, it goes again: in its
    # place, or last if the relay had already taken what stands behind it.
    assert arrived in ([100, 2], [0, 100, 2], [0, 2, 100])


@pytest.mark.first_case
def test_a_record_corrected_in_flight_is_sent_again_as_it_is_now(station: CloudStation) -> None:
    release = threading.Event()
    station.cloud.store.faults.append(fake_cloud.hold(release))
    (identifier,) = station.ingest("pose", 0)
    station.relay()
    station.cloud.store.wait_until(lambda: len(station.cloud.store.seen) == 1)
    report = read(Kind.POSE, documents.telemetry("pose", 100))
    assert isinstance(report, Report)
    telemetry.replace(station.context, Kind.POSE, identifier, report)
    release.set()
    station.wait_empty()
    assert station.cloud.store.stream(1, "pose") == [0, 100]


@pytest.mark.first_case
def test_telegraf16500_no_resend_after_restart(station: CloudStation) -> None:
    station.relay()
    station.ingest("pose", *range(10))
    station.wait_empty()
    station.stop()
    station.relay()
    station.ingest("alarm", 0)
    station.cloud.store.wait_for(11)
    assert len(station.cloud.store.seen) == 11


@pytest.mark.first_case
def test_a_restarted_relay_goes_on_where_it_was(station: CloudStation) -> None:
    station.ingest("pose", *range(40))
    for _ in range(4):
        station.relay()
        station.cloud.store.wait_for_another_request()
        station.stop()
        if station.rows("outbox") == 0:
            break
    station.relay()
    station.wait_empty()
    assert station.cloud.store.stream(1, "pose") == list(range(40))


@pytest.mark.first_case
def test_tb2132_relay_survives_a_long_outage(station: CloudStation) -> None:
    station.cloud.stop()
    station.relay()
    station.ingest("pose", *range(5))
    wait_until(lambda: station.rows("outbox", "attempts >= 8") > 0)
    station.cloud.start()
    station.wait_empty()
    assert station.cloud.store.stream(1, "pose") == list(range(5))


@pytest.mark.first_case
def test_the_key_for_the_cloud_comes_from_its_file(config: Config, tmp_path: Path) -> None:
    key_file = tmp_path / "cloud-uplink.key"
    key_file.write_text("s3cret\n", encoding="ascii")
    with running_cloud() as cloud:
        settings: dict[str, Any] = {
            "state_dir": config.state_dir,
            "database_url": config.database_url,
            "cloud_url": cloud.url,
        }
        station = CloudStation(Config(**settings, cloud_key_file=key_file), cloud)
        station.ingest("pose", 0)
        station.relay()
        cloud.store.wait_for(1)
        station.stop()
        station.database.close()
        assert cloud.store.kept[0].headers["Authorization"] == "Bearer s3cret"
