"""The items that every command becomes on every family of autopilot, as a reviewed record.

`GOLDEN=rewrite python -m pytest tests/golden/test_translation.py` writes the record anew; the
difference is then read in the version control.
"""

import json
import math
import os
from pathlib import Path
from typing import Any

import pytest

from afarcloud.plan import Mission
from mavlink_broker.dialect import Message
from mavlink_broker.translation.families import ARDUPILOT, GENERIC, PX4, Family
from mavlink_broker.translation.mission import Home, translate

FOLDER = Path(__file__).parent / "translation"
HOME = Home(40.44340, -3.73820, 650.0)
PLACE = {"latitude": 40.44352, "longitude": -3.73835}
FIELDS = ("seq", "command", "frame", "current", "param1", "param2", "param3", "param4")

COMMANDS: dict[str, list[dict[str, Any]]] = {
    "takeoff": [{"command_type_id": 1, "parameters": PLACE | {"altitude": 5.0}}],
    "takeoff_with_yaw_and_pitch": [
        {
            "command_type_id": 1,
            "parameters": PLACE | {"altitude": 5.0, "yaw_angle": 90, "minimum_pitch": 15},
        }
    ],
    "land": [{"command_type_id": 2, "parameters": PLACE}],
    "land_with_everything": [
        {
            "command_type_id": 2,
            "parameters": PLACE
            | {
                "minimum_target_altitude": 2.0,
                "precision_land_mode": 1,
                "desired_yaw_angle": 180,
                "landing_altitude": 1.5,
            },
        }
    ],
    "waypoint": [{"command_type_id": 3, "parameters": PLACE | {"altitude": 8.0}}],
    "waypoint_with_everything": [
        {
            "command_type_id": 3,
            "parameters": PLACE
            | {
                "altitude": 8.0,
                "hold_time": 3.0,
                "acceptance_radius": 2.0,
                "trajectory_control": 1.0,
                "desired_yaw_angle": 270,
            },
        }
    ],
    "home_landing": [{"command_type_id": 11, "parameters": {"landing": True}}],
    "home_hovering": [
        {"command_type_id": 3, "parameters": PLACE | {"altitude": 8.0}},
        {"command_type_id": 11, "parameters": {"landing": False}},
    ],
}


def mission_of(commands: list[dict[str, Any]]) -> Mission:
    numbered = [{"command_id": i + 1} | command for i, command in enumerate(commands)]
    return Mission.model_validate(
        {"mission_id": 1, "vehicle_id": 1, "maximum_speed": 4.0, "command_array": numbered}
    )


def as_record(message: Message) -> dict[str, Any]:
    values = {name: getattr(message, name) for name in (*FIELDS, "x", "y", "z")}
    return {
        name: None if isinstance(value, float) and math.isnan(value) else value
        for name, value in values.items()
    }


def record_of(family: Family) -> dict[str, Any]:
    record = {}
    for name, commands in COMMANDS.items():
        plan = translate(mission_of(commands), family, HOME)
        record[name] = {
            "items": [as_record(message) for message in plan.messages(1, 1)],
            "command_of_item": list(plan.command_of_item),
            "done_item": list(plan.done_item),
            "notes": [list(notes) for notes in plan.notes],
        }
    return record


@pytest.mark.parametrize("family", [PX4, ARDUPILOT, GENERIC], ids=lambda family: family.name)
def test_every_command_becomes_the_items_on_record(family: Family) -> None:
    path = FOLDER / f"{family.name}.json"
    record = record_of(family)
    if os.environ.get("GOLDEN") == "rewrite":
        path.parent.mkdir(exist_ok=True)
        path.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
    assert record == json.loads(path.read_text(encoding="utf-8"))
