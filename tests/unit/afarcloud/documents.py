"""Documents of every kind, as another system would send them."""

import copy
from typing import Any

PLAN: dict[str, Any] = {
    "plan_id": "01K9Z4T1W8F6Q2M3N5P7R9S0VX",
    "name": "North field weekly survey",
    "sequence_number": 41,
    "field_id": 7,
    "profile": "field",
    "created_at": "2026-11-21T08:00:00Z",
    "expires_at": "2026-11-21T20:00:00Z",
    "geofence": {
        "inclusion": [
            [
                [40.4430, -3.7392],
                [40.4440, -3.7392],
                [40.4440, -3.7380],
                [40.4430, -3.7380],
            ]
        ],
        "exclusion": [],
        "max_altitude": 60.0,
    },
    "missions": [
        {
            "sequence_number": 0,
            "mission_id": 1201,
            "vehicle_id": 1,
            "maximum_speed": 5.0,
            "command_array": [
                {
                    "command_id": 1,
                    "command_type_id": 1,
                    "parameters": {
                        "minimum_pitch": 0,
                        "yaw_angle": 0,
                        "latitude": 40.44340,
                        "longitude": -3.73820,
                        "altitude": 5.0,
                    },
                },
                {
                    "command_id": 2,
                    "command_type_id": 3,
                    "parameters": {
                        "hold_time": 2,
                        "acceptance_radius": 1.0,
                        "trajectory_control": 0,
                        "desired_yaw_angle": None,
                        "latitude": 40.44352,
                        "longitude": -3.73835,
                        "altitude": 5.0,
                    },
                },
                {
                    "command_id": 3,
                    "command_type_id": 4,
                    "parameters": {
                        "yaw_angle": 0,
                        "pitch_angle": -90,
                        "photo_count": 1,
                        "time_interval": 0,
                    },
                },
                {"command_id": 4, "command_type_id": 11, "parameters": {"landing": True}},
            ],
        },
        {
            "sequence_number": 1,
            "mission_id": 1202,
            "vehicle_id": 2,
            "maximum_speed": 4.0,
            "command_array": [
                {
                    "command_id": 1,
                    "command_type_id": 1,
                    "parameters": {
                        "latitude": 40.44310,
                        "longitude": -3.73900,
                        "altitude": 8.0,
                    },
                },
                {
                    "command_id": 2,
                    "command_type_id": 7,
                    "parameters": {
                        "latitude": 40.44330,
                        "longitude": -3.73880,
                        "orbit_altitude": 8.0,
                        "radius": 10.0,
                        "angular_velocity": 20.0,
                        "is_clockwise": True,
                        "start_point": 4,
                        "orbit_type": 2,
                    },
                },
                {
                    "command_id": 3,
                    "command_type_id": 2,
                    "parameters": {
                        "minimum_target_altitude": 2.0,
                        "precision_land_mode": 0,
                        "desired_yaw_angle": 90,
                        "latitude": 40.44310,
                        "longitude": -3.73900,
                        "landing_altitude": 0,
                    },
                },
            ],
        },
    ],
}

PLACE: dict[str, Any] = {"latitude": 40.4434, "longitude": -3.7382}

PARAMETERS: dict[int, dict[str, Any]] = {
    1: {"minimum_pitch": 0, "yaw_angle": 0, **PLACE, "altitude": 5},
    2: {
        "minimum_target_altitude": 2,
        "precision_land_mode": 0,
        "desired_yaw_angle": 0,
        **PLACE,
        "landing_altitude": 0,
    },
    3: {
        "hold_time": 1,
        "acceptance_radius": 1,
        "trajectory_control": 0,
        "desired_yaw_angle": 0,
        **PLACE,
        "altitude": 5,
    },
    4: {"yaw_angle": 0, "pitch_angle": -90, "photo_count": 1, "time_interval": 0},
    5: {"video_stream_id": 0, "freq": 1.0},
    6: {"video_stream_id": 0},
    7: {
        **PLACE,
        "orbit_altitude": 5,
        "radius": 5,
        "angular_velocity": 20,
        "is_clockwise": True,
        "start_point": 4,
        "orbit_type": 0,
    },
    8: {**PLACE, "altitude": 5, "heading": 0},
    9: {"corners": [[0.25, 0.25], [0.75, 0.75]], "track_mode": 0},
    10: {"panorama_mode": 0},
    11: {"landing": True},
}
"""Good parameters of each of the eleven command types."""

REPORTS: dict[str, dict[str, Any]] = {
    "pose": {
        "sequence_number": 0,
        "vehicle_id": 1,
        "latitude": -0.209439858,
        "longitude": 0.0211725145,
        "altitude": 4.839579,
        "yaw": 0.1,
        "pitch": 0.0,
        "roll": -2.25,
    },
    "battery": {"sequence_number": 0, "vehicle_id": 1, "capacity": 5.2, "percentage": 0.8},
    "image": {
        "sequence_number": 0,
        "vehicle_id": 1,
        "format": "jpeg",
        "image_size": 3,
        "name": "north_0001.jpg",
        "frame": "/9j/",
    },
    "observation": {
        "sequence_number": 0,
        "vehicle_id": 1,
        **PLACE,
        "altitude": 4.84,
        "observation_array": [
            {
                "resource_id": "temp",
                "observed_property": "temperature",
                "result_time": 1718630046,
                "result_value": 20.0,
                "result_uom": "C",
            }
        ],
    },
    "state_vector": {
        "sequence_number": 8,
        "vehicle_id": 1,
        **PLACE,
        "altitude": 4.84,
        "yaw": 87.0,
        "pitch": 0.2,
        "roll": -0.4,
        "battery_capacity": 5.2,
        "battery_percentage": 0.8,
        "linear_speed": 1.0,
    },
    "mission_report": {
        "sequence_number": 1,
        "vehicle_id": 1,
        "mission_id": 1201,
        "mission_status_id": 2,
        "command_report_array": [
            {"command_id": 1, "command_status_id": 3},
            {"command_id": 2, "command_status_id": 2},
        ],
    },
    "alarm": {
        "sequence_number": 0,
        "vehicle_id": 1,
        "alarm_type_id": 1,
        "alarm_code_id": 5,
        "param_array": [0.0, 0.0],
        "mission_id": 1201,
        "message": "GPS fix lost",
    },
    "latest_state_vector": {"sequence_number": 3},
}

EVENTS: list[dict[str, Any]] = [
    {
        "sequence_number": 5,
        "vehicle_id": 1,
        "event_type_id": 1,
        "abort": {**PLACE, "altitude": 5},
        "expires_at": "2026-11-21T08:01:10Z",
    },
    {"sequence_number": 6, "vehicle_id": 1, "event_type_id": 2},
    {"sequence_number": 7, "vehicle_id": 1, "event_type_id": 3, "maximum_speed": 2.5},
]


def plan() -> dict[str, Any]:
    """Give a fresh copy of PLAN to be damaged."""
    return copy.deepcopy(PLAN)


def mission_of(*commands: tuple[int, dict[str, Any]]) -> dict[str, Any]:
    """Build a bare mission of (command_type_id, parameters) pairs."""
    return {
        "mission_id": 1,
        "vehicle_id": 1,
        "maximum_speed": 10.0,
        "command_array": [
            {"command_id": index, "command_type_id": kind, "parameters": dict(parameters)}
            for index, (kind, parameters) in enumerate(commands, start=1)
        ],
    }
