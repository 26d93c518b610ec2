"""A report that is corrected while it is in flight reaches the cloud before the mission's end."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from afarcloud.plan import Plan
from afarcloud.state import MissionReport
from afarcloud.wire import Kind
from edge_server.config import Config
from edge_server.outbox import queue
from edge_server.outbox.answers import Answer
from edge_server.outbox.uplink import MAXIMUM_BATCH
from edge_server.process.preparation import prepare
from edge_server.services.context import Caller
from edge_server.services.errors import ConflictError
from edge_server.services.fleet import broker_work, vehicles
from edge_server.services.fleet.broker_work import Acknowledgement
from edge_server.services.fleet.vehicles import VehicleState
from edge_server.services.planning import plans
from edge_server.services.reports import dead_letters, telemetry
from edge_server.services.reports.telemetry import Arrival
from tests.support.virtual_station import VirtualCloud, VirtualStation, answering
from tests.unit.edge_server.documents import mission, mission_report, plan

RUNNING, FAILED = 2, 4


@pytest.fixture
def station(tmp_path: Path) -> Iterator[VirtualStation]:
    """A station with a cloud that accepts single records."""
    config = Config(state_dir=tmp_path)
    prepare(config)
    station = VirtualStation(config)
    yield station
    station.close()


def model(status: int, **fields: Any) -> MissionReport:
    return MissionReport.model_validate(mission_report(status, status, mission_id=7, **fields))


def ingest(station: VirtualStation, *statuses: int) -> list[int]:
    """Keep reports of one mission; returns their ids."""
    arrivals = [Arrival(Kind.MISSION_REPORT, model(status), None) for status in statuses]
    kept = telemetry.ingest_all(station.context, arrivals, "broker")
    return [one["id"] for one in kept if isinstance(one, dict)]


def correct(station: VirtualStation, record_id: int) -> None:
    report = model(RUNNING, message="windy")
    telemetry.replace(station.context, Kind.MISSION_REPORT, record_id, report)


def received(station: VirtualStation) -> list[tuple[int, str | None]]:
    """Status and message of the reports that the cloud has, in the order of their arrival."""
    bodies = [json.loads(record.payload) for record in station.cloud.kept.values()]
    return [(body["mission_status_id"], body.get("message")) for body in bodies]


def dead(station: VirtualStation) -> list[dict[str, Any]]:
    return dead_letters.page(station.context, after_id=0, limit=10, kind=None, vehicle_id=None)


def test_a_correction_is_sent_before_an_end_that_waits(station: VirtualStation) -> None:
    running, _ = ingest(station, RUNNING, FAILED)
    (batch,) = station.send_next()
    correct(station, running)
    assert station.send_next() == []
    station.answered(batch, station.cloud.send(batch.records))
    station.drain()
    assert received(station) == [(RUNNING, None), (RUNNING, "windy"), (FAILED, None)]


def test_a_corrected_report_that_the_cloud_put_off_is_sent_once(station: VirtualStation) -> None:
    running, _ = ingest(station, RUNNING, FAILED)
    (batch,) = station.send_next()
    correct(station, running)
    assert station.send_next() == []
    station.answered(batch, [Answer(503)])
    station.drain()
    assert received(station) == [(RUNNING, "windy"), (FAILED, None)]


@pytest.fixture
def overlapping(monkeypatch: pytest.MonkeyPatch) -> None:
    """A correction that is committed after the relay has read a report, and before it is noted."""
    monkeypatch.setattr(queue, "mark_sent", lambda _connection, _records: None)


@pytest.mark.usefixtures("overlapping")
def test_a_correction_is_not_sent_behind_an_end_in_flight(station: VirtualStation) -> None:
    running, _ = ingest(station, RUNNING, FAILED)
    (batch,) = station.send_next()
    station.answered(batch, station.cloud.send(batch.records))
    (end,) = station.send_next()
    correct(station, running)
    station.answered(end, station.cloud.send(end.records))
    station.relay_for(60.0)
    assert received(station) == [(RUNNING, None), (FAILED, None)]
    (letter,) = dead(station)
    assert letter["report"]["message"] == "windy"
    assert "later report" in letter["reason"]


@pytest.mark.first_case
@pytest.mark.usefixtures("overlapping")
@pytest.mark.parametrize("status", [200, 422])
def test_a_correction_is_not_sent_behind_an_end_of_its_batch(
    station: VirtualStation, status: int
) -> None:
    station.cloud = VirtualCloud(MAXIMUM_BATCH)
    running, _ = ingest(station, RUNNING, FAILED)
    (batch,) = station.send_next()
    correct(station, running)
    replies = station.cloud.send(batch.records)
    station.answered(batch, [Answer(status), *replies[1:]])
    station.relay_for(60.0)
    assert [one for one, _ in received(station)] == [RUNNING, FAILED]
    assert len(dead(station)) == 1


def test_a_report_is_not_corrected_once_the_end_behind_it_may_have_arrived(
    station: VirtualStation,
) -> None:
    """The relay is killed after the cloud has both, before it has stored the answers."""
    station.cloud = VirtualCloud(MAXIMUM_BATCH)
    running, _ = ingest(station, RUNNING, FAILED)
    (batch,) = station.send_next()
    station.cloud.send(batch.records)
    with pytest.raises(ConflictError, match="was sent to the cloud"):
        correct(station, running)
    station.restart()
    with pytest.raises(ConflictError, match="was sent to the cloud"):
        correct(station, running)
    station.drain()
    assert received(station) == [(RUNNING, None), (FAILED, None)]
    assert dead(station) == []


def test_a_dead_letter_is_not_corrected_behind_the_end_of_its_mission(
    station: VirtualStation,
) -> None:
    document = Plan.model_validate(plan(mission(7))["plan"])
    vehicles.put(station.context, 1, VehicleState(link_state="connected"))
    plans.create(station.context, document, Caller("operator"))
    broker_work.acknowledge(station.context, 1, Acknowledgement.ACCEPTED, None)
    station.cloud.faults.append(answering(422))
    running, _ = ingest(station, RUNNING, FAILED)
    station.relay_for(60.0)
    with pytest.raises(ConflictError, match="was sent to the cloud"):
        dead_letters.edit(station.context, running, model(RUNNING, message="windy"))
    assert received(station) == [(FAILED, None)]


def test_a_correction_of_another_mission_is_sent(station: VirtualStation) -> None:
    (running,) = ingest(station, RUNNING)
    other = MissionReport.model_validate(mission_report(FAILED, mission_id=8))
    telemetry.ingest_all(station.context, [Arrival(Kind.MISSION_REPORT, other, None)], "broker")
    (batch,) = station.send_next()
    station.answered(batch, station.cloud.send(batch.records))
    (end,) = station.send_next()
    correct(station, running)
    station.answered(end, station.cloud.send(end.records))
    station.drain()
    assert received(station) == [(RUNNING, None), (FAILED, None), (RUNNING, "windy")]
