"""Farmers and an operator at the console, in a real Chromium, against the running system."""

from pathlib import Path

import pytest

from tests.support.browser import TEST_TIMEOUT_S, console_journey, sign_in_link
from tests.support.system import running, short_plan

HOLD_S = 600.0
"""Time at the waypoint: the vehicle is still there when the operator stops it."""
SPEED = 2.0
"""Most of the time goes by in dialogs, in which the vehicle stands or hovers."""


def long_plan() -> dict[str, object]:
    """A plan that takes a picture, and does not end before somebody ends it."""
    plan = short_plan()
    plan["name"] = "Stopped on its way"
    takeoff, waypoint, *rest = plan["missions"][0]["command_array"]
    waypoint["parameters"]["hold_time"] = HOLD_S
    picture = {"command_type_id": 4, "parameters": {"pitch_angle": -90}}
    steps = [takeoff, picture, waypoint, *rest]
    plan["missions"][0]["command_array"] = [
        step | {"command_id": number} for number, step in enumerate(steps, 1)
    ]
    return plan


@pytest.mark.timeout(TEST_TIMEOUT_S)
def test_a_plan_is_flown_and_stopped_and_a_field_is_drawn(tmp_path: Path) -> None:
    with (
        console_journey(tmp_path) as take,
        running(tmp_path / "farm", speed=SPEED, with_video=True) as farm,
    ):
        take(
            "fly_and_stop",
            plan=long_plan(),
            FARMER_LINK=sign_in_link(farm, "farmer", "maria"),
            OPERATOR_LINK=sign_in_link(farm, "operator", "juan"),
        )
        take("plan_a_field", PLANNER_LINK=sign_in_link(farm, "farmer", "luis"))
        events = farm.get("/events/")
        plan, survey = farm.get("/plans/1"), farm.get("/plans/2")
        (field,) = farm.get("/fields/")
    assert [(event["event_type_name"], event["state"]) for event in events] == [
        ("DRONE_SPEED", "done"),
        ("PAUSE_MISSION", "done"),
        ("RESUME_MISSION", "done"),
        ("ABORT_MISSION", "done"),
    ]
    assert events[0]["maximum_speed"] == pytest.approx(2.0)
    assert plan["missions"][0]["mission_status_id"] == 5, plan
    assert field["name"] == "Olive grove"
    assert [len(ring) for ring in (field["boundary"], *field["exclusions"])] == [4, 3]
    assert (survey["name"], survey["field_id"]) == ("Olive grove 1", field["id"])
    assert {mission["dispatch_state"] for mission in survey["missions"]} == {"held"}
    heights = {
        command["parameters"].get("altitude")
        for command in survey["missions"][0]["command_array"]
        if command["command_type_id"] == 3
    }
    assert heights == {40.0}
