"""The items that every command becomes on every family of autopilot, as a reviewed record.

`GOLDEN=rewrite python -m pytest tests/golden/test_translation.py` writes the record anew; the
difference is then read in the version control.
"""

import json
import math
import os
import re
from pathlib import Path
from typing import Any

import pytest

from afarcloud.enumerations import OrbitType, TrackMode
from afarcloud.plan import Mission
from mavlink_broker.autopilots.families import ARDUPILOT, GENERIC, OWN, PX4, Family
from mavlink_broker.mavlink.dialect import Message, Route
from mavlink_broker.microservices.command import Command
from mavlink_broker.microservices.config_overrides import ParameterOverride
from mavlink_broker.planning.mission import FlightPlan, LiveCommand, translate
from mavlink_broker.planning.situation import Home

FOLDER = Path(__file__).parent / "translation"
HOME = Home(40.44340, -3.73820, 650.0)
ROUTE = Route(254, 191, 1, 1)
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
    "picture": [
        {"command_type_id": 3, "parameters": PLACE | {"altitude": 8.0}},
        {"command_type_id": 4, "parameters": {"pitch_angle": -90}},
    ],
    "pictures_to_the_east": [
        {"command_type_id": 3, "parameters": PLACE | {"altitude": 8.0}},
        {
            "command_type_id": 4,
            "parameters": {
                "pitch_angle": -45,
                "yaw_angle": 90,
                "photo_count": 5,
                "time_interval": 2,
            },
        },
    ],
    "video": [
        {"command_type_id": 5, "parameters": {"video_stream_id": 1, "freq": 2.0}},
        {"command_type_id": 3, "parameters": PLACE | {"altitude": 8.0}},
        {"command_type_id": 6, "parameters": {"video_stream_id": 1}},
    ],
    "hotpoint_from_the_south_inwards": [
        {
            "command_type_id": 7,
            "parameters": PLACE
            | {"orbit_altitude": 8.0, "radius": 12.0, "start_point": 1, "orbit_type": 2},
        },
        {"command_type_id": 11, "parameters": {"landing": True}},
    ],
    "hotpoint_counter_clockwise_backwards_too_fast": [
        {
            "command_type_id": 7,
            "parameters": PLACE
            | {
                "orbit_altitude": 8.0,
                "radius": 5.0,
                "angular_velocity": 60.0,
                "is_clockwise": False,
                "orbit_type": 1,
            },
        },
        {"command_type_id": 11, "parameters": {"landing": True}},
    ],
    "follow": [
        {"command_type_id": 8, "parameters": PLACE | {"altitude": 8.0}},
        {"command_type_id": 11, "parameters": {"landing": True}},
    ],
    "track": [
        {"command_type_id": 9, "parameters": {"corners": [[0.25, 0.25], [0.75, 0.5]]}},
        {"command_type_id": 11, "parameters": {"landing": True}},
    ],
    **{
        f"track_{mode.name.lower()}": [
            {"command_type_id": 1, "parameters": PLACE | {"altitude": 12.0}},
            {
                "command_type_id": 9,
                "parameters": {"corners": [[0.1, 0.2], [0.3, 0.4]], "track_mode": int(mode)},
            },
        ]
        for mode in TrackMode
    },
    **{
        f"hotpoint_{heading.name.lower()}": [
            {
                "command_type_id": 7,
                "parameters": PLACE
                | {"orbit_altitude": 8.0, "radius": 20.0, "orbit_type": int(heading)},
            },
        ]
        for heading in OrbitType
    },
    "follow_low_and_steered_by_hand": [
        {"command_type_id": 8, "parameters": PLACE | {"altitude": 2.0, "heading": 1}},
    ],
    "picture_video_and_panorama_behind_a_follow": [
        {"command_type_id": 8, "parameters": PLACE | {"altitude": 8.0}},
        {"command_type_id": 4, "parameters": {"pitch_angle": -90, "yaw_angle": 45}},
        {"command_type_id": 5, "parameters": {"video_stream_id": 1, "freq": 1.0}},
        {"command_type_id": 10, "parameters": {"panorama_mode": 1}},
        {"command_type_id": 6, "parameters": {"video_stream_id": 1}},
        {"command_type_id": 11, "parameters": {"landing": True}},
    ],
    "panorama_full": [
        {"command_type_id": 3, "parameters": PLACE | {"altitude": 8.0}},
        {"command_type_id": 10, "parameters": {"panorama_mode": 0}},
    ],
    "panorama_half": [
        {"command_type_id": 3, "parameters": PLACE | {"altitude": 8.0, "desired_yaw_angle": 90}},
        {"command_type_id": 10, "parameters": {"panorama_mode": 1}},
        {"command_type_id": 11, "parameters": {"landing": True}},
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
    names = (*FIELDS, "x", "y", "z")
    return {name: plain(getattr(message, name)) for name in names}


def plain(value: Any) -> Any:
    return None if isinstance(value, float) and math.isnan(value) else value


def stretch_record(plan: FlightPlan) -> dict[str, Any]:
    return {
        "items": [as_record(message) for message in plan.messages(1, 1)],
        "command_of_item": list(plan.command_of_item),
        "done_item": list(plan.done_item),
        "loans": [[index, override_record(override)] for index, override in plan.overrides],
    }


def live_record(live: LiveCommand) -> dict[str, Any]:
    action = live.action
    alternatives = {
        name: [[order_record(order) for order in commands] for commands in listed]
        for name, listed in (("begin", action.begin), ("finish", action.finish))
    }
    return {
        "command": live.command,
        "approach": action.approach,
        **alternatives,
        "end": f"{action.end}",
        "follow": action.follow,
        "loans": [override_record(override) for override in action.overrides],
        "way_notes": list(action.alternative_notes),
    }


def override_record(override: ParameterOverride) -> list[Any]:
    """A parameter that is borrowed, in its spellings."""
    return [[setting.name, setting.value] for setting in override]


def order_record(order: Command) -> dict[str, Any]:
    """Fields of a command, and how long it waits if it does."""
    waits = {"wait_s": order.wait_s} if order.wait_s else {}
    return message_record(order.message(ROUTE, 0)) | waits


def message_record(message: Message) -> dict[str, Any]:
    """Fields of a command without its target system."""
    fields = message.to_dict()
    return {name: plain(value) for name, value in fields.items() if name != "target_system"}


def record_of(family: Family) -> dict[str, Any]:
    record = {}
    for name, commands in COMMANDS.items():
        itinerary = translate(mission_of(commands), family, HOME)
        record[name] = {
            "segments": [
                stretch_record(segment) if isinstance(segment, FlightPlan) else live_record(segment)
                for segment in itinerary.segments
            ],
            "notes": [list(notes) for notes in itinerary.notes],
        }
    return record


def written(record: dict[str, Any]) -> str:
    """One line for each item and each order, so that a difference is easy to read."""
    text = json.dumps(record, indent=1)
    for innermost in (r"\[[^][{}]*\]", r"\{[^][{}]*\}"):
        text = re.sub(innermost, lambda found: " ".join(found.group().split()), text)
    return text + "\n"


@pytest.mark.parametrize("family", [PX4, OWN, ARDUPILOT, GENERIC], ids=lambda family: family.name)
def test_every_command_becomes_the_items_on_record(family: Family) -> None:
    path = FOLDER / f"{family.name}.json"
    record = record_of(family)
    if os.environ.get("GOLDEN") == "rewrite":
        path.parent.mkdir(exist_ok=True)
        path.write_text(written(record), encoding="utf-8")
    assert json.loads(json.dumps(record)) == json.loads(path.read_text(encoding="utf-8"))
