"""Reports of a broker that flies missions, sent over HTTP."""

from typing import Any

from edge_server.app import context_of, create_app
from edge_server.config import Config
from tests.unit.edge_server.conftest import Clock, Edge
from tests.unit.edge_server.documents import mission, mission_report, plan, telemetry

RUNNING, FINISHED, FAILED = 2, 3, 4


def serve(config: Config, clock: Clock | None = None) -> Edge:
    """Make an edge server with these settings and vehicle 1."""
    clock = clock or Clock()
    app = create_app(config, clock=clock)
    edge = Edge(app.test_client(), context_of(app), clock)
    edge.register(1)
    return edge


def begin(edge: Edge, mission_id: int = 1201) -> None:
    """Have the broker begin a mission."""
    assert edge.post_plan(plan(mission(mission_id))).status_code == 201
    edge.accept()
    report(edge, RUNNING, mission_id=mission_id)


def report(edge: Edge, status: int, key: str | None = None, **fields: Any) -> None:
    answer = edge.report("mission_report", mission_report(status, **fields), key)
    assert answer.status_code == 201, answer.json


def send(edge: Edge, kind: str, **fields: Any) -> None:
    answer = edge.report(kind, telemetry(kind) | fields)
    assert answer.status_code == 201, answer.json


def arm(edge: Edge, *, armed: bool) -> None:
    body = {"link_state": "connected", "armed": armed}
    assert edge.ask("PUT", "/vehicles/1", "broker", json=body).status_code == 200


def figure(edge: Edge, name: str) -> float:
    """Read a number from the metrics."""
    lines = edge.ask("GET", "/metrics", "operator").text.splitlines()
    (found,) = [line.split()[1] for line in lines if line.startswith(f"{name} ")]
    return float(found)


def points(edge: Edge, flight_id: int = 1) -> int:
    """Count the points of a flight's track."""
    times = edge.get(f"/flights/{flight_id}/track")["properties"]["coordinateProperties"]["times"]
    return len(times)
