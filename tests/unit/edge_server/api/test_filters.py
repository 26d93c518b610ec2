"""Lists filtered by vehicle, by time and by cursor."""

from typing import Any

import pytest

from tests.unit.edge_server.conftest import Edge
from tests.unit.edge_server.documents import mission, plan, telemetry


@pytest.fixture
def listed(edge: Edge) -> Edge:
    """Two vehicles with a pose and a plan each at noon, and again an hour later."""
    for hour in range(2):
        for vehicle_id in (1, 2):
            edge.report("pose", telemetry("pose", hour, vehicle_id))
            edge.post_plan(plan(mission(vehicle_id=vehicle_id, mission_id=10 * hour + vehicle_id)))
        edge.clock.pass_s(3600.0)
    return edge


def vehicles_of(items: list[dict[str, Any]]) -> list[int]:
    return [item.get("vehicle_id") or item["missions"][0]["vehicle_id"] for item in items]


@pytest.mark.first_case
@pytest.mark.parametrize("path", ["/pose/", "/plans/"])
@pytest.mark.parametrize(
    ("query", "vehicles"),
    [
        ("", [1, 2, 1, 2]),
        ("?vehicle_id=2", [2, 2]),
        ("?since=2026-11-21T12:30:00Z", [1, 2]),
        ("?since=2026-11-21T14:30:00%2B02:00", [1, 2]),
        ("?since=2026-11-21T14:30:00+02:00", [1, 2]),
        ("?since=1795264200", [1, 2]),
        ("?since=2026-11-21T12:30:00Z&vehicle_id=1", [1]),
        ("?since=2026-11-22T00:00:00Z", []),
        ("?limit=3", [1, 2, 1]),
    ],
)
def test_a_filtered_list(listed: Edge, path: str, query: str, vehicles: list[int]) -> None:
    assert vehicles_of(listed.get(path + query)) == vehicles


@pytest.mark.parametrize("path", ["/pose/", "/plans/", "/health"])
def test_a_parameter_that_is_given_twice_is_refused(listed: Edge, path: str) -> None:
    answer = listed.ask("GET", f"{path}?limit=1&since=0&limit=2", "operator")
    assert answer.status_code == 422
    assert answer.json is not None
    assert answer.json["detail"]["query"] == {"limit": ["must be given once"]}


@pytest.mark.first_case
@pytest.mark.parametrize("path", ["/pose/", "/plans/"])
def test_a_list_goes_on_after_a_cursor(listed: Edge, path: str) -> None:
    first = listed.get(f"{path}?limit=3")
    rest = listed.get(f"{path}?limit=3&after={first[-1]['id']}")
    assert first + rest == listed.get(path)


@pytest.mark.first_case
@pytest.mark.parametrize("path", ["/pose/", "/plans/"])
@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("since", "yesterday"),
        ("since", "2026-11-21T12:30:00"),
        ("since", "-1"),
        ("since", "nan"),
        ("since", "1" * 30),
        ("vehicle_id", "0"),
        ("vehicle_id", "one"),
        ("limit", "1001"),
        ("after", "-1"),
    ],
)
def test_a_query_that_cannot_be_used_is_named(edge: Edge, path: str, name: str, value: str) -> None:
    answer = edge.ask("GET", f"{path}?{name}={value}", "operator")
    assert answer.status_code == 422
    assert list((answer.json or {})["detail"]["query"]) == [name]
