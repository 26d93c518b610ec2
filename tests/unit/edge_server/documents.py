"""Documents of every kind, valid unless changed."""

import base64
from typing import Any

JPEG = b"\xff\xd8\xff\xe0 a very small picture"


def takeoff(command_id: int = 1, **parameters: Any) -> dict[str, Any]:
    """Take off over the field."""
    place = {"latitude": 40.4434, "longitude": -3.7382, "altitude": 5.0}
    return {"command_id": command_id, "command_type_id": 1, "parameters": place | parameters}


def waypoint(command_id: int = 2, **parameters: Any) -> dict[str, Any]:
    """Fly some metres north."""
    place = {"latitude": 40.4435, "longitude": -3.7382, "altitude": 5.0}
    return {"command_id": command_id, "command_type_id": 3, "parameters": place | parameters}


def home(command_id: int = 3) -> dict[str, Any]:
    """Fly home and land."""
    return {"command_id": command_id, "command_type_id": 11, "parameters": {"landing": True}}


def mission(mission_id: int = 1201, vehicle_id: int = 1, **fields: Any) -> dict[str, Any]:
    """Take off, one waypoint, home."""
    return {
        "sequence_number": 0,
        "mission_id": mission_id,
        "vehicle_id": vehicle_id,
        "maximum_speed": 5.0,
        "command_array": [takeoff(), waypoint(), home()],
    } | fields


def plan(*missions: dict[str, Any], **fields: Any) -> dict[str, Any]:
    """A plan in its envelope."""
    return {"plan": {"name": "North field", "missions": list(missions) or [mission()]} | fields}


def mission_report(
    status: int, *commands: int, mission_id: int = 1201, vehicle_id: int = 1, **fields: Any
) -> dict[str, Any]:
    """A report with the statuses of commands 1, 2, ..."""
    return {
        "sequence_number": 0,
        "vehicle_id": vehicle_id,
        "mission_id": mission_id,
        "mission_status_id": status,
        "command_report_array": [
            {"command_id": number, "command_status_id": each}
            for number, each in enumerate(commands, start=1)
        ],
    } | fields


def event(kind: int = 1, vehicle_id: int = 1, **fields: Any) -> dict[str, Any]:
    """An abort, unless it is another kind."""
    return {"sequence_number": 5, "vehicle_id": vehicle_id, "event_type_id": kind} | fields


def speed_event(maximum_speed: float = 2.5, **fields: Any) -> dict[str, Any]:
    """A new speed [m/s]."""
    return event(3, maximum_speed=maximum_speed, **fields)


_PLACE = {"latitude": 40.4434, "longitude": -3.7382, "altitude": 4.84}
_ATTITUDE = {"yaw": 87.0, "pitch": 0.2, "roll": -0.4}

TELEMETRY: dict[str, dict[str, Any]] = {
    "pose": _PLACE | _ATTITUDE,
    "battery": {"capacity": 5.2, "percentage": 0.8},
    "image": {
        "format": "jpeg",
        "image_size": len(JPEG),
        "name": "north_0001.jpg",
        "frame": base64.b64encode(JPEG).decode(),
    },
    "observation": _PLACE
    | {
        "observation_array": [
            {
                "resource_id": "temp",
                "observed_property": "temperature",
                "result_time": 1718630046,
                "result_value": 20.0,
                "result_uom": "C",
            }
        ]
    },
    "state_vector": _PLACE | _ATTITUDE | {"linear_speed": 1.0},
    "mission_report": {"mission_id": 1, "mission_status_id": 2, "command_report_array": []},
    "alarm": {"alarm_type_id": 1, "alarm_code_id": 5},
}
"""Bodies without sequence_number and vehicle_id, by kind."""


def telemetry(kind: str, sequence_number: int = 0, vehicle_id: int = 1) -> dict[str, Any]:
    """A report of a kind."""
    return {"sequence_number": sequence_number, "vehicle_id": vehicle_id} | TELEMETRY[kind]


VEHICLE_LOG: dict[str, Any] = {
    "format": "ulg",
    "started_at": "2026-11-21T12:00:00Z",
    "ended_at": "2026-11-21T12:10:00Z",
    "listed_at": "2026-11-21T11:59:58Z",
    "size_bytes": 10,
}
"""What a broker says of a log before it sends it."""
