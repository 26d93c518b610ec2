"""The running programs: the edge server dies, then the broker that had many reports for it."""

import struct
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import common

from tests.conformance.ground_station import GroundStation
from tests.scenario.test_killed_in_flight import RUNNING, has_landed
from tests.support.spooled_posts import posts_on_disk
from tests.support.system import FarmSystem, running, short_plan, wait_for

pytestmark = pytest.mark.scenario

FINISHED, FAILED, ABORTED = 3, 4, 5
SOFT_ABORT = 2
GPS, IS_OFF = 4.0, 1.0
EQUIPMENT_GPS = 5
SPEED = 4.0
"""The vehicle is simulated while programs start, too: faster, that would cost most."""


def photographing_plan() -> dict[str, Any]:
    """Take off, a picture, home."""
    plan = short_plan()
    photo = {"pitch_angle": -90, "photo_count": 1}
    commands = plan["missions"][0]["command_array"]
    commands[1] = {"command_id": 2, "command_type_id": 4, "parameters": photo}
    return plan


def break_gps(system: FarmSystem) -> None:
    """Let a part of the vehicle fail, as a ground station can."""
    settings = system.settings
    station = GroundStation(settings.gcs_port, settings.vehicle_port(1), 1)
    try:
        allowed, integer = struct.unpack("<f", struct.pack("<i", 1))[0], 6
        name = b"SYS_FAILURE_EN"
        station.ask(common.MAVLink_param_set_message(1, 1, name, allowed, integer), "PARAM_VALUE")
        result = station.command(common.MAV_CMD_INJECT_FAILURE, GPS, IS_OFF, 0.0)
        assert result == common.MAV_RESULT_ACCEPTED
    finally:
        station.close()


def on_disk(system: FarmSystem, text: str) -> bool:
    """Whether a post on the broker's disk contains this text."""
    return any(text.encode() in data for data in posts_on_disk(system.state_dir / "broker"))


def flying(system: FarmSystem, plan: dict[str, Any]) -> int:
    """Post a plan and wait until it is flown; gives its id."""
    identifier = int(system.post("/plans/", plan).json()["id"])

    def flies() -> bool:
        mission = system.get(f"/plans/{identifier}")["missions"][0]
        return bool(mission["mission_status_id"] >= RUNNING)

    wait_for(flies, "the flight")
    return identifier


def bodies(system: FarmSystem, kind: str) -> list[dict[str, Any]]:
    """What the cloud holds of a kind, in order of arrival."""
    return [record["body"] for record in system.cloud(f"/{kind}")]


def judge_cloud(system: FarmSystem, end: int) -> None:
    """Everything once and in order, and one end."""
    wait_for(lambda: not posts_on_disk(system.state_dir / "broker"), "an empty spool")
    system.wait_until_delivered()
    for kind in ("pose", "battery", "image", "alarm", "mission_report", "observation"):
        sent = [(body["session_id"], body["sequence_number"]) for body in bodies(system, kind)]
        assert len(set(sent)) == len(sent), kind
        for session in {name for name, _ in sent}:
            numbers = [number for name, number in sent if name == session]
            assert numbers == sorted(numbers), kind
    statuses = [body["mission_status_id"] for body in bodies(system, "mission_report")]
    assert statuses == sorted(statuses)
    assert statuses.count(end) == 1
    assert statuses[-1] == end


def die_and_come_back(system: FarmSystem, order: tuple[str, str]) -> None:
    """Lose the broker too; then both come back."""
    system.kill("broker")
    for name in order:
        system.start(name)
    system.wait_until_edge_answers()


@pytest.mark.promise
def test_unsent_broker_reports_survive_both(tmp_path: Path) -> None:
    """A mission, its results, its picture and an alarm of the time when nobody listened."""
    with running(tmp_path / "var", speed=SPEED) as system:
        identifier = flying(system, photographing_plan())
        system.kill("edge")
        wait_for(lambda: has_landed(system), "the landing")
        wait_for(lambda: on_disk(system, f'"mission_status_id":{FINISHED}'), "the end")
        wait_for(lambda: on_disk(system, '"/image/"'), "the picture")
        break_gps(system)
        wait_for(lambda: on_disk(system, '"/alarm/"'), "the alarm")
        die_and_come_back(system, ("edge", "broker"))
        (mission,) = system.wait_until_ended(identifier)["missions"]
        statuses = [c["command_status_id"] for c in mission["command_array"]]
        assert [mission["mission_status_id"], *statuses] == [FINISHED] * 4
        judge_cloud(system, FINISHED)
        assert len(bodies(system, "pose")) == len(bodies(system, "battery")) == 3
        assert len(bodies(system, "image")) == 1
        (alarm,) = bodies(system, "alarm")
        assert alarm["alarm_code_id"] == EQUIPMENT_GPS
        assert system.log_of("broker").count("ARMING, ARMED") == 1, "it was started once"


def test_the_answer_to_an_event_survives_both(tmp_path: Path) -> None:
    with running(tmp_path / "var", speed=SPEED) as system:
        identifier = flying(system, short_plan())
        order = {"sequence_number": 1, "vehicle_id": 1, "event_type_id": SOFT_ABORT}
        event = system.post("/events/", order).json()["id"]
        wait_for(lambda: system.get(f"/events/{event}")["state"] == "accepted", "the acceptance")
        system.kill("edge")
        wait_for(lambda: on_disk(system, '{"status":"done"'), "the event's end")
        die_and_come_back(system, ("broker", "edge"))
        (mission,) = system.wait_until_ended(identifier)["missions"]
        assert mission["mission_status_id"] == ABORTED
        wait_for(lambda: system.get(f"/events/{event}")["state"] == "done", "the answer")
        judge_cloud(system, ABORTED)
        assert "is refused" not in system.log_of("broker")
