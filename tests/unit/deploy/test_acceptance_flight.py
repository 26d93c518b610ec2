"""The acceptance flight: it says "flown" only of what is flown, delivered, and kept no more."""

import json
from pathlib import Path
from typing import Any

import pytest
import responses

from deploy import acceptance_flight
from deploy.acceptance_flight import FlightError, System

EDGE, CLOUD = "http://edge-server:8000", "http://cloud:8100"
PLAN = {"missions": [{"mission_id": 1, "vehicle_id": 1, "command_array": [{"command_id": 1}]}]}
FINISHED, FAILED = 3, 4


class Farm:
    """What edge server and cloud answer."""

    def __init__(self, folder: Path, http: responses.RequestsMock) -> None:
        (folder / "operator.key").write_text("the-key\n")
        self.environment = {
            "EDGE_URL": EDGE,
            "CLOUD_URL": CLOUD,
            "KEY_FILE": str(folder / "operator.key"),
        }
        self.http = http
        self.system = System(self.environment)

    def edge(self, path: str, answer: Any, method: str = "GET", status: int = 200) -> None:
        key = {"Authorization": "Bearer the-key"}
        matches = [responses.matchers.header_matcher(key)]
        self.http.add(method, EDGE + path, json=answer, status=status, match=matches)

    def cloud(self, path: str, answer: Any) -> None:
        self.http.add("GET", CLOUD + path, json=answer)

    def flies(self, status: int = FINISHED, before: int = 0) -> None:
        mission = PLAN["missions"][0] | {"mission_status_id": status}
        self.edge("/vehicles/", [{"vehicle_id": 1, "link_state": "connected"}])
        self.cloud("/", {"counts": {"pose": before}})
        self.edge("/plans/", {"id": 5}, "POST", 201)
        self.edge("/plans/5", {"missions": [mission]})

    def delivers(self, records: list[dict[str, Any]], before: int = 0) -> None:
        self.edge("/pose/", [])
        self.edge("/mission_report/", [])
        self.cloud(f"/records?after={before}", records)


@pytest.fixture
def farm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.setattr(acceptance_flight, "DELIVERY_S", 0.05)
    monkeypatch.setattr(acceptance_flight, "READY_S", 0.05)
    monkeypatch.setattr(acceptance_flight, "_LOOK_S", 0.001)
    with responses.RequestsMock(assert_all_requests_are_fired=False) as http:
        yield Farm(tmp_path, http)


def record(kind: str, **body: Any) -> dict[str, Any]:
    return {"kind": kind, "body": {"vehicle_id": 1} | body}


REPORT = record("mission_report", mission_id=1, mission_status_id=FINISHED)


def test_a_flight_whose_records_are_in_the_cloud_is_flown(farm: Farm) -> None:
    farm.flies(before=7)
    farm.delivers([record("pose"), REPORT], before=7)
    acceptance_flight.fly(farm.system, PLAN)


@pytest.mark.parametrize(
    "records",
    [
        [],
        [record("pose")],
        [REPORT],
        [record("pose"), record("mission_report", mission_id=1, mission_status_id=2)],
        [record("pose", vehicle_id=2), REPORT],
        [record("pose"), record("mission_report", mission_id=9, mission_status_id=FINISHED)],
    ],
)
def test_what_the_cloud_lacks_is_missed(farm: Farm, records: list[dict[str, Any]]) -> None:
    farm.flies()
    farm.delivers(records)
    with pytest.raises(FlightError, match="the cloud holds"):
        acceptance_flight.fly(farm.system, PLAN)


def test_what_the_edge_server_still_keeps_is_not_delivered(farm: Farm) -> None:
    farm.flies()
    farm.edge("/pose/", [{"id": 1}])
    farm.edge("/mission_report/", [])
    farm.cloud("/records?after=0", [record("pose"), REPORT])
    with pytest.raises(FlightError, match="the cloud holds"):
        acceptance_flight.fly(farm.system, PLAN)


def test_a_mission_that_failed_is_told(farm: Farm) -> None:
    farm.flies(status=FAILED)
    with pytest.raises(FlightError, match=r"missions \[1\] did not finish"):
        acceptance_flight.fly(farm.system, PLAN)


def test_a_vehicle_that_does_not_come_is_waited_for_so_long(farm: Farm) -> None:
    farm.edge("/vehicles/", [{"vehicle_id": 1, "link_state": "lost"}])
    with pytest.raises(FlightError, match="vehicles are connected"):
        acceptance_flight.fly(farm.system, PLAN)


def test_a_plan_that_is_refused_ends_the_test_with_the_reason(
    farm: Farm, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    farm.edge("/vehicles/", [{"vehicle_id": 1, "link_state": "connected"}])
    farm.cloud("/", {"counts": {"pose": 0}})
    farm.edge("/plans/", {"message": "no such command"}, "POST", 422)
    (tmp_path / "plan.json").write_text(json.dumps(PLAN))
    assert acceptance_flight.main([str(tmp_path / "plan.json")], farm.environment) == 1
    assert "no such command" in capsys.readouterr().err


def test_a_file_without_a_plan_ends_the_test(tmp_path: Path) -> None:
    (tmp_path / "plan.json").write_text("{")
    assert acceptance_flight.main([str(tmp_path / "plan.json")], {}) == 1
